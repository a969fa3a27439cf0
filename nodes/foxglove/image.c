/* SPDX-License-Identifier: MIT */
#include "nodes/foxglove/image.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "msgs/convert.h"

/* The first bits of a positive float are a logarithm of it: 8 of exponent and 4 more make
 * bins of an eighth to a quarter of a dB. */
#define SHIFT 19
#define BINS  (1u << (31 - SHIFT))

static float bin_start(size_t bin)
{
    uint32_t bits = (uint32_t)bin << SHIFT;
    float value;

    memcpy(&value, &bits, sizeof value);
    return value;
}

static size_t bin_of(float value)
{
    uint32_t bits;

    memcpy(&bits, &value, sizeof bits);
    return bits >> SHIFT;
}

static float plain(float intensity)
{
    return intensity > 0.0f && intensity <= FLT_MAX ? intensity : 0.0f;
}

static float find_brightest(const float *intensity, size_t n)
{
    float brightest = 0.0f;

    for (size_t i = 0; i < n; i++) {
        float v = plain(intensity[i]);
        brightest = v > brightest ? v : brightest;
    }
    return brightest;
}

void levels_measure(struct levels *out, const float *intensity, size_t n, size_t max)
{
    size_t counts[BINS] = {0}, below = 0, median = 0, bin;

    *out =
        (struct levels){.brightest = find_brightest(intensity, n), .threshold = FLT_MAX};
    if (out->brightest == 0.0f || !max)
        return;
    for (size_t i = 0; i < n; i++)
        counts[bin_of(plain(intensity[i]))]++;
    while (below + counts[median] < (n + 1) / 2)
        below += counts[median++];
    double least = fmax((double)bin_start(median) * pow(10.0, LEVEL_FLOOR_DB / 10.0),
                        (double)out->brightest * pow(10.0, -LEVEL_RANGE_DB / 10.0));
    bin = bin_of(out->brightest) + 1;
    while (bin > 0 && (double)bin_start(bin - 1) >= least &&
           out->n + counts[bin - 1] <= max)
        out->n += counts[--bin];
    if (out->n)
        out->threshold = bin_start(bin);
}

float level_db(const struct levels *l, float intensity, float least_db)
{
    float ratio = intensity > 0.0f ? intensity / l->brightest : 0.0f;

    return ratio > 0.0f ? fmaxf(10.0f * log10f(ratio), least_db) : least_db;
}

int image_open(struct image *out, const struct setting *s,
               const struct foxglove_message *m, size_t max)
{
    const Anlos__Volume *volume = (const Anlos__Volume *)m->content;

    out->intensity = volume_grid(volume, &out->grid);
    if (!out->intensity)
        return -EINVAL;
    if (!s->has_survey || s->survey_id != volume->survey_id)
        return -EAGAIN;
    out->wall = setting_wall(s);
    levels_measure(&out->levels, out->intensity, grid_size(&out->grid), max);
    return 0;
}
