/* SPDX-License-Identifier: MIT */
/* recon/imaging/imager.h -- one scan's traces to one volume; the methods behind
 * `--method`. Traces are added as they arrive; an image can be asked for at any time. */
#ifndef ANLOS_RECON_IMAGING_IMAGER_H
#define ANLOS_RECON_IMAGING_IMAGER_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/pool.h"
#include "dsp/pulse_compress.h"
#include "recon/geometry.h"
#include "recon/grid.h"
#include "recon/imaging/imager_options.h"

struct imager_config {
    const char *method; /* one of imager_methods() */
    const struct geometry *geometry;
    struct trace_format format; /* of the traces that will be added */
    double band_hz[2];
    double gate_m[2]; /* ranges (half paths) below the first are muted */
    struct grid grid;
    struct pool *pool;                    /* used while adding and imaging; not owned */
    const struct imager_options *options; /* NULL: the defaults */
};

struct imager;

#define TRACE_LOUDEST 1e13f

/* Can a trace be summed with others?  One sample that is no number would spoil every
 * voxel that it reaches, and in a Fourier transform all.  Both parts of all samples are
 * numbers and below TRACE_LOUDEST: louder is no echo, and sums of its square would
 * overflow. Cost: one pass. */
bool trace_check(const float complex *trace, size_t n);

/* "fast\0backprojection\0confocal\0lct\0paper\0incoherent\0iterative\0sparse\0": names,
 * each ended by a zero, an empty one at the end. */
const char *imager_methods(void);
bool imager_has_method(const char *name);

/* A point is a voxel of its images, or a few that touch, however wide the array's PSF is:
 * what lies apart are several things. */
bool imager_isolates(const char *name);

/* Is what is less than nothing in its images 0?  Else 0 is what was not imaged. */
bool imager_clips(const char *name);

/* Its amplitudes, with their phases, are those of each echo added up: what is taken out
 * of the traces is gone from the image. */
bool imager_adds(const char *name);

/* Plans and allocates everything, in one thread (FFTW's planner is not thread-safe).
 * 0, -EINVAL (values), -ENOENT (no such method), -ENOTSUP (the method cannot do this
 * geometry; *why says what it needs), -ENOMEM, -ECANCELED (the pool has stopped). */
int imager_create(struct imager **out, const struct imager_config *cfg, const char **why);

/* traces [n_microphones][format.n_samples] of one ping; masked[n_microphones] may be
 * NULL.  A trace that trace_check finds unfit counts as masked.  Threads
 * may add different pings at once.  A ping added twice counts once: the second is ignored
 * and false returned. */
bool imager_add(struct imager *im, size_t position, size_t speaker,
                const float complex *traces, const bool *masked);
size_t imager_pings(const struct imager *im);

/* intensity [nz][ny][nx] from what has been added.  Uses the pool.  0, or -ECANCELED: it
 * has stopped (pool_stop_by), and intensity is not to be used.  What has been added
 * stays: when the pool goes on, so may this. */
int imager_image(struct imager *im, float *restrict intensity);

/* What a method did for the image that it made last, beyond what it was told. */
struct imager_outcome {
    const char *choice; /* the option that the method may decide on by itself ("dmo",
                         * "lightcone"); NULL: it has none */
    bool chosen;        /* as if it had been set to always, not never */
    bool iterates;      /* then: */
    size_t iterations;  /* that it took; of several parts, that which took most */
    double residual;    /* relative, where they ended; of several parts, the largest */
    bool converged;     /* it is within the tolerance, of all parts */
};
void imager_outcome(const struct imager *im, struct imager_outcome *out);

/* Forget all traces: a new scan. */
void imager_reset(struct imager *im);
void imager_destroy(struct imager *im);

#endif
