/* SPDX-License-Identifier: MIT */
#include "hal/alsa/sample_format.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

static const struct {
    const char *name;
    size_t bytes;
    int bits; /* 0: float */
} formats[SAMPLE_FORMATS] = {
    [SAMPLE_FORMAT_S32] = {"S32", 4, 32},     [SAMPLE_FORMAT_S24] = {"S24", 4, 24},
    [SAMPLE_FORMAT_S24_3] = {"S24_3", 3, 24}, [SAMPLE_FORMAT_FLOAT] = {"float", 4, 0},
    [SAMPLE_FORMAT_S16] = {"S16", 2, 16},
};

const char *sample_format_name(enum sample_format f)
{
    return formats[f].name;
}

size_t sample_format_bytes(enum sample_format f)
{
    return formats[f].bytes;
}

static int32_t code_of(double value, int bits)
{
    double full = ldexp(1, bits - 1), code = rint(value * full);
    return (int32_t)fmin(fmax(code, -full), full - 1);
}

static void put(enum sample_format f, double value, unsigned char *out)
{
    float single = (float)value;
    int32_t code = formats[f].bits ? code_of(value, formats[f].bits) : 0;
    int16_t half = (int16_t)code;
    switch (f) {
    case SAMPLE_FORMAT_S16:
        memcpy(out, &half, sizeof half);
        break;
    case SAMPLE_FORMAT_S24_3: /* little-endian on every machine */
        for (int i = 0; i < 3; i++)
            out[i] = (unsigned char)((uint32_t)code >> 8 * i);
        break;
    case SAMPLE_FORMAT_FLOAT:
        memcpy(out, &single, sizeof single);
        break;
    default:
        memcpy(out, &code, sizeof code);
    }
}

void sample_format_write(enum sample_format f, const float *x, size_t n, float gain,
                         void *out, size_t step_bytes)
{
    unsigned char *at = out;
    for (size_t i = 0; i < n; i++, at += step_bytes)
        put(f, fmin(fmax((double)x[i] * gain, -1), 1), at);
}

static float get(enum sample_format f, const unsigned char *in)
{
    float single;
    int32_t code;
    int16_t half;
    switch (f) {
    case SAMPLE_FORMAT_S16:
        memcpy(&half, in, sizeof half);
        return (float)half / 0x1p15f;
    case SAMPLE_FORMAT_S24_3:
        code = (int32_t)((uint32_t)in[0] << 8 | (uint32_t)in[1] << 16 |
                         (uint32_t)in[2] << 24);
        return (float)code / 0x1p31f;
    case SAMPLE_FORMAT_S24: /* what the fourth byte holds is left open */
        memcpy(&code, in, sizeof code);
        return (float)(int32_t)((uint32_t)code << 8) / 0x1p31f;
    case SAMPLE_FORMAT_FLOAT:
        memcpy(&single, in, sizeof single);
        return single;
    default:
        memcpy(&code, in, sizeof code);
        return (float)code / 0x1p31f;
    }
}

void sample_format_read(enum sample_format f, const void *in, size_t step_bytes, size_t n,
                        float *x)
{
    const unsigned char *at = in;
    for (size_t i = 0; i < n; i++, at += step_bytes)
        x[i] = get(f, at);
}
