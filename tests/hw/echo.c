/* SPDX-License-Identifier: MIT */
#include "tests/hw/echo.h"

#include <math.h>
#include <string.h>

static double read_code(const struct way *w, const unsigned char *p)
{
    int32_t word;
    int16_t half;
    float single;
    switch (w->far_format) {
    case SND_PCM_FORMAT_S16:
        memcpy(&half, p, 2);
        return half;
    case SND_PCM_FORMAT_S24_3LE:
        return (int8_t)p[2] * 65536 + p[1] * 256 + p[0];
    case SND_PCM_FORMAT_FLOAT:
        memcpy(&single, p, 4);
        return single;
    default:
        memcpy(&word, p, 4);
        return word;
    }
}

static void write_code(const struct way *w, double code, unsigned char *p)
{
    int32_t word = w->far_format == SND_PCM_FORMAT_FLOAT ? 0 : (int32_t)code;
    int16_t half = (int16_t)word;
    float single = (float)code;
    switch (w->far_format) {
    case SND_PCM_FORMAT_S16:
        memcpy(p, &half, 2);
        break;
    case SND_PCM_FORMAT_S24_3LE:
        for (int i = 0; i < 3; i++)
            p[i] = (unsigned char)(word >> 8 * i);
        break;
    case SND_PCM_FORMAT_FLOAT:
        memcpy(p, &single, 4);
        break;
    default:
        memcpy(p, &word, 4);
    }
}

double full_scale(const struct way *w)
{
    return w->far_format == SND_PCM_FORMAT_FLOAT
               ? 1
               : ldexp(1, snd_pcm_format_width(w->far_format) - 1);
}

void echo_give(void *ctx, uint64_t frame, const void *heard, void *out, size_t n)
{
    struct echo *e = ctx;
    const struct way *w = e->way;
    size_t bytes = (size_t)snd_pcm_format_physical_width(w->far_format) / 8;
    for (size_t i = 0; i < n && frame + i < HEARD_MAX; i++) {
        double *to = e->heard + (frame + i) * w->n_channels;
        for (size_t c = 0; c < w->n_channels; c++)
            to[c] = read_code(w, (const unsigned char *)heard +
                                     (i * w->n_channels + c) * bytes);
        for (size_t c = 0; c < w->n_channels && c <= frame + i; c++) {
            double sum = 0;
            for (size_t k = 0; k < w->n_channels; k++)
                sum += to[k - c * w->n_channels];
            write_code(w, sum, (unsigned char *)out + (i * w->n_channels + c) * bytes);
        }
    }
    atomic_store(&e->n_heard, frame + n < HEARD_MAX ? frame + n : HEARD_MAX);
}

double echo_sum(const struct echo *e, size_t frame, size_t delay)
{
    double sum = 0;
    for (size_t c = 0; c < e->way->n_channels && frame >= delay; c++)
        sum += e->heard[(frame - delay) * e->way->n_channels + c];
    return sum;
}
