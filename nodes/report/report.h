/* SPDX-License-Identifier: MIT */
/* nodes/report/report.h -- the report node's step: gathers the end of a scan from the
 * messages and writes the folder of results. */
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
#include "msgs/wall.pb-c.h"
#include "nodes/rt/trails.h"
#include "recon/grid.h"
#include "recon/survey.h"
#include "recon/walls/walls.h"

/* What was tracked while an array stood on a vehicle: each track in a line, and a
 * picture of the last seconds seen from above. */

#define LOGBOOK_MAX_TRACKS 1000
#define LOGBOOK_SHOWN_NS   20000000000LL /* of the picture */

struct logbook_track { /* from its first list to its last */
    uint32_t id;
    Anlos__Shape shape;
    int64_t first_ns, last_ns;
    double from_m[3], to_m[3]; /* in the frames of the vehicle then */
    double velocity_m_s[2];    /* the last; NAN: not known */
    double existence;          /* the greatest */
    double speed_sum_m_s;
    uint64_t n, n_speeds, n_measured; /* lists with it, with its speed, that saw it */
};

struct logbook {  /* begins with logbook_init */
    bool tracked; /* there was a list of tracks */
    bool in_vehicle_frame;
    int64_t first_ns, last_ns; /* of its lists */
    uint64_t n_lists, n_left_out;
    size_t n_tracks, room;
    struct logbook_track *tracks; /* [n_tracks], the oldest first */
    struct trails trails;
    uint64_t survey_id; /* 0: none */
    bool has_walls;     /* node wall tells of them; else those of the survey */
    struct survey survey;
    struct walls walls;
    Anlos__WallList *wall_list; /* NULL: none came */
};

void logbook_init(struct logbook *d);
void logbook_ego(struct logbook *d, const Anlos__EgoMotion *m, int64_t capture_ns);
void logbook_survey(struct logbook *d, const Anlos__Survey *m);
int logbook_walls(struct logbook *d, const Anlos__WallList *m); /* 0, -ENOMEM */

/* Others than lists of tracks are ignored.  0, -ENOMEM. */
int logbook_list(struct logbook *d, const Anlos__DetectionList *list, int64_t capture_ns);

/* {"tracks": [...], "walls": [...], ...}; NULL: no list of tracks came. */
json_t *logbook_json(const struct logbook *d);

/* plan.png.  grid: of the last image, or NULL.  0, or errors as export_plan. */
int logbook_picture(const struct logbook *d, const char *folder, const struct grid *grid,
                    struct error *why);
void logbook_clear(struct logbook *d);

/* Of a system on several machines: what each said last of the others, how far apart
 * their clocks are above all. */

struct report_hosts { /* zeroed: none */
    size_t n;
    Anlos__HostStatus *list[HOSTS_MAX]; /* owned */
};

/* Copies it.  0, -ENOMEM. */
int report_hosts_take(struct report_hosts *h, const Anlos__HostStatus *status);

/* Seconds by which the clock of one host is ahead of that of another; 0 when nobody has
 * measured it. */
double report_hosts_ahead_s(const struct report_hosts *h, const char *of,
                            const char *than);

/* An array, an object for each pair that was measured. */
json_t *report_hosts_json(const struct report_hosts *h);
void report_hosts_clear(struct report_hosts *h);

#define REPORT_MAX_NODES 16

struct report_node {
    Anlos__Health *health; /* the newest; owned */
    int64_t epoch_ns;
    unsigned restarts;
};

struct report {
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
