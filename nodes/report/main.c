/* SPDX-License-Identifier: MIT */
/* nodes/report/main.c: "survey", "volume", "detections", "wall", "ego", "scan/status",
 * "health", and "host" of a system on several -> a folder.  Ends when it is written:
 * after the scan, or of a scan without end when it is stopped. */
#include <errno.h>

#include "msgs/topics.h"
#include "nodes/report/report.h"
#include "nodes/rt/export.h"
#include "nodes/rt/loop.h"

#define WRITE_S 300.0       /* at most, on a slow disk */
#define LOOK_NS 500000000LL /* whether all is there that will come */

struct run {
    struct node *node;
    struct report report;
    int64_t look_due_ns;
};

static int take_survey(void *self, const struct node_message *in)
{
    struct run *r = self;

    return report_survey(&r->report, (const Anlos__Survey *)in->content);
}

static int take_volume(void *self, const struct node_message *in)
{
    struct run *r = self;

    return report_volume(&r->report, (const Anlos__Volume *)in->content, in->capture_ns,
                         in->publish_ns);
}

static int take_detections(void *self, const struct node_message *in)
{
    struct run *r = self;

    return report_detections(&r->report, (const Anlos__DetectionList *)in->content,
                             in->capture_ns);
}

static int take_status(void *self, const struct node_message *in)
{
    struct run *r = self;

    return report_status(&r->report, (const Anlos__ScanStatus *)in->content,
                         node_machine_ns(r->node));
}

static int take_health(void *self, const struct node_message *in)
{
    struct run *r = self;

    return report_health(&r->report, (const Anlos__Health *)in->content, in->epoch_ns);
}

static int take_walls(void *self, const struct node_message *in)
{
    struct run *r = self;

    return logbook_walls(&r->report.logbook, (const Anlos__WallList *)in->content);
}

static int take_ego(void *self, const struct node_message *in)
{
    struct run *r = self;

    logbook_ego(&r->report.logbook, (const Anlos__EgoMotion *)in->content,
                in->capture_ns);
    return 0;
}

static int take_hosts(void *self, const struct node_message *in)
{
    struct run *r = self;

    return report_hosts_take(&r->report.hosts, (const Anlos__HostStatus *)in->content);
}

static bool has_hosts(const void *self)
{
    return node_launch(((const struct run *)self)->node)->hosts.n > 0;
}

static void start(void *self)
{
    node_state(((const struct run *)self)->node, ANLOS__HEALTH__STATE__READY, "ready");
}

static const struct loop_input inputs[] = {
    {.topic = topic_survey, .take = take_survey},
    {.topic = topic_volume, .take = take_volume},
    {.topic = topic_detections, .take = take_detections},
    {.topic = topic_scan_status, .take = take_status},
    {.topic = topic_health, .take = take_health},
    {.topic = topic_wall, .take = take_walls},
    {.topic = topic_ego, .take = take_ego},
    {.topic = topic_host, .take = take_hosts, .wanted = has_hosts},
    {.topic = NULL},
};

static int64_t look_due_ns(const void *self)
{
    return ((const struct run *)self)->look_due_ns;
}

static int look(void *self)
{
    struct run *r = self;
    int64_t now = node_machine_ns(r->node);

    r->look_due_ns = now + LOOK_NS;
    return report_is_complete(&r->report, now) ? LOOP_DONE : 0;
}

static const struct loop_timer timers[] = {
    {.due_ns = look_due_ns, .run = look, .when = LOOP_EACH},
    {.run = NULL},
};

static int run(struct run *r)
{
    const struct loop loop = {.inputs = inputs, .timers = timers, .start = start};
    struct error why = {""};
    const char *folder = node_launch(r->node)->report.folder;
    int err = export_folder(folder, &why);

    if (!err)
        err = loop_run(r->node, &loop, r);
    /* A system without end is over when it is stopped. */
    if (!err || (err == -ESHUTDOWN && node_launch(r->node)->scan.fixed)) {
        node_busy(r->node, WRITE_S);
        err = report_write(&r->report, folder, &why);
        if (!err)
            node_log(r->node, LOG_LEVEL_DEBUG, "%s is written", folder);
    }
    if (err && why.text[0])
        node_log(r->node, LOG_LEVEL_ERROR, "%s", why.text);
    return err;
}

int main(int argc, char **argv)
{
    struct run r = {0};
    int err = node_create(&r.node, "report",
                          "Writes the results of a scan into a folder.", argc, argv);

    if (!r.node)
        return err;
    report_init(&r.report);
    if (node_launch(r.node)->hosts.n)
        r.report.map = &node_launch(r.node)->hosts;
    err = run(&r);
    report_clear(&r.report);
    return node_finish(r.node, err);
}
