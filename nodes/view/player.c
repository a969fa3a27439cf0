/* SPDX-License-Identifier: MIT */
#include "nodes/view/player.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>

#include "hal/clock.h"
#include "nodes/rt/stop.h"

struct player {
    struct timeline *timeline;
    struct view *view;
    int64_t start_ns, end_ns;
    _Atomic int64_t at_ns;
    double took_ms; /* to show the place */
    json_t *images;
    void (*tell)(void *ctx, const struct view_message *m);
    void *ctx;
    pthread_t thread;
    bool runs;
    pthread_mutex_t lock; /* of what follows */
    pthread_cond_t wake;
    bool asked, stopped;
    int64_t wanted_ns;
};

static void take(void *ctx, const struct view_message *m)
{
    struct player *p = ctx;

    view_take(p->view, m, p->at_ns);
    p->tell(p->ctx, m);
}

static void tell_place(struct player *p, const char *wrong)
{
    json_t *state = json_pack("{ss sI sI sI sf sO ss}", "type", "timeline", "start_ms",
                              (json_int_t)(p->start_ns / 1000000), "span_us",
                              (json_int_t)((p->end_ns - p->start_ns + 999) / 1000),
                              "at_us",
                              (json_int_t)((p->at_ns - p->start_ns + 999) / 1000),
                              "took_ms", p->took_ms, "images", p->images, "wrong", wrong);

    board_post(view_board(p->view), BOARD_TIMELINE, frame_of_text(state));
}

static bool is_asked(void *ctx)
{
    struct player *p = ctx;

    pthread_mutex_lock(&p->lock);
    bool asked = p->asked || p->stopped;
    pthread_mutex_unlock(&p->lock);
    return asked;
}

/* First what there is, then, with nobody waiting for another place, whether it is whole.
 */
static void show(struct player *p, int64_t at_ns)
{
    struct error why = {""};
    int64_t began_ns = clock_now_ns(clock_system());

    p->at_ns = at_ns;
    view_reset(p->view);
    int err = timeline_at(p->timeline, at_ns, take, p, &why);
    view_flush(p->view, at_ns);
    p->took_ms = 1e-6 * (double)(clock_now_ns(clock_system()) - began_ns);
    tell_place(p, why.text);
    if (err)
        return;
    err = timeline_check(p->timeline, is_asked, p, &why);
    if (err && err != -EINTR)
        tell_place(p, why.text);
}

static void *run(void *ctx)
{
    struct player *p = ctx;

    show(p, p->end_ns);
    pthread_mutex_lock(&p->lock);
    while (!p->stopped) {
        int64_t wanted_ns = p->wanted_ns;
        if (!p->asked) {
            pthread_cond_wait(&p->wake, &p->lock);
            continue;
        }
        p->asked = false;
        pthread_mutex_unlock(&p->lock);
        show(p, wanted_ns);
        pthread_mutex_lock(&p->lock);
    }
    pthread_mutex_unlock(&p->lock);
    return NULL;
}

void player_beat(struct player *p)
{
    view_beat(p->view, p->at_ns);
}

void player_seek(void *player, double seconds)
{
    struct player *p = player;
    double most = 1e-9 * (double)(p->end_ns - p->start_ns);

    pthread_mutex_lock(&p->lock);
    p->wanted_ns = seconds >= most ? p->end_ns
                                   : p->start_ns + llround(1e9 * fmax(seconds, 0.0));
    p->asked = true;
    pthread_cond_signal(&p->wake);
    pthread_mutex_unlock(&p->lock);
}

int player_create(struct player **out, const char *path, struct view *view,
                  struct error *why)
{
    struct player *p = calloc(1, sizeof *p);

    if (!p)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    p->view = view;
    pthread_mutex_init(&p->lock, NULL);
    pthread_cond_init(&p->wake, NULL);
    int err = timeline_open(&p->timeline, path, why);
    if (err) {
        player_destroy(p);
        return err;
    }
    timeline_span(p->timeline, &p->start_ns, &p->end_ns);
    p->images = timeline_images(p->timeline);
    *out = p;
    return 0;
}

int player_start(struct player *p, void (*tell)(void *ctx, const struct view_message *m),
                 void *ctx)
{
    sigset_t before;

    p->tell = tell;
    p->ctx = ctx;
    stop_block(&before);
    int err = -pthread_create(&p->thread, NULL, run, p);
    stop_unblock(&before);
    p->runs = !err;
    return err;
}

void player_stop(struct player *p)
{
    if (!p || !p->runs)
        return;
    pthread_mutex_lock(&p->lock);
    p->stopped = true;
    pthread_cond_signal(&p->wake);
    pthread_mutex_unlock(&p->lock);
    pthread_join(p->thread, NULL);
    p->runs = false;
}

void player_destroy(struct player *p)
{
    if (!p)
        return;
    player_stop(p);
    json_decref(p->images);
    timeline_close(p->timeline);
    pthread_cond_destroy(&p->wake);
    pthread_mutex_destroy(&p->lock);
    free(p);
}
