/* SPDX-License-Identifier: MIT */
/* recon/detection/detection_range.h -- how far away is a person still found?  The sonar
 * equation (Urick 1983, chapter 2) for one who is heard by way of a wall, and the chance
 * that his brightest voxel passes the threshold of the detector.
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
#ifndef ANLOS_RECON_DETECTION_DETECTION_RANGE_H
#define ANLOS_RECON_DETECTION_DETECTION_RANGE_H

#include <stddef.h>

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

#endif
