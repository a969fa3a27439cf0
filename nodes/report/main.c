/* SPDX-License-Identifier: MIT */
/* nodes/report/main.c: "survey", "volume", "detections", "wall", "ego", "scan/status",
 * "health", and "host" of a system on several -> a folder. */
#include "nodes/report/report.h"
#include "nodes/rt/export.h"

int main(int argc, char **argv)
{
    struct node *node;
    struct report report;
    struct error why = {""};
    int err = node_create(&node, "report", "Writes the results of a scan into a folder.",
                          argc, argv);

    if (!node)
        return err;
    const struct launchfile *l = node_launch(node);
    report_init(&report);
    report.node = node;
    report.map = l->hosts.n ? &l->hosts : NULL;
    err = export_folder(l->report.folder, &why);
    return loop_main(node, &report_loop, &report, err, &why);
}
