/* SPDX-License-Identifier: MIT */
/* nodes/array/main.c: "array/fire", "stage/state", "scan/status", "ambient" -> the
 * speakers and microphones -> "ping", "survey" */
#include "nodes/array/acquisition.h"

int main(int argc, char **argv)
{
    struct node *node;
    struct array *array = NULL;
    struct acquisition *acquisition = NULL;
    struct error why = {""};
    int err = node_create(&node, "array", "Fires the speakers, records every microphone.",
                          argc, argv);

    if (!node)
        return err;
    err = array_open(&array, node_launch(node)->array.uri, node_clock(node), &why);
    if (!err && (err = acquisition_create(&acquisition, node, array)))
        array_close(array);
    return loop_main(node, &acquisition_loop, acquisition, err, &why);
}
