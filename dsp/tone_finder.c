/* SPDX-License-Identifier: MIT */
#include "dsp/tone_finder.h"

#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/fft.h"
#include "dsp/rank.h"

#define AROUND  16   /* lines, rate / n_samples wide, on either side: its median */
#define LOBE    2    /* of them on either side of a line in a Hann window */
#define WANDERS 0.03 /* of a frequency, from one block to the next */
#define SHARP   4.0  /* a comb's correlation over the median one */
#define SAME    0.85 /* of the largest correlation: it is a multiple of that lag */

enum { PINGS, DIFFERENCES, KINDS };

struct tone_finder {
    struct tone_finder_config cfg;
    size_t n_used, *used;       /* channels */
    size_t n_fft, n_bins;       /* from first on, of the band */
    size_t first, lobe, around; /* bins */
    size_t lags[2];
    float *window;       /* [n_samples] */
    double *window_lags; /* [lags[1] + 2] its autocorrelation, 1 at 0 */
    double window_power;
    bool *known;            /* [n_speakers] */
    float complex *before;  /* [n_speakers][n_used][n_bins] */
    float complex *now;     /* [n_bins] */
    double *power[KINDS];   /* [n_used][n_bins], sums over the block */
    double *mean;           /* [n_bins] */
    double *near;           /* [2 around + 1], or of all lags */
    double *correlation;    /* [lags[1] + 2] */
    size_t *hits;           /* [n_bins] channels with a line there */
    bool *is_line;          /* [n_bins] in half of them */
    double *inverse[KINDS]; /* [n_used] sums of one over what these are parts of */
    float *in, *out;        /* [n_fft] complex */
    fftwf_plan forward;
    size_t n_pings, n_differences; /* of the block */
    size_t n_with, n_without;      /* blocks in a row */
    struct tone_found last, found; /* in the last block; in enough of them */
};

/* -- plan ------------------------------------------------------------------------------
 */

static void make_window(struct tone_finder *f)
{
    size_t n = f->cfg.n_samples;

    for (size_t i = 0; i < n; i++)
        f->window[i] = (float)(0.5 - 0.5 * cos(2 * M_PI * ((double)i + 0.5) / (double)n));
    for (size_t lag = 0; lag < f->lags[1] + 2; lag++)
        for (size_t i = 0; i + lag < n; i++)
            f->window_lags[lag] += (double)f->window[i] * f->window[i + lag];
    f->window_power = f->window_lags[0];
    for (size_t lag = 0; lag < f->lags[1] + 2; lag++)
        f->window_lags[lag] /= f->window_power;
}

static bool allocate(struct tone_finder *f)
{
    size_t most = f->lags[1] + 2 > 2 * f->around + 1 ? f->lags[1] + 2 : 2 * f->around + 1;

    f->used = calloc(f->n_used, sizeof *f->used);
    f->window = calloc(f->cfg.n_samples, sizeof *f->window);
    f->window_lags = calloc(f->lags[1] + 2, sizeof *f->window_lags);
    f->known = calloc(f->cfg.n_speakers, sizeof *f->known);
    f->before = calloc(f->cfg.n_speakers * f->n_used * f->n_bins, sizeof *f->before);
    for (int k = 0; k < KINDS; k++) {
        f->power[k] = calloc(f->n_used * f->n_bins, sizeof *f->power[k]);
        f->inverse[k] = calloc(f->n_used, sizeof *f->inverse[k]);
    }
    f->mean = calloc(f->n_bins, sizeof *f->mean);
    f->near = calloc(most, sizeof *f->near);
    f->correlation = calloc(f->lags[1] + 2, sizeof *f->correlation);
    f->hits = calloc(f->n_bins, sizeof *f->hits);
    f->is_line = calloc(f->n_bins, sizeof *f->is_line);
    f->now = calloc(f->n_bins, sizeof *f->now);
    f->in = fftwf_malloc(2 * f->n_fft * sizeof *f->in);
    f->out = fftwf_malloc(2 * f->n_fft * sizeof *f->out);
    if (f->in && f->out)
        f->forward = fft_plan(f->n_fft, f->in, f->out, FFTW_FORWARD);
    return f->used && f->window && f->window_lags && f->known && f->before &&
           f->power[PINGS] && f->power[DIFFERENCES] && f->mean && f->near &&
           f->correlation && f->hits && f->is_line && f->now && f->inverse[PINGS] &&
           f->inverse[DIFFERENCES] && f->forward;
}

int tone_finder_create(struct tone_finder **out, const struct tone_finder_config *cfg)
{
    static const double apart_hz[2] = {TONE_FINDER_MOST_HZ, TONE_FINDER_LEAST_HZ};
    double lines = cfg->rate_hz / (double)cfg->n_samples; /* how wide one is */

    *out = NULL;
    if (!cfg->n_speakers || !cfg->n_channels || cfg->n_samples < 2 ||
        !(cfg->band_hz[0] >= 0 && cfg->band_hz[1] <= cfg->rate_hz / 2) ||
        !(cfg->band_hz[1] - cfg->band_hz[0] > 2 * AROUND * lines))
        return -EINVAL;
    struct tone_finder *f = calloc(1, sizeof *f);
    if (!f)
        return -ENOMEM;
    f->cfg = *cfg;
    f->n_used = cfg->n_channels < TONE_FINDER_CHANNELS ? cfg->n_channels
                                                       : TONE_FINDER_CHANNELS;
    f->n_fft = fft_size(cfg->n_samples + cfg->n_samples / 2, 1.1);
    double bin_hz = cfg->rate_hz / (double)f->n_fft;
    f->first = (size_t)ceil(cfg->band_hz[0] / bin_hz);
    f->n_bins = (size_t)(cfg->band_hz[1] / bin_hz) - f->first;
    f->lobe = (size_t)ceil(LOBE * lines / bin_hz);
    f->around = (size_t)ceil(AROUND * lines / bin_hz);
    for (int k = 0; k < 2; k++)
        f->lags[k] = (size_t)fmin(cfg->rate_hz / apart_hz[k], (double)cfg->n_samples / 2);
    if (!allocate(f)) {
        tone_finder_destroy(f);
        return -ENOMEM;
    }
    for (size_t c = 0; c < f->n_used; c++)
        f->used[c] = c * cfg->n_channels / f->n_used;
    make_window(f);
    *out = f;
    return 0;
}

void tone_finder_destroy(struct tone_finder *f)
{
    if (!f)
        return;
    free(f->used);
    free(f->window);
    free(f->window_lags);
    free(f->known);
    free(f->before);
    for (int k = 0; k < KINDS; k++) {
        free(f->power[k]);
        free(f->inverse[k]);
    }
    free(f->mean);
    free(f->near);
    free(f->correlation);
    free(f->hits);
    free(f->is_line);
    free(f->now);
    if (f->forward)
        fftwf_destroy_plan(f->forward);
    fftwf_free(f->in);
    fftwf_free(f->out);
    free(f);
}

/* -- spectra ---------------------------------------------------------------------------
 */

/* Adds powers of a ping's channel as parts of their sum, one over which is returned: a
 * ping that is louder than others counts no more than they. */
static double add_powers(size_t n, const float complex *x, const float complex *before,
                         double *out)
{
    double all = 0;

    for (size_t b = 0; b < n; b++) {
        float complex d = before ? x[b] - before[b] : x[b];
        all += crealf(d) * crealf(d) + cimagf(d) * cimagf(d);
    }
    for (size_t b = 0; b < n && all > 0; b++) {
        float complex d = before ? x[b] - before[b] : x[b];
        out[b] += (crealf(d) * crealf(d) + cimagf(d) * cimagf(d)) / all;
    }
    return all > 0 ? 1 / all : 0;
}

static void add_channel(struct tone_finder *f, size_t speaker, size_t channel)
{
    size_t n = f->n_bins, at = channel * n;
    float complex *before = f->before + (speaker * f->n_used) * n + at;

    f->inverse[PINGS][channel] += add_powers(n, f->now, NULL, f->power[PINGS] + at);
    if (f->known[speaker])
        f->inverse[DIFFERENCES][channel] +=
            add_powers(n, f->now, before, f->power[DIFFERENCES] + at);
    memcpy(before, f->now, n * sizeof *before);
}

/* Two channels as real and imaginary part; the second may be the first once more. */
static void add_pair(struct tone_finder *f, size_t speaker, size_t one, size_t two,
                     const float *samples, size_t stride)
{
    const float *x = samples + f->used[one] * stride;
    const float *y = samples + f->used[two] * stride;
    const float complex *z = (const float complex *)f->out;

    memset(f->in, 0, 2 * f->n_fft * sizeof *f->in);
    for (size_t i = 0; i < f->cfg.n_samples; i++) {
        f->in[2 * i] = f->window[i] * x[i];
        f->in[2 * i + 1] = f->window[i] * y[i];
    }
    fftwf_execute(f->forward);
    for (size_t k = 0; k < 2; k++) {
        size_t channel = k ? two : one;
        if (k && one == two)
            return;
        for (size_t b = 0; b < f->n_bins; b++) {
            float complex p = z[f->first + b];
            float complex q = conjf(z[(f->n_fft - f->first - b) % f->n_fft]);
            f->now[b] = k ? -0.5f * I * (p - q) : 0.5f * (p + q);
        }
        add_channel(f, speaker, channel);
    }
}

/* -- lines -----------------------------------------------------------------------------
 */

/* The median of what is around a bin, but for the line that may be there. */
static double floor_at(struct tone_finder *f, const double *power, size_t bin)
{
    size_t from = bin > f->around ? bin - f->around : 0, n = 0;
    size_t until = bin + f->around < f->n_bins ? bin + f->around + 1 : f->n_bins;

    for (size_t b = from; b < until; b++)
        if (b + f->lobe < bin || b > bin + f->lobe)
            f->near[n++] = power[b];
    return rank_median(f->near, n);
}

/* The bins that a line at one of them is in. */
static size_t from_of(const struct tone_finder *f, size_t bin)
{
    return bin > f->lobe ? bin - f->lobe : 0;
}

static size_t until_of(const struct tone_finder *f, size_t bin)
{
    return bin + f->lobe < f->n_bins ? bin + f->lobe + 1 : f->n_bins;
}

static bool is_peak(const struct tone_finder *f, size_t bin)
{
    for (size_t b = from_of(f, bin); b < until_of(f, bin); b++)
        if (f->mean[b] > f->mean[bin])
            return false;
    return f->mean[bin] > 0;
}

/* Peaks of the mean that are lines in half of the channels; the loudest's frequency.  How
 * many. */
static size_t find_lines(struct tone_finder *f, int kind)
{
    size_t n_heard = 0, n = 0;

    memset(f->hits, 0, f->n_bins * sizeof *f->hits);
    memset(f->mean, 0, f->n_bins * sizeof *f->mean);
    for (size_t c = 0; c < f->n_used; c++) {
        n_heard += f->inverse[kind][c] > 0;
        for (size_t b = 0; b < f->n_bins; b++)
            f->mean[b] += f->power[kind][c * f->n_bins + b];
    }
    for (size_t b = 0; b < f->n_bins; b++) {
        if (!is_peak(f, b) || f->mean[b] < TONE_FINDER_RATIO * floor_at(f, f->mean, b))
            continue;
        for (size_t c = 0; c < f->n_used; c++) {
            const double *power = f->power[kind] + c * f->n_bins;
            f->hits[b] += power[b] > TONE_FINDER_RATIO * floor_at(f, power, b);
        }
        f->is_line[b] = f->is_line[b] || 2 * f->hits[b] >= n_heard;
        n += 2 * f->hits[b] >= n_heard;
    }
    return n;
}

/* By a parabola through the logarithms of a peak of the mean. */
static double peak_hz(const struct tone_finder *f, size_t bin)
{
    double at = (double)(f->first + bin);

    if (bin && bin + 1 < f->n_bins) {
        double a = log(f->mean[bin - 1]), b = log(f->mean[bin]),
               c = log(f->mean[bin + 1]);
        double bend = a - 2 * b + c;
        at += bend < 0 ? 0.5 * (a - c) / bend : 0;
    }
    return at * f->cfg.rate_hz / (double)f->n_fft;
}

/* Mean square of what parts of a channel's pings stand for; a difference has twice as
 * much, in the mean over all phases. */
static double mean_square(const struct tone_finder *f, int kind, size_t channel,
                          double parts)
{
    double power = parts / f->inverse[kind][channel];

    return (kind == PINGS ? 2 : 1) * power / ((double)f->n_fft * f->window_power);
}

static double line_rms(struct tone_finder *f, int kind, size_t bin)
{
    double squares[TONE_FINDER_CHANNELS];
    size_t n = 0;

    for (size_t c = 0; c < f->n_used; c++) {
        const double *p = f->power[kind] + c * f->n_bins;
        double floor = floor_at(f, p, bin), sum = 0;
        for (size_t b = from_of(f, bin); b < until_of(f, bin); b++)
            sum += p[b] - floor;
        if (f->inverse[kind][c] > 0)
            squares[n++] = mean_square(f, kind, c, fmax(sum, 0));
    }
    return sqrt(rank_median(squares, n));
}

/* What is there of a few lines, in pings or in their differences. */
static void name_lines(struct tone_finder *f, int kind, size_t n, struct tone_found *out)
{
    *out = (struct tone_found){TONE_LINES, 0, -1, n};
    for (size_t b = 0; b < f->n_bins; b++) {
        double rms = f->is_line[b] ? line_rms(f, kind, b) : -1;
        if (rms > out->rms)
            *out = (struct tone_found){TONE_LINES, peak_hz(f, b), rms, n};
    }
}

/* The mean without its lines. */
static void take_out_lines(struct tone_finder *f)
{
    for (size_t bin = 0; bin < f->n_bins; bin++) {
        double floor = f->is_line[bin] ? floor_at(f, f->mean, bin) : 0;
        for (size_t b = from_of(f, bin); f->is_line[bin] && b < until_of(f, bin); b++)
            f->mean[b] = fmin(f->mean[b], floor);
    }
}

/* -- combs -----------------------------------------------------------------------------
 */

/* How much of the mean comes again after each time (Wiener 1930, Khinchin 1934): the
 * envelope, that of the window divided out. */
static void correlate(struct tone_finder *f)
{
    float complex *x = (float complex *)f->in;
    const float complex *y = (const float complex *)f->out;
    double all = 0;

    memset(f->in, 0, 2 * f->n_fft * sizeof *f->in);
    for (size_t b = 0; b < f->n_bins; b++)
        all += f->mean[b];
    for (size_t b = 0; b < f->n_bins && all > 0; b++)
        x[f->first + b] = (float)(f->mean[b] / all);
    fftwf_execute(f->forward);
    for (size_t lag = 0; lag < f->lags[1] + 2; lag++)
        f->correlation[lag] = cabsf(y[lag]) / f->window_lags[lag];
}

/* Of the mean; false: there is none.  What comes at other times before and now is in the
 * differences twice, the second time with its sign turned, as a comb is not.  level: what
 * part of the power it has. */
static bool find_comb(struct tone_finder *f, double *apart_hz, double *level)
{
    size_t n = f->lags[1] + 1 - f->lags[0], at = f->lags[0];

    correlate(f);
    memcpy(f->near, f->correlation + f->lags[0], n * sizeof *f->near);
    double middle = rank_median(f->near, n), most = 0;
    for (size_t lag = f->lags[0]; lag <= f->lags[1]; lag++)
        most = fmax(most, f->correlation[lag]);
    if (!(most > TONE_FINDER_COMB && most > SHARP * middle))
        return false;
    while (f->correlation[at] < SAME * most)
        at++;
    while (at < f->lags[1] && f->correlation[at + 1] > f->correlation[at])
        at++;
    if (crealf(((const float complex *)f->out)[at]) < 0)
        return false;
    double a = f->correlation[at - 1], b = f->correlation[at], c = f->correlation[at + 1];
    double bend = a - 2 * b + c;
    *apart_hz = f->cfg.rate_hz / ((double)at + (bend < 0 ? 0.5 * (a - c) / bend : 0));
    *level = fmin(most, 1);
    return true;
}

static double band_rms(struct tone_finder *f)
{
    double squares[TONE_FINDER_CHANNELS];
    size_t n = 0;

    for (size_t c = 0; c < f->n_used; c++) {
        double sum = 0;
        for (size_t b = 0; b < f->n_bins; b++)
            sum += f->power[DIFFERENCES][c * f->n_bins + b];
        if (f->inverse[DIFFERENCES][c] > 0)
            squares[n++] = mean_square(f, DIFFERENCES, c, sum);
    }
    return sqrt(rank_median(squares, n));
}

/* -- blocks ----------------------------------------------------------------------------
 */

/* A line whose phase is the same after a round shows in the pings alone; what is faint
 * beside our own sound, in their differences. */
static void judge(struct tone_finder *f, struct tone_found *out)
{
    double apart_hz, level;

    *out = (struct tone_found){.kind = TONE_NONE};
    memset(f->is_line, 0, f->n_bins * sizeof *f->is_line);
    size_t n = find_lines(f, PINGS);
    if (n && n <= TONE_FINDER_LINES)
        name_lines(f, PINGS, n, out);
    if (f->n_differences < TONE_FINDER_BLOCK)
        return;
    memset(f->is_line, 0, f->n_bins * sizeof *f->is_line);
    n = find_lines(f, DIFFERENCES);
    if (n && n <= TONE_FINDER_LINES) {
        if (out->kind == TONE_NONE)
            name_lines(f, DIFFERENCES, n, out);
        take_out_lines(f);
    }
    if (find_comb(f, &apart_hz, &level) && sqrt(level) * band_rms(f) > out->rms)
        *out = (struct tone_found){TONE_COMB, apart_hz, sqrt(level) * band_rms(f), 0};
}

/* A frequency may wander. */
static bool is_same(const struct tone_found *a, const struct tone_found *b)
{
    return a->kind == b->kind &&
           fabs(a->frequency_hz - b->frequency_hz) < WANDERS * a->frequency_hz;
}

static void end_block(struct tone_finder *f)
{
    struct tone_found now;

    judge(f, &now);
    f->n_with = now.kind == TONE_NONE ? 0 : is_same(&now, &f->last) ? f->n_with + 1 : 1;
    f->last = now;
    f->n_without = now.kind == TONE_NONE ? f->n_without + 1 : 0;
    if (f->n_with >= TONE_FINDER_SOME || f->n_without >= TONE_FINDER_FEW)
        f->found = now;
    for (int k = 0; k < KINDS; k++) {
        memset(f->power[k], 0, f->n_used * f->n_bins * sizeof *f->power[k]);
        memset(f->inverse[k], 0, f->n_used * sizeof *f->inverse[k]);
    }
    f->n_pings = f->n_differences = 0;
}

void tone_finder_ping(struct tone_finder *f, size_t speaker, const float *samples,
                      size_t stride)
{
    for (size_t c = 0; c < f->n_used; c += 2)
        add_pair(f, speaker, c, c + 1 < f->n_used ? c + 1 : c, samples, stride);
    f->n_differences += f->known[speaker];
    f->known[speaker] = true;
    if (++f->n_pings == TONE_FINDER_BLOCK)
        end_block(f);
}

const struct tone_found *tone_finder_found(const struct tone_finder *f)
{
    return &f->found;
}

void tone_found_text(const struct tone_found *t, char *text, size_t size)
{
    *text = '\0';
    if (t->kind == TONE_LINES && t->n_lines > 1)
        snprintf(text, size, "%zu steady tones, the loudest %.0f Hz", t->n_lines,
                 t->frequency_hz);
    else if (t->kind == TONE_LINES)
        snprintf(text, size, "a steady tone of %.0f Hz", t->frequency_hz);
    else if (t->kind == TONE_COMB)
        snprintf(text, size, "a comb of tones %.1f Hz apart", t->frequency_hz);
}
