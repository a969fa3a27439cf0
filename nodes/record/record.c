/* SPDX-License-Identifier: MIT */
#include "nodes/record/record.h"

#include <errno.h>
#include <inttypes.h>
#include <libgen.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/record/session.h"
#include "nodes/record/tap.h"
#include "nodes/rt/export.h"
#include "nodes/rt/stop.h"

#define DISK_S    30.0  /* that a slow disk may take for a write */
#define END_S     300.0 /* for its end */
#define STATUS_NS 1000000000LL

struct record {
    struct node *node;
    struct bus *bus; /* of its own, which keeps everything */
    struct choice choice;
    struct session session;
    struct recorder *recorder; /* NULL: no file of all */
    struct snapshot *snapshot;
    struct tap tap;
    int64_t status_due_ns;
    uint64_t told_news;
    bool stopped;     /* the file of all has ended before the rest */
    struct error why; /* it stops */
};

static void say(void *context, enum log_level level, const char *text)
{
    node_log(context, level, "%s", text);
}

static int make_folder(const char *path, struct error *why)
{
    char *copy = strdup(path);
    int err = copy ? export_folder(dirname(copy), why)
                   : error_say(why, -ENOMEM, "out of memory");

    free(copy);
    return err;
}

static int open_session(struct record *r, struct error *why)
{
    const struct launchfile *l = node_launch(r->node);
    struct error left_out = {""};

    r->session.topics = l->record.topics;
    r->session.exclude = l->record.exclude;
    r->session.start_ns = clock_now_ns(clock_system());
    int err = session_add_launch(&r->session, l, &left_out, why);
    if (left_out.text[0])
        node_log(r->node, LOG_LEVEL_WARNING, "not attached: %s", left_out.text);
    return err;
}

static void log_refusal(void *context, const char *text)
{
    say(context, LOG_LEVEL_WARNING, text);
}

/* Threads of the bus leave the signals to this one. */
static int open_bus(struct record *r, struct error *why)
{
    const struct bus_config cfg = {.run_dir = node_run_dir(r->node), .listen_only = true};
    sigset_t before;

    stop_block(&before);
    int err = bus_create(&r->bus, &cfg, why);
    stop_unblock(&before);
    if (!err)
        bus_on_refusal(r->bus, log_refusal, r->node);
    return err;
}

static int open_recorder(struct record *r, struct error *why)
{
    const struct launchfile *l = node_launch(r->node);
    const struct recorder_config cfg = {
        .path = l->record.path,
        .free_name = true,
        .topics = r->choice.topics,
        .n_topics = r->choice.n,
        .split_bytes = (uint64_t)l->record.split_mb * 1000000,
        .split_ns = (int64_t)l->record.split_s * 1000000000,
        .quota_bytes = (uint64_t)l->record.quota_mb * 1000000,
        .flush_ns = (int64_t)l->record.flush_ms * 1000000,
        .compression = l->record.compression,
        .shuffle = l->record.shuffle,
        .session = &r->session,
        .say = say,
        .context = r->node,
    };
    int err = make_folder(l->record.path, why);

    return err ? err
               : recorder_create(&r->recorder, &cfg, clock_now_ns(clock_system()), why);
}

static int open_snapshot(struct record *r, struct error *why)
{
    const struct launchfile *l = node_launch(r->node);
    const struct snapshot_config cfg = {
        .folder = l->record.snapshot.folder,
        .before_ns = (int64_t)l->record.snapshot.before_s * 1000000000,
        .after_ns = (int64_t)l->record.snapshot.after_s * 1000000000,
        .max_bytes = (size_t)l->record.snapshot.max_mb * 1000000,
        .on_faults = l->record.snapshot.faults,
        .topics = r->choice.topics,
        .n_topics = r->choice.n,
        .compression = l->record.compression,
        .shuffle = l->record.shuffle,
        .session = &r->session,
        .say = say,
        .context = r->node,
    };

    return snapshot_create(&r->snapshot, &cfg, why);
}

static int open_tap(struct record *r, struct error *why)
{
    int err = tap_open(&r->tap, r->bus, r->recorder, r->snapshot, r->choice.topics,
                       r->choice.n, clock_system());

    return err ? error_say(why, err, "cannot subscribe: %s", strerror(-err)) : 0;
}

static void tell_state(const struct record *r)
{
    const char *path = r->recorder ? recorder_path(r->recorder) : NULL;
    const struct launchfile *l = node_launch(r->node);

    if (!l->record.snapshot.folder)
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "records into %s", path);
    else
        node_state(r->node, ANLOS__HEALTH__STATE__READY,
                   "keeps the last %u s, for bags in %s%s%s", l->record.snapshot.before_s,
                   l->record.snapshot.folder, path ? "; records into " : "",
                   path ? path : "");
}

static int open_all(struct record *r, struct error *why)
{
    const struct launchfile *l = node_launch(r->node);
    int err = choice_make(&r->choice, l->record.topics, l->record.exclude, why);

    if (!err)
        err = open_session(r, why);
    if (!err)
        err = open_bus(r, why);
    if (!err && l->record.path[0])
        err = open_recorder(r, why);
    if (!err)
        err = open_snapshot(r, why);
    if (!err)
        err = open_tap(r, why);
    if (!err) {
        node_turn_limit(r->node, DISK_S);
        tell_state(r);
    }
    return err;
}

static void close_all(void *self)
{
    struct record *r = self;

    if (!r)
        return;
    recorder_destroy(r->recorder);
    snapshot_destroy(r->snapshot);
    tap_close(&r->tap);
    bus_destroy(r->bus);
    session_clear(&r->session);
    choice_clear(&r->choice);
    free(r);
}

int record_open(struct record **out, struct node *node, struct error *why)
{
    struct record *r = calloc(1, sizeof *r);

    if (!r)
        return error_say(why, -ENOMEM, "out of memory");
    r->node = node;
    int err = open_all(r, why);
    if (err)
        close_all(r);
    else
        *out = r;
    return err;
}

static size_t counts(void *self, struct device_count *out)
{
    const struct record *r = self;
    struct recorder_totals t = {0};
    Anlos__SaveStatus s;

    if (r->recorder)
        recorder_sum(r->recorder, &t);
    snapshot_status(r->snapshot, clock_now_ns(clock_system()), &s);
    out[0] = (struct device_count){"recorded", r->tap.messages};
    out[1] = (struct device_count){"lost", r->tap.lost};
    out[2] = (struct device_count){"file_bytes", t.file_bytes};
    out[3] = (struct device_count){"queue_bytes", bus_waiting_bytes(r->bus)};
    out[4] = (struct device_count){"files", t.n_files};
    out[5] = (struct device_count){"files_removed", t.n_removed};
    out[6] = (struct device_count){"refused", bus_refused(r->bus)};
    out[7] = (struct device_count){"snapshot_bytes", s.kept_bytes};
    out[8] = (struct device_count){"snapshots", s.saved};
    out[9] = (struct device_count){"snapshots_failed", s.failed};
    out[10] = (struct device_count){"snapshots_joined", s.joined};
    out[11] = (struct device_count){"snapshots_refused", s.refused};
    out[12] = (struct device_count){"snapshots_missing", s.missing};
    out[13] = (struct device_count){"faults_again", snapshot_faults_again(r->snapshot)};
    return 14;
}

static int messages_fd(const void *self)
{
    return bus_fd(((const struct record *)self)->bus);
}

static int64_t take_due_ns(const void *self)
{
    return ((const struct record *)self)->tap.due_ns;
}

/* NULL: the last seconds are not kept. */
static const char *snapshot_folder(const struct record *r)
{
    return node_launch(r->node)->record.snapshot.folder;
}

static const char *plural(uint64_t n)
{
    return n == 1 ? "" : "s";
}

/* Why, and what is in the file. */
static void tell_stop(struct record *r, Anlos__Health__State state,
                      const struct error *why, const char *what_goes_on)
{
    struct recorder_totals t = {0};

    if (r->recorder)
        recorder_sum(r->recorder, &t);
    uint64_t written = t.messages - t.unwritten, lost = t.lost + t.unwritten;
    node_state(r->node, state,
               "recording stops: %s; the bag has %" PRIu64 " message%s, %" PRIu64
               " %s lost%s",
               why->text, written, plural(written), lost, lost == 1 ? "is" : "are",
               what_goes_on);
}

static int take(void *self)
{
    struct record *r = self;
    int err = tap_step(&r->tap, 0, &r->why);

    if (r->tap.stopped && !r->stopped) {
        r->stopped = true;
        recorder_end(r->recorder, clock_now_ns(clock_system()), NULL);
        tell_stop(r, ANLOS__HEALTH__STATE__DEGRADED, &r->tap.stopped_why,
                  snapshot_folder(r) ? "; the last seconds are kept on" : "");
    }
    return err;
}

/* A recorder that keeps nothing speaks when it is asked. */
static int64_t status_due_ns(const void *self)
{
    const struct record *r = self;

    return snapshot_news(r->snapshot) != r->told_news     ? 0
           : node_launch(r->node)->record.snapshot.folder ? r->status_due_ns
                                                          : LOOP_NEVER;
}

/* A recording does not end because nobody can be told of it. */
static int publish_status(void *self)
{
    struct record *r = self;
    Anlos__SaveStatus s;

    r->told_news = snapshot_news(r->snapshot);
    r->status_due_ns = node_machine_ns(r->node) + STATUS_NS;
    snapshot_status(r->snapshot, clock_now_ns(clock_system()), &s);
    node_publish(r->node, topic_save_status(), 0, &s.base);
    return 0;
}

static void tell_end(struct record *r, int err, const struct recorder_totals *t)
{
    uint64_t written = t->messages - t->unwritten, lost = t->lost + t->unwritten;
    enum log_level level = lost ? LOG_LEVEL_WARNING : LOG_LEVEL_INFO;
    Anlos__SaveStatus s;

    if (err) {
        tell_stop(r, ANLOS__HEALTH__STATE__FAULT, &r->why, "");
        return;
    }
    if (!r->recorder || (r->stopped && snapshot_folder(r))) {
        snapshot_status(r->snapshot, clock_now_ns(clock_system()), &s);
        node_log(r->node, level,
                 "%s: %" PRIu64 " bag%s saved, %" PRIu64 " of %" PRIu64 " message%s lost",
                 snapshot_folder(r), s.saved, plural(s.saved), t->lost,
                 t->messages + t->lost, plural(t->messages + t->lost));
        return;
    }
    node_log(
        r->node, level,
        "%s: %" PRIu64 " message%s, %.1f MB in %u file%s, %" PRIu64 " message%s lost",
        recorder_path(r->recorder), written, plural(written),
        1e-6 * (double)t->file_bytes, t->n_files, plural(t->n_files), lost, plural(lost));
}

/* After an error of writing what is in the file gets its end all the same.  That the
 * recording is not whole was told then. */
static int end(void *self, int err)
{
    struct record *r = self;
    struct recorder_totals sum;

    if (err == -ESHUTDOWN)
        err = tap_drain(&r->tap, &r->why);
    node_device(r->node, NULL, NULL);
    node_busy(r->node, END_S);
    snapshot_end(r->snapshot, clock_now_ns(clock_system()));
    if (r->stopped) {
        recorder_sum(r->recorder, &sum);
    } else if (r->recorder) {
        int ended =
            recorder_end(r->recorder, clock_now_ns(clock_system()), err ? NULL : &r->why);
        err = err ? err : ended;
        recorder_sum(r->recorder, &sum);
    } else {
        sum = (struct recorder_totals){.messages = r->tap.messages, .lost = r->tap.lost};
    }
    tell_end(r, err, &sum);
    return err || r->stopped || sum.lost || sum.unwritten ? NODE_TOLD : 0;
}

static const struct loop_timer timers[] = {
    {.due_ns = take_due_ns, .run = take, .when = LOOP_EACH},
    {.due_ns = status_due_ns, .run = publish_status},
    {.run = NULL},
};

/* It hears nothing itself: its bus does, whose messages each turn takes one of. */
const struct loop record_loop = {.timers = timers,
                                 .fd = messages_fd,
                                 .counts = counts,
                                 .end = end,
                                 .close = close_all};
