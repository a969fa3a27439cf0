/* SPDX-License-Identifier: MIT */
#include "dsp/channels.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/normal_equations.h"
#include "dsp/rank.h"

#define OUTLIER     3.0  /* standard deviations */
#define LEAST_SIGMA 0.01 /* dB */
#define LEFT_OVER   1e-9 /* of a diagonal, of unknowns that are determined */
#define FITS        3

struct fit {
    size_t n_speakers, n; /* n: all unknowns, speakers first */
    size_t n_microphones;
    const double *level_db;
    bool *used;   /* [pairs] */
    double *a;    /* [n][n] */
    double *gain; /* [n] */
};

/* Normal equations of the pairs used.  They have one solution up to a constant that goes
 * from speakers to microphones: the elimination sets one gain 0. */
static void solve(struct fit *f)
{
    memset(f->a, 0, f->n * f->n * sizeof *f->a);
    memset(f->gain, 0, f->n * sizeof *f->gain);
    for (size_t j = 0; j < f->n_speakers; j++)
        for (size_t m = 0; m < f->n_microphones; m++) {
            size_t pair = j * f->n_microphones + m, k = f->n_speakers + m;
            if (!f->used[pair])
                continue;
            f->a[j * f->n + j] += 1.0;
            f->a[k * f->n + k] += 1.0;
            f->a[j * f->n + k] += 1.0;
            f->a[k * f->n + j] += 1.0;
            f->gain[j] += f->level_db[pair];
            f->gain[k] += f->level_db[pair];
        }
    normal_equations_solve(f->n, f->a, f->gain, LEFT_OVER);
}

static double off_db(const struct fit *f, size_t pair)
{
    return f->level_db[pair] - f->gain[pair / f->n_microphones] -
           f->gain[f->n_speakers + pair % f->n_microphones];
}

/* rms over the pairs used. */
static double residual_db(const struct fit *f, size_t *n_used)
{
    double sum = 0.0;
    *n_used = 0;
    for (size_t p = 0; p < f->n_speakers * f->n_microphones; p++)
        if (f->used[p]) {
            sum += off_db(f, p) * off_db(f, p);
            ++*n_used;
        }
    return *n_used ? sqrt(sum / (double)*n_used) : NAN;
}

static void choose(struct fit *f, double limit_db)
{
    for (size_t p = 0; p < f->n_speakers * f->n_microphones; p++)
        f->used[p] = isfinite(f->level_db[p]) && fabs(off_db(f, p)) <= limit_db;
}

/* Gains [n] of those that some pair tells, less their mean, which is returned. */
static double centre(const struct fit *f, bool microphones, double *out, size_t *unknown)
{
    size_t n = microphones ? f->n_microphones : f->n_speakers, known = 0;
    size_t others = microphones ? f->n_speakers : f->n_microphones;
    double mean = 0.0;
    for (size_t i = 0; i < n; i++) {
        bool told = false;
        for (size_t k = 0; k < others; k++)
            told |= f->used[microphones ? k * f->n_microphones + i
                                        : i * f->n_microphones + k];
        out[i] = told ? f->gain[i + (microphones ? f->n_speakers : 0)] : NAN;
        mean += told ? out[i] : 0.0;
        known += told;
    }
    *unknown = n - known;
    mean = known ? mean / (double)known : 0.0;
    for (size_t i = 0; i < n; i++)
        out[i] -= mean;
    return mean;
}

int levels_fit(struct levels *out, size_t n_speakers, size_t n_microphones,
               const double *level_db, double *speaker_db, double *microphone_db)
{
    size_t n = n_speakers + n_microphones;
    struct fit f = {.n_speakers = n_speakers,
                    .n_microphones = n_microphones,
                    .n = n,
                    .level_db = level_db,
                    .used = calloc(n_speakers * n_microphones, sizeof *f.used),
                    .a = malloc(n * n * sizeof *f.a),
                    .gain = calloc(n, sizeof *f.gain)};
    double limit_db = INFINITY;
    int err = f.used && f.a && f.gain ? 0 : -ENOMEM;
    *out = (struct levels){.n_used = 0};
    for (int k = 0; k < FITS && !err; k++) {
        choose(&f, limit_db);
        solve(&f);
        out->residual_db = residual_db(&f, &out->n_used);
        limit_db = OUTLIER * fmax(out->residual_db, LEAST_SIGMA);
        if (!out->n_used)
            err = -ENODATA;
    }
    if (!err) {
        out->mean_db = centre(&f, false, speaker_db, &out->n_speakers_unknown);
        out->mean_db += centre(&f, true, microphone_db, &out->n_microphones_unknown);
    }
    free(f.used);
    free(f.a);
    free(f.gain);
    return err;
}

#define ITERATIONS 50

static double complex phasor(double complex z)
{
    double a = cabs(z);
    return a > 0.0 ? z / a : 0.0;
}

/* out[n_out] = the phases that follow from known[n_known] of the other kind; a pair's
 * peak is at i * stride_out + k * stride_known. */
static void follow(size_t n_out, size_t stride_out, size_t n_known, size_t stride_known,
                   const double complex *peaks, const double complex *known,
                   double complex *out)
{
    for (size_t i = 0; i < n_out; i++) {
        double complex sum = 0.0;
        for (size_t k = 0; k < n_known; k++)
            sum += phasor(peaks[i * stride_out + k * stride_known]) * conj(known[k]);
        out[i] = phasor(sum);
    }
}

/* The phase that most are near to: the one of them with the greatest sum of projections
 * that are not negative.  A mean would vanish where half are inverted. */
static double complex majority(const double complex *phases, size_t n)
{
    double complex best = 1.0;
    double most = -1.0;
    for (size_t i = 0; i < n; i++) {
        double sum = 0.0;
        for (size_t k = 0; k < n; k++) {
            double along = creal(phases[k] * conj(phases[i]));
            sum += along > 0.0 ? along : 0.0;
        }
        if (cabs(phases[i]) > 0.0 && sum > most + 1e-9) {
            most = sum;
            best = phases[i];
        }
    }
    return best;
}

static void judge(const double complex *phases, size_t n, bool *inverted)
{
    double complex usual = majority(phases, n);
    for (size_t i = 0; i < n; i++)
        inverted[i] = creal(phases[i] * conj(usual)) < 0.0;
}

int polarity_find(size_t n_speakers, size_t n_microphones, const double complex *peaks,
                  bool *speaker_inverted, bool *microphone_inverted)
{
    double complex *speakers = calloc(n_speakers, sizeof *speakers);
    double complex *microphones = calloc(n_microphones, sizeof *microphones);
    int err = speakers && microphones ? 0 : -ENOMEM;
    /* A start that no pattern of signs is orthogonal to. */
    for (size_t m = 0; !err && m < n_microphones; m++)
        microphones[m] = cexp(I * 0.1 * (double)m / (double)n_microphones) *
                         phasor(peaks[m] != 0.0 ? peaks[m] : 1.0);
    for (int k = 0; !err && k < ITERATIONS; k++) {
        follow(n_speakers, n_microphones, n_microphones, 1, peaks, microphones, speakers);
        follow(n_microphones, 1, n_speakers, n_microphones, peaks, speakers, microphones);
    }
    if (!err) {
        judge(speakers, n_speakers, speaker_inverted);
        judge(microphones, n_microphones, microphone_inverted);
    }
    free(speakers);
    free(microphones);
    return err;
}

/* NaN: heard by fewer than half. */
static double misfit(const double *heard, const double *expected, size_t n,
                     double *scratch)
{
    size_t m = 0;
    for (size_t i = 0; i < n; i++)
        if (!isnan(heard[i]))
            scratch[m++] = fabs(heard[i] - expected[i]);
    if (2 * m < n || !m)
        return NAN;
    return rank_double(scratch, m, m / 2 + 1);
}

int channel_order_find(size_t n, size_t n_others, const double *heard,
                       const double *expected, double tolerance_s,
                       struct channel_place *out)
{
    double *scratch = malloc((n_others + 1) * sizeof *scratch);
    if (!scratch)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++) {
        const double *row = heard + i * n_others;
        double own = misfit(row, expected + i * n_others, n_others, scratch);
        struct channel_place best = {i, own, own};
        for (size_t k = 0; k < n; k++) {
            double other = misfit(row, expected + k * n_others, n_others, scratch);
            if (other < best.other_s) {
                best.answers_as = k;
                best.other_s = other;
            }
        }
        out[i] = best;
        if (!(own > tolerance_s && best.other_s < 0.5 * own))
            out[i] = (struct channel_place){i, own, own};
    }
    free(scratch);
    return 0;
}
