/* SPDX-License-Identifier: MIT */
/* nodes/record/main.c: every topic -> a bag */
#include "nodes/record/record.h"

int main(int argc, char **argv)
{
    struct node *node;
    struct record *record = NULL;
    struct error why = {""};
    int err = node_create(&node, "record", "Records every topic into a bag (MCAP).", argc,
                          argv);

    if (!node)
        return err;
    err = record_open(&record, node, &why);
    return loop_main(node, &record_loop, record, err, &why);
}
