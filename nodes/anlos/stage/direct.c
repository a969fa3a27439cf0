#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>

#include "hal/stage.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/stage/wish.h"
#include "nodes/rt/exit_code.h"

#define LOOK_MS 20 /* between looks at a stage that moves */

static bool moves(const struct stage_status *s)
{
    return s->motion == STAGE_MOVING || s->motion == STAGE_SETTLING;
}

static void print(const struct stage_status *s)
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
static int await_rest(struct stage *stage)
{
    struct stage_status status;
    bool stopped = false;

    for (stage_status(stage, &status); moves(&status); stage_status(stage, &status)) {
        if (interrupt_requested() && !stopped) {
            stopped = true;
            stage_stop(stage);
        }
        poll(NULL, 0, LOOK_MS);
    }
    print(&status);
    return stopped                        ? EXIT_INTERRUPTED
           : status.motion == STAGE_FAULT ? EXIT_FAILED
                                          : EXIT_WORKED;
}

static int refuse(const char *what, int err)
{
    fprintf(stderr, "anlos stage: %s: %s\n", what,
            err == -ERANGE   ? "it does not reach that far"
            : err == -ESTALE ? "its place is not known, home it first"
                             : strerror(-err));
    return EXIT_FAILED;
}

static int grant(struct stage *stage, const struct stage_wish *w)
{
    int err = 0;

    if (w->verb == VERB_HOME)
        err = stage_home(stage);
    else if (w->verb == VERB_MOVE)
        err = stage_move(stage, w->target_m);
    if (err)
        return refuse(w->verb == VERB_HOME ? "home" : "move", err);
    return await_rest(stage);
}

int stage_wish_direct(const char *uri, const struct stage_wish *wishes, size_t n)
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
        code = grant(stage, &wishes[i]);
    stage_status(stage, &status);
    if (status.note[0])
        fprintf(stderr, "anlos stage: note: %s\n", status.note);
    stage_close(stage);
    return code;
}
