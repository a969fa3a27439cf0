/* SPDX-License-Identifier: MIT */
/* recon/walls/wall_echo.h -- arrivals of one pair's sound, and what way a wall would have
 * given it: by the image source behind the wall (Allen and Berkley, J. Acoust. Soc. Am.
 * 65 (1979) 943). */
#ifndef ANLOS_RECON_WALLS_WALL_ECHO_H
#define ANLOS_RECON_WALLS_WALL_ECHO_H

#include <complex.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/pulse_compress.h"
#include "recon/walls/wall.h"

struct wall_echo {
    double speaker_m[3];    /* where it stood in the middle of its emission */
    double microphone_m[3]; /* and where this stood when that arrived; all in one frame */
    double velocity_m_s[3]; /* of the array then, over ground */
    double path_m;          /* what was heard: delay times speed of sound */
    double weight;          /* 0..1: amplitude over that of the trace's strongest */
    double lag_s;  /* path is added by this times the rate at which the way grows */
    uint32_t pair; /* counts traces; those of one trace follow each other */
    uint32_t speaker, microphone, place; /* numbers: whose errors it shares with others */
};

struct wall_echo_peak {
    double path_m, amplitude;
};

/* What a chirp's matched filter adds to the path of an echo whose way grows, for each m/s
 * of that, when the way is that in the middle of the emission: duration times middle
 * frequency over band, from the Doppler shift that looks like a delay (Rihaczek 1969,
 * "Principles of High-Resolution Radar", section 7.2).  Of a chirp that falls: negative.
 */
double wall_echo_lag_s(const struct chirp *chirp);

/* The strongest peaks of |trace| [format.n_samples], at most `most`, by delay, between
 * two paths: those threshold_db above the mean noise power there (by its median) and not
 * more than range_db under the strongest.  Between samples by a parabola through the
 * logarithms, which a windowed band's main lobe nearly is.  Returns how many. */
size_t wall_echo_peaks(const struct trace_format *format, const float complex *trace,
                       double sound_speed_m_s, const double path_m[2],
                       double threshold_db, double range_db, struct wall_echo_peak *out,
                       size_t most);

/* The path of an echo by way of walls[n], the first one first: 1 for a wall itself, 2 for
 * the corner between two. */
double wall_echo_path_m(const struct wall_echo *e, const struct wall *const *walls,
                        size_t n);

/* The same by way of a wall that bends about the upright: it touches w at the foot of the
 * perpendicular from about_m, and curvature_1_m > 0 bulges towards the array.  The
 * shortest way in the plan, unrolled along the upright. */
double wall_echo_bent_path_m(const struct wall_echo *e, const struct wall *w,
                             const double about_m[3], double curvature_1_m);

#endif
