/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/clock.h"
#include "msgs/bus.h"
#include "msgs/save.pb-c.h"
#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/feed.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/rundir.h"
#include "nodes/rt/stop.h"

#define REPEAT_MS 100          /* a request that is not answered is sent again */
#define ANSWER_NS 5000000000LL /* without an answer there is no recorder that could */

static const char help[] =
    "anlos bag save -- write down the last seconds, of a recorder that keeps them\n"
    "\n"
    "usage: anlos bag save [REASON] [options]\n"
    "\n"
    "  REASON            a few words for the bag's name and metadata; default request\n"
    "  --no-wait         ends when the recorder has begun; else when the bag is "
    "complete\n"
    "  --run-dir DIR     where the system's sockets are, default "
    "$XDG_RUNTIME_DIR/anlos,\n"
    "                    else /tmp/anlos-UID\n"
    "  --help            this text\n"
    "\n"
    "Prints the bag's name.  Recorders that keep the last seconds: 'anlos launch FILE\n"
    "--snapshot DIR', record.snapshot in a launch file, 'anlos bag record --snapshot "
    "DIR'.\n"
    "A second request while a bag is being written makes it longer.\n"
    "\n"
    "examples\n"
    "  anlos bag save\n"
    "  anlos bag save 'cyclist behind the bus'\n"
    "\n"
    "exit codes: 0 done; 1 failed, or nobody keeps the last seconds; 2 bad arguments;\n"
    "130 stopped by Ctrl-C (the recorder goes on)\n";

struct save {
    const char *reason, *run_dir;
    struct bus *bus;
    uint64_t id;
    Anlos__SaveStatus *heard; /* the newest that names the request; NULL: none yet */
};

static const struct usage_option options[] = {
    {"no-wait", USAGE_SWITCH('n')},
    {"run-dir", USAGE_TEXT(struct save, run_dir)},
    {.name = NULL},
};

static int64_t now_ns(void)
{
    return clock_now_ns(clock_system());
}

static int hear(struct save *s)
{
    struct bus_message m;
    int err = bus_receive(s->bus, &m, REPEAT_MS);

    if (err)
        return err == -ETIMEDOUT ? 0 : err;
    Anlos__SaveStatus *status = (Anlos__SaveStatus *)bus_message_unpack(&m);
    bus_message_free(&m);
    if (!status || (!s->heard && status->request_id != s->id)) {
        if (status)
            anlos__save_status__free_unpacked(status, NULL);
        return 0;
    }
    if (s->heard)
        anlos__save_status__free_unpacked(s->heard, NULL);
    s->heard = status;
    return 0;
}

static int ask(struct save *s, struct error *why)
{
    Anlos__SaveRequest m = ANLOS__SAVE_REQUEST__INIT;
    int64_t end_ns = now_ns() + ANSWER_NS;

    m.id = s->id;
    m.reason = (char *)s->reason;
    while (!s->heard) {
        int err = bus_publish_message(s->bus, topic_save(), 0, now_ns(), &m.base);
        if (!err)
            err = hear(s);
        if (err)
            return error_say(why, err, "%s", strerror(-err));
        if (interrupt_requested())
            return error_say(why, -EINTR, "interrupted before a recorder answered");
        if (!s->heard && now_ns() > end_ns)
            return error_say(why, -ETIMEDOUT,
                             "nobody in %s keeps the last seconds: 'anlos launch FILE "
                             "--snapshot DIR' does, and 'anlos bag record --snapshot "
                             "DIR' beside a system that runs",
                             s->run_dir);
    }
    return s->heard->error[0] ? error_say(why, -EPROTO, "not saved: %s", s->heard->error)
                              : 0;
}

static int await_end(struct save *s, struct error *why)
{
    uint64_t failed = s->heard->failed;
    char *path = strdup(s->heard->path);
    int64_t heard_ns = now_ns();
    int err = path ? 0 : -ENOMEM;

    while (!err && s->heard->state == ANLOS__SAVE_STATUS__STATE__SAVES &&
           !strcmp(path, s->heard->path)) {
        const Anlos__SaveStatus *before = s->heard;
        err = hear(s);
        if (s->heard != before)
            heard_ns = now_ns();
        if (!err && interrupt_requested())
            err =
                error_say(why, -EINTR, "interrupted; the recorder goes on with %s", path);
        if (!err && now_ns() - heard_ns > 6 * ANSWER_NS)
            err = error_say(why, -ETIMEDOUT, "the recorder has fallen silent");
    }
    if (!err && s->heard->failed > failed)
        err = error_say(why, -EIO, "%s", s->heard->error);
    free(path);
    return err;
}

static int save(struct save *s, bool waits, struct error *why)
{
    char run_dir[RUNDIR_SIZE];
    int err = rundir_open(run_dir, s->run_dir, why);

    if (err)
        return err;
    s->run_dir = run_dir;
    s->id = (uint64_t)now_ns();
    const struct bus_config cfg = {
        .node = "hand", .run_dir = run_dir, .epoch_ns = (int64_t)s->id};
    if (!feed_answers(run_dir))
        return error_say(why, -ESRCH, "nothing is running in %s", run_dir);
    err = bus_create(&s->bus, &cfg, why);
    if (!err && (err = bus_subscribe(s->bus, topic_save_status())))
        error_say(why, err, "cannot subscribe: %s", strerror(-err));
    if (!err)
        err = ask(s, why);
    if (!err) {
        printf("%s\n", s->heard->path);
        fflush(stdout);
        err = waits ? await_end(s, why) : 0;
    }
    if (s->heard)
        anlos__save_status__free_unpacked(s->heard, NULL);
    bus_destroy(s->bus);
    return err;
}

int bag_save(int argc, char **argv)
{
    struct save s = {.reason = "request"};
    struct usage usage = {
        .command = "bag save", .help = help, .options = options, .into = &s};
    struct error why = {""};
    bool waits = true;
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        waits = false;
    if (code)
        return ~code;
    if (argc - optind > 1)
        return usage_error("bag save",
                           "%s: unexpected; a reason of several words stands "
                           "in quotation marks",
                           argv[optind + 1]);
    if (optind < argc)
        s.reason = argv[optind];
    interrupt_catch();
    return verb_end("save", save(&s, waits, &why), &why);
}
