/* SPDX-License-Identifier: MIT */
/* nodes/view/view_state.h -- what a view knows, and how it says so. */
#ifndef ANLOS_NODES_VIEW_VIEW_STATE_H
#define ANLOS_NODES_VIEW_VIEW_STATE_H

#include <pthread.h>
#include <stdatomic.h>

#include "msgs/clock.pb-c.h"
#include "msgs/envelope.h"
#include "msgs/save.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/volume.pb-c.h"
#include "nodes/rt/trails.h"
#include "nodes/view/history.h"
#include "nodes/view/meter.h"
#include "nodes/view/names.h"
#include "nodes/view/picture.h"
#include "nodes/view/view.h"
#include "recon/survey.h"
#include "recon/walls/walls.h"

#define VIEW_MAX_NODES 64
#define VIEW_LINES     100 /* of the log */

struct view_node {
    char name[ENVELOPE_NODE_SIZE];
    char text[256];
    Anlos__Health__State state;
    uint32_t pid;
    double uptime_s, cpu_s, cpu_share; /* of one core, since the message before */
    uint64_t rss_bytes, lost, refused; /* lost: gaps and dropped of what it receives */
    int64_t heard_ns, epoch_ns;
};

struct view_line {
    int64_t stamp_ns;
    const char *level;
    char node[ENVELOPE_NODE_SIZE];
    char text[512];
    uint64_t repeats, left_out;
};

struct view {
    struct board *board;
    char *origin;
    bool is_bag, may_save;
    atomic_int pages;

    bool changed[BOARD_SUBJECTS];
    int64_t
        posted_ns; /* 0: never, as the next two, which view_beat takes in any thread */
    _Atomic int64_t beat_ns, heard_ns;

    struct survey survey;
    uint64_t survey_id; /* 0: none */
    bool has_walls;     /* node wall tells of them */
    struct walls walls; /* else those of the survey */
    struct trails trails;
    struct history history;
    bool has_history;
    json_t *kept[BOARD_SUBJECTS]; /* made of the newest message; NULL: none */
    struct meter meter;
    int64_t measured_ns;
    struct view_node nodes[VIEW_MAX_NODES];
    size_t n_nodes;
    struct view_line lines[VIEW_LINES]; /* a ring */
    uint64_t n_lines;                   /* ever */

    pthread_mutex_t picture_lock; /* slices are asked for by other threads */
    struct picture picture;
    uint32_t picture_id; /* counts the pictures; 0: none */
    struct view_image {  /* which image it is of */
        uint64_t survey_id;
        uint32_t scan, pings_used;
        bool preview;
        int64_t capture_ns;
    } image;
};

json_t *view_scan_json(const Anlos__ScanStatus *s);
json_t *view_stage_json(const Anlos__StageState *s);
json_t *view_record_json(const Anlos__SaveStatus *s, bool may_save, int64_t now_ns);
json_t *view_clock_json(const Anlos__Clock *c);
void view_take_health(struct view *v, const Anlos__Health *h, int64_t epoch_ns,
                      int64_t now_ns);
json_t *view_nodes_json(const struct view *v, int64_t now_ns);
void view_take_line(struct view *v, const Anlos__Log *l);
json_t *view_log_json(const struct view *v);

/* Makes the picture of a volume and posts it, unless it is the one that is shown. */
void view_take_volume(struct view *v, const Anlos__Volume *volume, int64_t capture_ns,
                      int64_t publish_ns);
void view_post_volume(struct view *v, const Anlos__Volume *volume, int64_t publish_ns);

#endif
