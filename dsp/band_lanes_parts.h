/* dsp/band_lanes_parts.h -- inside dsp/band_lanes: what its way forth and its way back
 * share. */
#ifndef ANLOS_DSP_BAND_LANES_PARTS_H
#define ANLOS_DSP_BAND_LANES_PARTS_H

#include <stdint.h>

#include "dsp/band_lanes.h"
#include "dsp/lane_fft.h"

#define LANES VECTOR_LANES
#define POINT BAND_LANES_POINT
/* Positions of all rows that are mixed while the first cache has them. */
#define TILE 16
/* Floats between streams, that they do not share a cache's lines. */
#define PAD (4 * POINT)
/* Sums that are made together, so that none waits for the last. */
#define STEP 4

struct band_lanes {
    const struct band_plan *plan;
    struct lane_fft *forward, *inverse;
    uint32_t *below, *above; /* [n_bins]: places of a stream's bins, of its partner's */
    float *rows;             /* [R][TILE][16] */
    float *spectrum;         /* [R/2][m][POINT] */
    float *output;  /* [R][m'][POINT] and PAD; imaginary parts before real ones */
    float *samples; /* [n_output, 16 more][POINT] */
};

struct band_lanes_input {
    const float *x; /* [n_channels][stride] */
    size_t stride, n, n_channels;
};

static inline size_t band_lanes_output_stride(const struct band_plan *p)
{
    return p->n_inverse * POINT + PAD;
}

/* The streams before their transforms, from all channels. */
void band_lanes_mix(struct band_lanes *bl, const struct band_lanes_input *in);

/* The transforms forth, the filter and the transforms back. */
void band_lanes_transform(struct band_lanes *bl, const float *filter, bool shared);

/* The samples that are wanted, and those to rows. */
void band_lanes_combine(struct band_lanes *bl);
void band_lanes_store(const struct band_lanes *bl, float complex *restrict y,
                      size_t n_channels);

#endif
