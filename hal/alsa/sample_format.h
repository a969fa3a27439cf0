/* SPDX-License-Identifier: MIT */
/* hal/alsa/sample_format.h -- the sample formats of sound cards, to and from floats of
 * full scale +-1.  A code is the value times 2^(bits - 1), rounded to the nearest and
 * held within the codes there are; reading is exact up to the 24 bits of a float. */
#ifndef ANLOS_HAL_ALSA_SAMPLE_FORMAT_H
#define ANLOS_HAL_ALSA_SAMPLE_FORMAT_H

#include <stddef.h>

/* The best one first.  S24: the low three bytes of four; S24_3: three bytes. */
enum sample_format {
    SAMPLE_FORMAT_S32,
    SAMPLE_FORMAT_S24,
    SAMPLE_FORMAT_S24_3,
    SAMPLE_FORMAT_FLOAT,
    SAMPLE_FORMAT_S16,
    SAMPLE_FORMATS
};

const char *sample_format_name(enum sample_format f);
size_t sample_format_bytes(enum sample_format f);

/* n samples of one channel, step_bytes apart, the first at `out`, from x[n] * gain.  A
 * value beyond full scale becomes full scale. */
void sample_format_write(enum sample_format f, const float *x, size_t n, float gain,
                         void *out, size_t step_bytes);

/* The way back: x[n].  A float that is not finite comes as it is. */
void sample_format_read(enum sample_format f, const void *in, size_t step_bytes, size_t n,
                        float *x);

#endif
