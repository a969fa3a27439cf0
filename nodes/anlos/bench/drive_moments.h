/* nodes/anlos/bench/drive_moments.h -- how good each list of a drive was. */
#ifndef ANLOS_NODES_ANLOS_BENCH_DRIVE_MOMENTS_H
#define ANLOS_NODES_ANLOS_BENCH_DRIVE_MOMENTS_H

#include <stddef.h>

struct drive_moment {
    double t_s, gospa_m, ospa_m, localisation_m, missed_m, false_m;
    size_t n_objects, n_tracks, n_detections;
};

struct drive_moments {
    struct drive_moment *at; /* [n]; free() it */
    size_t n, room;
};

/* 0, -ENOMEM. */
int drive_moments_add(struct drive_moments *m, const struct drive_moment *moment);

#endif
