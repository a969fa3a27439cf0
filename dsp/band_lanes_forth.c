/* dsp/band_lanes_forth.c -- from rows of samples to the streams of all channels. */
#include <string.h>

#include "dsp/band_lanes_parts.h"
#include "dsp/lane_turn.h"

/* TILE samples of all channels from `first` on, zeros beyond the last sample; lanes
 * without a channel repeat the last one. */
VECTOR_INLINE void row_load(const struct band_lanes_input *in, size_t first, float *to)
{
    float block[LANES][TILE] = {{0}};
    size_t left = first < in->n ? in->n - first : 0;

    if (in->n_channels == LANES && left >= TILE) {
        lane_turn(in->x + first, in->stride, to, LANES);
        return;
    }
    for (size_t c = 0; c < LANES && left; c++) {
        size_t channel = c < in->n_channels ? c : in->n_channels - 1;
        memcpy(block[c], in->x + channel * in->stride + first,
               (left < TILE ? left : TILE) * sizeof(float));
    }
    lane_turn(block[0], TILE, to, LANES);
}

/* Two rows of a tile that is needed later: so many streams of memory no machine
 * foresees. */
VECTOR_INLINE void rows_fetch(const struct band_lanes_input *in, size_t m, size_t row,
                              size_t first)
{
    for (size_t r = row; r < row + 2; r++) {
        size_t at = r * m + first;
        for (size_t c = 0; at < in->n && c < in->n_channels; c++)
            __builtin_prefetch(in->x + c * in->stride + at);
    }
}

VECTOR_INLINE void tile_load(float *rows, const struct band_lanes_input *in, size_t m,
                             size_t r, size_t first)
{
    for (size_t row = 0; row < r; row++)
        row_load(in, row * m + first, rows + row * TILE * LANES);
    for (size_t row = 1; row < r / 2; row++) {
        float *restrict a = rows + row * TILE * LANES;
        float *restrict b = rows + (r - row) * TILE * LANES;
        for (size_t i = 0; i < TILE * LANES; i++) {
            float difference = a[i] - b[i];
            b[i] += a[i];
            a[i] = difference;
        }
    }
}

/* As band_rows_mix. */
VECTOR_INLINE void tile_mix(float *restrict out, const float *restrict rows, size_t half,
                            const float *restrict root, const float *restrict twiddle,
                            size_t m)
{
    for (size_t i = 0; i < TILE; i += STEP) {
        float re[STEP][LANES] = {{0}}, im[STEP][LANES] = {{0}};

        for (size_t r = 0; r < half; r++) {
            const float *a = rows + (r * TILE + i) * LANES, *b = a + half * TILE * LANES;
#pragma GCC unroll 4 /* all STEP: their sums become registers */
            for (size_t q = 0; q < STEP; q++) {
                for (size_t v = 0; v < LANES; v++) {
                    re[q][v] += root[r] * a[q * LANES + v];
                    im[q][v] += root[half + r] * b[q * LANES + v];
                }
            }
        }
#pragma GCC unroll 4
        for (size_t q = 0; q < STEP; q++) {
            float *y = out + (i + q) * POINT, tr = twiddle[i + q],
                  ti = twiddle[m + i + q];
            for (size_t v = 0; v < LANES; v++) {
                y[v] = re[q][v] * tr - im[q][v] * ti;
                y[LANES + v] = re[q][v] * ti + im[q][v] * tr;
            }
        }
    }
}

VECTOR_CLONES
void band_lanes_mix(struct band_lanes *bl, const struct band_lanes_input *in)
{
    const struct band_plan *p = bl->plan;
    size_t m = p->n_forward, r = p->layout.n_streams;

    for (size_t i = 0; i < m; i += TILE) {
        tile_load(bl->rows, in, m, r, i);
        for (size_t s = 0; s < r / 2; s++) {
            rows_fetch(in, m, 2 * s, i + 2 * TILE);
            tile_mix(bl->spectrum + (s * m + i) * POINT, bl->rows, r / 2,
                     p->roots + s * r, p->twiddle + 2 * s * m + i, m);
        }
    }
}
