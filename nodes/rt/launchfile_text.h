/* SPDX-License-Identifier: MIT */
/* nodes/rt/launchfile_text.h -- a launch file as it is written; what is a pointer and
 * NULL was left out, and names are not checked yet. */
#ifndef ANLOS_NODES_RT_LAUNCHFILE_TEXT_H
#define ANLOS_NODES_RT_LAUNCHFILE_TEXT_H

#include <stdbool.h>
#include <stdint.h>

#include <cyaml/cyaml.h>

struct launch_text_array {
    char *uri;
    double *person_m;
};

struct launch_text_stage {
    char *uri;
};

struct launch_text_scan {
    char *mode;
    bool *background;
    unsigned *window, *retries, *background_frames;
    uint32_t *speakers; /* [speakers_count] */
    unsigned speakers_count;
    double *timeout_s;
};

struct launch_text_dsp {
    char *window, *compression, *background;
    double *background_s;
};

struct launch_text_options { /* as written; by the names of recon/imaging/imager_options.h
                              */
    char *base, *iterations, *tolerance, *l1, *tv, *tv_isotropic, *rho, *snr_db, *sharpen;
    char *dmo, *lightcone, *coherence;
};

struct launch_text_frames {
    unsigned *pings;
    char *sum, *every;
};

struct launch_text_recon {
    char *method;
    unsigned *threads;
    bool *preview;
    struct launch_text_frames frames;
    struct launch_text_options options;
};

struct launch_text_track {
    char *mode, *cfar;
    double *false_alarm_rate;
    double *threshold_db, *min_existence, *confirm_existence, *detection_probability;
    double *clutter, *sidelobe_db, *look_s, *acceleration_psd, *join_m, *coast_s;
    unsigned *confirm_hits, *confirm_of;
};

struct launch_text_can_diagnosis {
    unsigned *request, *response, *functional;
};

struct launch_text_can {
    char *uri;
    unsigned *base_id, *sensor, *bitrate, *data_bitrate;
    bool *fd, *motion, *field_of_view;
    double *load;
    struct launch_text_can_diagnosis diagnosis;
};

struct launch_text_view {
    char *address, *bag;
    unsigned *port;
    bool *save;
};

struct launch_text_wall {
    char *from, *prior;
    double *vertical_deg, *reach_m, *every_s, *lost_s;
    double (*free_view_m)[2]; /* [free_view_m_count] */
    unsigned free_view_m_count;
};

struct launch_text_report {
    char *folder;
};

struct launch_text_processes {
    double *alive_s;
    char *realtime;
};

struct launch_text_host {
    char *name, *endpoint, *keys;
    char **nodes; /* [nodes_count] */
    unsigned nodes_count;
};

struct launch_text_snapshot {
    char *folder;
    unsigned *before_s, *after_s, *max_mb;
    bool *faults;
};

struct launch_text_record {
    char *path, *topics, *exclude, *compression;
    unsigned *split_mb, *split_s, *quota_mb, *flush_ms;
    bool *shuffle;
    struct launch_text_snapshot snapshot;
};

struct launch_text_play {
    char *bag, *rate, *topics, *exclude, *remap;
    bool *loop;
    double *start_s, *end_s;
};

struct launch_text {
    char **nodes; /* [nodes_count] */
    unsigned nodes_count;
    struct launch_text_array array;
    struct launch_text_stage stage;
    struct launch_text_scan scan;
    struct launch_text_dsp dsp;
    struct launch_text_recon recon;
    struct launch_text_track track;
    struct launch_text_can can;
    struct launch_text_wall wall;
    struct launch_text_report report;
    struct launch_text_view view;
    struct launch_text_record record;
    struct launch_text_play play;
    struct launch_text_processes processes;
    struct launch_text_host *hosts; /* [hosts_count] */
    unsigned hosts_count;
};

/* What is written for an option; NULL: nothing. */
const char *launch_text_option(const struct launch_text *t, const char *name);

/* For yaml_load: makes a struct launch_text. */
extern const struct cyaml_schema_value launch_text_schema;

#endif
