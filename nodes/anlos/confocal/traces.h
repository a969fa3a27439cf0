/* SPDX-License-Identifier: MIT */
/* nodes/anlos/confocal/traces.h -- photon counts as waves (Lindell 2019, wave-based
 * imaging by f-k migration): their square root, without what does not change, in the band
 * where it stands out of the noise, as the analytic baseband signal that migration and
 * back-projection of sound take. */
#ifndef ANLOS_NODES_ANLOS_CONFOCAL_TRACES_H
#define ANLOS_NODES_ANLOS_CONFOCAL_TRACES_H

#include <complex.h>

#include "dsp/pulse_compress.h"
#include "nodes/anlos/confocal/file.h"

struct confocal_traces {
    struct trace_format format;
    double band_hz[2];
    float complex *traces; /* [nx][ny][format.n_samples] */
};

/* Clear with confocal_traces_clear.  0, -ENODATA (nothing changes over time), -ENOMEM. */
int confocal_traces_create(struct confocal_traces *t, const struct confocal_scan *s,
                           struct error *why);
void confocal_traces_clear(struct confocal_traces *t);

#endif
