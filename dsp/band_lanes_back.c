/* dsp/band_lanes_back.c -- from the streams, transformed and filtered, to rows of
 * samples. */
#include <string.h>

#include "dsp/band_lanes_parts.h"
#include "dsp/lane_turn.h"

/* A stream's bins, conjugated by `sign` -1, times their filter, real and imaginary parts
 * swapped: a transform forward of those is the swapped transform back. */
VECTOR_INLINE void bins_multiply(float *restrict y, const float *restrict spectrum,
                                 const uint32_t *place, const float *restrict filter,
                                 size_t n, bool shared, float sign)
{
    for (size_t k = 0; k < n; k++, y += POINT) {
        const float *z = spectrum + (size_t)place[k] * POINT;
        const float *h = filter + k * (shared ? 2 : POINT);

        VECTOR_LOOP
        for (size_t v = 0; v < LANES; v++) {
            float re = z[v], im = sign * z[LANES + v];
            float hr = h[shared ? 0 : v], hi = h[shared ? 1 : LANES + v];
            y[v] = re * hi + im * hr;
            y[LANES + v] = re * hr - im * hi;
        }
    }
}

VECTOR_INLINE void stream_return(struct band_lanes *bl, size_t stream,
                                 const float *spectrum, const float *filter, bool shared)
{
    const struct band_plan *p = bl->plan;
    size_t n = p->layout.n_bins, m = p->n_inverse;
    float *y = bl->output + stream * band_lanes_output_stride(p);
    bool half = 2 * n <= m;

    filter += stream * n * (shared ? 2 : POINT);
    if (stream < p->layout.n_streams / 2)
        bins_multiply(y, spectrum, bl->below, filter, n, shared, 1.0f);
    else
        bins_multiply(y, spectrum, bl->above, filter, n, shared, -1.0f);
    memset(y + n * POINT, 0, ((half ? m / 2 : m) - n) * POINT * sizeof(float));
    if (half)
        lane_fft_forward(bl->inverse, y);
    else
        lane_fft_whole(bl->inverse, y);
}

VECTOR_INLINE void streams_return(struct band_lanes *bl, const float *filter, bool shared)
{
    size_t m = bl->plan->n_forward, r = bl->plan->layout.n_streams;

    for (size_t s = 0; s < r / 2; s++) {
        float *spectrum = bl->spectrum + s * m * POINT;

        lane_fft_whole(bl->forward, spectrum);
        stream_return(bl, s, spectrum, filter, shared);
        stream_return(bl, r - 1 - s, spectrum, filter, shared);
    }
}

VECTOR_CLONES
void band_lanes_transform(struct band_lanes *bl, const float *filter, bool shared)
{
    if (shared)
        streams_return(bl, filter, true);
    else
        streams_return(bl, filter, false);
}

/* STEP samples at once, as band_block_combine: v [n_streams][stride], of samples `at`,
 * shift and step as in the plan. */
VECTOR_INLINE void places_combine(const struct band_plan *p, const float *restrict v,
                                  const size_t at[STEP], float *restrict samples)
{
    const float *sr = p->step, *si = sr + p->n_table;
    const float *hr = p->shift, *hi = hr + p->n_table;
    float re[STEP][LANES] = {{0}}, im[STEP][LANES] = {{0}};

    for (size_t s = p->layout.n_streams; s-- > 0;) {
        const float *x = v + s * band_lanes_output_stride(p);
#pragma GCC unroll 4
        for (size_t q = 0; q < STEP; q++) {
            float c = sr[at[q]], d = si[at[q]];
            for (size_t l = 0; l < LANES; l++) {
                float turned = x[q * POINT + LANES + l] + re[q][l] * c - im[q][l] * d;
                im[q][l] = x[q * POINT + l] + re[q][l] * d + im[q][l] * c;
                re[q][l] = turned;
            }
        }
    }
#pragma GCC unroll 4
    for (size_t q = 0; q < STEP; q++) {
        float *y = samples + at[q] * POINT, c = hr[at[q]], d = hi[at[q]];
        if (at[q] >= p->layout.n_output)
            continue;
        for (size_t l = 0; l < LANES; l++) {
            y[l] = re[q][l] * c - im[q][l] * d;
            y[LANES + l] = re[q][l] * d + im[q][l] * c;
        }
    }
}

VECTOR_CLONES
void band_lanes_combine(struct band_lanes *bl)
{
    const struct band_plan *p = bl->plan;
    const uint32_t *number = bl->inverse->number;

    for (size_t place = 0; place < p->n_inverse; place += STEP) {
        for (size_t turn = 0; turn < p->n_table; turn += p->n_inverse) {
            size_t at[STEP], least = SIZE_MAX;

            for (size_t q = 0; q < STEP; q++) {
                at[q] = number[place + q] + turn;
                least = at[q] < least ? at[q] : least;
            }
            if (least < p->layout.n_output)
                places_combine(p, bl->output + place * POINT, at, bl->samples);
        }
    }
}

VECTOR_CLONES
void band_lanes_store(const struct band_lanes *bl, float complex *restrict y,
                      size_t n_channels)
{
    size_t n = bl->plan->layout.n_output;

    for (size_t i = 0; i < n; i += LANES / 2) {
        size_t floats = 2 * (n - i < LANES / 2 ? n - i : LANES / 2);
        float block[LANES][LANES];

        if (n_channels == LANES && floats == LANES) {
            lane_turn(bl->samples + i * POINT, LANES, (float *)(y + i), 2 * n);
            continue;
        }
        lane_turn(bl->samples + i * POINT, LANES, block[0], LANES);
        for (size_t c = 0; c < n_channels; c++)
            memcpy(y + c * n + i, block[c], floats * sizeof(float));
    }
}
