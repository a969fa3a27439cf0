/* SPDX-License-Identifier: MIT */
/* nodes/view/main.c: what there is to see -> a web page and Foxglove */
#include <errno.h>

#include "msgs/topics.h"
#include "nodes/rt/log_history.h"
#include "nodes/rt/loop.h"
#include "nodes/view/viewer.h"

#define DISK_S 30.0 /* that a slow disk may take for a read of a bag */

static int subscribe(struct node *node)
{
    int err = 0;

    for (const struct topic *t = topics_all(); !err && t->name; t++)
        err = node_subscribe(node, t);
    return err;
}

static void log_connection(void *node, const char *text)
{
    node_log(node, LOG_LEVEL_WARNING, "%s", text);
}

static int create(struct node *node, struct viewer **out)
{
    const struct launchfile *l = node_launch(node);
    const struct viewer_config cfg = {.address = l->view.address,
                                      .port = l->view.port,
                                      .bag = l->view.bag,
                                      .run_dir = node_run_dir(node),
                                      .now_ns = node_machine_ns(node),
                                      .log = log_connection,
                                      .log_ctx = node};
    struct error why = {""};
    int err = viewer_create(out, &cfg, &why);

    if (err) {
        node_log(node, LOG_LEVEL_ERROR, "%s", why.text);
        return err;
    }
    node_turn_limit(node, DISK_S);
    node_log(node, LOG_LEVEL_INFO, "the page is at %s", viewer_url(*out));
    node_state(node, ANLOS__HEALTH__STATE__READY, "page at %s", viewer_url(*out));
    return 0;
}

struct run {
    struct node *node;
    struct viewer *viewer;
    int64_t log_due_ns; /* what was logged before; LOOP_NEVER: it is known */
    int64_t tick_due_ns;
};

static void take_line(void *ctx, const Anlos__Log *line)
{
    const struct run *r = ctx;
    const struct view_message m = {topic_log(), line->node,     &line->base,
                                   0,           line->stamp_ns, 0};

    viewer_take(r->viewer, &m, node_machine_ns(r->node));
}

static int64_t log_due_ns(const void *self)
{
    return ((const struct run *)self)->log_due_ns;
}

static int read_log(void *self)
{
    struct run *r = self;

    log_history_read(node_run_dir(r->node), take_line, r);
    r->log_due_ns = LOOP_NEVER;
    return 0;
}

static int64_t tick_due_ns(const void *self)
{
    return ((const struct run *)self)->tick_due_ns;
}

static int tick(void *self)
{
    struct run *r = self;
    int wait_ms = viewer_tick(r->viewer, node_machine_ns(r->node));

    r->tick_due_ns = wait_ms < 0 ? LOOP_NEVER
                                 : node_machine_ns(r->node) + wait_ms * 1000000LL;
    return 0;
}

static int take(void *self, const struct node_message *in)
{
    struct run *r = self;
    const struct view_message m = {in->topic,      in->from,       in->content,
                                   in->capture_ns, in->publish_ns, in->epoch_ns};

    viewer_take(r->viewer, &m, node_machine_ns(r->node));
    return 0;
}

static const struct loop_timer timers[] = {
    {.due_ns = log_due_ns, .run = read_log},
    {.due_ns = tick_due_ns, .run = tick, .when = LOOP_EACH},
    {.run = NULL},
};

/* Of a bag nothing comes but from there. */
static int run(struct run *r)
{
    const struct loop loop = {.timers = timers, .rest = take};
    bool is_bag = node_launch(r->node)->view.bag != NULL;
    int err = is_bag ? 0 : subscribe(r->node);

    r->log_due_ns = is_bag ? LOOP_NEVER : node_machine_ns(r->node) + LOG_HISTORY_READ_NS;
    return err ? err : loop_run(r->node, &loop, r);
}

int main(int argc, char **argv)
{
    struct run r = {0};
    int err = node_create(&r.node, "view",
                          "Shows image, objects, levels and health on a web page, and in "
                          "Foxglove.",
                          argc, argv);

    if (!r.node)
        return err;
    err = create(r.node, &r.viewer);
    if (!err)
        err = run(&r);
    viewer_destroy(r.viewer);
    return node_finish(r.node, err);
}
