/* SPDX-License-Identifier: MIT */
#include "dsp/noise_floor.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"

#define QUIET_PART 0.1

struct noise_floor {
    struct noise_floor_config cfg;
    size_t n;              /* samples that count */
    float complex *kept;   /* [n_speakers][n_channels][n] */
    bool *known;           /* [n_speakers][n_channels] */
    float *powers;         /* [n] */
    double *fresh, *quiet; /* [n_channels] */
};

int noise_floor_create(struct noise_floor **out, const struct noise_floor_config *cfg)
{
    *out = NULL;
    if (!cfg->n_speakers || !cfg->n_channels || cfg->from >= cfg->until ||
        cfg->until > cfg->n_samples)
        return -EINVAL;
    struct noise_floor *f = calloc(1, sizeof *f);
    if (!f)
        return -ENOMEM;
    f->cfg = *cfg;
    f->n = cfg->until - cfg->from;
    f->kept = calloc(cfg->n_speakers * cfg->n_channels, f->n * sizeof *f->kept);
    f->known = calloc(cfg->n_speakers * cfg->n_channels, sizeof *f->known);
    f->powers = calloc(f->n, sizeof *f->powers);
    f->fresh = calloc(cfg->n_channels, sizeof *f->fresh);
    f->quiet = calloc(cfg->n_channels, sizeof *f->quiet);
    if (!f->kept || !f->known || !f->powers || !f->fresh || !f->quiet) {
        noise_floor_destroy(f);
        return -ENOMEM;
    }
    *out = f;
    return 0;
}

/* Of noise of which a part is below what is so in f->powers. */
static double mean_of(const struct noise_floor *f, double part)
{
    size_t k = (size_t)(part * (double)f->n);

    return (double)rank_smallest(f->powers, f->n, k + 1) / -log1p(-part);
}

static double quiet_power(struct noise_floor *f, const float complex *x)
{
    for (size_t i = 0; i < f->n; i++) {
        float re = crealf(x[i]), im = cimagf(x[i]);
        f->powers[i] = re * re + im * im;
    }
    return mean_of(f, QUIET_PART);
}

static double fresh_power(struct noise_floor *f, const float complex *x,
                          const float complex *before)
{
    for (size_t i = 0; i < f->n; i++) {
        float re = crealf(x[i]) - crealf(before[i]);
        float im = cimagf(x[i]) - cimagf(before[i]);
        f->powers[i] = re * re + im * im;
    }
    return 0.5 * mean_of(f, 0.5);
}

bool noise_floor_execute(struct noise_floor *f, size_t speaker,
                         const float complex *traces, const bool *unfit, double *power)
{
    size_t n_channels = f->cfg.n_channels;
    double fresh = 0.0, quiet = 0.0;
    bool any = false;

    for (size_t m = 0; m < n_channels; m++) {
        const float complex *now = traces + m * f->cfg.n_samples + f->cfg.from;
        float complex *before = f->kept + (speaker * n_channels + m) * f->n;
        bool *known = &f->known[speaker * n_channels + m];
        f->fresh[m] = f->quiet[m] = NAN;
        if (unfit && unfit[m])
            continue;
        if (*known) {
            any = true;
            fresh += f->fresh[m] = fresh_power(f, now, before);
            quiet += f->quiet[m] = quiet_power(f, now);
        }
        memcpy(before, now, f->n * sizeof *before);
        *known = true;
    }
    if (any)
        memcpy(power, quiet < fresh ? f->quiet : f->fresh, n_channels * sizeof *power);
    return any;
}

void noise_floor_destroy(struct noise_floor *f)
{
    if (!f)
        return;
    free(f->kept);
    free(f->known);
    free(f->powers);
    free(f->fresh);
    free(f->quiet);
    free(f);
}
