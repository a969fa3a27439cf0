#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "hal/clock.h"
#include "msgs/bus.h"
#include "msgs/stage.pb-c.h"
#include "msgs/topics.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/stage/wish.h"
#include "nodes/anlos/feed.h"
#include "nodes/rt/exit_code.h"
#include "nodes/rt/rundir.h"

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

int stage_wish_remote(const char *asked, const struct stage_wish *wishes, size_t n)
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
