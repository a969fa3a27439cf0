/* SPDX-License-Identifier: MIT */
/* nodes/anlos/confocal/scan.h -- optical confocal scans, what of one lies in a gate, and
 * its counts as waves.  They come as MATLAB files (O'Toole 2018):
 *   rect_data [n][n][n_bins]  photon counts: places of the wall's scan, then time
 *   width                     half of the side of the scanned square, m
 *   bin_s                     time bin, s; 4e-12 when missing
 * Time 0 is when the light meets the wall; range is half the way of light from there. */
#ifndef ANLOS_NODES_ANLOS_CONFOCAL_SCAN_H
#define ANLOS_NODES_ANLOS_CONFOCAL_SCAN_H

#include <complex.h>
#include <stddef.h>

#include "dsp/error.h"
#include "dsp/pulse_compress.h"

#define CONFOCAL_LIGHT_M_S 299792458.0

struct confocal_file {
    size_t nx, ny, n_bins;
    double pitch_x_m, pitch_y_m; /* of the scan, centred on (0, 0) */
    double bin_m;                /* of range */
    float *counts; /* [n_bins][ny][nx] as the file has it: x falls and y falls along the
                    * indices, seen from the wall into the hidden scene */
    size_t n_not_finite; /* samples, which are 0 here */
};

struct confocal_scan { /* the part of it that lies in a gate */
    size_t nx, ny, n;  /* x and y rising */
    double pitch_x_m, pitch_y_m;
    double range_m, range_step_m; /* middle of bin 0, and from bin to bin */
    float *counts;                /* [ny][nx][n] */
};

/* Clear with confocal_file_clear, also after an error.  The error is "file: variable:
 * what was expected".  0, -ENOENT and other errno of reading, -EINVAL, -EFBIG, -EIO,
 * -ENODATA (nothing but zeros), -ENOMEM. */
int confocal_file_load(struct confocal_file *f, const char *path, struct error *why);
void confocal_file_clear(struct confocal_file *f);

/* A gate that leaves out the light that comes straight from the wall: from where the
 * whole scan is darkest between it and the brightest echo, to the end. */
void confocal_file_gate(const struct confocal_file *f, double gate_m[2]);

/* The gate's bins, summed in groups so that at most max_bins remain, or until they are
 * least_step_m long: finer than the detector tells times apart there is only noise.  0,
 * -EINVAL (no bin lies in the gate), -ENOMEM. */
int confocal_scan_create(struct confocal_scan *s, const struct confocal_file *f,
                         const double gate_m[2], size_t max_bins, double least_step_m,
                         struct error *why);
void confocal_scan_clear(struct confocal_scan *s);

/* Photon counts as waves (Lindell 2019, wave-based imaging by f-k migration): their
 * square root, without what does not change, in the band where it stands out of the
 * noise, as the analytic baseband signal that migration and back-projection of sound
 * take. */

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
