/* SPDX-License-Identifier: MIT */
/* nodes/stage/main.c: "stage/command" and "stage/manual" -> the translation stage ->
 * "stage/state" */
#include "nodes/stage/mover.h"

int main(int argc, char **argv)
{
    struct node *node;
    struct stage *stage = NULL;
    struct mover mover;
    struct error why = {""};
    int err = node_create(&node, "stage", "Moves the stage that carries the array.", argc,
                          argv);

    if (!node)
        return err;
    err = stage_open(&stage, node_launch(node)->stage.uri, node_clock(node), &why);
    mover_init(&mover, node, stage);
    return loop_main(node, &mover_loop, &mover, err, &why);
}
