/* SPDX-License-Identifier: MIT */
/* recon/coherent/stretch.h -- normal moveout and logarithmic stretch in one
 * interpolation, and the way back (Lindell 2019, Eq. 11 and 13; Zhou 1996): log time is
 * ln t0, t0 the time at which a co-located pair would have heard what a pair of
 * half-offset h hears at t = sqrt(t0^2 + (2h/c)^2).
 *
 * 32 powers or 16 complex baseband traces lie side by side, row by row: [sample][2][16]
 * floats, of traces 16 re, then 16 im.  Of traces the
 * carrier is put back, because a stretched carrier is none any more.
 *
 * The steps of log time are as fine as the last time needs (powers: 1.5 samples for each
 * period of the band's width; traces: 1.4 complex samples for each period of the band's
 * top; 2% less where a shorter transform then does), so that earlier times, even those of
 * a gate that begins with the emission, are sampled more finely.  Interpolation is by
 * 8-tap windowed sinc; there and back returns a Hann-windowed echo within 1% of its peak,
 * inside the gate; 3% of complex traces when the gate begins with the emission. */
#ifndef ANLOS_RECON_COHERENT_STRETCH_H
#define ANLOS_RECON_COHERENT_STRETCH_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/pulse_compress.h"

struct stretch_config {
    double sound_speed_m_s;
    bool power;              /* else complex traces */
    double band_hz[2];       /* of the traces, also when they are powers */
    struct trace_format in;  /* oversampled by 2 or nearly */
    struct trace_format out; /* co-located; carrier_hz as in */
    double mute_s;           /* zero-offset times before this become 0 */
    size_t n_offsets;
    const double *half_offset_m; /* [n_offsets] */
};

struct stretch;

/* 0, -EINVAL, -ENOMEM. */
int stretch_create(struct stretch **out, const struct stretch_config *cfg);

/* Rows of log time: a length that lane_fft transforms, its end zero so that what dip
 * moveout brings forward does not come round to the end. */
size_t stretch_rows(const struct stretch *s);

/* Angular log-frequency of bin q of a forward transform over them; odd, infinite where
 * both signs share the bin. */
double stretch_frequency(const struct stretch *s, size_t q);

/* out [rows][2][16] = in [in.n_samples][2][16] of one offset, moved out, multiplied by
 * (t c)^2 (powers; Lindell 2019, section 4) or t0 c / 2 (traces: what fades as 1 / r^2
 * then fades as 1 / r, as migration expects).  0 where the stretch exceeds 2, before the
 * mute and beyond the input; the ends fade over 8 samples. */
void stretch_in(const struct stretch *s, size_t offset, const float *restrict in,
                float *restrict out);

/* out [out.n_samples][2][16] = in [rows][2][16] at zero-offset times. */
void stretch_out(const struct stretch *s, const float *restrict in, float *restrict out);
void stretch_destroy(struct stretch *s);

#endif
