/* SPDX-License-Identifier: MIT */
#include "nodes/record/session.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "dsp/error.h"
#include "dsp/list.h"
#include "hal/text_file.h"
#include "msgs/bag/manifest.h"
#include "nodes/record/revision.h"
#include "nodes/rt/uri.h"

/* -- pairs of a metadata record ---------------------------------------------------------
 */

void pairs_text(struct pairs *p, const char *key, const char *value)
{
    bag_map_put(&p->map, bytes_of(key), bytes_of(value));
}

void pairs_count(struct pairs *p, const char *key, uint64_t value)
{
    char text[24];

    snprintf(text, sizeof text, "%" PRIu64, value);
    pairs_text(p, key, text);
}

void pairs_stamp(struct pairs *p, const char *key, int64_t ns)
{
    char text[24];

    snprintf(text, sizeof text, "%" PRId64, ns);
    pairs_text(p, key, text);
}

void pairs_number(struct pairs *p, const char *key, double value)
{
    char text[DECIMAL_SIZE];

    if (!isnan(value))
        pairs_text(p, key, decimal_print(value, text));
}

int pairs_write(const struct pairs *p, const char *name, struct bag_writer *w,
                struct error *why)
{
    const struct bag_metadata m = {bytes_of(name), bytes_in(&p->map)};

    return p->map.failed ? error_say(why, -ENOMEM, "out of memory")
                         : bag_writer_metadata(w, &m, why);
}

void pairs_clear(struct pairs *p)
{
    bytes_free(&p->map);
}

/* -- attachments ------------------------------------------------------------------------
 */

static const char *media_type(const char *name)
{
    static const char *const types[][2] = {{".yaml", "application/yaml"},
                                           {".yml", "application/yaml"},
                                           {".csv", "text/csv"},
                                           {".txt", "text/plain"},
                                           {".wav", "audio/wav"}};
    const char *dot = strrchr(name, '.');

    for (size_t i = 0; dot && i < sizeof types / sizeof *types; i++)
        if (!strcmp(dot, types[i][0]))
            return types[i][1];
    return "application/octet-stream";
}

/* Takes data over in any case. */
static int add(struct attachments *c, const char *name, uint8_t *data, size_t size)
{
    char *copy = strdup(name);

    if (!copy || list_grow(&c->items, c->n, &c->room, sizeof *c->items)) {
        free(copy);
        free(data);
        return -ENOMEM;
    }
    c->items[c->n++] = (struct attachments_item){copy, data, size};
    return 0;
}

static int read_all(FILE *f, const char *path, uint8_t **out, size_t *size,
                    struct error *why)
{
    struct stat st;

    if (fstat(fileno(f), &st))
        return error_say(why, -errno, "%s: %s", path, strerror(errno));
    if (!S_ISREG(st.st_mode))
        return error_say(why, S_ISDIR(st.st_mode) ? -EISDIR : -EINVAL, "%s: no file",
                         path);
    if ((uint64_t)st.st_size > ATTACHMENTS_MAX_FILE)
        return error_say(why, -EFBIG, "%s: over %zu MB", path,
                         ATTACHMENTS_MAX_FILE >> 20);
    *size = (size_t)st.st_size;
    *out = malloc(*size + 1);
    if (!*out)
        return error_say(why, -ENOMEM, "out of memory");
    if (fread(*out, 1, *size, f) == *size)
        return 0;
    free(*out);
    return error_say(why, -EIO, "%s cannot be read", path);
}

int attachments_add_file(struct attachments *c, const char *name, const char *path,
                         struct error *why)
{
    uint8_t *data = NULL;
    size_t size = 0;
    FILE *f = fopen(path, "re");

    if (!f)
        return error_say(why, -errno, "%s: %s", path, strerror(errno));
    int err = read_all(f, path, &data, &size, why);
    fclose(f);
    if (!err && add(c, name, data, size))
        err = error_say(why, -ENOMEM, "out of memory");
    return err;
}

static int add_entry(struct attachments *c, const char *prefix, const char *folder,
                     const char *entry, struct error *why)
{
    char path[PATH_MAX], name[PATH_MAX];
    struct stat st;

    if (snprintf(path, sizeof path, "%s/%s", folder, entry) >= (int)sizeof path ||
        snprintf(name, sizeof name, "%s%s", prefix, entry) >= (int)sizeof name)
        return error_say(why, -ENAMETOOLONG, "%.500s/%s: path too long", folder, entry);
    if (stat(path, &st) || !S_ISREG(st.st_mode))
        return 0;
    return attachments_add_file(c, name, path, why);
}

int attachments_add_folder(struct attachments *c, const char *prefix, const char *folder,
                           struct error *why)
{
    struct dirent **names = NULL;
    int n = scandir(folder, &names, NULL, alphasort);
    int err = n < 0 ? error_say(why, -errno, "%s: %s", folder, strerror(errno)) : 0;

    for (int i = 0; i < n; i++) {
        if (!err && names[i]->d_name[0] != '.')
            err = add_entry(c, prefix, folder, names[i]->d_name, why);
        free(names[i]);
    }
    free(names);
    return err;
}

int attachments_write(const struct attachments *c, struct bag_writer *w, int64_t now_ns,
                      struct error *why)
{
    int err = 0;

    for (size_t i = 0; !err && i < c->n; i++) {
        const struct attachments_item *item = &c->items[i];
        const struct bag_attachment a = {.log_time = (uint64_t)now_ns,
                                         .create_time = (uint64_t)now_ns,
                                         .name = bytes_of(item->name),
                                         .media_type = bytes_of(media_type(item->name)),
                                         .data = {item->data, item->size}};
        err = bag_writer_attachment(w, &a, why);
    }
    return err;
}

void attachments_clear(struct attachments *c)
{
    for (size_t i = 0; i < c->n; i++) {
        free(c->items[i].name);
        free(c->items[i].data);
    }
    free(c->items);
    *c = (struct attachments){0};
}

/* -- the session ------------------------------------------------------------------------
 */

#define LEFT_OUT_SIZE 300 /* of a reason */

static size_t folder_length(const char *path)
{
    const char *slash = strrchr(path, '/');

    return slash ? (size_t)(slash - path) + 1 : 0;
}

/* The path as it is written in the launch file; without folders if it leaves the launch
 * file's. */
static const char *name_within(const char *path, const char *launch)
{
    size_t n = folder_length(launch);

    if (!strncmp(path, "./", 2) && !n)
        path += 2;
    if (!strncmp(path, launch, n) && path[n] != '/' && !strstr(path + n, ".."))
        return path + n;
    return path + folder_length(path);
}

static int add_launch_file(struct session *s, const char *path, const char *launch,
                           char name[PATH_MAX], struct error *why)
{
    if (snprintf(name, PATH_MAX, "%s%s", MANIFEST_LAUNCH_FOLDER,
                 name_within(path, launch)) >= PATH_MAX)
        return error_say(why, -ENAMETOOLONG, "%.500s: path too long", path);
    return attachments_add_file(&s->attachments, name, path, why);
}

/* One of the inputs; path is freed.  A folder (of WAV files) is no input but the sound
 * itself. */
static int add_input(struct session *s, char *path, const char *launch,
                     struct error *left_out)
{
    char name[PATH_MAX];
    struct error reason = {""};
    int err = path ? 0 : -ENOMEM;

    if (path && *path)
        err = add_launch_file(s, path, launch, name, &reason);
    free(path);
    if (!err || err == -ENOMEM || err == -EISDIR)
        return err == -ENOMEM ? err : 0;
    text_add(left_out->text, sizeof left_out->text, "; ", "%.*s", LEFT_OUT_SIZE,
             reason.text);
    return 0;
}

int session_add_launch(struct session *s, const struct launchfile *l,
                       struct error *left_out, struct error *why)
{
    static const char *const options[] = {"survey", "calibrated", "rig"};
    const char *uri = l->array.uri;
    char name[PATH_MAX];
    int err = add_launch_file(s, l->path, l->path, name, why);

    if (err)
        return err;
    s->launch = strdup(name);
    if (!s->launch)
        return error_say(why, -ENOMEM, "out of memory");
    if (uri_has_scheme(uri, "sim"))
        err = add_input(s, uri_path(uri), l->path, left_out);
    for (size_t i = 0; !err && i < sizeof options / sizeof *options; i++)
        err = add_input(s, uri_option(uri, options[i]), l->path, left_out);
    return err ? error_say(why, err, "out of memory") : 0;
}

static void put_start(struct pairs *p, int64_t ns)
{
    char date[32], text[64];
    time_t s = (time_t)(ns / 1000000000);
    struct tm utc;

    strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%S", gmtime_r(&s, &utc));
    snprintf(text, sizeof text, "%s.%09dZ", date, (int)(ns % 1000000000));
    pairs_text(p, MANIFEST_STARTED, text);
    pairs_stamp(p, MANIFEST_START_NS, ns);
}

int session_write(const struct session *s, unsigned part, int64_t now_ns,
                  struct bag_writer *w, struct error *why)
{
    struct pairs p = {0};
    char host[HOST_NAME_MAX + 1] = "";

    gethostname(host, sizeof host - 1);
    pairs_text(&p, MANIFEST_VERSION, ANLOS_VERSION);
    pairs_text(&p, MANIFEST_REVISION, ANLOS_REVISION);
    pairs_text(&p, MANIFEST_HOST, host);
    put_start(&p, s->start_ns);
    if (s->launch)
        pairs_text(&p, MANIFEST_LAUNCH, s->launch);
    pairs_text(&p, MANIFEST_TOPICS, s->topics);
    pairs_text(&p, MANIFEST_EXCLUDE, s->exclude ? s->exclude : "");
    pairs_count(&p, MANIFEST_PART, part);
    int err = pairs_write(&p, MANIFEST_SESSION, w, why);
    pairs_clear(&p);
    return err ? err : attachments_write(&s->attachments, w, now_ns, why);
}

void session_clear(struct session *s)
{
    attachments_clear(&s->attachments);
    free(s->launch);
    *s = (struct session){0};
}
