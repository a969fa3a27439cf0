/* SPDX-License-Identifier: MIT */
/* nodes/play/main.c: a bag -> what was recorded in it, "clock" */
#include <errno.h>

#include "nodes/play/run.h"

#define DISK_S 30.0 /* that a slow disk may take for a read */

static int create(struct playback **out, struct node *node)
{
    const struct launchfile *l = node_launch(node);
    struct error why = {""};
    const struct playback_config cfg = {
        .bag_iterator = {.bag = l->play.bag,
                         .start_s = l->play.start_s,
                         .end_s = l->play.end_s,
                         .remap = l->play.remap},
        .run_dir = node_run_dir(node),
        .rate = l->play.rate,
        .loop = l->play.loop,
        .topics = l->play.topics,
        .exclude = l->play.exclude,
        .nodes = (const char *const *)l->nodes,
        .n_nodes = l->n_nodes,
        .several_hosts = l->hosts.n > 0,
        .fixed = l->scan.fixed,
        .window = l->scan.window,
        .timeout_s = l->scan.timeout_s,
    };
    int err = playback_create(out, &cfg, node_epoch_ns(node), &why);

    if (err)
        node_log(node, LOG_LEVEL_ERROR, "%s", why.text);
    return err;
}

int main(int argc, char **argv)
{
    struct node *node;
    struct playback *player = NULL;
    int err = node_create(&node, "play", "Plays a bag in the place of who recorded it.",
                          argc, argv);

    if (!node)
        return err;
    err = create(&player, node);
    node_turn_limit(node, DISK_S);
    if (!err)
        err = play_run(node, player, NULL, true);
    playback_destroy(player);
    return node_finish(node, err);
}
