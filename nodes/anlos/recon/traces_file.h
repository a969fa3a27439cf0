/* SPDX-License-Identifier: MIT */
/* nodes/anlos/recon/traces_file.h -- pulse-compressed traces from elsewhere, as a MATLAB
 * file:
 *
 *   traces   [n_ping][n_sample], complex or real, of any numeric class
 *   tx_m     [n_ping][3], where the sound of a ping came from
 *   rx_m     [n_ping][3], and where it was heard
 *   fs_hz    rate of the samples
 *   t0_s     time of sample 0 after the emission
 *   fc_hz    carrier, when the traces are basebanded: the analytic signal at t is
 *            trace exp(2 pi i fc_hz t); else 0
 *   c_m_s    speed of sound
 *   band_hz  [2], where the echoes are; may be missing
 *
 * They come out as the imagers want them (dsp/pulse_compress.h): the band that they fill
 * is that of the file, or found in their mean spectrum, and stands around the middle of a
 * rate 2.2 times its width.  Real traces become analytic by it. */
#ifndef ANLOS_NODES_ANLOS_RECON_TRACES_FILE_H
#define ANLOS_NODES_ANLOS_RECON_TRACES_FILE_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"
#include "dsp/pulse_compress.h"

#define TRACES_MAX_CUT 6

struct traces_file {
    size_t n_pings;
    double (*pings_m)[2][3]; /* [n_pings][speaker, microphone] */
    double sound_speed_m_s;
    double band_hz[2];
    struct trace_format format;
    float complex *traces; /* [n_pings][format.n_samples] */
    bool *masked;          /* [n_pings] silent, or with samples that are not finite or
                            * louder than any echo (recon/imaging/imager.h) */
    size_t n_silent, n_not_finite, n_too_loud;
    struct traces_island {
        double from_hz, to_hz;
    } cut[TRACES_MAX_CUT]; /* noise that stands out and is not of the band */
    size_t n_cut;          /* may be more than there is room for */
    double cut_share;      /* of the power */
    bool unsure; /* in the band that was found nothing is surely echoes, most is noise */
};

/* band_hz [2]: where the echoes are, in place of what the file says; NULL.
 * Clear with traces_clear, also after an error.  The error is "file: variable: what
 * was expected".  0, -ENOENT and other errno of reading, -EINVAL, -EFBIG, -EIO (broken
 * off), -ENODATA (all are masked), -ENOMEM. */
int traces_load(struct traces_file *out, const char *path, const double band_hz[2],
                struct error *why);
void traces_clear(struct traces_file *t);

/* Leaves of all traces the samples within these delays.  0, -ERANGE (fewer than 2 are).
 */
int traces_cut(struct traces_file *t, const double gate_s[2]);

/* Traces of any rate and carrier to a band of their own: what they fill of their
 * spectrum, around the middle of a rate 2.2 times as wide. Exact but for what lies
 * outside the band. */

/* What a file says, as it stands there. */
struct traces_raw {
    size_t n_pings, n_samples;
    float complex *traces; /* finite, but for masked pings */
    size_t stride, step;   /* from one ping, one sample to the next */
    double rate_hz, t0_s, carrier_hz;
    bool real; /* all imaginary parts are 0, and there is no carrier */
};

/* The band that the mean of n_spectra power spectra [n] over 0..rate holds, circular: the
 * smallest arc with all that stands out, `width` bins from `first` on.  n_used: n, or for
 * real signals n / 2.  0, -EINVAL (nothing stands out). */
int traces_band(const double *power, size_t n, size_t n_used, size_t n_spectra,
                size_t *first, size_t *width);

#endif
