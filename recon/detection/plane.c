/* SPDX-License-Identifier: MIT */
#include "recon/detection/plane.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/normal_equations.h"
#include "dsp/rank.h"

#define TOLERANCE    0.25 /* of the echo's length */
#define FIRST        0.5  /* of the strongest echo, that the first one is */
#define LEAST_SHARE  0.9  /* of all traces, whose first echo is the plane's */
#define LEAST_LEVEL  0.3  /* of the median amplitude */
#define LEAST_TRACES 64
#define TRIALS       200
#define MOST_BEND    0.2  /* 1 is a point's */
#define LEAST_BOW    2.0  /* tolerances, that a point's would be */
#define LEAST_COS    0.5  /* of the normal and the array's */
#define INDEPENDENT  1e-9 /* of its own, that places leave of an unknown */
#define MUTED        3.0  /* pulses on both sides */
#define RANGE_ERROR  1e-3 /* speed of sound known to 0.1 % */

struct arrival {
    double middle_m[3], range_m, amplitude, pulse_s, lag_s;
    bool fits;
};

struct face {
    double x, y, z, distance_m; /* normal . p = distance_m */
};

static double range_to(const struct face *f, const double p[3])
{
    return f->distance_m - f->x * p[0] - f->y * p[1] - f->z * p[2];
}

/* Where |y| crosses a level between two samples. */
static double crossing(const float complex *y, size_t below, size_t above, double level)
{
    double low = (double)cabsf(y[below]), high = (double)cabsf(y[above]);
    double part = high > low ? (level - low) / (high - low) : 1.0;

    return (double)below + part * ((double)above - (double)below);
}

/* The first echo that is not much fainter than the strongest. */
static bool find_echo(const float complex *y, size_t n, size_t *top)
{
    double most = 0.0;
    size_t at = 0;

    for (size_t q = 0; q < n; q++)
        most = fmax(most, (double)cabsf(y[q]));
    while (at < n && (double)cabsf(y[at]) < FIRST * most)
        at++;
    *top = at;
    for (size_t q = at; q < n && (double)cabsf(y[q]) >= FIRST * most; q++)
        if (cabsf(y[q]) > cabsf(y[*top]))
            *top = q;
    return most > 0.0 && *top > 0 && *top + 1 < n;
}

static bool listen(const struct trace_set *set, size_t trace, bool burst,
                   struct arrival *out)
{
    const struct trace_format *f = &set->format;
    const float complex *y = set->traces + trace * f->n_samples;
    double speaker[3], microphone[3], offset2 = 0.0;
    size_t top, first, last;

    if (!find_echo(y, f->n_samples, &top))
        return false;
    double level = (double)cabsf(y[top]), low = (double)cabsf(y[top - 1]);
    double high = (double)cabsf(y[top + 1]), bend = 2.0 * level - low - high;
    for (first = top; first > 0 && (double)cabsf(y[first]) > 0.5 * level;)
        first--;
    for (last = top; last + 1 < f->n_samples && (double)cabsf(y[last]) > 0.5 * level;)
        last++;
    double rise = crossing(y, first, first + 1, 0.5 * level);
    double fall = crossing(y, last, last - 1, 0.5 * level);
    double peak = (double)top + (bend > 0.0 ? 0.5 * (high - low) / bend : 0.0);
    double path_m = (f->t0_s + (burst ? rise : peak) / f->rate_hz) *
                    set->geometry->sound_speed_m_s;
    geometry_pair(set->geometry, trace, speaker, microphone);
    for (int a = 0; a < 3; a++) {
        out->middle_m[a] = 0.5 * (speaker[a] + microphone[a]);
        offset2 += (speaker[a] - microphone[a]) * (speaker[a] - microphone[a]);
    }
    out->range_m = 0.5 * sqrt(fmax(path_m * path_m - offset2, 0.0));
    out->amplitude = level;
    out->pulse_s = (fall - rise) / f->rate_hz;
    out->lag_s = burst ? 0.5 * out->pulse_s : 0.0;
    return true;
}

/* Least squares of range = D - x mx - y my - z mz over the arrivals that fit (or those
 * that are listed), of a face whose z is known from before. */
static bool regress(const struct arrival *all, size_t n, const size_t *listed,
                    struct face *f)
{
    double m[3][3] = {{0.0}}, x[3] = {0.0};

    for (size_t i = 0; i < n; i++) {
        const struct arrival *a = &all[listed ? listed[i] : i];
        if (!listed && !a->fits)
            continue;
        const double row[3] = {1.0, -a->middle_m[0], -a->middle_m[1]};
        for (int r = 0; r < 3; r++) {
            for (int k = 0; k < 3; k++)
                m[r][k] += row[r] * row[k];
            x[r] += row[r] * (a->range_m + f->z * a->middle_m[2]);
        }
    }
    if (normal_equations_solve(3, m[0], x, INDEPENDENT) ||
        x[1] * x[1] + x[2] * x[2] > 1.0 - LEAST_COS * LEAST_COS)
        return false;
    *f = (struct face){x[1], x[2], sqrt(1.0 - x[1] * x[1] - x[2] * x[2]), x[0]};
    return true;
}

static size_t count_fits(struct arrival *all, size_t n, const struct face *f,
                         double tolerance_m)
{
    size_t count = 0;

    for (size_t i = 0; i < n; i++) {
        double off_m = all[i].range_m - range_to(f, all[i].middle_m);
        all[i].fits = fabs(off_m) < tolerance_m;
        count += all[i].fits;
    }
    return count;
}

static size_t agree(struct arrival *all, size_t n, double tolerance_m, struct face *out)
{
    unsigned long long seed = 1;
    struct face best = {.z = 1.0}, f;
    size_t most = 0;

    for (int t = 0; t < TRIALS; t++) {
        size_t three[3];
        for (int i = 0; i < 3; i++) {
            seed = seed * 6364136223846793005ull + 1442695040888963407ull;
            three[i] = (size_t)(seed >> 33) % n;
        }
        f = (struct face){.z = 1.0};
        if (!regress(all, 3, three, &f))
            continue;
        size_t count = count_fits(all, n, &f, tolerance_m);
        if (count > most) {
            most = count;
            best = f;
        }
    }
    for (int i = 0; i < 4 && most > 0; i++) {
        most = count_fits(all, n, &best, tolerance_m);
        if (!regress(all, n, NULL, &best))
            return 0;
    }
    *out = best;
    return most > 0 ? count_fits(all, n, &best, tolerance_m) : 0;
}

/* As loud from nearly everywhere as from the middle one: it goes on beyond the view. */
static int is_even(const struct arrival *all, size_t n, bool *even)
{
    double *level = malloc(n * sizeof *level);
    size_t loud = 0;

    if (!level)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++)
        level[i] = all[i].amplitude;
    double middle = rank_double(level, n, n / 2 + 1);
    for (size_t i = 0; i < n; i++)
        loud += level[i] > LEAST_LEVEL * middle;
    *even = (double)loud >= LEAST_SHARE * (double)n;
    free(level);
    return 0;
}

/* How much the arrivals bend, a point's being 1; false: the aperture is too small. */
static bool is_flat(const struct arrival *all, size_t n, const struct face *f,
                    double tolerance_m)
{
    double middle[3] = {0.0}, mean[2] = {0.0}, most_m = 0.0, bow2 = 0.0, bend = 0.0;

    for (size_t i = 0; i < n; i++)
        for (int a = 0; a < 3; a++)
            middle[a] += all[i].middle_m[a] / (double)n;
    for (int pass = 0; pass < 2; pass++)
        for (size_t i = 0; i < n; i++) {
            double d = geometry_distance(all[i].middle_m, middle);
            double bow_m = d * d / (2.0 * f->distance_m);
            double off_m = all[i].range_m - range_to(f, all[i].middle_m);
            if (!all[i].fits)
                continue;
            if (pass == 0) {
                mean[0] += bow_m / (double)n;
                mean[1] += off_m / (double)n;
                most_m = fmax(most_m, bow_m);
            } else {
                bow2 += (bow_m - mean[0]) * (bow_m - mean[0]);
                bend += (bow_m - mean[0]) * (off_m - mean[1]);
            }
        }
    return most_m > LEAST_BOW * tolerance_m && bow2 > 0.0 &&
           fabs(bend / bow2) < MOST_BEND;
}

static void describe(const struct arrival *all, size_t n, const struct face *f,
                     struct plane *plane)
{
    struct detection *out = &plane->object;
    const double normal[3] = {f->x, f->y, f->z};
    double low[3] = {INFINITY, INFINITY, INFINITY}, rest2 = 0.0;
    double high[3] = {-INFINITY, -INFINITY, -INFINITY};
    size_t count = 0;

    memset(plane, 0, sizeof *plane);
    for (size_t i = 0; i < n; i++) {
        double range_m = range_to(f, all[i].middle_m);
        if (!all[i].fits)
            continue;
        for (int a = 0; a < 3; a++) {
            double at_m = all[i].middle_m[a] + range_m * normal[a];
            low[a] = fmin(low[a], at_m);
            high[a] = fmax(high[a], at_m);
        }
        rest2 += (all[i].range_m - range_m) * (all[i].range_m - range_m);
        plane->pulse_s += all[i].pulse_s;
        plane->lag_s += all[i].lag_s;
        count++;
    }
    for (int a = 0; a < 3; a++) {
        out->position_m[a] = 0.5 * (low[a] + high[a]);
        out->extent_m[a] = high[a] - low[a];
        plane->normal[a] = normal[a];
    }
    double off_m = f->distance_m, across_m2 = 0.0;
    for (int a = 0; a < 3; a++)
        off_m -= normal[a] * out->position_m[a];
    across_m2 = rest2 / (double)count / (double)count +
                RANGE_ERROR * RANGE_ERROR * f->distance_m * f->distance_m;
    for (int a = 0, e = 0; a < 3; a++) {
        out->position_m[a] += off_m * normal[a];
        for (int b = a; b < 3; b++, e++)
            out->covariance_m2[e] = across_m2 * normal[a] * normal[b];
    }
    /* along it: anywhere between the ends */
    const double along[2][3] = {{normal[2], 0.0, -normal[0]},
                                {-normal[0] * normal[1],
                                 normal[0] * normal[0] + normal[2] * normal[2],
                                 -normal[1] * normal[2]}};
    for (int k = 0; k < 2; k++) {
        double length2 = 0.0, size_m = out->extent_m[k];
        for (int a = 0; a < 3; a++)
            length2 += along[k][a] * along[k][a];
        for (int a = 0, e = 0; a < 3; a++)
            for (int b = a; b < 3; b++, e++)
                out->covariance_m2[e] += size_m * size_m / 12.0 * along[k][a] *
                                         along[k][b] / length2;
    }
    plane->pulse_s /= (double)count;
    plane->lag_s /= (double)count;
    out->existence = 1.0 - 1.0 / (double)n;
    out->shape = (struct shape_guess){SHAPE_PLATE, (double)count / (double)n};
}

int plane_fit(struct plane *out, const struct trace_set *set, bool burst)
{
    size_t traces = set->geometry->n_positions * trace_set_pairs(set), n = 0, fit = 0;
    double tolerance_m = 0.0;
    struct arrival *all = malloc(traces * sizeof *all);
    struct face face = {.z = 1.0};
    bool even = false;
    int err = all ? 0 : -ENOMEM;

    for (size_t q = 0; !err && q < traces; q++)
        if (set->heard[q])
            n += listen(set, q, burst, &all[n]);
    for (size_t i = 0; i < n; i++)
        tolerance_m += all[i].pulse_s / (double)n;
    tolerance_m *= TOLERANCE * 0.5 * set->geometry->sound_speed_m_s;
    if (n >= LEAST_TRACES)
        fit = agree(all, n, tolerance_m, &face);
    if (!err && (n < LEAST_TRACES || (double)fit < LEAST_SHARE * (double)n ||
                 !is_flat(all, n, &face, tolerance_m)))
        err = -ERANGE;
    if (!err)
        err = is_even(all, n, &even);
    if (!err && !even)
        err = -ERANGE;
    if (!err)
        describe(all, n, &face, out);
    free(all);
    return err;
}

double plane_behind_m(const struct plane *plane, const double p[3])
{
    double behind_m = 0.0;

    for (int a = 0; a < 3; a++)
        behind_m += plane->normal[a] * (p[a] - plane->object.position_m[a]);
    return behind_m;
}

bool plane_covers(const struct plane *plane, const double p[3])
{
    for (int a = 0; a < 2; a++)
        if (fabs(p[a] - plane->object.position_m[a]) > 0.5 * plane->object.extent_m[a])
            return false;
    return true;
}

/* Nothing of the inner two thirds, then more and more. */
static double kept(double part)
{
    return 0.5 - 0.5 * cos(M_PI * fmin(fmax(3.0 * part - 2.0, 0.0), 1.0));
}

void plane_mute(const struct plane *plane, const struct trace_set *set,
                float complex *traces)
{
    const struct trace_format *f = &set->format;
    size_t n = set->geometry->n_positions * trace_set_pairs(set);
    double band_hz = set->band_hz[1] - set->band_hz[0];
    double half = MUTED * f->rate_hz * fmax(plane->pulse_s, 1.0 / band_hz);

    for (size_t q = 0; q < n; q++) {
        double speaker[3], image[3];
        geometry_pair(set->geometry, q, speaker, image);
        double behind_m = plane_behind_m(plane, image);
        for (int a = 0; a < 3; a++)
            image[a] -= 2.0 * behind_m * plane->normal[a];
        double delay_s = geometry_distance(speaker, image) /
                         set->geometry->sound_speed_m_s;
        double middle = (delay_s + plane->lag_s - f->t0_s) * f->rate_hz;
        double first = fmax(ceil(middle - half), 0.0);
        double last = fmin(floor(middle + half), (double)f->n_samples - 1.0);
        for (double k = first; k <= last; k += 1.0)
            traces[q * f->n_samples + (size_t)k] *= (float)kept(fabs(k - middle) / half);
    }
}
