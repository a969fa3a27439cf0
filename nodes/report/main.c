/* SPDX-License-Identifier: MIT */
/* nodes/report/main.c: "survey", "volume", "detections", "wall", "ego", "scan/status",
 * "health", and "host" of a system on several -> a folder.  Ends when it is written:
 * after the scan, or of a scan without end when it is stopped. */
#include <errno.h>

#include "msgs/topics.h"
#include "nodes/report/report.h"
#include "nodes/rt/export.h"
#include "nodes/rt/node.h"

#define WRITE_S 300.0 /* at most, on a slow disk */

static int subscribe(struct node *node)
{
    const struct topic *const topics[] = {
        topic_survey(), topic_volume(), topic_detections(), topic_scan_status(),
        topic_health(), topic_wall(),   topic_ego()};

    for (size_t i = 0; i < sizeof topics / sizeof *topics; i++) {
        int err = node_subscribe(node, topics[i]);
        if (err)
            return err;
    }
    return node_launch(node)->hosts.n ? node_subscribe(node, topic_host()) : 0;
}

static int take(struct node *node, struct report *r, const struct node_message *in)
{
    if (in->topic == topic_survey())
        return report_survey(r, (const Anlos__Survey *)in->content);
    if (in->topic == topic_volume())
        return report_volume(r, (const Anlos__Volume *)in->content, in->capture_ns,
                             in->publish_ns);
    if (in->topic == topic_detections())
        return report_detections(r, (const Anlos__DetectionList *)in->content,
                                 in->capture_ns);
    if (in->topic == topic_scan_status())
        return report_status(r, (const Anlos__ScanStatus *)in->content,
                             node_machine_ns(node));
    if (in->topic == topic_wall())
        return logbook_walls(&r->logbook, (const Anlos__WallList *)in->content);
    if (in->topic == topic_ego())
        logbook_ego(&r->logbook, (const Anlos__EgoMotion *)in->content, in->capture_ns);
    if (in->topic == topic_host())
        return report_hosts_take(&r->hosts, (const Anlos__HostStatus *)in->content);
    if (in->topic == topic_health())
        return report_health(r, (const Anlos__Health *)in->content, in->epoch_ns);
    return 0;
}

static int run(struct node *node, struct report *r)
{
    struct node_message in;
    struct error why = {""};
    const char *folder = node_launch(node)->report.folder;
    int err = export_folder(folder, &why);

    if (!err)
        err = subscribe(node);
    if (!err)
        node_state(node, ANLOS__HEALTH__STATE__READY, "ready");
    while (!err && !report_is_complete(r, node_machine_ns(node))) {
        err = node_next(node, &in, 500);
        if (!err)
            err = take(node, r, &in);
        else if (err == -ETIMEDOUT)
            err = 0;
    }
    /* A system without end is over when it is stopped. */
    if (!err || (err == -ESHUTDOWN && node_launch(node)->scan.fixed)) {
        node_busy(node, WRITE_S);
        err = report_write(r, folder, &why);
        if (!err)
            node_log(node, LOG_LEVEL_DEBUG, "%s is written", folder);
    }
    if (err && why.text[0])
        node_log(node, LOG_LEVEL_ERROR, "%s", why.text);
    return err;
}

int main(int argc, char **argv)
{
    struct node *node;
    struct report report;
    int err = node_create(&node, "report", "Writes the results of a scan into a folder.",
                          argc, argv);

    if (!node)
        return err;
    report_init(&report);
    if (node_launch(node)->hosts.n)
        report.map = &node_launch(node)->hosts;
    err = run(node, &report);
    report_clear(&report);
    return node_finish(node, err);
}
