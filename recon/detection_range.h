/* recon/detection_range.h -- how far away is a person still found?  The sonar equation
 * (Urick 1983, chapter 2) for one who is heard by way of a wall, and the chance that his
 * brightest voxel passes the threshold of the detector.
 *
 * An echo's amplitude in a trace, of a source of amplitude 1 at 1 m: a wall that mirrors
 * it from a path p away gives W / p, a person at range r (half the path) W P / r^2: P is
 * what his brightest part scatters (a length), times the second bounce on the wall.  So
 * the wall's echo tells W, and with it all that stands before the microphones' amplifier.
 *
 * An image adds M microphones in phase and the powers of K pings.  Noise is gamma
 * distributed with shape K then, and so is an echo that each speaker hears differently
 * (Swerling 2), with 1 + snr times its mean: with
 *   Q(K, K t) = false-alarm rate,  Q(K, K t / (1 + snr)) = probability of detection,
 * Q the upper regularised gamma function,
 *   r^4 = W^2 P^2 M / (noise snr).
 * Who walks towards the array or away is in another voxel after few pings: of the K only
 * those count for him in which he stays in one, and snr is K / stay times as much.  (One
 * who walks across stays in longer, and is found from farther away.) */
#ifndef ANLOS_RECON_DETECTION_RANGE_H
#define ANLOS_RECON_DETECTION_RANGE_H

#include <stddef.h>

struct detection_range {
    size_t n_pings;          /* K; 1: of a coherent sum, whose snr is the sum's */
    double false_alarm_rate; /* of a voxel, 0 to 0.5 */
    double probability;      /* of detection, 0.5 to 1 */
    double scattering_m;     /* P */
    double stay;             /* pings that he is in a voxel, 1 to K */
};

/* Pings that one who walks stays in a voxel of an image of n. */
double detection_range_stay(double speed_m_s, double ping_s, double voxel_m, size_t n);

/* What an echo needs over the noise of one ping, as a ratio of powers. */
double detection_range_snr(const struct detection_range *d);

/* echo: W^2, the power of a sample; noise: its mean power in the sum of all microphones
 * over their number squared (one's own over M, where all are as loud).  m; 0 without echo
 * or with endless noise, INFINITY without noise. */
double detection_range_m(const struct detection_range *d, double echo, double noise);

#endif
