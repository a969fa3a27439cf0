/* SPDX-License-Identifier: MIT */
/* nodes/anlos/score/drive_result.h -- how good the tracks of a drive were, as sums that
 * add up over drives, and the figures that these make. */
#ifndef ANLOS_NODES_ANLOS_SCORE_DRIVE_RESULT_H
#define ANLOS_NODES_ANLOS_SCORE_DRIVE_RESULT_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"

#define DRIVE_CONFIDENCE 0.95

struct drive_sum { /* of squares or values */
    double sum;
    size_t n;
};

/* Is what is said true?  Of the objects that CAN frames name: existence in bins, with how
 * often there was somebody; and of those who were, by class, the squared error over the
 * covariance (NEES; of two numbers that are right, 2, and 95 % of them under 5.99). */
enum { DRIVE_BINS = 8, DRIVE_CLASSES = 4 };
#define DRIVE_NEES_95 5.991

struct drive_bin {
    double stated; /* sum */
    size_t n, n_true;
};

struct drive_nees {
    struct drive_sum sum;
    size_t n_within; /* of 95 % */
};

/* Where a bin begins, 0..1; DRIVE_BINS: where the last one ends. */
double drive_bin_from(size_t bin);
const char *drive_class_name(size_t class); /* "person"; the last: all others */
void drive_bins_add(struct drive_bin bins[DRIVE_BINS], double existence, bool is_true);
void drive_nees_add(struct drive_nees by_class[DRIVE_CLASSES], const char *kind,
                    double nees);

struct drive_result { /* no pointers: it goes from one process to another */
    double seconds;
    size_t n_lists;
    struct drive_sum gospa, ospa, localisation, missed, false_ones;
    struct drive_sum position2, velocity2;
    struct drive_sum seen, seen_far; /* detections of objects: Pd */
    struct drive_sum told, told_far; /* the same on CAN */
    struct drive_bin existence[DRIVE_BINS];
    struct drive_nees nees[DRIVE_CLASSES];
    struct drive_sum delay, lead; /* from first echo to track; before sight */
    double worst_delay_s;
    size_t n_entries, n_late; /* objects that came in; and left without a track */
    size_t n_false_tracks;
};

void drive_sum_add(struct drive_sum *s, double value);

/* Mean; NaN of none. */
double drive_mean(const struct drive_sum *s);
double drive_rms(const struct drive_sum *squares);

enum drive_figure {
    DRIVE_GOSPA,
    DRIVE_OSPA,
    DRIVE_LOCALISATION,
    DRIVE_MISSED,
    DRIVE_FALSE,
    DRIVE_SEEN,
    DRIVE_SEEN_FAR,
    DRIVE_TOLD,
    DRIVE_TOLD_FAR,
    DRIVE_FALSE_TRACKS,
    DRIVE_DELAY,
    DRIVE_DELAY_WORST,
    DRIVE_LEAD,
    DRIVE_POSITION,
    DRIVE_VELOCITY,
    DRIVE_FIGURES
};

/* NaN: there was nothing to tell it from. */
double drive_figure(const struct drive_result *r, enum drive_figure which);
const char *drive_figure_name(enum drive_figure which); /* in files, with its unit */

/* False tracks in an hour: as they were, and what they are below of with
 * DRIVE_CONFIDENCE. */
double drive_false_per_hour(const struct drive_result *r);
double drive_false_per_hour_bound(const struct drive_result *r);

struct drive_tally { /* of some drives */
    size_t n;
    struct drive_result all;     /* as if they were one */
    double worst[DRIVE_FIGURES]; /* of one drive; NaN: none tells */
};

void drive_tally_init(struct drive_tally *t);
void drive_tally_add(struct drive_tally *t, const struct drive_result *r);

/* What a count tells of the rate behind it. */

/* The largest mean with which up to n events still come with a probability of
 * 1 - confidence: the rate is below it, as sure as that (Garwood 1936, one-sided).  Of
 * none at 95 %: 3.0.  0 < confidence < 1. */
double poisson_bound(size_t n, double confidence);

/* How good each list of a drive was. */

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

/* A drive and what came of it. */

struct drive_outcome {
    int err; /* 0, -EINTR (result and moments are of what was done), negative errno */
    struct error why;
    struct drive_result result;
    struct drive_moments moments; /* free() its at */
};

#endif
