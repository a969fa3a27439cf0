/* SPDX-License-Identifier: MIT */
#include "recon/planning/scattering.h"

#include <math.h>
#include <string.h>

#include "dsp/normal_equations.h"

#define REACH_M    0.13  /* of the surface that is fitted, to either side */
#define JUMP_M     0.08  /* echoes farther off than this belong to something else */
#define ROUGH_M    0.006 /* rms, about the range resolution: beyond it nothing fits */
#define LEAST      0.7   /* of the echoes around a place that must belong together */
#define BEND_MAX   2.0
#define TERMS      4    /* 1, x, y, (x^2 + y^2) / 2 */
#define UNRESOLVED 1e-9 /* of a term's own square: an axis without extent */

/* A mirror: nearer to 0 than to 1, from straight ahead to within a few wavelengths, and
 * seen from enough places to believe it. */
#define SPECULAR_BEND    0.25
#define SPECULAR_SHIFT_M 0.08
#define SPECULAR_SHARE   0.05

struct arrivals {
    const struct scattering_config *cfg;
    float *range_m, *power; /* [ny][nx] */
    size_t reach[2];        /* in lines; 0: no fit along this axis */
};

/* The maximum of a trace between its samples. */
static void pick(const struct scattering_config *cfg, const float *trace, float *range_m,
                 float *power)
{
    size_t best = 0;
    for (size_t n = 1; n + 1 < cfg->n_ranges; n++)
        if (trace[n] > trace[best] || best == 0)
            best = n;
    float left = trace[best ? best - 1 : 0], peak = trace[best];
    float right = trace[best + 1 < cfg->n_ranges ? best + 1 : best];
    float bow = left - 2.0f * peak + right, at = 0.0f;
    if (bow < 0.0f && left <= peak && right <= peak)
        at = 0.5f * (left - right) / bow;
    *range_m = (float)(cfg->range_m + cfg->range_step_m * ((double)best + (double)at));
    *power = isfinite(peak) && peak > 0.0f ? peak : 0.0f;
}

struct fit { /* sums over the echoes around a place */
    double a[TERMS][TERMS], b[TERMS], square;
    size_t n;
};

static void fit_add(struct fit *f, double x, double y, double range_m)
{
    const double term[TERMS] = {1.0, x, y, 0.5 * (x * x + y * y)};
    for (int p = 0; p < TERMS; p++) {
        for (int q = 0; q < TERMS; q++)
            f->a[p][q] += term[p] * term[q];
        f->b[p] += term[p] * range_m;
    }
    f->square += range_m * range_m;
    f->n++;
}

/* Lengths in units of REACH_M.  False when no surface fits. */
static int fit_place(const struct arrivals *s, size_t x, size_t y, double term[TERMS])
{
    const struct scattering_config *cfg = s->cfg;
    const size_t *r = s->reach;
    double centre_m = s->range_m[y * cfg->nx + x];
    struct fit f = {0};
    for (size_t v = y - r[1]; v <= y + r[1]; v++) {
        for (size_t u = x - r[0]; u <= x + r[0]; u++) {
            double beside_m = s->range_m[v * cfg->nx + u] - centre_m;
            if (!(s->power[v * cfg->nx + u] > 0.0f) || !(fabs(beside_m) < JUMP_M))
                continue;
            fit_add(&f, cfg->pitch_x_m / REACH_M * ((double)u - (double)x),
                    cfg->pitch_y_m / REACH_M * ((double)v - (double)y),
                    beside_m / REACH_M);
        }
    }
    size_t all = (2 * r[0] + 1) * (2 * r[1] + 1);
    if ((double)f.n < LEAST * (double)all || f.n < TERMS)
        return 0;
    memcpy(term, f.b, sizeof f.b);
    double left = f.square;
    normal_equations_solve(TERMS, f.a[0], term, UNRESOLVED);
    for (int p = 0; p < TERMS; p++)
        left -= term[p] * f.b[p];
    return sqrt(fmax(left, 0.0) / (double)f.n) * REACH_M < ROUGH_M;
}

static size_t lines_in_reach(size_t n, double pitch_m)
{
    if (n < 3)
        return 0;
    double lines = fmax(rint(REACH_M / pitch_m), 1.0);
    return lines < (double)((n - 1) / 2) ? (size_t)lines : (n - 1) / 2;
}

static void average(const struct arrivals *s, struct scattering *out)
{
    const struct scattering_config *cfg = s->cfg;
    double weight = 0.0, bend = 0.0, shift_m = 0.0;
    size_t n = 0, places = 0;
    for (size_t y = s->reach[1]; y + s->reach[1] < cfg->ny; y++) {
        for (size_t x = s->reach[0]; x + s->reach[0] < cfg->nx; x++) {
            double term[TERMS], w = s->power[y * cfg->nx + x];
            double range_m = s->range_m[y * cfg->nx + x];
            places++;
            if (!(w > 0.0) || !fit_place(s, x, y, term))
                continue;
            double b = term[3] / REACH_M * range_m;
            bend += w * fmin(fmax(b, -BEND_MAX), BEND_MAX);
            shift_m += w * range_m * hypot(term[1], term[2]);
            weight += w;
            n++;
        }
    }
    if (n)
        *out = (struct scattering){bend / weight, shift_m / weight,
                                   (double)n / (double)places};
}

void scattering_measure(const struct scattering_config *cfg, const float *power,
                        float *scratch, struct scattering *out)
{
    size_t cells = cfg->nx * cfg->ny;
    struct arrivals s = {cfg, scratch, scratch + cells, {0, 0}};
    *out = (struct scattering){0.0, 0.0, 0.0};
    s.reach[0] = lines_in_reach(cfg->nx, cfg->pitch_x_m);
    s.reach[1] = lines_in_reach(cfg->ny, cfg->pitch_y_m);
    if ((!s.reach[0] && !s.reach[1]) || cfg->n_ranges < 3)
        return;
    for (size_t q = 0; q < cells; q++)
        pick(cfg, power + q * cfg->n_ranges, &s.range_m[q], &s.power[q]);
    average(&s, out);
}

bool scattering_is_specular(const struct scattering *s)
{
    return s->share > SPECULAR_SHARE && s->bend < SPECULAR_BEND &&
           s->shift_m < SPECULAR_SHIFT_M;
}
