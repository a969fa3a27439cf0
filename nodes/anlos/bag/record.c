/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "dsp/error.h"
#include "msgs/bag/compression.h"
#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/feed.h"
#include "nodes/anlos/usage.h"
#include "nodes/record/recorder.h"
#include "nodes/record/session.h"
#include "nodes/record/tap.h"
#include "nodes/rt/log.h"
#include "nodes/rt/process.h"
#include "nodes/rt/rundir.h"
#include "nodes/rt/stop.h"
#include "nodes/rt/terminal.h"

/* What `anlos bag record` shows: on a terminal a line that is rewritten, elsewhere a
 * line whenever messages get lost; at the end a table. */

struct record_show {
    bool terminal;
    bool line_shown;
    uint64_t lost; /* as shown last */
};

/* The work of `anlos bag record`. */

struct record_options {
    const char *out;
    char *topics;                       /* patterns */
    const char *exclude;                /* patterns, or NULL */
    char exclude_room[VERB_PATTERNS];   /* where they may lie */
    const char *run_dir;                /* NULL: the default */
    const char *launch;                 /* launch file to be attached, or NULL */
    double split_mb, split_s, quota_mb; /* 0: none */
    double flush_ms;
    const char *snapshot; /* folder of bags of the last seconds, or NULL */
    size_t before_s, after_s, max_mb;
    bool no_faults;
    double duration_s; /* INFINITY: until Ctrl-C */
    enum bag_compression compression;
    bool shuffle;
};

#define CLEAR_LINE "\r\033[K"
#define LIST_SIZE  200

/* "ping 3, traces 12" */
static void list_losses(const struct balance *t, char out[LIST_SIZE])
{
    size_t used = 0;

    out[0] = '\0';
    for (size_t i = 0; i < t->n && used < LIST_SIZE; i++)
        if (t->list[i].lost)
            used += (size_t)snprintf(out + used, LIST_SIZE - used, "%s%s %" PRIu64,
                                     used ? ", " : "", t->list[i].topic->name,
                                     t->list[i].lost);
}

static void clear_line(struct record_show *s)
{
    if (!s->line_shown)
        return;
    fputs(CLEAR_LINE, stdout);
    fflush(stdout);
    s->line_shown = false;
}

/* Of who keeps the last seconds only. */
static void record_show_kept(struct record_show *s, const Anlos__SaveStatus *kept,
                             uint64_t lost, double elapsed_s)
{
    if (s->terminal) {
        char line[120];
        size_t rows, columns;
        live_size(STDOUT_FILENO, &rows, &columns);
        snprintf(line, sizeof line,
                 "%.0f s  keeps %.1f s, %.1f MB  saved %" PRIu64 "  lost %" PRIu64,
                 elapsed_s, kept->kept_s, 1e-6 * (double)kept->kept_bytes, kept->saved,
                 lost);
        printf(CLEAR_LINE "%.*s", (int)columns - 1, line);
        fflush(stdout);
        s->line_shown = true;
    } else if (lost > s->lost) {
        fprintf(stderr, "anlos bag record: messages lost so far: %" PRIu64 "\n", lost);
    }
    s->lost = lost;
}

/* How it is going; for every second or so. */
static void record_show_progress(struct record_show *s, const struct recorder *r,
                                 double elapsed_s, size_t queue_bytes)
{
    struct recorder_totals t;
    char losses[LIST_SIZE];

    recorder_sum(r, &t);
    list_losses(recorder_balance(r), losses);
    if (s->terminal) {
        char line[LIST_SIZE + 120];
        size_t rows, columns; /* a line that wraps would not be taken back */
        live_size(STDOUT_FILENO, &rows, &columns);
        snprintf(line, sizeof line,
                 "%.0f s  %" PRIu64 " messages  %.1f MB  waiting %.1f MB  lost %s",
                 elapsed_s, t.messages, 1e-6 * (double)t.file_bytes,
                 1e-6 * (double)queue_bytes, t.lost ? losses : "0");
        printf(CLEAR_LINE "%.*s", (int)columns - 1, line);
        fflush(stdout);
        s->line_shown = true;
    } else if (t.lost > s->lost) {
        fprintf(stderr, "anlos bag record: messages lost so far: %s\n", losses);
    }
    s->lost = t.lost;
}

/* A line from the recorder, above that of the progress.  context: a struct record_show.
 */
static void record_show_text(void *context, enum log_level level, const char *text)
{
    struct record_show *s = context;

    clear_line(s);
    fprintf(stderr, "anlos bag record: %s%s\n",
            level >= LOG_LEVEL_WARNING ? "warning: " : "", text);
}

/* The table.  true: stdout took it. */
static bool record_show_end(struct record_show *s, const struct recorder *r,
                            double elapsed_s)
{
    const struct balance *balance = recorder_balance(r);
    struct recorder_totals t;

    clear_line(s);
    recorder_sum(r, &t);
    printf("%-14s %10s %12s %10s\n", "topic", "messages", "MB", "lost");
    for (size_t i = 0; i < balance->n; i++)
        if (balance->list[i].messages || balance->list[i].lost)
            printf("%-14s %10" PRIu64 " %12.3f %10" PRIu64 "\n",
                   balance->list[i].topic->name, balance->list[i].messages,
                   1e-6 * (double)balance->list[i].bytes, balance->list[i].lost);
    if (t.unwritten)
        printf("of them %" PRIu64 ", the newest, could not be written\n", t.unwritten);
    printf("%s: %" PRIu64 " messages in %.1f s, %.3f MB", recorder_path(r),
           t.messages - t.unwritten, elapsed_s, 1e-6 * (double)t.file_bytes);
    if (t.n_files + t.n_removed > 1)
        printf(" in %u files", t.n_files);
    if (t.n_removed)
        printf(" (%u older ones are removed)", t.n_removed);
    printf(", %" PRIu64 " lost\n", t.lost);
    return !fflush(stdout);
}

#define LOOK_MS        100 /* between looks at Ctrl-C and the clock */
#define SHOW_PERIOD_NS 1000000000LL

struct job {
    const struct record_options *options;
    const struct clock_source *clock;
    char run_dir[RUNDIR_SIZE];
    struct choice choice;
    struct session session;
    struct bus *bus;
    struct recorder *recorder; /* NULL: no file of all */
    struct snapshot *snapshot; /* NULL: none */
    struct tap tap;
    struct record_show show;
    int64_t status_due_ns;
    uint64_t told_news;
    bool stopped; /* the file of all has ended before the rest */
    int64_t start_ns;
    double recorded_s; /* without the wait for what was sent before the end */
};

/* Of the launch file that was asked for; else of that which the launcher left.  The sound
 * is worth more than its settings: what went wrong with the latter is said, and no error.
 */
static int add_launch(struct job *j, struct error *why)
{
    const struct record_options *o = j->options;
    char *found = o->launch ? NULL : rundir_launch(j->run_dir);
    const char *path = o->launch ? o->launch : found;
    struct launchfile *launch = NULL;
    struct error left_out = {""}, reason = {""};
    int err = path ? launchfile_load(&launch, path, NULL, &reason) : 0;

    if (!err && launch)
        err = session_add_launch(&j->session, launch, &left_out, &reason);
    launchfile_destroy(launch);
    free(found);
    if (err && o->launch)
        return error_say(why, err, "%s", reason.text);
    if (err)
        left_out = reason;
    if (left_out.text[0])
        fprintf(stderr, "anlos bag record: not attached: %s\n", left_out.text);
    if (!path)
        fprintf(stderr,
                "anlos bag record: no launch file is known in %s: the bag has none "
                "(--launch FILE)\n",
                j->run_dir);
    return 0;
}

static int open_session(struct job *j, struct error *why)
{
    const struct record_options *o = j->options;

    j->session.topics = o->topics;
    j->session.exclude = o->exclude;
    j->session.start_ns = j->start_ns;
    return add_launch(j, why);
}

static int open_bus(struct job *j, struct error *why)
{
    /* A snapshot answers those who ask for it. */
    const struct bus_config cfg = {.node = j->options->snapshot ? "recorder" : NULL,
                                   .run_dir = j->run_dir,
                                   .epoch_ns = j->start_ns,
                                   .listen_only = !j->options->snapshot};
    int err = rundir_open(j->run_dir, j->options->run_dir, why);

    if (err)
        return err;
    if (!feed_answers(j->run_dir))
        fprintf(stderr, "anlos bag record: nothing is running in %s yet; waiting\n",
                j->run_dir);
    return bus_create(&j->bus, &cfg, why);
}

static int open_recorder(struct job *j, struct error *why)
{
    const struct record_options *o = j->options;
    const struct recorder_config cfg = {
        .path = o->out,
        .topics = j->choice.topics,
        .n_topics = j->choice.n,
        .split_bytes = (uint64_t)(1e6 * o->split_mb),
        .split_ns = (int64_t)(1e9 * o->split_s),
        .quota_bytes = (uint64_t)(1e6 * o->quota_mb),
        .flush_ns = (int64_t)(1e6 * o->flush_ms),
        .compression = o->compression,
        .shuffle = o->shuffle,
        .session = &j->session,
        .say = record_show_text,
        .context = &j->show,
    };

    return recorder_create(&j->recorder, &cfg, j->start_ns, why);
}

static int open_snapshot(struct job *j, struct error *why)
{
    const struct record_options *o = j->options;
    const struct snapshot_config cfg = {
        .folder = o->snapshot,
        .before_ns = (int64_t)o->before_s * 1000000000,
        .after_ns = (int64_t)o->after_s * 1000000000,
        .max_bytes = o->max_mb * 1000000,
        .on_faults = !o->no_faults,
        .topics = j->choice.topics,
        .n_topics = j->choice.n,
        .compression = o->compression,
        .shuffle = o->shuffle,
        .session = &j->session,
        .say = record_show_text,
        .context = &j->show,
    };

    return snapshot_create(&j->snapshot, &cfg, why);
}

static int open_tap(struct job *j, struct error *why)
{
    int err = tap_open(&j->tap, j->bus, j->recorder, j->snapshot, j->choice.topics,
                       j->choice.n, j->clock);

    return err ? error_say(why, err, "cannot subscribe: %s", strerror(-err)) : 0;
}

static double elapsed_s(const struct job *j)
{
    return 1e-9 * (double)(clock_now_ns(j->clock) - j->start_ns);
}

static void tell_status(struct job *j, int64_t now_ns)
{
    Anlos__SaveStatus s;

    if (!j->snapshot ||
        (now_ns < j->status_due_ns && snapshot_news(j->snapshot) == j->told_news))
        return;
    j->status_due_ns = now_ns + SHOW_PERIOD_NS;
    j->told_news = snapshot_news(j->snapshot);
    snapshot_status(j->snapshot, now_ns, &s);
    bus_publish_message(j->bus, topic_save_status(), 0, now_ns, &s.base);
}

static void show(struct job *j, int64_t now_ns)
{
    Anlos__SaveStatus s;

    if (j->tap.recorder) {
        record_show_progress(&j->show, j->recorder, elapsed_s(j),
                             bus_waiting_bytes(j->bus));
        return;
    }
    snapshot_status(j->snapshot, now_ns, &s);
    record_show_kept(&j->show, &s, j->tap.lost, elapsed_s(j));
}

/* Once. */
static void tell_stop(struct job *j)
{
    char text[sizeof j->tap.stopped_why.text + 64];

    if (!j->tap.stopped || j->stopped)
        return;
    j->stopped = true;
    recorder_end(j->recorder, clock_now_ns(j->clock), NULL);
    snprintf(text, sizeof text, "recording stops: %s; the last seconds are kept on",
             j->tap.stopped_why.text);
    record_show_text(&j->show, LOG_LEVEL_WARNING, text);
}

static int record(struct job *j, struct error *why)
{
    int64_t start_ns = clock_now_ns(j->clock), show_ns = start_ns + SHOW_PERIOD_NS;
    int err = 0;

    show(j, start_ns);
    while (!err && !interrupt_requested()) {
        double left_s = j->options->duration_s - elapsed_s(j);
        if (left_s <= 0.0)
            break;
        err = tap_step(&j->tap, (int)fmin(LOOK_MS, 1e3 * left_s + 1.0), why);
        tell_stop(j);
        int64_t now = clock_now_ns(j->clock);
        tell_status(j, now);
        if (err || now < show_ns)
            continue;
        show_ns = now + SHOW_PERIOD_NS;
        show(j, now);
    }
    j->recorded_s = elapsed_s(j);
    return err ? err : tap_drain(&j->tap, why);
}

static bool show_snapshots(struct job *j, double elapsed_s)
{
    Anlos__SaveStatus s;

    clear_line(&j->show);
    snapshot_status(j->snapshot, clock_now_ns(j->clock), &s);
    printf("%s: %" PRIu64 " bag%s saved, %" PRIu64 " not whole, %" PRIu64
           " messages in %.1f s, %" PRIu64 " lost\n",
           j->options->snapshot, s.saved, s.saved == 1 ? "" : "s", s.failed,
           j->tap.messages, elapsed_s, j->tap.lost);
    return !fflush(stdout);
}

/* What was recorded before an error is shown too. */
static int end(struct job *j, int err, struct error *why)
{
    struct recorder_totals t = {.lost = j->tap.lost};
    bool shown = true;
    int ended = 0;

    if (j->snapshot) {
        snapshot_end(j->snapshot, clock_now_ns(j->clock));
        shown = show_snapshots(j, j->recorded_s);
    }
    if (j->recorder) {
        ended = j->stopped
                    ? 0
                    : recorder_end(j->recorder, clock_now_ns(j->clock), err ? NULL : why);
        recorder_sum(j->recorder, &t);
        shown &= record_show_end(&j->show, j->recorder, j->recorded_s);
    }
    uint64_t refused = bus_refused(j->bus);
    if (refused)
        fprintf(stderr,
                "anlos bag record: %llu messages were refused (wrong magic, version or "
                "length)\n",
                (unsigned long long)refused);
    if (err || ended)
        return err ? err : ended;
    if (!j->tap.messages)
        fprintf(stderr,
                "anlos bag record: no message came; 'anlos topic list' says what is "
                "published in %s\n",
                j->run_dir);
    if (!shown)
        return error_say(why, -EIO, "standard output cannot be written");
    return j->stopped || t.lost || t.unwritten ? 1 : 0;
}

/* Until Ctrl-C or the end of the duration; shows how it goes and what came of it.
 * *began: there is a bag.  0, 1 (messages got lost), negative errno. */
static int record_run(const struct record_options *o, bool *began, struct error *why)
{
    struct job j = {.options = o,
                    .clock = clock_system(),
                    .show.terminal = isatty(STDOUT_FILENO) != 0};

    interrupt_catch();
    heap_share();
    j.start_ns = clock_now_ns(j.clock);
    int err = choice_make(&j.choice, o->topics, o->exclude, why);
    if (!err)
        err = open_bus(&j, why);
    if (!err)
        err = open_session(&j, why);
    if (!err && o->out)
        err = open_recorder(&j, why);
    *began = j.recorder != NULL;
    if (!err && o->snapshot)
        err = open_snapshot(&j, why);
    *began |= j.snapshot != NULL;
    if (!err)
        err = open_tap(&j, why);
    if (!err)
        err = record(&j, why);
    if (*began)
        err = end(&j, err, why);
    tap_close(&j.tap);
    recorder_destroy(j.recorder);
    snapshot_destroy(j.snapshot);
    bus_destroy(j.bus);
    session_clear(&j.session);
    choice_clear(&j.choice);
    return err;
}

static const char help[] =
    "anlos bag record -- record what goes over the bus of a running system\n"
    "\n"
    "usage: anlos bag record -o FILE [TOPICS...] [options]\n"
    "       anlos bag record --snapshot DIR [TOPICS...] [options]\n"
    "\n"
    "  TOPICS            names or patterns, also with commas between; default all\n"
    "  -o, --out FILE    the bag; must not be there\n"
    "  --exclude T,...   all but these: names or patterns with commas between\n"
    "  --duration-s S    ends after S seconds; default: when Ctrl-C is pressed\n"
    "  --split-mb N      begins a new file whenever one has N MB: FILE_0001.mcap,\n"
    "                    FILE_0002.mcap and so on, each of use by itself\n"
    "  --split-s S       and whenever S seconds are over\n"
    "  --quota-mb N      keeps the files of this recording within N MB: the oldest go;\n"
    "                    without --split-mb each has an eighth of that\n"
    "  --compression C   none (default), lz4 or zstd\n"
    "  --shuffle         with it, sound and images go byte by byte: half of what a\n"
    "                    sound card gives is left; programs of before cannot read it\n"
    "  --flush-ms MS     a message is on the disk after that long at the latest; "
    "default\n"
    "                    1000\n"
    "  --snapshot DIR    keeps the last seconds in memory, and writes them into a bag\n"
    "                    in DIR when 'anlos bag save', the page or a new fault asks\n"
    "                    for it; without -o, or beside it\n"
    "  --before-s S      so many seconds are kept; default 30\n"
    "  --after-s S       and so many after the request are saved; default 5\n"
    "  --max-mb N        with so much memory at most; default 512; 30 s of\n"
    "                    launch/drive.yaml take 320\n"
    "  --no-faults       a new fault of a process saves nothing\n"
    "  --launch FILE     the launch file to be kept with its inputs; default: that of "
    "the\n"
    "                    system that 'anlos launch' runs there\n"
    "  --run-dir DIR     where the system's sockets are, default "
    "$XDG_RUNTIME_DIR/anlos,\n"
    "                    else /tmp/anlos-UID\n"
    "  --help            this text\n"
    "\n"
    "May start before the system does.  Messages that get lost are counted, shown, and\n"
    "written into the bag.  A full disk ends the recording, and the bag is whole; after "
    "a\n"
    "crash 'anlos bag recover' gets all but the last moments (--flush-ms).\n"
    "\n"
    "examples\n"
    "  anlos bag record -o scan.mcap\n"
    "  anlos bag record --snapshot out/snapshots\n"
    "  anlos bag record -o drive.mcap 'scan/*' survey ping --split-s 60 --quota-mb "
    "20000\n"
    "\n"
    "exit codes: 0 done, also by Ctrl-C, or when no message came, which it says; 1 "
    "failed,\n"
    "or messages got lost; 2 bad arguments or files\n";

/* What still fits the integers that it becomes. */
#define UP_TO_1E9(field)                                                                 \
    USAGE_NUMBER(struct record_options, field, USAGE_ABOVE_0, 1e9),                      \
        .expected = "a number above 0 and up to 1e+09"

static const struct usage_option options[] = {
    {"out", USAGE_TEXT(struct record_options, out), .letter = 'o'},
    {"exclude", USAGE_VALUE('x')},
    {"duration-s", UP_TO_1E9(duration_s)},
    {"split-mb", UP_TO_1E9(split_mb)},
    {"split-s", UP_TO_1E9(split_s)},
    {"quota-mb", UP_TO_1E9(quota_mb)},
    {"compression", USAGE_NAME('c', verb_compression_name)},
    {"shuffle", USAGE_FLAG(struct record_options, shuffle)},
    {"flush-ms", USAGE_NUMBER(struct record_options, flush_ms, USAGE_ABOVE_0, 3600e3),
     .expected = "a number above 0 and up to 3.6e+06"},
    {"snapshot", USAGE_TEXT(struct record_options, snapshot)},
    {"before-s", USAGE_COUNT(struct record_options, before_s, 1, SNAPSHOT_MOST_S)},
    {"after-s", USAGE_COUNT(struct record_options, after_s, 0, SNAPSHOT_MOST_S)},
    {"max-mb",
     USAGE_COUNT(struct record_options, max_mb, SNAPSHOT_LEAST_MB, SNAPSHOT_MOST_MB)},
    {"no-faults", USAGE_FLAG(struct record_options, no_faults)},
    {"launch", USAGE_TEXT(struct record_options, launch)},
    {"run-dir", USAGE_TEXT(struct record_options, run_dir)},
    {.name = NULL},
};

static int take_option(struct record_options *o, int code)
{
    if (code == 'x')
        return verb_add_patterns("bag record", optarg, o->exclude_room, &o->exclude);
    o->compression = verb_compression(optarg);
    return 0;
}

/* Words with commas between.  NULL: no memory. */
static char *join(char **words, int n)
{
    size_t size = 2;

    for (int i = 0; i < n; i++)
        size += strlen(words[i]) + 1;
    char *out = malloc(size), *end = out;
    if (!out)
        return NULL;
    strcpy(out, n ? "" : "*");
    for (int i = 0; i < n; i++) {
        if (i)
            *end++ = ',';
        end = stpcpy(end, words[i]);
    }
    return out;
}

static int run(struct record_options *o, char **words, int n)
{
    struct error why = {""};
    bool began = false;

    o->topics = join(words, n);
    int result = o->topics ? record_run(o, &began, &why)
                           : error_say(&why, -ENOMEM, "out of memory");
    free(o->topics);
    int code = result < 0 ? verb_end("record", result, &why) : EXIT_WORKED;
    return result && began ? EXIT_FAILED : code;
}

int bag_record(int argc, char **argv)
{
    struct record_options o = {.before_s = SNAPSHOT_BEFORE_S,
                               .after_s = SNAPSHOT_AFTER_S,
                               .max_mb = SNAPSHOT_MAX_MB,
                               .flush_ms = 1000.0,
                               .duration_s = INFINITY,
                               .compression = BAG_NONE};
    struct usage usage = {
        .command = "bag record", .help = help, .options = options, .into = &o};
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        if ((code = take_option(&o, code)) != 0)
            return code;
    if (code)
        return ~code;
    if (!o.out && !o.snapshot)
        return usage_error("bag record", "-o FILE, or --snapshot DIR, is missing");
    if (o.split_mb > o.quota_mb / 2 && o.quota_mb > 0.0)
        return usage_error("bag record",
                           "--split-mb %g: expected no more than half of --quota-mb %g",
                           o.split_mb, o.quota_mb);
    if (o.shuffle && o.compression == BAG_NONE)
        return usage_error("bag record", "--shuffle: is for --compression zstd or lz4");
    return run(&o, argv + optind, argc - optind);
}
