/* nodes/scan/rounds.h -- pings of an array that goes round its speakers without end: how
 * many came, how many did not, and how fast they come. */
#ifndef ANLOS_NODES_SCAN_ROUNDS_H
#define ANLOS_NODES_SCAN_ROUNDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

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
