/* dsp/band_transform.h -- a real signal to the frequencies of one band, and those back to
 * complex baseband over a part of the time: what a filter needs, and nothing beside it.
 *
 * Long transforms are cut into short ones and direct sums in vector code
 * (dsp/band_plan).  That takes half the time of FFTW's own transforms of those lengths,
 * and short ones are planned in a moment. */
#ifndef ANLOS_DSP_BAND_TRANSFORM_H
#define ANLOS_DSP_BAND_TRANSFORM_H

#include <complex.h>
#include <stddef.h>

struct band_transform_config {
    size_t n_min;        /* the transform is at least this long; 2^26 at most */
    double band[2];      /* cycles per sample, 0..0.5 */
    double oversampling; /* of the baseband, over the width of the band, >= 1 */
    double span;         /* time that is wanted back, in samples of the signal, < n_min */
};

/* Bins are numbered [n_streams][n_bins]; some at the edges may lie outside of the band.
 */
struct band_transform_layout {
    size_t length; /* L */
    size_t n_streams, n_bins;
    size_t n_output; /* samples of the baseband that cover the span */
    double rate;     /* of the baseband, over the signal's */
    double carrier;  /* cycles per sample of the signal; is at 0 in the baseband */
};

struct band_plan;
struct band_transform;

/* Plans (from one thread at a time) and allocates.  0, -EINVAL, -ENOMEM. */
int band_transform_create(struct band_transform **out,
                          const struct band_transform_config *cfg);
void band_transform_layout(const struct band_transform *bt,
                           struct band_transform_layout *out);

/* How it is cut and its tables, for dsp/band_lanes; they live as long as it does. */
const struct band_plan *band_transform_plan(const struct band_transform *bt);

/* Frequency of a bin, in cycles per sample. */
double band_transform_frequency(const struct band_transform *bt, size_t stream,
                                size_t bin);

/* Transforms x[n], n <= length; zeros follow.  The bins stay inside. */
void band_transform_forward(struct band_transform *bt, const float *x, size_t n);

/* A bin of what was transformed: sum over x[i] exp(-2 pi i frequency i). */
float complex band_transform_bin(const struct band_transform *bt, size_t stream,
                                 size_t bin);

/* y[n_output]: sum over all bins of filter * bin * exp(2 pi i (frequency - carrier) t),
 * t = i / rate.  filter: [n_streams][n_bins], 0 where there is nothing to be kept. */
void band_transform_inverse(struct band_transform *bt,
                            const float complex *restrict filter,
                            float complex *restrict y);
void band_transform_destroy(struct band_transform *bt);

#endif
