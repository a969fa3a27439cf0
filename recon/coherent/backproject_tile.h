/* SPDX-License-Identifier: MIT */
/* recon/coherent/backproject_tile.h -- the inner part of back-projection for any
 * geometry: voxels in the lanes, each looks its delay up in the traces
 * (recon/coherent/fine_trace.h). */
#ifndef ANLOS_RECON_COHERENT_BACKPROJECT_TILE_H
#define ANLOS_RECON_COHERENT_BACKPROJECT_TILE_H

#include "recon/coherent/fine_trace.h"
#include "recon/grid.h"

/* Whole vectors: the voxels' distances to the elements of a position stay in the cache,
 * and as they are near each other they read few lines of each trace. */
#define TILE_VOXELS 384

struct tile_path {                          /* to the voxels */
    float delay[TILE_VOXELS];               /* in fine samples */
    float re[TILE_VOXELS], im[TILE_VOXELS]; /* phasor of the carrier over that delay */
};

struct tile {        /* one a thread */
    size_t n, whole; /* voxels; whole vectors are filled up with the last one */
    float position[3][TILE_VOXELS];
    size_t number[TILE_VOXELS];                      /* in the image */
    float part[2][TILE_VOXELS], sum[2][TILE_VOXELS]; /* of one speaker, of all */
    float squares[TILE_VOXELS];
};

size_t tile_count(const struct grid *g);

/* The voxels of one, all sums 0. */
void tile_lay(struct tile *t, const struct grid *g, size_t item);

struct tile_sound { /* samples and turns of the carrier in a metre */
    float per_m, turns_per_m;
    float half_start; /* a way there and a way back each carry half of a trace's start */
};

void tile_sound(struct tile_sound *s, const struct fine_trace *f, double sound_speed_m_s);

/* One way; the phasor goes on by more turns. */
void tile_path(const struct tile *t, const struct tile_sound *s, const double at[3],
               double more_turns, struct tile_path *restrict out);

/* There and back at once; half of the delay. */
void tile_round_trip(const struct tile *t, const struct tile_sound *s, const double to[3],
                     const double from[3], struct tile_path *restrict out);

struct tile_trace {
    const uint32_t *words;
    float last;  /* n_stored - 2: delays beyond are held here, where the trace is 0 */
    float scale; /* the trace's unit times its weight */
    float power; /* the same of its power */
};

/* Adds a trace at the voxels' delays times the phasor, which is that of `from` alone,
 * and, if they count, its weighted squares. */
void tile_add(const struct tile *t, const struct tile_trace *r,
              const struct tile_path *to, const struct tile_path *from,
              float sum[2][TILE_VOXELS], float *squares);

/* part times the phasor of a way to sum; part is 0 then. */
void tile_add_part(struct tile *t, const struct tile_path *to);

/* Fetches a trace's samples for the first, the middle and the last voxel: where they lie
 * is nothing the processor could guess. */
void tile_fetch(const struct tile *t, const struct tile_trace *r,
                const struct tile_path *to, const struct tile_path *from);

#endif
