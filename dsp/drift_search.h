/* dsp/drift_search.h -- where about the stretch of dsp/drift.h lies: the largest sum over
 * blocks of the correlation of scene and stretched background, inside of a block by one
 * delay for all its samples.  All lags' correlations are taken once; each stretch then
 * costs an interpolation of each block. */
#ifndef ANLOS_DSP_DRIFT_SEARCH_H
#define ANLOS_DSP_DRIFT_SEARCH_H

#include "dsp/interpolator.h"
#include "dsp/pulse_compress.h"

#define DRIFT_BLOCK 32 /* samples */

struct drift_search;

/* Real and imaginary parts of the channels of a ping, apart; each points to sample 0 of
 * channel 0, the next channel comes `stride` later. */
struct drift_planes {
    size_t n_channels, stride;
    float *background_re, *background_im, *scene_re, *scene_im;
};

/* Keeps the interpolator.  highest_hz: of the band.  0, -EINVAL, -ENOMEM. */
int drift_search_create(struct drift_search **out, const struct trace_format *format,
                        double highest_hz, double max_stretch,
                        const struct interpolator *ip);

/* Zeros that the planes need on either side of a channel's samples. */
size_t drift_search_padding(const struct drift_search *ds);

/* The best stretch of the grid, which is fine enough for Gauss-Newton steps from there.
 */
double drift_search_best(struct drift_search *ds, const struct drift_planes *planes);
void drift_search_destroy(struct drift_search *ds);

#endif
