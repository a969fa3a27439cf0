/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "hal/clock.h"
#include "msgs/bus.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/process.h"
#include "nodes/rt/rundir.h"
#include "nodes/rt/stop.h"
#include "nodes/view/viewer.h"

#define LOOK_UP_MS 100 /* between looks at Ctrl-C */

static const char help[] =
    "anlos view -- look at a running system, or at a bag, on a web page\n"
    "\n"
    "usage: anlos view [--bag FILE] [--port N] [--address A] [--save]\n"
    "                  [--run-dir DIR]\n"
    "\n"
    "Serves one page until Ctrl-C and prints where: the image from three sides and "
    "slice\n"
    "by slice, the hidden objects on a plan with vehicle and walls, tracks with where "
    "they\n"
    "were and how they move, what the vehicle is told of the sensor, the level of each\n"
    "channel, signal to noise, latency and the number of objects over time, the scan, "
    "the\n"
    "nodes and their log.  It may be started before the system and outlive it.\n"
    "Foxglove connects to the same port (ws://127.0.0.1:8765).\n"
    "\n"
    "  --bag FILE     a recording: the page has a timeline, and shows the state at any\n"
    "                 time of it; several pages show the same time\n"
    "  --port N       default 8765; 0: any that is free\n"
    "  --address A    of this machine, default 127.0.0.1: nobody else sees the page.\n"
    "                 0.0.0.0: everybody on the network does, without a password\n"
    "  --save         the page gets a button that saves the last 30 s, of a recorder "
    "that\n"
    "                 keeps them (anlos launch --snapshot); of a bag, one for "
    "bookmarks,\n"
    "                 which are kept beside it, in FILE.bookmarks; else it only reads\n"
    "  --run-dir DIR  where the system's sockets are, default $XDG_RUNTIME_DIR/anlos, "
    "else\n"
    "                 /tmp/anlos-UID\n"
    "  --help         this text\n"
    "\n"
    "Writes no files but bookmarks.  A launch file starts it with the system: nodes:\n"
    "[..., view].\n"
    "\n"
    "examples\n"
    "  anlos view\n"
    "  anlos view --bag out/demo.mcap --port 8080\n"
    "\n"
    "exit codes: 1 failed, e.g. the port is in use; 2 bad arguments or bag; 130 stopped "
    "by\n"
    "Ctrl-C\n";

static int64_t now_ns(void)
{
    return clock_now_ns(clock_system());
}

static int subscribe(struct bus *bus, struct error *why)
{
    for (const struct topic *t = topics_all(); t->name; t++) {
        int err = bus_subscribe(bus, t);
        if (err)
            return error_say(why, err, "topic %s: %s", t->name, strerror(-err));
    }
    return 0;
}

static void take(struct viewer *viewer, struct bus_message *in)
{
    ProtobufCMessage *content = bus_message_unpack(in);

    if (content) {
        const struct view_message m = {.topic = in->topic,
                                       .from = in->envelope.node,
                                       .content = content,
                                       .capture_ns = in->envelope.capture_ns,
                                       .publish_ns = in->envelope.publish_ns,
                                       .epoch_ns = in->envelope.epoch_ns};
        viewer_take(viewer, &m, now_ns());
        protobuf_c_message_free_unpacked(content, NULL);
    }
    bus_message_free(in);
}

/* bus: nobody publishes on it when a bag is shown. */
static int watch(struct viewer *viewer, struct bus *bus)
{
    int err = 0;

    while (!err && !interrupt_requested()) {
        struct bus_message in;
        int wait_ms = viewer_tick(viewer, now_ns());
        err = bus_receive(bus, &in, wait_ms < LOOK_UP_MS ? wait_ms : LOOK_UP_MS);
        if (!err)
            take(viewer, &in);
        else if (err == -ETIMEDOUT)
            err = 0;
    }
    return err;
}

static void log_connection(void *ctx, const char *text)
{
    (void)ctx;
    fprintf(stderr, "anlos view: %s\n", text);
}

static int ask_to_save(void *bus, const ProtobufCMessage *request)
{
    return bus_publish_message(*(struct bus **)bus, topic_save(), 0, now_ns(), request);
}

static int serve(struct viewer_config *cfg, const char *asked, bool saves)
{
    char run_dir[RUNDIR_SIZE];
    struct bus_config bus_cfg = {.node = saves ? "page" : NULL,
                                 .run_dir = run_dir,
                                 .epoch_ns = now_ns(),
                                 .listen_only = !saves};
    struct error why = {""};
    struct viewer *viewer = NULL;
    struct bus *bus = NULL;
    int err = rundir_open(run_dir, asked, &why);

    cfg->save = saves ? ask_to_save : NULL;
    cfg->save_ctx = &bus;
    cfg->log = log_connection;
    cfg->run_dir = run_dir;
    cfg->now_ns = now_ns();
    if (!err)
        err = bus_create(&bus, &bus_cfg, &why);
    if (!err && !cfg->bag)
        err = subscribe(bus, &why);
    if (!err)
        err = viewer_create(&viewer, cfg, &why);
    if (err) {
        fprintf(stderr, "anlos view: %s\n", why.text);
    } else {
        printf("%s\n", viewer_url(viewer));
        fflush(stdout);
        err = watch(viewer, bus);
        if (err)
            fprintf(stderr, "anlos view: %s\n", strerror(-err));
    }
    viewer_destroy(viewer);
    bus_destroy(bus);
    switch (err) {
    case 0:
        return EXIT_INTERRUPTED;
    case -EADDRINUSE:
    case -ENOMEM:
    case -EAGAIN:
        return EXIT_FAILED;
    default:
        return EXIT_BAD_INPUT;
    }
}

struct request {
    struct viewer_config viewer;
    const char *run_dir; /* NULL: the default */
    bool saves;
};

static const struct usage_option options[] = {
    {"bag", USAGE_TEXT(struct request, viewer.bag)},
    {"port", USAGE_VALUE('p')},
    {"address", USAGE_TEXT(struct request, viewer.address)},
    {"run-dir", USAGE_TEXT(struct request, run_dir)},
    {"save", USAGE_FLAG(struct request, saves)},
    {.name = NULL},
};

int command_view(int argc, char **argv)
{
    struct request q = {.viewer = {.address = VIEWER_ADDRESS, .port = VIEWER_PORT}};
    struct usage usage = {
        .command = "view", .help = help, .options = options, .into = &q};
    size_t port;
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0) {
        if (usage_count(optarg, 0, 65535, &port))
            return usage_error("view", "--port %s: expected 0 to 65535", optarg);
        q.viewer.port = (unsigned)port;
    }
    if (code)
        return ~code;
    if (optind < argc)
        return usage_error("view", "%s: expected options only; a bag is named by --bag",
                           argv[optind]);
    q.viewer.may_mark = q.saves;
    interrupt_catch();
    heap_share();
    return serve(&q.viewer, q.run_dir, q.saves && !q.viewer.bag);
}
