/* SPDX-License-Identifier: MIT */
/* recon/static_array/range_doppler.h -- when a moving reflector was where a chirp's echo
 * shows it.
 *
 * The chirp runs through f1 + (B / T) u, u from 0 to T.  A reflector whose one-way path
 * grows at v shifts it by -(2 v / c) f; around the middle of the band, f = f_c, the
 * matched filter takes a shift of frequency df for a delay of -df T / B:
 *
 *   apparent delay = delay + (2 v / c) f_c T / B     (a down-chirp: B < 0)
 *   apparent range = range + v f_c T / B             (half the path)
 *
 * where delay and range are those of the middle of the chirp, T / 2 (Fitzgerald 1974,
 * "Effects of range-Doppler coupling on chirp radar tracking accuracy", IEEE Trans.
 * AES-10).  So each path shows as it was, or will be, at
 *
 *   T / 2 + f_c T / B = T f2 / (f2 - f1)             after the chirp's start,
 *
 * and so does the whole image, bearings included: with its speed known, a track's own, an
 * object is put where it is.  An up-chirp looks ahead, a down-chirp back; in equal parts
 * they show the middle, T / 2.  The band of sound is wide: over it the delay is smeared
 * by (2 v / c) T, which costs sharpness and level. */
#ifndef ANLOS_RECON_STATIC_ARRAY_RANGE_DOPPLER_H
#define ANLOS_RECON_STATIC_ARRAY_RANGE_DOPPLER_H

/* T f2 / (f2 - f1), seconds after the chirp's start.  stop_hz may be below start_hz: a
 * down-chirp; they differ. */
static inline double range_doppler_instant_s(double start_hz, double stop_hz,
                                             double duration_s)
{
    return duration_s * stop_hz / (stop_hz - start_hz);
}

#endif
