/* SPDX-License-Identifier: MIT */
/* nodes/track/main.c: "survey", "wall", "ego", "volume" -> detection, the wall's mirror,
 * tracks -> "detections" */
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/track/tracking.h"

int main(int argc, char **argv)
{
    struct node *node;
    struct tracking *tracking = NULL;
    struct pipeline_config cfg;
    struct error why = {""};
    int err =
        node_create(&node, "track", "Finds the hidden objects in the image.", argc, argv);

    if (!node)
        return err;
    launchfile_pipeline(&cfg, node_launch(node));
    err = tracking_create(&tracking, node, &cfg.tracker);
    return loop_main(node, &tracking_loop, tracking, err, &why);
}
