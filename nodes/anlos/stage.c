/* SPDX-License-Identifier: MIT */
/* nodes/anlos/stage.c -- `anlos stage`: the stage by hand. */
#include <errno.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/clock.h"
#include "hal/stage.h"
#include "msgs/bus.h"
#include "msgs/stage.pb-c.h"
#include "msgs/topics.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/feed.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/rundir.h"
#include "nodes/rt/stop.h"

enum stage_verb { VERB_STATUS, VERB_HOME, VERB_MOVE, VERB_STOP, VERB_RELEASE };

struct stage_wish {
    enum stage_verb verb;
    double target_m; /* of VERB_MOVE */
};

struct stage_sight {
    const char *state; /* "idle" */
    double position_m;
    bool homed;
    const char *text; /* what is wrong; or empty */
};

enum { MAX_WISHES = 16 };

static const char help[] =
    "anlos stage -- look at the stage, home it, move it by hand\n"
    "\n"
    "usage: anlos stage COMMAND... [--run-dir DIR]    of a system that runs\n"
    "       anlos stage URI COMMAND...                when none does\n"
    "\n"
    "commands, one after the other\n"
    "  status          what it does, and where it is\n"
    "  home            lets it look for its place, which also ends a fault; a scan that\n"
    "                  had paused goes on\n"
    "  move M          moves it to M metres; a scan pauses until home or release\n"
    "  stop            brakes it; a scan pauses until home or release\n"
    "  release         lets a scan go on after move or stop\n"
    "\n"
    "  URI             the device, as stage.uri in a launch file: gpiod:CHIP?step=...,\n"
    "                  zaber:TTY?pitch_mm=..., sim:; for status, home and move\n"
    "  --run-dir DIR   where the system's sockets are, default $XDG_RUNTIME_DIR/anlos, "
    "else\n"
    "                  /tmp/anlos-UID\n"
    "  --help          this text\n"
    "\n"
    "Ctrl-C brakes what moves. Writes no files.\n"
    "\n"
    "examples\n"
    "  anlos stage status\n"
    "  anlos stage 'zaber:/dev/ttyUSB0?pitch_mm=25.4' home move 0.5\n"
    "\n"
    "exit codes: 0 done; 1 in fault, refused, or nothing is running; 2 bad arguments;\n"
    "130 stopped by Ctrl-C\n";

/* "idle at 0.1000 m", and what else there is to know, as a line on stdout. */
static void stage_sight_print(const struct stage_sight *s)
{
    printf("%s at %.5f m%s%s%s\n", s->state, s->position_m,
           s->homed ? "" : ", place not known", s->text[0] ? ": " : "", s->text);
    fflush(stdout);
}

/* -- with a system that runs in the folder: through its stage process -------------------
 */

#define REPEAT_MS 100        /* a command that is not answered is sent again */
#define ANSWER_NS 5000000000 /* without an answer there is no stage */

struct remote {
    struct bus *bus;
    Anlos__StageState state; /* heard last; its texts are ours */
    char text[256], refusal[256];
    bool heard;
};

static int64_t now_ns(void)
{
    return clock_now_ns(clock_system());
}

static void take(struct remote *r, struct bus_message *m)
{
    ProtobufCMessage *content = bus_message_unpack(m);

    if (content) {
        r->state = *(const Anlos__StageState *)content;
        snprintf(r->text, sizeof r->text, "%s", r->state.text);
        snprintf(r->refusal, sizeof r->refusal, "%s", r->state.manual_refusal);
        r->heard = true;
        protobuf_c_message_free_unpacked(content, NULL);
    }
    bus_message_free(m);
}

/* Listens for a while.  0, or -errno. */
static int hear(struct remote *r)
{
    struct bus_message m;
    int err = bus_receive(r->bus, &m, REPEAT_MS);

    if (!err)
        take(r, &m);
    return err == -ETIMEDOUT ? 0 : err;
}

static int lost(const char *what)
{
    fprintf(stderr,
            "anlos stage: %s; is there a stage process in the run folder? 'anlos topic "
            "echo stage/state' shows what it says\n",
            what);
    return EXIT_FAILED;
}

static void print(const struct remote *r)
{
    static const char *const names[] = {"idle", "moving", "settling", "in fault", "idle"};
    unsigned state = (unsigned)r->state.state;
    const struct stage_sight sight = {.state = state < 5 ? names[state] : "unknown",
                                      .position_m = r->state.position_m,
                                      .homed = r->state.homed,
                                      .text = r->text};

    stage_sight_print(&sight);
}

/* Sends the command until the state names it.  An exit code. */
static int command(struct remote *r, Anlos__StageManual__Verb verb, double target_m)
{
    Anlos__StageManual m = ANLOS__STAGE_MANUAL__INIT;
    int64_t begin_ns = now_ns();

    m.id = (uint64_t)begin_ns;
    m.verb = verb;
    m.target_m = target_m;
    do {
        int err = bus_publish_message(r->bus, topic_stage_manual(), 0, now_ns(), &m.base);
        if (!err)
            err = hear(r);
        if (err)
            return lost(strerror(-err));
        if (now_ns() - begin_ns > ANSWER_NS)
            return lost("no answer");
    } while (!r->heard || r->state.manual_id != m.id);
    if (!r->refusal[0])
        return EXIT_WORKED;
    fprintf(stderr, "anlos stage: %s\n", r->refusal);
    return EXIT_FAILED;
}

static bool moves(const struct remote *r)
{
    return r->state.state == ANLOS__STAGE_STATE__STATE__MOVING ||
           r->state.state == ANLOS__STAGE_STATE__STATE__SETTLING;
}

/* Until it is at rest; Ctrl-C brings it there. */
static int await_rest(struct remote *r)
{
    int64_t heard_ns = now_ns();
    bool stopped = false;

    while (moves(r)) {
        if (interrupt_requested() && !stopped) {
            stopped = true;
            command(r, ANLOS__STAGE_MANUAL__VERB__STOP, 0);
        }
        r->heard = false;
        int err = hear(r);
        if (err)
            return lost(strerror(-err));
        if (r->heard)
            heard_ns = now_ns();
        else if (now_ns() - heard_ns > ANSWER_NS)
            return lost("it has fallen silent");
    }
    return stopped                                              ? EXIT_INTERRUPTED
           : r->state.state == ANLOS__STAGE_STATE__STATE__FAULT ? EXIT_FAILED
                                                                : EXIT_WORKED;
}

static int await_state(struct remote *r)
{
    int64_t begin_ns = now_ns();

    while (!r->heard) {
        int err = hear(r);
        if (err || now_ns() - begin_ns > ANSWER_NS)
            return lost(err ? strerror(-err) : "no word of the stage");
        if (interrupt_requested())
            return EXIT_INTERRUPTED;
    }
    return EXIT_WORKED;
}

static int grant(struct remote *r, const struct stage_wish *w)
{
    static const Anlos__StageManual__Verb verbs[] = {
        [VERB_HOME] = ANLOS__STAGE_MANUAL__VERB__HOME,
        [VERB_MOVE] = ANLOS__STAGE_MANUAL__VERB__MOVE,
        [VERB_STOP] = ANLOS__STAGE_MANUAL__VERB__STOP,
        [VERB_RELEASE] = ANLOS__STAGE_MANUAL__VERB__RELEASE,
    };
    int code;

    if (w->verb == VERB_STATUS)
        code = await_state(r);
    else
        code = command(r, verbs[w->verb], w->target_m);
    if (!code && (w->verb == VERB_HOME || w->verb == VERB_MOVE || w->verb == VERB_STOP))
        code = await_rest(r);
    if (r->heard)
        print(r);
    return code;
}

static int stage_wish_remote(const char *asked, const struct stage_wish *wishes, size_t n)
{
    char run_dir[RUNDIR_SIZE];
    struct error why = {.text = ""};
    struct remote r = {.heard = false};
    int code = EXIT_WORKED;

    if (rundir_open(run_dir, asked, &why)) {
        fprintf(stderr, "anlos stage: %s\n", why.text);
        return EXIT_BAD_INPUT;
    }
    if (!feed_answers(run_dir)) {
        fprintf(stderr,
                "anlos stage: nothing is running in %s; name the folder with --run-dir, "
                "or the device: anlos stage URI ...\n",
                run_dir);
        return EXIT_FAILED;
    }
    const struct bus_config cfg = {
        .node = "hand", .run_dir = run_dir, .epoch_ns = now_ns(), .world = BUS_LIVE};
    int err = bus_create(&r.bus, &cfg, &why);
    if (err) {
        fprintf(stderr, "anlos stage: %s\n", why.text);
        return EXIT_FAILED;
    }
    interrupt_catch();
    err = bus_subscribe(r.bus, topic_stage_state());
    if (err)
        code = lost(strerror(-err));
    for (size_t i = 0; i < n && code == EXIT_WORKED; i++)
        code = grant(&r, &wishes[i]);
    bus_destroy(r.bus);
    return code;
}

/* -- without one: opens the device itself -----------------------------------------------
 */

#define LOOK_MS 20 /* between looks at a stage that moves */

static bool is_moving(const struct stage_status *s)
{
    return s->motion == STAGE_MOVING || s->motion == STAGE_SETTLING;
}

static void print_direct(const struct stage_status *s)
{
    static const char *const names[] = {[STAGE_IDLE] = "idle",
                                        [STAGE_MOVING] = "moving",
                                        [STAGE_SETTLING] = "settling",
                                        [STAGE_FAULT] = "in fault"};
    const struct stage_sight sight = {.state = names[s->motion],
                                      .position_m = s->position_m,
                                      .homed = s->homed,
                                      .text = s->text};

    stage_sight_print(&sight);
}

/* Until it is at rest; Ctrl-C brings it there. */
static int await_rest_direct(struct stage *stage)
{
    struct stage_status status;
    bool stopped = false;

    for (stage_status(stage, &status); is_moving(&status); stage_status(stage, &status)) {
        if (interrupt_requested() && !stopped) {
            stopped = true;
            stage_stop(stage);
        }
        poll(NULL, 0, LOOK_MS);
    }
    print_direct(&status);
    return stopped                        ? EXIT_INTERRUPTED
           : status.motion == STAGE_FAULT ? EXIT_FAILED
                                          : EXIT_WORKED;
}

static int refuse(struct stage *stage, const char *what, int err)
{
    char why[STAGE_TEXT_SIZE];
    struct stage_status status;

    stage_status(stage, &status);
    stage_refusal(&status, err, why);
    fprintf(stderr, "anlos stage: %s: %s\n", what, why);
    return EXIT_FAILED;
}

static int grant_direct(struct stage *stage, const struct stage_wish *w)
{
    int err = 0;

    if (w->verb == VERB_HOME)
        err = stage_home(stage);
    else if (w->verb == VERB_MOVE)
        err = stage_move(stage, w->target_m);
    if (err)
        return refuse(stage, w->verb == VERB_HOME ? "home" : "move", err);
    return await_rest_direct(stage);
}

static int stage_wish_direct(const char *uri, const struct stage_wish *wishes, size_t n)
{
    struct error why = {.text = ""};
    struct stage_status status;
    struct stage *stage;
    int err = stage_open(&stage, uri, clock_system(), &why);
    int code = EXIT_WORKED;

    if (err) {
        fprintf(stderr, "anlos stage: %s\n", why.text);
        return EXIT_BAD_INPUT;
    }
    interrupt_catch();
    for (size_t i = 0; i < n && code == EXIT_WORKED; i++)
        code = grant_direct(stage, &wishes[i]);
    stage_status(stage, &status);
    if (status.note[0])
        fprintf(stderr, "anlos stage: note: %s\n", status.note);
    stage_close(stage);
    return code;
}

/* -- the command line -------------------------------------------------------------------
 */

struct request {
    const char *uri, *run_dir;
    struct stage_wish wishes[MAX_WISHES];
    size_t n;
};

static int find_verb(const char *word)
{
    static const char *const verbs[] = {[VERB_STATUS] = "status",
                                        [VERB_HOME] = "home",
                                        [VERB_MOVE] = "move",
                                        [VERB_STOP] = "stop",
                                        [VERB_RELEASE] = "release"};

    for (int i = 0; i < 5; i++)
        if (!strcmp(word, verbs[i]))
            return i;
    return -1;
}

/* argv[*i] is a command; *i comes to stand at its last word.  0, or an exit code. */
static int take_wish(struct request *r, int argc, char **argv, int *i)
{
    struct stage_wish wish = {.verb = VERB_STATUS};
    const char *word = argv[*i];
    int verb = find_verb(word);

    if (verb < 0)
        return usage_error("stage", "%s: expected status, home, move M, stop or release",
                           word);
    if (r->n == MAX_WISHES)
        return usage_error("stage", "more than %d commands", MAX_WISHES);
    wish.verb = (enum stage_verb)verb;
    if (wish.verb == VERB_MOVE) {
        if (++*i >= argc)
            return usage_error("stage", "move: expected metres");
        if (usage_numbers(argv[*i], 1, &wish.target_m))
            return usage_error("stage", "move %s: expected metres", argv[*i]);
    }
    r->wishes[r->n++] = wish;
    return 0;
}

/* Not getopt's way: "move -0.1" has no option in it. */
static int read_arguments(struct request *r, int argc, char **argv)
{
    int code = 0;

    for (int i = 1; i < argc && !code; i++) {
        if (!strcmp(argv[i], "--run-dir")) {
            if (++i == argc)
                return usage_error("stage", "--run-dir: a folder is missing");
            r->run_dir = argv[i];
        } else if (argv[i][0] == '-') {
            return usage_error("stage", "%s: unknown option", argv[i]);
        } else if (!r->uri && !r->n && strchr(argv[i], ':')) {
            r->uri = argv[i];
        } else {
            code = take_wish(r, argc, argv, &i);
        }
    }
    return code;
}

static int check(const struct request *r)
{
    if (!r->n)
        return usage_error("stage", "a command is missing");
    if (r->uri && r->run_dir)
        return usage_error("stage", "expected a URI or --run-dir, not both");
    for (size_t i = 0; i < r->n && r->uri; i++)
        if (r->wishes[i].verb == VERB_STOP || r->wishes[i].verb == VERB_RELEASE)
            return usage_error("stage", "stop and release are for a system that runs");
    return 0;
}

int command_stage(int argc, char **argv)
{
    struct request r = {.n = 0};

    for (int i = 1; i < argc; i++)
        if (!strcmp(argv[i], "--help") || !strcmp(argv[i], "-h"))
            return fputs(help, stdout) < 0 ? EXIT_FAILED : EXIT_WORKED;
    int code = read_arguments(&r, argc, argv);
    if (!code)
        code = check(&r);
    if (code)
        return code;
    return r.uri ? stage_wish_direct(r.uri, r.wishes, r.n)
                 : stage_wish_remote(r.run_dir, r.wishes, r.n);
}
