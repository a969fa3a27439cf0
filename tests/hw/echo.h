/* SPDX-License-Identifier: MIT */
/* tests/hw/echo.h -- what a far end answers with: on each channel c the sum of all that
 * is heard, c frames later.  Keeps all it hears, as codes of the format. */
#ifndef ANLOS_TESTS_HW_ECHO_H
#define ANLOS_TESTS_HW_ECHO_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include <alsa/asoundlib.h>

enum { HEARD_MAX = 400000 }; /* frames */

/* One way to run the card. */
struct way {
    const char *format, *access;
    snd_pcm_format_t far_format;
    unsigned n_channels, rate_hz;
    const char *device; /* NULL: hw:Loopback,0,0 */
};

struct echo {
    const struct way *way;
    double *heard; /* [HEARD_MAX][n_channels], codes */
    atomic_size_t n_heard;
};

double full_scale(const struct way *w);

/* For a far end (tests/hw/far_end.h); ctx is the echo. */
void echo_give(void *ctx, uint64_t frame, const void *heard, void *answer, size_t n);

/* The sum of all channels, `delay` frames before a frame; 0 before the first. */
double echo_sum(const struct echo *e, size_t frame, size_t delay);

#endif
