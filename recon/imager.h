/* recon/imager.h -- one scan's traces to one volume; the methods behind `--method`.
 * Traces are added as they arrive; an image can be asked for at any time. */
#ifndef ANLOS_RECON_IMAGER_H
#define ANLOS_RECON_IMAGER_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/pool.h"
#include "dsp/pulse_compress.h"
#include "recon/geometry.h"
#include "recon/grid.h"

struct psf;

/* What some methods can be told; imager_options_default fills it in. */
struct imager_options {
    const char *base;  /* iterative: the method whose image it deconvolves, or "lct" */
    size_t iterations; /* iterative, sparse: at most */
    double tolerance;  /* iterative, sparse: relative residual that ends them */
    double l1, tv;     /* iterative, sparse: weights relative to the data's largest */
    bool tv_isotropic; /* iterative */
    double rho;        /* iterative: penalty to start with, relative */
    const struct psf *psf; /* iterative: as measured; NULL: from the geometry */
    double snr_db;         /* lct: of the Wiener filter */
    int lightcone;         /* paper: 1 always, 0 never, -1 unless it sees a mirror */
    double coherence;      /* backprojection: exponent of the coherence factor; 0: off */
};

void imager_options_default(struct imager_options *o);

struct imager_config {
    const char *method; /* imager_methods(): "fast", "backprojection" */
    const struct geometry *geometry;
    struct trace_format format; /* of the traces that will be added */
    double band_hz[2];
    double gate_m[2]; /* ranges (half paths) below the first are muted */
    struct grid grid;
    struct pool *pool;                    /* used while adding and imaging; not owned */
    const struct imager_options *options; /* NULL: the defaults */
};

struct imager;

/* "fast\0backprojection\0": names, each ended by a zero, an empty one at the end. */
const char *imager_methods(void);

/* Plans and allocates everything, in one thread (FFTW's planner is not thread-safe).
 * 0, -EINVAL (values), -ENOENT (no such method), -ENOTSUP (the method cannot do this
 * geometry; *why says what it needs), -ENOMEM. */
int imager_create(struct imager **out, const struct imager_config *cfg, const char **why);

/* traces [n_microphones][format.n_samples] of one ping; masked[n_microphones] may be
 * NULL. Threads may add different pings at once.  A ping added twice counts once: the
 * second is ignored and false returned. */
bool imager_add(struct imager *im, size_t position, size_t speaker,
                const float complex *traces, const bool *masked);
size_t imager_pings(const struct imager *im);

/* intensity [nz][ny][nx] from what has been added.  Uses the pool. */
void imager_image(struct imager *im, float *restrict intensity);

/* Forget all traces: a new scan. */
void imager_reset(struct imager *im);
void imager_destroy(struct imager *im);

#endif
