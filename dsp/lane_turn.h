/* dsp/lane_turn.h -- 16 signals from rows of samples to lanes, and back: blocks of 4 x 4,
 * which every machine's registers hold.  For VECTOR_CLONES functions. */
#ifndef ANLOS_DSP_LANE_TURN_H
#define ANLOS_DSP_LANE_TURN_H

#include <stddef.h>

#include "dsp/vector.h"

typedef float lane_four __attribute__((vector_size(16), aligned(4), may_alias));

/* to[c][r] = from[r][c] for r, c < 4. */
VECTOR_INLINE void lane_turn_four(const float *const from[4], float *to, size_t stride)
{
    lane_four a = *(const lane_four *)from[0], b = *(const lane_four *)from[1];
    lane_four c = *(const lane_four *)from[2], d = *(const lane_four *)from[3];
    lane_four e = __builtin_shufflevector(a, b, 0, 4, 1, 5);
    lane_four f = __builtin_shufflevector(a, b, 2, 6, 3, 7);
    lane_four g = __builtin_shufflevector(c, d, 0, 4, 1, 5);
    lane_four h = __builtin_shufflevector(c, d, 2, 6, 3, 7);
    *(lane_four *)to = __builtin_shufflevector(e, g, 0, 1, 4, 5);
    *(lane_four *)(to + stride) = __builtin_shufflevector(e, g, 2, 3, 6, 7);
    *(lane_four *)(to + 2 * stride) = __builtin_shufflevector(f, h, 0, 1, 4, 5);
    *(lane_four *)(to + 3 * stride) = __builtin_shufflevector(f, h, 2, 3, 6, 7);
}

/* to[c][r] = from[r][c] for r, c < 16, rows apart by their strides. */
VECTOR_INLINE void lane_turn(const float *restrict from, size_t from_stride,
                             float *restrict to, size_t to_stride)
{
    for (size_t r = 0; r < VECTOR_LANES; r += 4) {
        const float *row = from + r * from_stride;
        for (size_t c = 0; c < VECTOR_LANES; c += 4) {
            const float *rows[4] = {row + c, row + from_stride + c,
                                    row + 2 * from_stride + c, row + 3 * from_stride + c};
            lane_turn_four(rows, to + c * to_stride + r, to_stride);
        }
    }
}

#endif
