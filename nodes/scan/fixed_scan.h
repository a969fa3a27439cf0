/* SPDX-License-Identifier: MIT */
/* nodes/scan/fixed_scan.h -- an array that stands: the same state machine as scan.h for a
 * system that has no end.  It waits for the nodes it needs and for the survey, then asks
 * the array to go round its speakers without end: first without the hidden objects, where
 * a background is to be recorded, then with them.  Nothing is taken again; what got lost
 * is counted.  It asks once more when no ping comes, and restarts, as another scan,
 * when array or survey are not the same any more, or when dsp has lost its background. It
 * is done when the array says that the recording that it plays has ended. */
#ifndef ANLOS_NODES_SCAN_FIXED_SCAN_H
#define ANLOS_NODES_SCAN_FIXED_SCAN_H

#include "nodes/scan/scan.h"

struct fixed_scan;

/* 0, -ENOMEM. */
int fixed_scan_create(struct fixed_scan **out, const struct scan_config *cfg);

/* As scan_hear: every message, before it is handed on.  false: it is void. */
bool fixed_scan_hear(struct fixed_scan *s, const char *from, int64_t epoch_ns,
                     int64_t now_ns);

/* 0, -ENOMEM.  One that does not fit makes the scan fail. */
int fixed_scan_survey(struct fixed_scan *s, const Anlos__Survey *survey);
void fixed_scan_health(struct fixed_scan *s, const char *from,
                       const Anlos__Health *health);
void fixed_scan_ping(struct fixed_scan *s, const Anlos__Ping *ping, int64_t now_ns);

/* What to do now: true when *out is to be published, which borrows from s.  Call after
 * each message and at least every 100 ms. */
bool fixed_scan_step(struct fixed_scan *s, int64_t now_ns, Anlos__FireCommand *out);

/* pings_expected is 0: there is no end.  The text lives in s. */
void fixed_scan_status(struct fixed_scan *s, int64_t now_ns, Anlos__ScanStatus *out);
void fixed_scan_destroy(struct fixed_scan *s);

/* Pings of an array that goes round its speakers without end: how many came, how many
 * did not, and how fast they come. */

#define ROUNDS_RING 64

struct rounds {
    size_t n_speakers;           /* of a round */
    uint64_t next;               /* ping that is to come: round x n_speakers + speaker */
    uint64_t all_done, all_lost; /* since the first start; those that are void are lost */
    uint64_t all_void;
    int64_t newest_ns[ROUNDS_RING]; /* arrivals, a ring */
    size_t n;                       /* of this start */
};

/* The array was asked to begin; what was counted stays. */
void rounds_start(struct rounds *t, size_t n_speakers);

/* A ping of a round from 1 and the speaker's index in it.  One that comes twice, or after
 * a later one, does not count. */
void rounds_add(struct rounds *t, uint32_t round, size_t index, bool valid,
                int64_t now_ns);

/* Rounds that are over. */
size_t rounds_frames(const struct rounds *t);

/* As "2.6 frames/s, 41.7 pings/s; 3 void". */
void rounds_text(const struct rounds *t, int64_t now_ns, char *out, size_t size);

#endif
