/* SPDX-License-Identifier: MIT */
/* nodes/wall/main.c: "survey", "echoes" or "wall/given", "ego" -> the walls -> "wall" */
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/wall/finding.h"

int main(int argc, char **argv)
{
    struct node *node;
    struct finding *finding = NULL;
    struct pipeline_config cfg;
    struct error why = {""};
    int err = node_create(&node, "wall", "Tells where the walls are that mirror sound.",
                          argc, argv);

    if (!node)
        return err;
    launchfile_pipeline(&cfg, node_launch(node));
    err = finding_create(&finding, node, &cfg.walls);
    return loop_main(node, &finding_loop, finding, err, &why);
}
