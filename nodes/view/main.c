/* SPDX-License-Identifier: MIT */
/* nodes/view/main.c: what there is to see -> a web page and Foxglove */
#include "msgs/topics.h"
#include "nodes/view/viewer.h"

#define DISK_S 30.0 /* that a slow disk may take for a read of a bag */

static void log_connection(void *node, const char *text)
{
    node_log(node, LOG_LEVEL_WARNING, "%s", text);
}

static int save(void *node, const ProtobufCMessage *request)
{
    return node_publish(node, topic_save(), 0, request);
}

static int open_viewer(struct viewer **out, struct node *node, struct error *why)
{
    const struct launchfile *l = node_launch(node);
    const struct viewer_config cfg = {.node = node,
                                      .address = l->view.address,
                                      .port = l->view.port,
                                      .bag = l->view.bag,
                                      .may_mark = l->view.save,
                                      .run_dir = node_run_dir(node),
                                      .now_ns = node_machine_ns(node),
                                      .save = l->view.save && !l->view.bag ? save : NULL,
                                      .save_ctx = node,
                                      .log = log_connection,
                                      .log_ctx = node};
    int err = viewer_create(out, &cfg, why);

    if (err)
        return err;
    node_turn_limit(node, DISK_S);
    node_log(node, LOG_LEVEL_INFO, "the page is at %s", viewer_url(*out));
    node_state(node, ANLOS__HEALTH__STATE__READY, "page at %s", viewer_url(*out));
    /* Of a bag nothing comes but from there. */
    for (const struct topic *t = topics_all(); !err && !cfg.bag && t->name; t++)
        err = node_subscribe(node, t);
    return err;
}

int main(int argc, char **argv)
{
    struct node *node;
    struct viewer *viewer = NULL;
    struct error why = {""};
    int err = node_create(&node, "view",
                          "Shows image, objects, levels and health on a web page, and in "
                          "Foxglove.",
                          argc, argv);

    if (!node)
        return err;
    err = open_viewer(&viewer, node, &why);
    return loop_main(node, &viewer_loop, viewer, err, &why);
}
