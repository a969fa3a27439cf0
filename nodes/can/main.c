/* SPDX-License-Identifier: MIT */
/* nodes/can/main.c: "detections", "scan/status", "survey", "health", "wall" -> the
 * vehicle's CAN bus -> "ego", "ambient", "wall/given" */
#include "nodes/can/vehicle.h"

int main(int argc, char **argv)
{
    struct node *node;
    struct vehicle *vehicle = NULL;
    struct error why = {""};
    int err = node_create(&node, "can", "Tells the vehicle what is around the corner.",
                          argc, argv);

    if (!node)
        return err;
    err = vehicle_open(&vehicle, node, &why);
    return loop_main(node, &vehicle_loop, vehicle, err, &why);
}
