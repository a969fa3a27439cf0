/* SPDX-License-Identifier: MIT */
#include "recon/frontend/channel_check.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/rank.h"

#define SILENT_POWER_RATIO 1e-6
#define CLIPPED_SHARE      0.01

struct verdict {
    uint32_t clipped_samples, not_finite_samples;
    bool silent, damaged, clipped;
};

struct channel_check {
    size_t n_microphones, n_positions;
    struct verdict *verdicts; /* [n_positions][n_microphones] */
    double *scratch;          /* [n_positions][2][n_microphones] */
};

int channel_check_create(struct channel_check **out, size_t n_microphones,
                         size_t n_positions)
{
    struct channel_check *c = calloc(1, sizeof *c);
    if (!c)
        return -ENOMEM;
    c->n_microphones = n_microphones;
    c->n_positions = n_positions;
    c->verdicts = calloc(n_positions * n_microphones, sizeof *c->verdicts);
    c->scratch = calloc(n_positions * n_microphones, 2 * sizeof *c->scratch);
    if (!c->verdicts || !c->scratch) {
        channel_check_destroy(c);
        return -ENOMEM;
    }
    *out = c;
    return 0;
}

#define LANES 8
#define BLOCK 512

/* Without the mean: an offset is no sound.  Sums in lanes, so that the compiler may use
 * vectors, and in blocks, so that float is enough inside one. */
static double channel_power(const float *x, size_t n)
{
    double sum = 0.0, squares = 0.0;
    for (size_t start = 0; start < n; start += BLOCK) {
        float s[LANES] = {0.0f}, q[LANES] = {0.0f};
        size_t length = n - start < BLOCK ? n - start : BLOCK, i = 0;
        for (; i + LANES <= length; i += LANES) {
            for (size_t k = 0; k < LANES; k++) {
                float v = x[start + i + k] - x[0];
                s[k] += v;
                q[k] += v * v;
            }
        }
        for (; i < length; i++) {
            float v = x[start + i] - x[0];
            s[0] += v;
            q[0] += v * v;
        }
        for (size_t k = 0; k < LANES; k++) {
            sum += (double)s[k];
            squares += (double)q[k];
        }
    }
    double mean = sum / (double)n;
    double power = squares / (double)n - mean * mean;
    return power <= 1e-12 * mean * mean ? 0.0 : power;
}

void channel_check_position(struct channel_check *c, size_t position, size_t n_frames,
                            const float *samples, const uint32_t *clipped,
                            const uint32_t *not_finite, bool *masked)
{
    size_t n = c->n_microphones;
    double *power = c->scratch + 2 * position * n, *sorted = power + n;
    for (size_t i = 0; i < n; i++) {
        power[i] = channel_power(samples + i * n_frames, n_frames);
        sorted[i] = isfinite(power[i]) ? power[i] : 0.0; /* NaN has no order */
    }
    double median = rank_double(sorted, n, n / 2 + 1);

    for (size_t i = 0; i < n; i++) {
        struct verdict *v = &c->verdicts[position * n + i];
        v->clipped_samples = clipped[i];
        v->not_finite_samples = not_finite[i];
        v->silent = power[i] <= SILENT_POWER_RATIO * median;
        v->damaged = not_finite[i] > 0 || !isfinite(power[i]);
        v->clipped = (double)clipped[i] > CLIPPED_SHARE * (double)n_frames;
        if (v->silent || v->damaged || v->clipped)
            masked[i] = true;
    }
}

void channel_check_summary(const struct channel_check *c, size_t microphone,
                           struct channel_summary *out)
{
    *out = (struct channel_summary){0};
    for (size_t k = 0; k < c->n_positions; k++) {
        const struct verdict *v = &c->verdicts[k * c->n_microphones + microphone];
        out->silent += v->silent;
        out->damaged += v->damaged;
        out->clipped += v->clipped;
        out->clipped_samples += v->clipped_samples;
        out->not_finite_samples += v->not_finite_samples;
    }
}

void channel_check_destroy(struct channel_check *c)
{
    if (!c)
        return;
    free(c->scratch);
    free(c->verdicts);
    free(c);
}
