/* SPDX-License-Identifier: MIT */
/* nodes/recon/main.c: of a scan "survey", "traces", "scan/status" -> "volume", "receipt";
 * of a static array "survey", "traces", "ego", "wall" -> "volume", and in a replay
 * "receipt" */
#include "nodes/recon/recon.h"
#include "nodes/recon/steady.h"
#include "nodes/rt/launchfile_pipeline.h"

int main(int argc, char **argv)
{
    struct node *node;
    struct recon *recon = NULL;
    struct steady *steady = NULL;
    struct pipeline_config cfg;
    struct error why = {""};
    int err = node_create(&node, "recon",
                          "Images what the echoes show, while they come in.", argc, argv);

    if (!node)
        return err;
    launchfile_pipeline(&cfg, node_launch(node));
    if (cfg.is_static) {
        err = steady_create(&steady, node, &cfg.array);
        return loop_main(node, &steady_loop, steady, err, &why);
    }
    err = recon_create(&recon, node, &cfg.scan);
    return loop_main(node, &recon_loop, recon, err, &why);
}
