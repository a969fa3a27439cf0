/* SPDX-License-Identifier: MIT */
#include "nodes/view/viewer.h"

#include <errno.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/clock.pb-c.h"
#include "msgs/save.pb-c.h"
#include "msgs/topics.h"
#include "nodes/foxglove/server.h"
#include "nodes/rt/log_history.h"
#include "nodes/view/player.h"
#include "nodes/view/server.h"

#define SAVE_NS   2000000000LL /* that a request is repeated for, unanswered */
#define REPLAY_NS 2000000000LL /* without a word of it, a replay has ended */

struct viewer {
    struct node *node;
    int64_t log_due_ns; /* what was logged before; LOOP_NEVER: it is known */
    int64_t tick_due_ns;
    struct view *view;
    struct player *player; /* NULL: no bag */
    struct server *server;
    int64_t beat_ns; /* the last sign of life of a bag */
    int (*save)(void *ctx, const ProtobufCMessage *request);
    void *save_ctx;
    atomic_bool save_asked; /* by a page, in another thread */
    uint64_t save_id;       /* of the request that is not answered yet; 0: none */
    int64_t save_end_ns;
    int64_t replay_ns, replay_heard_ns; /* the time of a replay, and when it was told */
};

static void tell_foxglove(struct viewer *v, const struct view_message *m)
{
    const struct foxglove_message out = {.topic = m->topic,
                                         .node = m->from,
                                         .content = m->content,
                                         .capture_ns = m->capture_ns,
                                         .publish_ns = m->publish_ns};

    server_message(v->server, &out);
}

static void show_foxglove(void *ctx, const struct view_message *m)
{
    struct viewer *v = ctx;

    tell_foxglove(v, m);
    server_time(v->server, m->publish_ns);
}

static void ask_to_save(void *ctx)
{
    struct viewer *v = ctx;

    atomic_store(&v->save_asked, true);
}

/* Until the recorder names it: so none gets lost. */
static void request_save(struct viewer *v, int64_t now_ns)
{
    Anlos__SaveRequest r = ANLOS__SAVE_REQUEST__INIT;

    if (atomic_exchange(&v->save_asked, false)) {
        v->save_id = (uint64_t)now_ns;
        v->save_end_ns = now_ns + SAVE_NS;
    }
    if (!v->save_id)
        return;
    r.id = v->save_id;
    r.reason = (char *)"button";
    if (v->save(v->save_ctx, &r.base) || now_ns > v->save_end_ns)
        v->save_id = 0;
}

static int create_all(struct viewer *v, const struct viewer_config *cfg,
                      struct error *why)
{
    struct server_config server = {.address = cfg->address,
                                   .port = cfg->port,
                                   .now_ns = cfg->now_ns,
                                   .log = cfg->log,
                                   .log_ctx = cfg->log_ctx};
    int err = view_create(&v->view, cfg->bag ? cfg->bag : cfg->run_dir, cfg->bag != NULL);

    if (err)
        return error_say(why, err, "not enough memory for the view");
    v->node = cfg->node;
    v->save = cfg->save;
    v->save_ctx = cfg->save_ctx;
    view_may_save(v->view, cfg->save != NULL);
    if (cfg->bag)
        err = player_create(&v->player, cfg->bag, cfg->may_mark, v->view, why);
    server.view = v->view;
    server.seek = v->player ? player_seek : NULL;
    server.mark = v->player ? player_mark : NULL;
    server.bag_ctx = v->player;
    server.save = cfg->save ? ask_to_save : NULL;
    server.save_ctx = v;
    if (!err)
        err = server_create(&v->server, &server, why);
    if (!err && v->player && (err = player_start(v->player, show_foxglove, v)))
        error_say(why, err, "%s: no thread to read it: %s", cfg->bag, strerror(-err));
    return err;
}

int viewer_create(struct viewer **out, const struct viewer_config *cfg, struct error *why)
{
    struct viewer *v = calloc(1, sizeof *v);
    int err = v ? create_all(v, cfg, why)
                : error_say(why, -ENOMEM, "not enough memory for the view");

    if (err)
        viewer_destroy(v);
    else
        *out = v;
    return err;
}

const char *viewer_url(const struct viewer *v)
{
    return server_url(v->server);
}

void viewer_take(struct viewer *v, const struct view_message *m, int64_t now_ns)
{
    view_take(v->view, m, now_ns);
    tell_foxglove(v, m);
    if (m->topic == topic_save_status() &&
        ((const Anlos__SaveStatus *)m->content)->request_id == v->save_id)
        v->save_id = 0;
    if (m->topic == topic_clock()) {
        v->replay_ns = ((const Anlos__Clock *)m->content)->time_ns;
        v->replay_heard_ns = now_ns;
    }
}

int viewer_tick(struct viewer *v, int64_t now_ns)
{
    if (v->player) { /* it has a thread of its own, which may read for long */
        if (now_ns - v->beat_ns >= VIEW_BEAT_NS || now_ns < v->beat_ns) {
            player_beat(v->player);
            v->beat_ns = now_ns;
        }
        return (int)((v->beat_ns + VIEW_BEAT_NS - now_ns) / 1000000 + 1);
    }
    if (v->save)
        request_save(v, now_ns);
    server_time(v->server,
                now_ns - v->replay_heard_ns < REPLAY_NS ? v->replay_ns : now_ns);
    return view_tick(v->view, now_ns);
}

/* The player's thread tells the server, whose threads seek in the player. */
void viewer_destroy(struct viewer *v)
{
    if (!v)
        return;
    player_stop(v->player);
    server_destroy(v->server);
    player_destroy(v->player);
    view_destroy(v->view);
    free(v);
}

static int take(void *self, const struct node_message *in)
{
    struct viewer *v = self;
    const struct view_message m = {in->topic,      in->from,       in->content,
                                   in->capture_ns, in->publish_ns, in->epoch_ns};

    viewer_take(v, &m, node_machine_ns(v->node));
    return 0;
}

static void take_line(void *ctx, const Anlos__Log *line)
{
    struct viewer *v = ctx;
    const struct view_message m = {topic_log(), line->node,     &line->base,
                                   0,           line->stamp_ns, 0};

    viewer_take(v, &m, node_machine_ns(v->node));
}

static int64_t log_due_ns(const void *self)
{
    return ((const struct viewer *)self)->log_due_ns;
}

static int read_log(void *self)
{
    struct viewer *v = self;

    log_history_read(node_run_dir(v->node), take_line, v);
    v->log_due_ns = LOOP_NEVER;
    return 0;
}

static int64_t tick_due_ns(const void *self)
{
    return ((const struct viewer *)self)->tick_due_ns;
}

static int tick(void *self)
{
    struct viewer *v = self;
    int wait_ms = viewer_tick(v, node_machine_ns(v->node));

    v->tick_due_ns = wait_ms < 0 ? LOOP_NEVER
                                 : node_machine_ns(v->node) + wait_ms * 1000000LL;
    return 0;
}

static const struct loop_timer timers[] = {
    {.due_ns = log_due_ns, .run = read_log},
    {.due_ns = tick_due_ns, .run = tick, .when = LOOP_EACH},
    {.run = NULL},
};

static void start(void *self)
{
    struct viewer *v = self;

    v->log_due_ns = v->player ? LOOP_NEVER
                              : node_machine_ns(v->node) + LOG_HISTORY_READ_NS;
}

static void destroy(void *self)
{
    viewer_destroy(self);
}

const struct loop viewer_loop = {
    .timers = timers, .start = start, .rest = take, .close = destroy};
