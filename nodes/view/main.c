/* SPDX-License-Identifier: MIT */
/* nodes/view/main.c: what there is to see -> a web page and Foxglove */
#include <errno.h>

#include "msgs/topics.h"
#include "nodes/rt/log_history.h"
#include "nodes/rt/node.h"
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

struct looker {
    struct node *node;
    struct viewer *viewer;
};

static void take_line(void *ctx, const Anlos__Log *line)
{
    const struct looker *l = ctx;
    const struct view_message m = {topic_log(), line->node,     &line->base,
                                   0,           line->stamp_ns, 0};

    viewer_take(l->viewer, &m, node_machine_ns(l->node));
}

static int run(struct node *node, struct viewer *viewer)
{
    struct node_message in;
    struct looker looker = {node, viewer};
    bool is_bag = node_launch(node)->view.bag != NULL, knows_log = is_bag;
    int64_t began_ns = node_machine_ns(node);
    int err = is_bag ? 0 : subscribe(node);

    while (!err) {
        if (!knows_log && node_machine_ns(node) - began_ns >= LOG_HISTORY_READ_NS) {
            log_history_read(node_run_dir(node), take_line, &looker);
            knows_log = true;
        }
        int wait_ms = viewer_tick(viewer, node_machine_ns(node));
        err = node_next(node, &in, wait_ms);
        if (err == -ETIMEDOUT) {
            err = 0;
        } else if (!err) {
            const struct view_message m = {in.topic,      in.from,       in.content,
                                           in.capture_ns, in.publish_ns, in.epoch_ns};
            viewer_take(viewer, &m, node_machine_ns(node));
        }
    }
    return err;
}

int main(int argc, char **argv)
{
    struct viewer *viewer = NULL;
    struct node *node;
    int err = node_create(&node, "view",
                          "Shows image, objects, levels and health on a web page, and in "
                          "Foxglove.",
                          argc, argv);

    if (!node)
        return err;
    err = create(node, &viewer);
    if (!err)
        err = run(node, viewer);
    viewer_destroy(viewer);
    return node_finish(node, err);
}
