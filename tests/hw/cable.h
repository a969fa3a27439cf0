/* SPDX-License-Identifier: MIT */
/* tests/hw/cable.h -- the array on one end of a snd-aloop cable, an echo on the other. */
#ifndef ANLOS_TESTS_HW_CABLE_H
#define ANLOS_TESTS_HW_CABLE_H

#include "tests/hal/scratch.h"

#include "hal/array.h"
#include "tests/hw/echo.h"
#include "tests/hw/far_end.h"

enum { SPEAKERS = 3, MICROPHONES = 4, MAX_RATE_HZ = 192000 };

/* Frames from one emission to the next (1/16 s), and of an emission (1/100 s). */
size_t cable_slot(const struct way *w);
size_t cable_chirp(const struct way *w);

struct cable {
    struct scratch *scratch;
    struct echo echo;
    struct far_end *far; /* NULL: none */
    struct array *array; /* NULL: none */
};

/* *state: a cable, with nothing at its ends.  Not on a test's stack: an assertion that
 * fails leaves that while the threads of both ends run on.  What is open in the end, as
 * it is when the test failed, is closed. */
int cable_setup(void **state);
int cable_teardown(void **state);

/* Writes rig.yaml: speaker j at the channel j from the last, microphone m at channel
 * 2 m + 1, the last microphone inverted, speaker 1 too. */
const char *cable_rig(struct scratch *s, const struct way *w);
void cable_open(struct cable *c, const struct way *w);

/* The array stays; the far end stops and restarts. */
void cable_stop_far_end(struct cable *c);
void cable_start_far_end(struct cable *c);

/* No ping comes any more; what the far end has heard is still there. */
void cable_close_array(struct cable *c);
void cable_close(struct cable *c);

/* Fails unless every frame came through so far, at both ends: in the guest no process is
 * late, whatever else the machine does. */
void cable_check_whole(const struct cable *c);
uint64_t cable_count(const struct cable *c, const char *name);

enum { N_SAMPLES_MAX = MAX_RATE_HZ / 8 };
struct taken {
    size_t n_samples;
    float samples[MICROPHONES][N_SAMPLES_MAX];
};

/* Fires all speakers in cable_order; their pings, all of them valid, in out[SPEAKERS]. */
extern const uint32_t cable_order[SPEAKERS];
void cable_shoot(struct array *a, struct taken *out);

#endif
