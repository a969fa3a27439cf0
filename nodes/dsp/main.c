/* SPDX-License-Identifier: MIT */
/* nodes/dsp/main.c: "survey", "ping", "ego", "ambient" -> pulse compression -> "traces",
 * "receipt"; where walls are from echoes, "echoes".  With "wall" the array's self-test,
 * to health: of a live array. */
#include "nodes/dsp/dsp.h"
#include "nodes/rt/launchfile_pipeline.h"

int main(int argc, char **argv)
{
    struct node *node;
    struct dsp *dsp = NULL;
    struct pipeline_config cfg;
    struct error why = {""};
    int err = node_create(&node, "dsp", "Compresses pulses and subtracts the background.",
                          argc, argv);

    if (!node)
        return err;
    launchfile_pipeline(&cfg, node_launch(node));
    cfg.frontend.judges_array = !node_is_replayed(node);
    err = dsp_create(&dsp, node, &cfg.frontend);
    return loop_main(node, &dsp_loop, dsp, err, &why);
}
