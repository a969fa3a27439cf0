/* SPDX-License-Identifier: MIT */
/* nodes/can/diagnosis.h -- the frame Diagnosis of what the health messages of all nodes
 * say.  Time is an argument. */
#ifndef ANLOS_NODES_CAN_DIAGNOSIS_H
#define ANLOS_NODES_CAN_DIAGNOSIS_H

#include "msgs/detections.pb-c.h"
#include "nodes/can/watch.h"

struct diagnosis_node {
    char name[ENVELOPE_NODE_SIZE];
    int64_t heard_ns, before_ns; /* its newest health, and the one before by a second */
    double cpu_s, cpu_before_s;  /* as they said */
    uint64_t dropped;        /* pings and traces that it missed, when it makes images */
    uint64_t dropped_before; /* in the processes before */
};

struct diagnosis {
    unsigned n_processors;
    struct diagnosis_node nodes[WATCH_MAX_NODES]; /* [n_nodes] */
    size_t n_nodes;
    double noise_db;     /* as who hears says; NaN: not known */
    int64_t noise_ns;    /* when it said so */
    double snr_db;       /* of the strongest object of the newest list; NaN: none */
    uint64_t lost_pings; /* as the scan counts them */
    int trouble;         /* the fault that was told last */
};

void diagnosis_init(struct diagnosis *d, unsigned n_processors);
void diagnosis_health(struct diagnosis *d, const Anlos__Health *health, int64_t now_ns);
void diagnosis_list(struct diagnosis *d, const Anlos__DetectionList *list);
void diagnosis_scan(struct diagnosis *d, const Anlos__ScanStatus *status);

/* Of the compressed sound, over an echo of gain 1; NaN: not known now. */
double diagnosis_noise_db(const struct diagnosis *d, int64_t now_ns);

/* Signal to noise of the strongest object; NaN while images are stale. */
double diagnosis_snr_db(const struct diagnosis *d, const struct watch *w);

/* The next one, once a second: of the faults since the start each has its turn. */
void diagnosis_next(struct diagnosis *d, const struct watch *w, int64_t now_ns,
                    struct can_diagnosis *out);

#endif
