/* SPDX-License-Identifier: MIT */
#include "nodes/view/player.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>

#include "hal/clock.h"
#include "nodes/rt/log.h"
#include "nodes/rt/stop.h"
#include "nodes/view/bookmarks.h"

struct player {
    struct timeline *timeline;
    struct view *view;
    int64_t start_ns, end_ns;
    _Atomic int64_t at_ns;
    double took_ms; /* to show the place */
    json_t *images;
    void (*tell)(void *ctx, const struct view_message *m);
    void *ctx;
    bool may_mark;
    bool plotted;     /* all lists of the bag are in the history */
    int64_t saved_ns; /* when the bag was asked for; 0: it was not */
    char saved_for[BOOKMARK_NAME_SIZE];
    pthread_t thread;
    bool runs;
    pthread_mutex_t lock; /* of what follows */
    pthread_cond_t wake;
    bool asked, stopped, marked;
    int64_t wanted_ns;
    struct bookmarks bookmarks;
    struct error unmarked; /* why the last change was not made */
    struct error wrong;    /* of the place that is shown */
};

static void take(void *ctx, const struct view_message *m)
{
    struct player *p = ctx;

    view_take(p->view, m, p->at_ns);
    p->tell(p->ctx, m);
}

/* In the order of their times; fixed: it is the bag's. */
static json_t *bookmarks_json(const struct player *p)
{
    double saved_s = 1e-9 * (double)(p->saved_ns - p->start_ns);
    size_t before = 0;
    json_t *all = json_array();

    for (size_t i = 0; i < p->bookmarks.n; i++) {
        const struct bookmark *b = &p->bookmarks.list[i];
        before += b->at_s <= saved_s;
        json_array_append_new(
            all, json_pack("{sf ss sb}", "at_s", b->at_s, "name", b->name, "fixed", 0));
    }
    if (p->saved_ns)
        json_array_insert_new(
            all, before,
            json_pack("{sf ss sb}", "at_s", saved_s, "name", p->saved_for, "fixed", 1));
    return all;
}

static void tell_place(struct player *p)
{
    pthread_mutex_lock(&p->lock);
    log_text_clean(p->wrong.text); /* they name files: without UTF-8 there is no JSON */
    log_text_clean(p->unmarked.text);
    json_t *state = json_pack(
        "{ss sI sI sI sf sO ss so sb ss}", "type", "timeline", "start_ms",
        (json_int_t)(p->start_ns / 1000000), "span_us",
        (json_int_t)((p->end_ns - p->start_ns + 999) / 1000), "at_us",
        (json_int_t)((p->at_ns - p->start_ns + 999) / 1000), "took_ms", p->took_ms,
        "images", p->images, "wrong", p->wrong.text, "bookmarks", bookmarks_json(p),
        "may_mark", p->may_mark, "unmarked", p->unmarked.text);
    pthread_mutex_unlock(&p->lock);

    board_post(view_board(p->view), BOARD_TIMELINE, frame_of_text(state));
}

static void take_list(void *ctx, const struct view_message *m)
{
    view_history_take(((struct player *)ctx)->view, m);
}

static bool is_asked(void *ctx)
{
    struct player *p = ctx;

    pthread_mutex_lock(&p->lock);
    bool asked = p->asked || p->stopped || p->marked;
    pthread_mutex_unlock(&p->lock);
    return asked;
}

/* With nobody waiting for a place: the plots over all of the bag, and whether what is
 * shown is whole. */
static void go_on(struct player *p)
{
    struct error why = {""};

    if (!p->plotted) {
        int err = timeline_lists(p->timeline, take_list, is_asked, p);
        view_history_post(p->view);
        p->plotted = err != -EINTR;
        if (err == -EINTR)
            return;
    }
    if (p->wrong.text[0])
        return;
    int err = timeline_check(p->timeline, is_asked, p, &why);
    if (!err || err == -EINTR)
        return;
    p->wrong = why;
    tell_place(p);
}

static void show(struct player *p, int64_t at_ns)
{
    int64_t began_ns = clock_now_ns(clock_system());

    p->at_ns = at_ns;
    view_reset(p->view);
    p->wrong.text[0] = '\0';
    timeline_at(p->timeline, at_ns, take, p, &p->wrong);
    view_flush(p->view, at_ns);
    p->took_ms = 1e-6 * (double)(clock_now_ns(clock_system()) - began_ns);
    tell_place(p);
}

static void *run(void *ctx)
{
    struct player *p = ctx;

    show(p, p->end_ns);
    go_on(p);
    pthread_mutex_lock(&p->lock);
    while (!p->stopped) {
        int64_t wanted_ns = p->wanted_ns;
        bool asked = p->asked, marked = p->marked;
        if (!asked && !marked) {
            pthread_cond_wait(&p->wake, &p->lock);
            continue;
        }
        p->asked = p->marked = false;
        pthread_mutex_unlock(&p->lock);
        if (asked)
            show(p, wanted_ns);
        else
            tell_place(p);
        go_on(p);
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

void player_mark(void *player, double at_s, const char *name)
{
    struct player *p = player;

    pthread_mutex_lock(&p->lock);
    p->unmarked.text[0] = '\0';
    if (!p->may_mark)
        error_say(&p->unmarked, -EPERM, "this page only reads");
    else if (name)
        bookmarks_add(&p->bookmarks, at_s, name, &p->unmarked);
    else
        bookmarks_remove(&p->bookmarks, at_s, &p->unmarked);
    p->marked = true;
    pthread_cond_signal(&p->wake);
    pthread_mutex_unlock(&p->lock);
}

/* A file that is no list of bookmarks is left alone, and said. */
static int open_bookmarks(struct player *p, const char *path, bool may_mark)
{
    int err = bookmarks_read(&p->bookmarks, path, &p->unmarked);

    p->may_mark = may_mark && !err;
    if (timeline_saved(p->timeline, &p->saved_ns, p->saved_for, sizeof p->saved_for) &&
        (p->saved_ns < p->start_ns || p->saved_ns > p->end_ns))
        p->saved_ns = 0;
    return err == -ENOMEM ? err : 0;
}

int player_create(struct player **out, const char *path, bool may_mark, struct view *view,
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
    view_history_span(view, p->start_ns, p->end_ns);
    if (open_bookmarks(p, path, may_mark)) {
        player_destroy(p);
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    }
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
    bookmarks_clear(&p->bookmarks);
    timeline_close(p->timeline);
    pthread_cond_destroy(&p->wake);
    pthread_mutex_destroy(&p->lock);
    free(p);
}
