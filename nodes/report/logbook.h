/* SPDX-License-Identifier: MIT */
/* nodes/report/logbook.h -- what was tracked while an array stood on a vehicle: each
 * track in a line, and a picture of the last seconds seen from above. */
#ifndef ANLOS_NODES_REPORT_LOGBOOK_H
#define ANLOS_NODES_REPORT_LOGBOOK_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

#include "dsp/error.h"
#include "msgs/detections.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "nodes/rt/setting.h"
#include "nodes/rt/trails.h"
#include "recon/grid.h"

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
    struct setting setting;
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

#endif
