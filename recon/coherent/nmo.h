/* SPDX-License-Identifier: MIT */
/* recon/coherent/nmo.h -- coherent normal moveout: the trace of a pair with half-offset h
 * becomes the trace of a co-located pair at its midpoint, t0 = sqrt(t^2 - (2h/c)^2)
 * (Lindell 2019, Eq. 11), with the carrier's phase kept in double.  Amplitudes are
 * multiplied by the range c t0 / 2, so that an echo that fades as 1/r^2 fades as 1/r, as
 * migration expects. */
#ifndef ANLOS_RECON_COHERENT_NMO_H
#define ANLOS_RECON_COHERENT_NMO_H

#include <complex.h>
#include <stddef.h>

#include "dsp/pulse_compress.h"

struct nmo_config {
    double sound_speed_m_s;
    struct trace_format in;  /* oversampled by 2 or nearly */
    struct trace_format out; /* carrier_hz as in; a lower rate saves work downstream */
    double mute_s;           /* zero-offset times before this become 0 */
    double band_hz;          /* width of the band */
    size_t n_offsets;
    const double *half_offset_m; /* [n_offsets] */
    const double *shift_s; /* [n_offsets]: so much later is what comes in; NULL: none */
};

struct nmo;

/* 0, -EINVAL, -ENOMEM. */
int nmo_create(struct nmo **out, const struct nmo_config *cfg);

/* out[out.n_samples] += moveout of in[in.n_samples], which belongs to an offset.
 * Times outside the input trace add 0.  Reads only from n: threads may share it. */
void nmo_stack(const struct nmo *n, size_t offset, const float complex *restrict in,
               float complex *restrict out);
void nmo_destroy(struct nmo *n);

#endif
