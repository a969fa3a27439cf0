/* SPDX-License-Identifier: MIT */
/* nodes/record/main.c: every topic -> a bag.  Ends when it is asked to, or when it cannot
 * write any more; the rest of the system goes on. */
#include <errno.h>
#include <inttypes.h>
#include <libgen.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/record/session.h"
#include "nodes/record/tap.h"
#include "nodes/rt/export.h"
#include "nodes/rt/node.h"
#include "nodes/rt/stop.h"

#define DISK_S  30.0  /* that a slow disk may take for a write */
#define END_S   300.0 /* for its end */
#define LOOK_MS 100   /* between looks at the node's own affairs */

struct run {
    struct node *node;
    struct bus *bus; /* of its own, which keeps everything */
    struct choice choice;
    struct session session;
    struct recorder *recorder;
    struct tap tap;
};

static void say(void *context, enum log_level level, const char *text)
{
    node_log(context, level, "%s", text);
}

static size_t counts(void *device, struct device_count *out)
{
    const struct run *r = device;
    struct recorder_totals t;

    recorder_sum(r->recorder, &t);
    out[0] = (struct device_count){"recorded", t.messages};
    out[1] = (struct device_count){"lost", t.lost};
    out[2] = (struct device_count){"file_bytes", t.file_bytes};
    out[3] = (struct device_count){"queue_bytes", bus_waiting_bytes(r->bus)};
    out[4] = (struct device_count){"files", t.n_files};
    out[5] = (struct device_count){"files_removed", t.n_removed};
    out[6] = (struct device_count){"refused", bus_refused(r->bus)};
    return 7;
}

static int make_folder(const char *path, struct error *why)
{
    char *copy = strdup(path);
    int err = copy ? export_folder(dirname(copy), why)
                   : error_say(why, -ENOMEM, "out of memory");

    free(copy);
    return err;
}

static int open_session(struct run *r, struct error *why)
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
static int open_bus(struct run *r, struct error *why)
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

/* The node's health is due now and then, and its signals end the wait. */
static int receive(void *source, struct bus_message *out, int timeout_ms)
{
    const struct run *r = source;
    struct node_message in;
    int err = node_next(r->node, &in, 0);

    if (err != -ETIMEDOUT)
        return err; /* it hears nothing, so this is a request to end */
    return bus_receive(r->bus, out, timeout_ms);
}

static int open_recorder(struct run *r, struct error *why)
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
        .session = &r->session,
        .say = say,
        .context = r->node,
    };
    int err = make_folder(l->record.path, why);

    if (!err)
        err = recorder_create(&r->recorder, &cfg, clock_now_ns(clock_system()), why);
    if (err)
        return err;
    err = tap_open(&r->tap, r->bus, r->recorder, &cfg, clock_system());
    r->tap.receive = receive;
    r->tap.source = r;
    return err ? error_say(why, err, "cannot subscribe: %s", strerror(-err)) : 0;
}

static int open_all(struct run *r, struct error *why)
{
    const struct launchfile *l = node_launch(r->node);
    int err = choice_make(&r->choice, l->record.topics, l->record.exclude, why);

    if (!err)
        err = open_session(r, why);
    if (!err)
        err = open_bus(r, why);
    if (!err)
        err = open_recorder(r, why);
    if (!err) {
        node_turn_limit(r->node, DISK_S);
        node_device(r->node, counts, r);
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "records into %s",
                   recorder_path(r->recorder));
    }
    return err;
}

static const char *plural(uint64_t n)
{
    return n == 1 ? "" : "s";
}

static void tell_end(const struct run *r, int err, const struct recorder_totals *sum,
                     const struct error *why)
{
    const struct recorder_totals t = *sum;

    if (err) {
        node_state(r->node, ANLOS__HEALTH__STATE__FAULT,
                   "recording stops: %s; the bag has %" PRIu64 " message%s, %" PRIu64
                   " %s lost",
                   why->text, t.messages - t.unwritten, plural(t.messages - t.unwritten),
                   t.lost + t.unwritten, t.lost + t.unwritten == 1 ? "is" : "are");
        return;
    }
    node_log(r->node, t.lost ? LOG_LEVEL_WARNING : LOG_LEVEL_INFO,
             "%s: %" PRIu64 " message%s, %.1f MB in %u file%s, %" PRIu64
             " message%s lost",
             recorder_path(r->recorder), t.messages, plural(t.messages),
             1e-6 * (double)t.file_bytes, t.n_files, plural(t.n_files), t.lost,
             plural(t.lost));
}

/* After an error of writing what is in the file gets its end all the same.  Was anything
 * lost, or an error? */
static bool end_recording(struct run *r, int err, struct error *why)
{
    struct recorder_totals sum;

    if (err == -ESHUTDOWN)
        err = tap_drain(&r->tap, why);
    node_device(r->node, NULL, NULL);
    node_busy(r->node, END_S);
    int ended = recorder_end(r->recorder, clock_now_ns(clock_system()), err ? NULL : why);
    err = err ? err : ended;
    recorder_sum(r->recorder, &sum);
    tell_end(r, err, &sum, why);
    recorder_destroy(r->recorder);
    return err || sum.lost || sum.unwritten;
}

/* The exit code: that of the node, or that the recording is not whole, which was told
 * already. */
static int run(struct run *r)
{
    struct error why = {""};
    int err = open_all(r, &why);

    if (err && !r->recorder)
        node_log(r->node, LOG_LEVEL_ERROR, "%s", why.text);
    while (!err)
        err = tap_step(&r->tap, LOOK_MS, &why);
    bool began = r->recorder != NULL;
    bool is_short = began && end_recording(r, err, &why);
    tap_close(&r->tap);
    bus_destroy(r->bus);
    session_clear(&r->session);
    choice_clear(&r->choice);
    int code = node_finish(r->node, began ? 0 : err);
    return is_short ? EXIT_FAILED : code;
}

int main(int argc, char **argv)
{
    struct run r = {0};
    int err = node_create(&r.node, "record", "Records every topic into a bag (MCAP).",
                          argc, argv);

    return r.node ? run(&r) : err;
}
