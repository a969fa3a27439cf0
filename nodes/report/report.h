/* SPDX-License-Identifier: MIT */
/* nodes/report/report.h -- the node report: gathers the end of a scan from the messages
 * and writes the folder of results. */
#ifndef ANLOS_NODES_REPORT_REPORT_H
#define ANLOS_NODES_REPORT_REPORT_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

#include "dsp/error.h"
#include "msgs/detections.pb-c.h"
#include "msgs/health.pb-c.h"
#include "msgs/host.pb-c.h"
#include "msgs/hosts.h"
#include "msgs/scan.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/volume.pb-c.h"
#include "nodes/report/logbook.h"
#include "nodes/rt/loop.h"

/* Of a system on several machines: what each said last of the others, how far apart
 * their clocks are above all. */

struct report_hosts { /* zeroed: none */
    size_t n;
    Anlos__HostStatus *list[HOSTS_MAX]; /* owned */
};

/* Copies it.  0, -ENOMEM. */
int report_hosts_take(struct report_hosts *h, const Anlos__HostStatus *status);

#define REPORT_MAX_NODES 16

struct report_node {
    Anlos__Health *health; /* the newest; owned */
    int64_t epoch_ns;
    unsigned restarts;
};

struct report {
    struct node *node; /* not owned; NULL: for the steps below alone */
    int64_t look_due_ns;
    Anlos__Volume *volume; /* the last of the scan, not a preview; owned */
    Anlos__DetectionList *detections;
    Anlos__ScanStatus *status;
    int64_t volume_capture_ns, volume_publish_ns;
    double ping_s;                /* length of a recording; NaN: not known */
    int64_t running_ns, ended_ns; /* 0: not yet */
    struct report_node nodes[REPORT_MAX_NODES];
    size_t n_nodes;
    const struct hosts *map; /* who is where; NULL: all on one machine */
    struct report_hosts hosts;
    struct logbook logbook; /* of a fixed array */
};

/* Ends when it is written: after the scan, or of a scan without end when it is stopped.
 */
extern const struct loop report_loop;

void report_init(struct report *r);

/* Each copies what it needs.  0, -ENOMEM. */
int report_survey(struct report *r, const Anlos__Survey *survey);
int report_volume(struct report *r, const Anlos__Volume *volume, int64_t capture_ns,
                  int64_t publish_ns);
int report_detections(struct report *r, const Anlos__DetectionList *list,
                      int64_t capture_ns);
int report_status(struct report *r, const Anlos__ScanStatus *status, int64_t now_ns);
int report_health(struct report *r, const Anlos__Health *health, int64_t epoch_ns);

/* The scan has ended, and its volume and detections are here; or it has failed, and for
 * 5 s nothing more has come. */
bool report_is_complete(const struct report *r, int64_t now_ns);

/* report.json, and as far as there are any detections.json, of tracks plan.png,
 * projections and volume.nrrd.  Without report.json none of them; when another one fails
 * the rest is there, and the error names what is not.  0 or a negative errno. */
int report_write(const struct report *r, const char *folder, struct error *why);
void report_clear(struct report *r);

/* The file report.json: how the scan went. */

/* NULL: no memory. */
json_t *report_json(const struct report *r);

#endif
