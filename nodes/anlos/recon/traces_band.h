/* nodes/anlos/recon/traces_band.h -- traces of any rate and carrier to a band of their
 * own: what they fill of their spectrum, around the middle of a rate 2.2 times as wide.
 * Exact but for what lies outside the band. */
#ifndef ANLOS_NODES_ANLOS_RECON_TRACES_BAND_H
#define ANLOS_NODES_ANLOS_RECON_TRACES_BAND_H

#include "nodes/anlos/recon/traces_file.h"

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

/* How far apart the frequencies are that traces of this length tell. */
double traces_bin_hz(const struct traces_raw *r);

/* From n_pings and masked: band_hz, format, traces, cut and unsure of *t.  band_hz [2]:
 * the band that is wanted; NULL: it is found.  Noise (dsp/stationary.h) may be louder
 * than the echoes: where there are some, the band is of them and of what may be some, and
 * what was cut outside of it is told.  0, -EINVAL (no band), -ERANGE (band_hz: there is
 * no such frequency in the traces), -EDOM (it is narrower than two of traces_bin_hz above
 * 0), -ENOMEM. */
int traces_reband(struct traces_file *t, const struct traces_raw *r,
                  const double band_hz[2]);

#endif
