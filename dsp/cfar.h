/* SPDX-License-Identifier: MIT */
/* dsp/cfar.h -- constant false-alarm rate detection: is a cell brighter than its
 * surroundings let noise be?  The level of the noise is taken from training cells around
 * the cell under test, with guard cells left out in between: their mean (cell averaging,
 * Finn and Johnson 1968), or one of them in their order (ordered statistic, Rohling
 * 1983), which neighbouring objects do not raise.
 *
 * Noise is a power that is gamma distributed, of unknown mean and a shape that is the
 * same everywhere: 1 for one image with random phases (exponential), N when N independent
 * powers were added up, under 1 for spiky clutter.  Then
 *
 *   false-alarm rate = E { Q(shape, shape factor level) },
 *
 * Q the upper regularised gamma function and the expectation over the level that n
 * independent training cells of mean 1 give.  For shape 1 these are the closed forms
 * (1 + factor / n)^-n and prod_{i < k} (n - i) / (n - i + factor).  A tail that is
 * another than that, of clutter, is learnt from the images. */
#ifndef ANLOS_DSP_CFAR_H
#define ANLOS_DSP_CFAR_H

#include <stdbool.h>
#include <stddef.h>

enum cfar_kind { CFAR_OFF, CFAR_AVERAGING, CFAR_ORDERED };

#define CFAR_MIN_TRAINING 16 /* cells; where there are fewer, nothing is detected */

struct cfar_config {
    enum cfar_kind kind;     /* not CFAR_OFF */
    double false_alarm_rate; /* of each cell: 1e-12 to 0.5 */
    double rank;        /* ordered: which part of the training cells is below; 0.75 */
    size_t n[3];        /* cells along x, y, z */
    size_t pitch[3];    /* training cells lie so many cells apart: where the image is
                         * finer than its resolution, nearer ones are no others */
    size_t guard[3];    /* cells left out on either side of the cell under test */
    size_t training[3]; /* training cells, pitch apart, on either side beyond */
};

/* How bright noise is. */
struct cfar_noise {
    double shape; /* of the gamma distribution */
    bool heavy;   /* no shape's: this part of the powers lies over... */
    double part, from, scale, index; /* ...from, and these are its scale and index */
};

/* Which part of the noise is brighter than x times its mean. */
double cfar_noise_tail(double shape, double x);

struct cfar;

/* Noise of shape 1 until it has learnt.  0, -EINVAL (values, or too few training cells),
 * -ENOMEM. */
int cfar_create(struct cfar **out, const struct cfar_config *cfg);

/* Learns shape and tail of the noise from an image [nz][ny][nx], >= 0 (0: nothing was
 * imaged there, as beyond a gate; such cells are not trained on either): from cells a
 * pitch apart, and of the images after the first from every other of these, so that some
 * images in a row count.  A few objects do no harm; what is twice as bright as the rarest
 * noise that is known, and more, is not learnt from, but for the first image.  Images
 * that say the same again would make what moves slowly look like noise: leave them out.
 */
void cfar_learn(struct cfar *c, const float *image);
const struct cfar_noise *cfar_noise(const struct cfar *c);
bool cfar_has_learnt(const struct cfar *c);

/* At a cell, 0 <= cell < nx ny nz: the mean power of the noise there (0: not enough
 * training cells) and how bright the cell has to be.  Microseconds; one instance a
 * thread. */
struct cfar_level {
    double noise, threshold;
};
struct cfar_level cfar_at(struct cfar *c, const float *image, size_t cell);

/* Of many cells of one image, nearly all of which are noise: after cfar_look at the whole
 * of it, is a cell of it brighter than the threshold that cfar_at has there?  Takes a
 * tenth of its time. */
void cfar_look(struct cfar *c, const float *image);
bool cfar_stands_out(struct cfar *c, const float *image, size_t cell);

/* The factor over the level for n training cells. */
double cfar_factor(struct cfar *c, size_t n);
void cfar_destroy(struct cfar *c);

#endif
