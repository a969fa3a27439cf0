/* SPDX-License-Identifier: MIT */
#include "hal/stage/worker.h"

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "hal/realtime.h"

enum wish { NOTHING, HOME, MOVE, STOP, QUIT };

struct stage_worker {
    struct stage_worker_config cfg;
    const struct stage_worker_ops *ops;
    void *device;
    const struct clock_source *clock;
    pthread_t thread;
    int wake_fd;
    atomic_bool cancelled;
    atomic_uint place_changes; /* odd: it is being written; then read it again */
    _Atomic double position_m;
    _Atomic int64_t at_ns; /* when it was there */
    pthread_mutex_t lock;  /* for what follows */
    enum wish wish;
    double wish_m, wish_m_s;
    struct stage_status status; /* motion: IDLE, MOVING or FAULT */
    int64_t rest_ns;            /* since when it stands still */
};

/* A stop in an emergency is newer than any wish but to end. */
static void fault(struct stage_worker *w, int err, const char *text)
{
    w->status.motion = STAGE_FAULT;
    w->status.homed = false;
    snprintf(w->status.text, sizeof w->status.text, "%s", text);
    if (w->wish == MOVE || (err == -ESHUTDOWN && w->wish == HOME))
        w->wish = NOTHING;
}

static void come_to_rest(struct stage_worker *w)
{
    w->status.motion = STAGE_IDLE;
    w->rest_ns = clock_now_ns(w->clock);
}

static enum wish take_wish(struct stage_worker *w, double *target_m, double *speed_m_s,
                           bool *home_first)
{
    uint64_t times;

    pthread_mutex_lock(&w->lock);
    enum wish wish = w->wish;
    *target_m = w->wish_m;
    *speed_m_s = w->wish_m_s;
    *home_first = wish == MOVE && !w->status.homed;
    if (wish == HOME) { /* the fault may be newer than the wish */
        w->status.motion = STAGE_MOVING;
        w->status.text[0] = '\0';
    }
    if (wish != QUIT)
        w->wish = NOTHING;
    atomic_store(&w->cancelled, wish == QUIT);
    if (read(w->wake_fd, &times, sizeof times) < 0)
        times = 0; /* nobody had called */
    pthread_mutex_unlock(&w->lock);
    return wish;
}

static int home(struct stage_worker *w, char *text)
{
    pthread_mutex_lock(&w->lock);
    w->status.homed = false;
    pthread_mutex_unlock(&w->lock);
    int err = w->ops->home(w->device, text);
    pthread_mutex_lock(&w->lock);
    w->status.homed = !err;
    pthread_mutex_unlock(&w->lock);
    return err;
}

static int grant(struct stage_worker *w, enum wish wish, double target_m,
                 double speed_m_s, bool home_first, char *text)
{
    int err = 0;

    switch (wish) {
    case HOME:
        return home(w, text);
    case MOVE:
        if (home_first)
            err = home(w, text);
        return err ? err : w->ops->move(w->device, target_m, speed_m_s, text);
    case STOP:
        return w->ops->stop ? w->ops->stop(w->device, text) : 0;
    default:
        return w->ops->rest(w->device, w->wake_fd, text);
    }
}

/* What came of it.  A homing that was stopped by hand leaves no place. */
static void conclude(struct stage_worker *w, enum wish wish, int err, const char *text)
{
    pthread_mutex_lock(&w->lock);
    if (err && err != -ECANCELED)
        fault(w, err, text[0] ? text : strerror(-err));
    else if (wish == STOP && !w->status.homed && w->status.motion == STAGE_MOVING)
        fault(w, 0, "homing was stopped; its place is not known until it is homed");
    else if (!err && wish != NOTHING && w->wish == NOTHING &&
             w->status.motion == STAGE_MOVING)
        come_to_rest(w);
    if (wish == STOP)
        w->status.target_m = atomic_load(&w->position_m);
    pthread_mutex_unlock(&w->lock);
}

static void *work(void *state)
{
    struct stage_worker *w = state;

    for (;;) {
        char text[STAGE_TEXT_SIZE] = "";
        double target_m, speed_m_s;
        bool home_first;
        enum wish wish = take_wish(w, &target_m, &speed_m_s, &home_first);
        if (wish == QUIT)
            return NULL;
        conclude(w, wish, grant(w, wish, target_m, speed_m_s, home_first, text), text);
    }
}

static int start_thread(struct stage_worker *w)
{
    struct error missing = {.text = ""};
    int err = realtime_start(&w->thread, work, w, w->cfg.realtime, &missing);

    if (!err && missing.text[0])
        stage_worker_note(w, "no real-time priority or locked memory: under load steps "
                             "come late and moves take longer; raise the limits rtprio "
                             "and memlock");
    return err;
}

int stage_worker_create(struct stage_worker **out, const struct stage_worker_config *cfg,
                        const struct stage_worker_ops *ops, void *device,
                        const struct clock_source *clock, struct error *why)
{
    struct stage_worker *w = calloc(1, sizeof *w);

    if (!w)
        return error_say(why, -ENOMEM, "out of memory");
    w->cfg = *cfg;
    w->ops = ops;
    w->device = device;
    w->clock = clock;
    w->rest_ns = clock_now_ns(clock) - (int64_t)(1e9 * cfg->settle_s);
    w->status = (struct stage_status){
        .motion = STAGE_IDLE, .homed = cfg->homed, .target_m = cfg->position_m};
    atomic_init(&w->cancelled, false);
    atomic_init(&w->place_changes, 0);
    atomic_init(&w->position_m, cfg->position_m);
    atomic_init(&w->at_ns, clock_now_ns(clock));
    pthread_mutex_init(&w->lock, NULL);
    if (!cfg->homed && !cfg->home_first)
        fault(w, 0, "its place is not known: home it");
    w->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    *out = w; /* the thread's device may use it at once */
    int err = w->wake_fd < 0 ? -errno : start_thread(w);
    if (!err)
        return 0;
    *out = NULL;
    if (w->wake_fd >= 0)
        close(w->wake_fd);
    pthread_mutex_destroy(&w->lock);
    free(w);
    return error_say(why, err, "no thread for the stage: %s", strerror(-err));
}

/* With the lock held. */
static void ask(struct stage_worker *w, enum wish wish, double target_m, double speed_m_s)
{
    const uint64_t once = 1;

    w->wish = wish;
    w->wish_m = target_m;
    w->wish_m_s = speed_m_s;
    atomic_store(&w->cancelled, true);
    if (write(w->wake_fd, &once, sizeof once) < 0)
        w->wish = wish; /* it is awake already: the counter is full */
}

int stage_worker_move(struct stage_worker *w, double target_m, double speed_m_s)
{
    int err = 0;

    pthread_mutex_lock(&w->lock);
    if (w->status.motion == STAGE_FAULT) {
        err = -ESTALE;
    } else {
        w->status.motion = STAGE_MOVING;
        w->status.target_m = target_m;
        ask(w, MOVE, target_m, speed_m_s);
    }
    pthread_mutex_unlock(&w->lock);
    return err;
}

int stage_worker_home(struct stage_worker *w)
{
    pthread_mutex_lock(&w->lock);
    w->status.motion = STAGE_MOVING;
    w->status.homed = false;
    w->status.text[0] = '\0';
    ask(w, HOME, 0, 0);
    pthread_mutex_unlock(&w->lock);
    return 0;
}

int stage_worker_stop(struct stage_worker *w)
{
    pthread_mutex_lock(&w->lock);
    if (w->status.motion == STAGE_MOVING)
        ask(w, STOP, 0, 0);
    pthread_mutex_unlock(&w->lock);
    return 0;
}

/* Of one moment, without ever holding up the thread that moves it. */
static void read_place(struct stage_worker *w, struct stage_status *out)
{
    unsigned before;

    do {
        before = atomic_load(&w->place_changes);
        out->position_m = atomic_load(&w->position_m);
        out->at_ns = atomic_load(&w->at_ns);
    } while (before % 2 || before != atomic_load(&w->place_changes));
}

void stage_worker_status(struct stage_worker *w, struct stage_status *out)
{
    pthread_mutex_lock(&w->lock);
    *out = w->status;
    read_place(w, out);
    if (out->motion == STAGE_IDLE &&
        clock_now_ns(w->clock) < w->rest_ns + (int64_t)(1e9 * w->cfg.settle_s))
        out->motion = STAGE_SETTLING;
    pthread_mutex_unlock(&w->lock);
}

bool stage_worker_cancelled(const struct stage_worker *w)
{
    return atomic_load(&w->cancelled);
}

int stage_worker_wake_fd(const struct stage_worker *w)
{
    return w->wake_fd;
}

void stage_worker_was_at(struct stage_worker *w, double position_m, int64_t at_ns)
{
    atomic_fetch_add(&w->place_changes, 1);
    atomic_store(&w->position_m, position_m);
    atomic_store(&w->at_ns, at_ns);
    atomic_fetch_add(&w->place_changes, 1);
}

void stage_worker_at(struct stage_worker *w, double position_m)
{
    stage_worker_was_at(w, position_m, clock_now_ns(w->clock));
}

void stage_worker_note(struct stage_worker *w, const char *note)
{
    pthread_mutex_lock(&w->lock);
    snprintf(w->status.note, sizeof w->status.note, "%s", note);
    pthread_mutex_unlock(&w->lock);
}

void stage_worker_destroy(struct stage_worker *w)
{
    if (!w)
        return;
    pthread_mutex_lock(&w->lock);
    ask(w, QUIT, 0, 0);
    pthread_mutex_unlock(&w->lock);
    pthread_join(w->thread, NULL);
    close(w->wake_fd);
    pthread_mutex_destroy(&w->lock);
    free(w);
}
