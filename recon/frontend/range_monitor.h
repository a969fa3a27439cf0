/* SPDX-License-Identifier: MIT */
/* recon/frontend/range_monitor.h -- how far away would a person still be found?  Of a
 * fixed array that knows a wall.  The wall's echo, the reference, is measured in each
 * ping, and the sonar equation says what is left of a person, and how much of that the
 * noise of now lets be found.  The range is limited when a person at the end of the gate
 * would be found less often than RANGE_PROBABILITY for RANGE_LESS_S, and is so no more
 * when it reaches RANGE_CLEAR_RATIO farther. */
#ifndef ANLOS_RECON_FRONTEND_RANGE_MONITOR_H
#define ANLOS_RECON_FRONTEND_RANGE_MONITOR_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"
#include "dsp/pulse_compress.h"
#include "recon/static_array/frames.h"
#include "recon/survey.h"
#include "recon/walls/walls.h"

/* The sonar equation (Urick 1983, chapter 2) for a person who is heard by way of a wall,
 * and the chance that his brightest voxel passes the threshold of the detector.
 *
 * An echo's amplitude in a trace, of a source of amplitude 1 at 1 m: a wall that mirrors
 * it from a path p away gives W / p, a person at range r (half the path) W P / r^2: P is
 * what his brightest part scatters (a length), times the second bounce on the wall.  So
 * the wall's echo tells W, and with it all that stands before the microphones' amplifier.
 *
 * An image adds M microphones in phase and the powers of K pings.  Who walks towards the
 * array or away is in another voxel after few of them: of the K only s are of him, the
 * others of noise alone.  (One who walks across stays in longer, and is found from
 * farther away.)  Each speaker hears his echo differently (Swerling 2: one case for each
 * ping), so that the power of each of his pings is exponential with mean 1 + snr, and
 * that of the others with mean 1.  Together they are a gamma distributed sum R, of shape
 * K, of which a part B, beta distributed and independent of R, is louder: R (1 + snr B).
 * So Q(K, T) = false-alarm rate,   E { Q(K, T / (1 + snr B)) } = probability of
 * detection, B: beta(s, K - s),   Q: the upper regularised gamma function (Swerling 1960;
 * with s = K, where B is 1, Richards 2005, section 6.3.3).  With the snr that this takes
 *   r^4 = W^2 P^2 M / (noise snr). */
struct detection_range {
    size_t n_pings; /* K, 1 or more; 1: of a coherent sum, whose snr is its own */
    double false_alarm_rate; /* of a voxel, 1e-12 to 0.5 */
    double probability;      /* of detection, 0.5 to 0.999 */
    double stay;             /* s, pings that he is in a voxel, 1 to K */
};

/* Pings that one who walks stays in a voxel of an image of n. */
double detection_range_stay(double speed_m_s, double ping_s, double voxel_m, size_t n);

/* What an echo needs over the noise of one ping, as a ratio of powers.  NaN: values are
 * not as above.  Some milliseconds: once. */
double detection_range_snr(const struct detection_range *d);

/* scattering_m: P.  echo: W^2, the power of a sample; noise: its mean power in the sum of
 * all microphones over their number squared (one's own over M, where all are as loud).
 * m; 0 without echo or with endless noise, INFINITY without noise. */
double detection_range_m(double scattering_m, double snr, double echo, double noise);

#define RANGE_PROBABILITY 0.9
#define RANGE_CLEAR_RATIO 1.1
#define RANGE_LESS_S      1.2

struct range_config {
    bool ranges; /* a fixed array: say how far it reaches; else what follows is nothing */
    size_t n_pings; /* in an image */
    enum frames_sum sum;
    double false_alarm_rate; /* of a voxel */
    double person_m;         /* scattering length P */
};

struct range_ping { /* what was heard of a speaker, from its emission to the next */
    size_t speaker;
    const float complex *traces; /* [n_microphones][format.n_samples] */
    const double *noise;         /* [n_microphones] power of a sample */
    const bool *usable;          /* [n_microphones] */
    bool speaker_usable;
};

struct range_levels { /* NaN: not known */
    double echo;      /* power of the wall's echo in a trace, a mean */
    double range_m;   /* up to which a person is found; 0: nowhere in the gate, which */
    double gate_m;    /* ends here */
    bool limited;     /* range_m is less */
};

struct range_monitor;

/* gate_m: near and far end of what is imaged.  The survey outlives it.  0, -EINVAL (a
 * false-alarm rate or number of pings that makes no sense), -ENOMEM. */
int range_monitor_create(struct range_monitor **out, const struct range_config *cfg,
                         const struct survey *s, const struct trace_format *format,
                         const double gate_m[2], struct error *why);

/* What the one before has learnt of the same array, in other air. */
void range_monitor_inherit(struct range_monitor *r, const struct range_monitor *before);

/* Topic "wall": the surest wall's echo is the reference from now on.  One that was not
 * seen for a second may be elsewhere: until it is, the reference stays what it was, as it
 * does after a list that is none. */
void range_monitor_walls(struct range_monitor *r, const struct walls *walls);
/* Whose echo is the reference, in the array frame; NULL: none is heard now. */
const struct wall_gate *range_monitor_wall(const struct range_monitor *r);

/* Some samples about the wall's echo in each trace. */
void range_monitor_take(struct range_monitor *r, const struct range_ping *ping);
void range_monitor_levels(const struct range_monitor *r, struct range_levels *out);
void range_monitor_destroy(struct range_monitor *r);

#endif
