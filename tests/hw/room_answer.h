/* SPDX-License-Identifier: MIT */
/* tests/hw/room_answer.h -- the simulated room at the far end of a cable: each chirp that
 * is played is answered with what the room's microphones would hear of it. */
#ifndef ANLOS_TESTS_HW_ROOM_ANSWER_H
#define ANLOS_TESTS_HW_ROOM_ANSWER_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal/room/room.h"
#include "tests/hw/far_end.h"

struct room_answer {
    struct room *room;
    size_t n_channels;    /* of both directions; speaker j at channel j */
    const size_t *inputs; /* [n_microphones] channels */
    double amplitude;     /* of the chirp, that is asked for */
    size_t n_frames;      /* of one answer */
    float *answers;       /* [2 passes][n_positions][n_speakers][n_microphones]
                             [n_frames] */
    float *pending;       /* [n_frames][n_microphones], a ring: of answers begun */
    int32_t *chirp;       /* [n_chirp] codes */
    size_t n_chirp;
    uint64_t start; /* of the emission under way, or of the last one */
    size_t speaker;
    atomic_int position, pass; /* where the array stands; what is in the room */
    atomic_size_t n_emissions;
    atomic_size_t n_strange; /* samples that are not the chirp's, or not at a speaker */
};

/* Computes all answers of the scene; aborts the program when that is not possible. */
void room_answer_create(struct room_answer *out, const char *scene, size_t n_channels,
                        const size_t *inputs, double amplitude);

/* A far end of 32-bit samples with the room at it, so many frames away. */
struct far_end *room_answer_start(struct room_answer *r, size_t ahead_frames);

/* What that far end calls; ctx is the room_answer. */
void room_answer_give(void *ctx, uint64_t frame, const void *heard, void *answer,
                      size_t n);

/* No emission is under way, and the room is silent.  Not while a far end runs. */
void room_answer_forget(struct room_answer *r);
void room_answer_clear(struct room_answer *r);

#endif
