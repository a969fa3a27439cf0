/* SPDX-License-Identifier: MIT */
/* recon/imaging/method.h -- what an imaging method provides; imager.c holds the table. */
#ifndef ANLOS_RECON_IMAGING_METHOD_H
#define ANLOS_RECON_IMAGING_METHOD_H

#include "recon/imaging/imager.h"

struct imager_method {
    const char *name;
    bool any_geometry; /* also pings with places of their own (geometry.pings_m) */
    bool continuous;   /* also a stage that does not stop (geometry.slot_m) */
    bool isolates;     /* imager_isolates */
    bool adds;         /* imager_adds */
    bool clips;        /* imager_clips */
    bool fits; /* its image explains what was heard as if nothing stood outside: the
                * imager gives it more than the volume, and cuts that off */
    int (*create)(void **state, const struct imager_config *cfg, const char **why);
    /* Adds one ping that has not been added before.  Threads may add different pings at
     * once.  masked[n_microphones] is never NULL. */
    void (*add)(void *state, size_t position, size_t speaker, const float complex *traces,
                const bool *masked);
    /* Ends early where the pool has stopped; the next one is as if that had not been. */
    void (*image)(void *state, float *intensity);
    void (*describe)(const void *state, struct imager_outcome *out); /* NULL: nothing */
    void (*reset)(void *state);
    void (*destroy)(void *state);
};

/* Delays of co-located pairs (2 range / c) from some pulse widths before the nearest
 * voxel of the image to as many behind the farthest, for their echoes to be whole; but
 * from the mute, and to the farthest that pairs with this half offset still heard when
 * the traces end.  0, -ENOTSUP: the gate holds none of the image. */
int method_span(double span_s[2], const struct imager_config *cfg, double half_offset_m,
                const char **why);

/* Samples of such a span.  A thin image, or one that the gate only touches, gets as many
 * as the filters take. */
size_t method_samples(const double span_s[2], double rate_hz, size_t at_least);

/* A measurement [cells][n_planes] of ranges as the planes of a volume, [n_planes][cells].
 */
void method_planes(struct pool *pool, size_t n_planes, size_t cells, const float *ranges,
                   float *volume);

/* Intensity is not negative: what is below 0 (or no number) is noise or interpolation. */
void method_clip(struct pool *pool, const struct grid *g, float *intensity);

extern const struct imager_method method_fast;
extern const struct imager_method method_backprojection;
extern const struct imager_method method_confocal;
extern const struct imager_method method_lct;
extern const struct imager_method method_paper;
extern const struct imager_method method_incoherent;
extern const struct imager_method method_iterative;
extern const struct imager_method method_sparse;

#endif
