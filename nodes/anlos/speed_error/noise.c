/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/speed_error/noise.h"

#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/random.h"
#include "nodes/rt/export.h"
#include "nodes/rt/stop.h"
#include "recon/detection/peak.h"
#include "recon/frontend/compressor.h"

/* Adds (x - from) / |x - from| / c to the gradient of the delay. */
static void add_gradient(double g[3], const double x[3], const double from[3], double c)
{
    double d[3], r = 0.0;
    for (int a = 0; a < 3; a++) {
        d[a] = x[a] - from[a];
        r += d[a] * d[a];
    }
    for (int a = 0; a < 3; a++)
        g[a] += d[a] / (sqrt(r) * c);
}

/* Diagonal of the inverse of a symmetric positive definite matrix. */
static int invert_diagonal(const double m[3][3], double out[3])
{
    double det = 0.0, minor[3];
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3, c = (a + 2) % 3;
        minor[a] = m[b][b] * m[c][c] - m[b][c] * m[c][b];
        det += m[0][a] * (m[1][(a + 1) % 3] * m[2][(a + 2) % 3] -
                          m[1][(a + 2) % 3] * m[2][(a + 1) % 3]);
    }
    double scale = m[0][0] * m[1][1] * m[2][2];
    if (!(det > 1e-12 * scale))
        return -EDOM;
    for (int a = 0; a < 3; a++)
        out[a] = minor[a] / det;
    return 0;
}

int bench_bound(struct bench_bound *out, const struct geometry *g, const double at_m[3],
                const double band_hz[2], bool phase_known, const double *snr)
{
    double f0 = band_hz[0], f1 = band_hz[1], middle = 0.5 * (f0 + f1);
    double square = (f0 * f0 + f0 * f1 + f1 * f1) / 3.0;
    double j[3][3] = {{0}}, b[3] = {0}, weight = 0.0, variance[3];
    size_t n_m = g->n_microphones, pairs = g->n_speakers * n_m;
    for (size_t p = 0; p < pairs * g->n_positions; p++) {
        double s[3], m[3], d[3] = {0}, w = snr[p] * 4.0 * M_PI * M_PI;
        geometry_speaker(g, p / pairs, p % pairs / n_m, s);
        geometry_microphone(g, p / pairs, p % pairs / n_m, p % n_m, m);
        add_gradient(d, at_m, s, g->sound_speed_m_s);
        add_gradient(d, at_m, m, g->sound_speed_m_s);
        weight += w;
        for (int a = 0; a < 3; a++) {
            b[a] += w * middle * d[a];
            for (int c = 0; c < 3; c++)
                j[a][c] += w * square * d[a] * d[c];
        }
    }
    for (int a = 0; a < 3 && !phase_known; a++)
        for (int c = 0; c < 3; c++)
            j[a][c] -= b[a] * b[c] / weight;
    if (invert_diagonal((const double(*)[3])j, variance))
        return -EDOM;
    out->lateral_m = sqrt(variance[0] + variance[1]);
    out->depth_m = sqrt(variance[2]);
    return 0;
}

struct bench_trials {
    const struct bench_scene *scene;
    struct survey survey;
    struct processing processing;
    struct pool *pool;
    enum window window;
    size_t threads, n_methods, n; /* n: samples of a trace */
    struct imager *imagers[BENCH_TRIAL_METHODS];
    struct compressor **compressors; /* [threads] */
    float **samples;                 /* [threads][n_microphones][frames] */
    float complex **mixed;           /* [threads][n_microphones][n] */
    float complex *echo, *noise;     /* [n_positions][n_speakers][n_microphones][n] */
    float *intensity;
};

struct job { /* for the pool */
    struct bench_trials *t;
    uint64_t seed;
    struct imager *imager;
    float signal, noise;
};

static void compress(struct bench_trials *t, float complex *out, size_t position,
                     size_t thread, const float *samples)
{
    const struct survey *s = &t->survey;
    for (size_t j = 0; j < s->n_speakers; j++)
        compressor_execute(
            t->compressors[thread], survey_is_down(s, j),
            samples + survey_slot_of(s, j) * s->slot_samples, t->scene->frames,
            out + (position * s->n_speakers + j) * s->n_microphones * t->n);
}

static void compress_echo(void *ctx, size_t position, size_t thread)
{
    struct bench_trials *t = ((struct job *)ctx)->t;
    size_t size = t->survey.n_microphones * t->scene->frames;
    compress(t, t->echo, position, thread, t->scene->scene + position * size);
}

static void compress_noise(void *ctx, size_t position, size_t thread)
{
    const struct job *job = ctx;
    struct bench_trials *t = job->t;
    size_t size = t->survey.n_microphones * t->scene->frames;
    uint64_t words[2] = {job->seed, position};
    struct random random;
    random_seed(&random, words, 2);
    memset(t->samples[thread], 0, size * sizeof(float));
    random_add_noise(&random, t->samples[thread], size, 1.0f);
    compress(t, t->noise, position, thread, t->samples[thread]);
}

static void mix_position(void *ctx, size_t position, size_t thread)
{
    const struct job *job = ctx;
    struct bench_trials *t = job->t;
    size_t size = t->survey.n_microphones * t->n;
    for (size_t j = 0; j < t->survey.n_speakers; j++) {
        size_t at = (position * t->survey.n_speakers + j) * size;
        for (size_t i = 0; i < size; i++)
            t->mixed[thread][i] = job->signal * t->echo[at + i] +
                                  job->noise * t->noise[at + i];
        imager_add(job->imager, position, j, t->mixed[thread], NULL);
    }
}

static int plan_thread(struct bench_trials *t, size_t thread, struct trace_format *format,
                       struct error *why)
{
    int err = compressor_create(&t->compressors[thread], &t->processing, &t->survey,
                                COMPRESSION_MATCHED_FILTER, t->window, why);
    if (err)
        return err;
    compressor_format(t->compressors[thread], format);
    t->samples[thread] =
        malloc(t->survey.n_microphones * t->scene->frames * sizeof(float));
    t->mixed[thread] =
        malloc(t->survey.n_microphones * format->n_samples * sizeof(float complex));
    return t->samples[thread] && t->mixed[thread] ? 0 : -ENOMEM;
}

static int plan(struct bench_trials *t, const char *methods, struct error *why)
{
    struct trace_format format;
    int err = processing_plan(&t->processing, &t->survey, why);
    size_t last = survey_slot_of(&t->survey, t->survey.n_speakers - 1) *
                  t->survey.slot_samples;
    if (!err && last + t->processing.ping_samples > t->scene->frames)
        err = error_say(why, -EINVAL, "the last ping ends after the recording");
    for (size_t i = 0; !err && i < t->threads; i++)
        err = plan_thread(t, i, &format, why);
    for (const char *m = methods; !err && *m && t->n_methods < BENCH_TRIAL_METHODS;
         m += strlen(m) + 1, t->n_methods++)
        err = processing_imager(&t->imagers[t->n_methods], &t->processing, m, &format,
                                t->pool, why);
    if (err)
        return err;
    t->n = format.n_samples;
    size_t traces = t->survey.n_positions * t->survey.n_speakers *
                    t->survey.n_microphones;
    t->echo = malloc(traces * t->n * sizeof *t->echo);
    t->noise = malloc(traces * t->n * sizeof *t->noise);
    t->intensity = malloc(grid_size(&t->processing.grid) * sizeof *t->intensity);
    return t->echo && t->noise && t->intensity ? 0 : -ENOMEM;
}

int bench_trials_create(struct bench_trials **out, const struct bench_scene *scene,
                        const double limits[3][3], const char *methods,
                        enum window window, size_t threads, struct error *why)
{
    struct bench_trials *t = calloc(1, sizeof *t);
    if (!t)
        return error_say(why, -ENOMEM, "out of memory");
    t->scene = scene;
    t->window = window;
    t->threads = threads;
    t->compressors = calloc(threads, sizeof(void *));
    t->samples = calloc(threads, sizeof(void *));
    t->mixed = calloc(threads, sizeof(void *));
    int err = t->compressors && t->samples && t->mixed
                  ? survey_copy(&t->survey, &scene->survey)
                  : -ENOMEM;
    if (!err)
        err = pool_create(&t->pool, threads);
    if (!err) {
        t->survey.has_gate = survey_overlaps(&t->survey); /* without one there are none */
        t->survey.has_volume = true;
        memcpy(t->survey.volume_m, limits, sizeof t->survey.volume_m);
        err = plan(t, methods, why);
    }
    if (err == -ENOMEM)
        error_say(why, err, "out of memory");
    if (err) {
        bench_trials_destroy(t);
        return err;
    }
    pool_run(t->pool, t->survey.n_positions, compress_echo, &(struct job){.t = t});
    *out = t;
    return 0;
}

void bench_trials_noise(struct bench_trials *t, uint64_t seed)
{
    struct job job = {.t = t, .seed = seed};
    pool_run(t->pool, t->survey.n_positions, compress_noise, &job);
}

const float *bench_trials_image(struct bench_trials *t, size_t m, double signal,
                                double noise)
{
    struct job job = {
        .t = t, .imager = t->imagers[m], .signal = (float)signal, .noise = (float)noise};
    imager_reset(t->imagers[m]);
    pool_run(t->pool, t->survey.n_positions, mix_position, &job);
    imager_image(t->imagers[m], t->intensity);
    return t->intensity;
}

const struct processing *bench_trials_processing(const struct bench_trials *t)
{
    return &t->processing;
}

double bench_trials_power(const struct bench_trials *t)
{
    const struct survey *s = &t->survey;
    size_t slots = survey_slots(s, s->n_speakers) * s->slot_samples;
    size_t channels = s->n_positions * s->n_microphones;
    double sum = 0.0;
    for (size_t i = 0; i < channels; i++) {
        const float *x = t->scene->scene + i * t->scene->frames;
        for (size_t q = 0; q < slots; q++)
            sum += (double)x[q] * (double)x[q];
    }
    return sum / (double)(channels * slots);
}

/* Energy of the echo of one pair: of the samples that its chirp lasts. */
static double echo_energy(const struct bench_trials *t, size_t position, size_t speaker,
                          size_t microphone)
{
    const struct survey *s = &t->survey;
    const double *p = t->scene->truth.points_m[0];
    double a[3], b[3], way_m = 0.0, sum = 0.0;
    geometry_speaker(&t->processing.geometry, position, speaker, a);
    geometry_microphone(&t->processing.geometry, position, speaker, microphone, b);
    way_m = hypot(hypot(p[0] - a[0], p[1] - a[1]), p[2] - a[2]) +
            hypot(hypot(p[0] - b[0], p[1] - b[1]), p[2] - b[2]);
    size_t first =
        survey_slot_of(s, speaker) * s->slot_samples +
        (size_t)rint(way_m / s->sound_speed_m_s * s->sample_rate_hz + s->latency_samples);
    size_t last = first + (size_t)rint(s->chirp_duration_s * s->sample_rate_hz);
    const float *x = t->scene->scene +
                     (position * s->n_microphones + microphone) * t->scene->frames;
    for (size_t i = first; i < last && i < t->scene->frames; i++)
        sum += (double)x[i] * (double)x[i];
    return sum;
}

/* The bound of the point's place, at a raw signal to noise of 0 dB: it falls with the
 * root of the signal to noise.  A background with as much noise is taken away.  0, -EDOM.
 */
static int bench_trials_bound(const struct bench_trials *t, bool phase_known,
                              struct bench_bound *out)
{
    const struct survey *s = &t->survey;
    size_t n = s->n_positions * s->n_speakers * s->n_microphones;
    double *snr = malloc(n * sizeof *snr);
    if (!snr)
        return -ENOMEM;
    double variance = 2.0 * bench_trials_power(t); /* of scene and background, at 0 dB */
    for (size_t p = 0; p < n; p++)
        snr[p] = echo_energy(t, p / s->n_microphones / s->n_speakers,
                             p / s->n_microphones % s->n_speakers, p % s->n_microphones) /
                 variance;
    int err = bench_bound(out, &t->processing.geometry, t->scene->truth.points_m[0],
                          t->processing.band_hz, phase_known, snr);
    free(snr);
    return err;
}

void bench_trials_destroy(struct bench_trials *t)
{
    if (!t)
        return;
    for (size_t m = 0; m < BENCH_TRIAL_METHODS; m++)
        imager_destroy(t->imagers[m]);
    for (size_t i = 0; i < t->threads; i++) {
        if (t->compressors)
            compressor_destroy(t->compressors[i]);
        if (t->samples)
            free(t->samples[i]);
        if (t->mixed)
            free(t->mixed[i]);
    }
    free(t->compressors);
    free(t->samples);
    free(t->mixed);
    free(t->echo);
    free(t->noise);
    free(t->intensity);
    pool_destroy(t->pool);
    survey_clear(&t->survey);
    free(t);
}

/* -- position error of one point over raw signal to noise -------------------------------
 */

/* The point is looked for in a box: farther off an error is no error but a miss. */
static const double box_m[3] = {0.10, 0.10, 0.04};
static const double steps_m[3] = {0.008, 0.008, 0.003};

static const double levels_db[] = {-60, -55, -50, -45, -40, -35,
                                   -30, -20, -10, 0,   10,  20};

/* The others are not about where one point is in noise, or would take hours. */
static const char able[] = "fast\0backprojection\0confocal\0lct\0paper\0incoherent\0";

static bool is_able(const char *method)
{
    for (const char *m = able; *m; m += strlen(m) + 1)
        if (!strcmp(m, method))
            return true;
    return false;
}

static void choose(struct bench_noise *out, const char *methods)
{
    size_t used = 0;
    for (const char *m = methods; *m; m += strlen(m) + 1) {
        size_t n = strlen(m) + 1;
        if (!is_able(m) || used + n >= sizeof out->methods)
            continue;
        memcpy(out->methods + used, m, n);
        used += n;
        out->n_methods++;
    }
}

static size_t brightest(const float *v, size_t n)
{
    size_t best = 0;
    for (size_t i = 1; i < n; i++)
        best = v[i] > v[best] ? i : best;
    return best;
}

/* Adds the squares of one image's errors. */
static void add_errors(struct bench_noise *b, size_t method, size_t level,
                       const struct grid *grid, const float *image, const double at_m[3])
{
    struct peak_fit fit;
    peak_fit(grid, image, brightest(image, grid_size(grid)), 1.0, PEAK_ZERO_EMPTY, NULL,
             &fit);
    double x = fit.position_m[0] - at_m[0], y = fit.position_m[1] - at_m[1];
    double z = fit.position_m[2] - at_m[2];
    b->lateral_m[method][level] += x * x + y * y;
    b->depth_m[method][level] += z * z;
}

static int find_bounds(struct bench_noise *b, const struct bench_trials *t)
{
    struct bench_bound known, unknown;
    int err = bench_trials_bound(t, true, &known);
    if (!err)
        err = bench_trials_bound(t, false, &unknown);
    for (size_t i = 0; !err && i < b->n_levels; i++) {
        double scale = pow(10.0, -b->snr_db[i] / 20.0);
        b->known[i] =
            (struct bench_bound){scale * known.lateral_m, scale * known.depth_m};
        b->unknown[i] =
            (struct bench_bound){scale * unknown.lateral_m, scale * unknown.depth_m};
    }
    return err;
}

static int run_seeds(struct bench_noise *b, struct bench_trials *t, const double at_m[3],
                     size_t n_seeds, struct error *why)
{
    const struct grid *grid = &bench_trials_processing(t)->grid;
    double rms = sqrt(2.0 * bench_trials_power(t)); /* of the difference, at 0 dB */
    while (b->n_seeds < n_seeds && !interrupt_requested()) {
        bench_trials_noise(t, b->n_seeds);
        for (size_t m = 0; m < b->n_methods; m++)
            for (size_t i = 0; i < b->n_levels && !interrupt_requested(); i++)
                add_errors(
                    b, m, i, grid,
                    bench_trials_image(t, m, 1.0, rms * pow(10.0, -b->snr_db[i] / 20.0)),
                    at_m);
        b->n_seeds++;
    }
    for (size_t m = 0; m < b->n_methods; m++)
        for (size_t i = 0; i < b->n_levels; i++) {
            b->lateral_m[m][i] = sqrt(b->lateral_m[m][i] / (double)b->n_seeds);
            b->depth_m[m][i] = sqrt(b->depth_m[m][i] / (double)b->n_seeds);
        }
    return interrupt_requested() ? error_say(why, -EINTR, "interrupted") : 0;
}

int bench_noise_run(struct bench_noise *out, const struct bench_scene *point,
                    const char *methods, size_t n_seeds, size_t threads,
                    struct error *why)
{
    const double *at_m = point->truth.points_m[0];
    struct bench_trials *t;
    double limits[3][3];
    *out = (struct bench_noise){.n_levels = sizeof levels_db / sizeof *levels_db};
    memcpy(out->snr_db, levels_db, sizeof levels_db);
    choose(out, methods);
    for (int a = 0; a < 3; a++) { /* not with the point on a voxel */
        limits[a][0] = at_m[a] - box_m[a] - 0.3 * steps_m[a];
        limits[a][1] = at_m[a] + box_m[a];
        limits[a][2] = steps_m[a];
    }
    int err = bench_trials_create(&t, point, (const double(*)[3])limits, out->methods,
                                  WINDOW_HANN, threads, why);
    if (err)
        return err;
    err = find_bounds(out, t);
    if (err)
        error_say(why, err, "bound: %s", strerror(-err));
    else
        err = run_seeds(out, t, at_m, n_seeds, why);
    bench_trials_destroy(t);
    return err;
}

int bench_noise_write(const struct bench_noise *b, const char *folder, struct error *why)
{
    struct export_file e;
    int err = export_file_open(&e, folder, "noise.csv", why);
    if (err)
        return err;
    fputs("method,snr_db,seeds,lateral_cm,depth_cm,bound_lateral_cm,bound_depth_cm,"
          "bound_depth_phase_known_cm\n",
          e.f);
    const char *m = b->methods;
    for (size_t i = 0; i < b->n_methods; i++, m += strlen(m) + 1)
        for (size_t k = 0; k < b->n_levels; k++)
            fprintf(e.f, "%s,%g,%zu,%.6g,%.6g,%.6g,%.6g,%.6g\n", m, b->snr_db[k],
                    b->n_seeds, 100.0 * b->lateral_m[i][k], 100.0 * b->depth_m[i][k],
                    100.0 * b->unknown[k].lateral_m, 100.0 * b->unknown[k].depth_m,
                    100.0 * b->known[k].depth_m);
    return export_file_commit(&e, why);
}
