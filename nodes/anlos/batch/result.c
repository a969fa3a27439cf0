/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/batch/batch.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "dsp/hash.h"
#include "nodes/anlos/text.h"
#include "nodes/record/revision.h"
#include "nodes/rt/json_whole.h"
#include "nodes/rt/stop.h"

/* -- hashes -----------------------------------------------------------------------------
 */
/* With its end, so that two texts are not the same as one. */
static uint64_t add_text(uint64_t h, const char *text)
{
    return text ? hash_add(h, text, strlen(text) + 1) : hash_add(h, "\xff", 1);
}

static int add_file(uint64_t *h, const char *path, size_t *lines)
{
    char bytes[65536];
    struct stat st;
    size_t n;
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);

    if (fd < 0)
        return -errno;
    if (fstat(fd, &st) || !S_ISREG(st.st_mode)) { /* a pipe would be waited for */
        close(fd);
        return -EINVAL;
    }
    FILE *f = fdopen(fd, "r");
    if (!f) {
        close(fd);
        return -ENOMEM;
    }
    while ((n = fread(bytes, 1, sizeof bytes, f))) {
        *h = hash_add(*h, bytes, n);
        for (const char *p = bytes;
             lines && (p = memchr(p, '\n', n - (size_t)(p - bytes))); p++)
            ++*lines;
    }
    int err = ferror(f) ? -EIO : 0;
    fclose(f);
    return err;
}

int result_program(uint64_t *out, struct error *why)
{
    *out = HASH_BEGIN;
    int err = add_file(out, "/proc/self/exe", NULL);
    return err ? error_say(why, err, "this program's file cannot be read: %s",
                           strerror(-err))
               : 0;
}

static const char *launch_of(const struct result_place *p, const struct manifest_bag *bag)
{
    return bag->launch ? bag->launch : p->launch;
}

void result_name(const struct result_place *p, const struct manifest_bag *bag,
                 char out[RESULT_NAME_SIZE])
{
    const char *slash = strrchr(bag->name, '/'), *base = slash ? slash + 1 : bag->name;
    const char *dot = strrchr(base, '.');
    int n = dot && dot > base ? (int)(dot - base) : (int)strlen(base);
    uint64_t h = add_text(HASH_BEGIN, bag->job);

    h = add_text(h, bag->launch ? NULL : p->launch);
    h = hash_add(h, &p->program, sizeof p->program);
    n = n < RESULT_NAME_SIZE - 24 ? n : RESULT_NAME_SIZE - 24;
    snprintf(out, RESULT_NAME_SIZE, "%s%.*s-%016" PRIx64, base[0] == '.' ? "_" : "", n,
             base, h);
}

uint64_t result_inputs(const struct result_place *p, const struct manifest_bag *bag)
{
    const char *files[] = {launch_of(p, bag), bag->truth, bag->scene};
    uint64_t h = HASH_BEGIN;
    struct stat st;

    if (!stat(bag->path, &st)) {
        int64_t numbers[] = {st.st_size, st.st_mtim.tv_sec, st.st_mtim.tv_nsec};
        h = hash_add(h, numbers, sizeof numbers);
    }
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        h = add_text(h, files[i] ? "" : NULL);
        if (files[i])
            add_file(&h, files[i], NULL); /* one that is missing fails later, in words */
    }
    return h;
}

/* -- what is there ----------------------------------------------------------------------
 */
static json_t *hex(uint64_t h)
{
    return json_sprintf("%016" PRIx64, h);
}

const char *result_text(const json_t *o, const char *key)
{
    const char *text = json_string_value(json_object_get(o, key));

    return text ? text : "";
}

bool result_is_failure(const json_t *line)
{
    return strcmp(result_text(line, "outcome"), "done") != 0;
}

static void file_of(const struct result_place *p, const char *name, char path[PATH_MAX])
{
    snprintf(path, PATH_MAX, "%s/%s.json", p->folder, name);
}

json_t *result_load(const struct result_place *p, const char *name, uint64_t inputs)
{
    char path[PATH_MAX], expected[24];

    file_of(p, name, path);
    snprintf(expected, sizeof expected, "%016" PRIx64, inputs);
    json_t *line = json_load_file(path, 0, NULL);
    if (json_integer_value(json_object_get(line, "format")) == RESULT_FORMAT &&
        !result_is_failure(line) && !strcmp(result_text(line, "inputs"), expected))
        return line;
    json_decref(line);
    return NULL;
}

/* Names of files may be any bytes. */
static json_t *any_text(const char *text)
{
    char clean[PATH_MAX];
    json_t *o = json_string(text);

    if (o)
        return o;
    text_clean(clean, sizeof clean, text);
    return json_string(clean);
}

static json_t *text_or_null(const char *text)
{
    return text ? any_text(text) : json_null();
}

/* As the manifest has it: its own folder may be named in many ways. */
static json_t *written(const struct manifest_bag *bag, const char *path)
{
    size_t folder = strlen(bag->path) - strlen(bag->name);

    return text_or_null(path && !strncmp(path, bag->path, folder) ? path + folder : path);
}

static json_t *tags_of(const struct manifest_bag *bag)
{
    json_t *tags = json_array();

    for (const char *p = bag->tags; *p;) {
        size_t n = strcspn(p, ",");
        if (n)
            json_array_append_new(tags, json_stringn(p, n));
        p += n + (p[n] == ',');
    }
    return tags;
}

bool result_retag(json_t *line, const struct manifest_bag *bag)
{
    json_t *tags = tags_of(bag);
    bool same = json_equal(tags, json_object_get(line, "tags"));

    json_object_set_new(line, "tags", tags);
    return !same;
}

/* -- what came of a child ---------------------------------------------------------------
 */
static json_t *load(const char *folder, const char *name)
{
    char path[PATH_MAX];

    snprintf(path, sizeof path, "%s/%s", folder, name);
    return json_load_file(path, 0, NULL);
}

static void take(json_t *into, const char *as, const json_t *from, const char *key)
{
    json_t *value = json_object_get(from, key);

    if (value)
        json_object_set(into, as, value);
}

/* The one bag's figures as `anlos score` has them. */
static void add_score(json_t *figures, const json_t *scores)
{
    static const char *const not_of_a_bag[] = {"drives", "cutoff_m", "order",
                                               "confidence", "worst"};
    json_t *score = json_object_iter_value(json_object_iter((json_t *)scores));

    json_object_update(figures, score);
    for (size_t i = 0; score && i < sizeof not_of_a_bag / sizeof *not_of_a_bag; i++)
        json_object_del(figures, not_of_a_bag[i]);
}

static json_t *figures_of(const json_t *report, const char *folder)
{
    const json_t *pings = json_object_get(report, "pings");
    json_t *figures = json_object(), *scores = load(folder, "score/drive.json");

    take(figures, "images", json_object_get(report, "recording"), "images");
    take(figures, "objects", report, "objects");
    take(figures, "pings_expected", pings, "expected");
    take(figures, "pings_used", pings, "used");
    take(figures, "pings_unusable", pings, "unusable");
    take(figures, "clipped_samples", report, "clipped_samples");
    add_score(figures, scores);
    json_decref(scores);
    return figures;
}

static void add_can(json_t *line, const char *folder)
{
    char path[PATH_MAX];
    uint64_t h = HASH_BEGIN;
    size_t frames = 0;

    snprintf(path, sizeof path, "%s/can.candump", folder);
    if (!add_file(&h, path, &frames))
        json_object_set_new(
            line, "can",
            json_pack("{sI, so}", "frames", (json_int_t)frames, "hash", hex(h)));
}

static void add_done(json_t *line, const char *folder)
{
    json_t *report = load(folder, "report.json");

    take(line, "method", report, "method");
    take(line, "recorded_by", json_object_get(report, "recording"), "revision");
    json_object_set_new(line, "figures", figures_of(report, folder));
    add_can(line, folder);
    take(line, "warnings", report, "warnings");
    json_decref(report);
}

static json_t *reason(const struct result_run *run)
{
    const char *said = run->said;

    if (!strncmp(said, "anlos ", 6)) /* "recon: ...", "score: ..." */
        said += 6;
    if (run->timeout_s && WIFSIGNALED(run->status))
        return json_sprintf("it took longer than %zu s (--timeout) and was ended%s%s",
                            run->timeout_s, said[0] ? ": " : "", said);
    if (WIFSIGNALED(run->status))
        return json_sprintf("its process was killed by signal %d (%s)%s%s%s",
                            WTERMSIG(run->status), strsignal(WTERMSIG(run->status)),
                            WTERMSIG(run->status) == SIGKILL
                                ? ": out of memory, or somebody ended it"
                                : "",
                            said[0] ? ": " : "", said);
    if (said[0])
        return any_text(said);
    return json_sprintf("its process ended with code %d and no word",
                        WEXITSTATUS(run->status));
}

static double seconds(struct timeval t)
{
    return (double)t.tv_sec + 1e-6 * (double)t.tv_usec;
}

static json_t *run_of(const struct result_run *run)
{
    char host[HOST_NAME_MAX + 1] = "", started[64], second[32];
    struct tm utc;

    gethostname(host, sizeof host - 1);
    strftime(second, sizeof second, "%Y-%m-%dT%H:%M:%S",
             gmtime_r(&run->started.tv_sec, &utc));
    snprintf(started, sizeof started, "%s.%03ldZ", second,
             run->started.tv_nsec / 1000000);
    return json_pack("{ss, ss, ss, sf, sf, sI}", "host", host, "shard", run->shard,
                     "started", started, "wall_s", run->wall_s, "cpu_s",
                     seconds(run->used.ru_utime) + seconds(run->used.ru_stime),
                     "peak_memory_bytes", (json_int_t)run->used.ru_maxrss * 1024);
}

json_t *result_make(const struct result_place *p, const struct manifest_bag *bag,
                    uint64_t inputs, const char *folder, const struct result_run *run)
{
    bool done = WIFEXITED(run->status) && WEXITSTATUS(run->status) == EXIT_WORKED;
    json_t *line = json_object();
    struct stat st;
    int64_t bytes = stat(bag->path, &st) ? 0 : st.st_size;

    json_object_set_new(line, "format", json_integer(RESULT_FORMAT));
    json_object_set_new(line, "job", any_text(bag->job));
    json_object_set_new(line, "bag", any_text(bag->name));
    json_object_set_new(line, "bag_bytes", json_integer(bytes));
    json_object_set_new(line, "tags", tags_of(bag));
    json_object_set_new(line, "launch",
                        bag->launch ? written(bag, bag->launch)
                                    : text_or_null(p->launch));
    json_object_set_new(line, "truth",
                        written(bag, bag->truth ? bag->truth : bag->scene));
    json_object_set_new(line, "inputs", hex(inputs));
    json_object_set_new(line, "version", json_string(ANLOS_VERSION));
    json_object_set_new(line, "revision", json_string(ANLOS_REVISION));
    json_object_set_new(line, "program", hex(p->program));
    json_object_set_new(line, "outcome", json_string(done ? "done" : "failed"));
    json_object_set_new(line, "error", done ? json_null() : reason(run));
    if (done)
        add_done(line, folder);
    json_object_set_new(line, "run", run_of(run));
    return line;
}

int result_write(const struct result_place *p, const char *name, const json_t *line,
                 const char *temporary, struct error *why)
{
    char path[PATH_MAX];
    bool whole = json_whole(line);
    FILE *f = whole ? fopen(temporary, "we") : NULL;

    file_of(p, name, path);
    if (!whole)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    errno = 0;
    if (f && (json_dumpf(line, f, JSON_COMPACT | JSON_REAL_PRECISION(9)) ||
              putc('\n', f) == EOF || fflush(f) || fsync(fileno(f)))) {
        int err = errno ? -errno : -EIO;
        fclose(f);
        unlink(temporary);
        return error_say(why, err, "%s: cannot be written: %s", path, strerror(-err));
    }
    if (f && !fclose(f) && !rename(temporary, path))
        return 0;
    int err = errno ? -errno : -EIO;
    unlink(temporary);
    return error_say(why, err, "%s: cannot be written: %s", path, strerror(-err));
}
