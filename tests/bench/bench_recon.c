/* SPDX-License-Identifier: MIT */
/* A raw recording and its background in memory, 32 positions x 16 speakers x 16
 * microphones of noise, to a volume: what `anlos recon` does between reading and
 * detection.
 *
 *     bench_recon [METHOD...]        default: fast backprojection */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

#include "recon/frontend/compressor.h"
#include "recon/processing.h"

enum { POSITIONS = 32, SPEAKERS = 16, MICS = 16, SLOT = 3000, TAIL = 1500 };
enum { FRAMES = SPEAKERS * SLOT + TAIL, MAX_THREADS = 2, MAX_RUNS = 9 };

#define ENOUGH_S 10.0 /* of one method on one number of threads */

struct bench {
    struct survey survey;
    double speakers[SPEAKERS][3], microphones[MICS][3], positions[POSITIONS];
    struct processing processing;
    float *scene, *background; /* [POSITIONS][MICS][FRAMES] */
    struct pool *pool;
    struct imager *imager;
    struct compressor *compressors[MAX_THREADS];
    float *difference[MAX_THREADS];     /* [MICS][FRAMES] */
    float complex *traces[MAX_THREADS]; /* [MICS][n] */
    float *intensity;
};

static double clock_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void lay_out(struct bench *b)
{
    struct survey *s = &b->survey;
    static const double volume[3][3] = {
        {0.0, 1.08, 0.01}, {0.0, 1.0, 0.01}, {1.6, 3.2, 0.005}};
    for (int i = 0; i < SPEAKERS; i++) {
        b->speakers[i][1] = b->microphones[i][1] = i / 15.0;
        b->microphones[i][0] = 0.08;
    }
    for (int k = 0; k < POSITIONS; k++)
        b->positions[k] = k / 31.0;
    *s = (struct survey){.sound_speed_m_s = 340.0,
                         .temperature_c = NAN,
                         .sample_rate_hz = 48000.0,
                         .chirp_start_hz = 2000.0,
                         .chirp_stop_hz = 20000.0,
                         .chirp_duration_s = 0.0625,
                         .slot_samples = SLOT,
                         .n_speakers = SPEAKERS,
                         .n_microphones = MICS,
                         .n_positions = POSITIONS,
                         .speakers_m = b->speakers,
                         .microphones_m = b->microphones,
                         .stage_axis = {1.0, 0.0, 0.0},
                         .stage_positions_m = b->positions,
                         .has_volume = true};
    memcpy(s->volume_m, volume, sizeof volume);
}

static int fill(float **x, uint32_t seed)
{
    size_t n = (size_t)POSITIONS * MICS * FRAMES;
    *x = malloc(n * sizeof **x);
    if (!*x)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++) {
        seed = seed * 1664525u + 1013904223u;
        (*x)[i] = (float)(int32_t)seed * 0x1p-31f;
    }
    return 0;
}

static void process_position(void *ctx, size_t position, size_t thread)
{
    struct bench *b = ctx;
    size_t start = position * MICS * FRAMES;
    float *d = b->difference[thread];
    for (size_t i = 0; i < (size_t)MICS * FRAMES; i++)
        d[i] = b->scene[start + i] - b->background[start + i];
    for (size_t j = 0; j < SPEAKERS; j++) {
        compressor_execute(b->compressors[thread], false, d + j * SLOT, FRAMES,
                           b->traces[thread]);
        imager_add(b->imager, position, j, b->traces[thread], NULL);
    }
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static int plan(struct bench *b, const char *method, size_t threads, struct error *why)
{
    struct trace_format format;
    int err = pool_create(&b->pool, threads);
    for (size_t t = 0; !err && t < threads; t++) {
        err = compressor_create(&b->compressors[t], &b->processing, &b->survey,
                                COMPRESSION_MATCHED_FILTER, WINDOW_HANN, why);
        if (err)
            return err;
        compressor_format(b->compressors[t], &format);
        b->difference[t] = malloc((size_t)MICS * FRAMES * sizeof(float));
        b->traces[t] = malloc(MICS * format.n_samples * sizeof(float complex));
        if (!b->difference[t] || !b->traces[t])
            err = error_say(why, -ENOMEM, "out of memory");
    }
    return err ? err
               : processing_imager(&b->imager, &b->processing, method, &format, b->pool,
                                   why);
}

static void release(struct bench *b)
{
    imager_destroy(b->imager);
    b->imager = NULL;
    for (size_t t = 0; t < MAX_THREADS; t++) {
        compressor_destroy(b->compressors[t]);
        free(b->difference[t]);
        free(b->traces[t]);
        b->compressors[t] = NULL;
        b->difference[t] = NULL;
        b->traces[t] = NULL;
    }
    pool_destroy(b->pool);
    b->pool = NULL;
}

static int run(struct bench *b, const char *method, size_t threads, struct error *why)
{
    double total_s[MAX_RUNS], stack_s[MAX_RUNS], planned_s = clock_s(), spent_s = 0.0;
    size_t runs = 0;
    int err = plan(b, method, threads, why);
    planned_s = clock_s() - planned_s;
    for (; !err && runs < MAX_RUNS && spent_s < ENOUGH_S; runs++) {
        imager_reset(b->imager);
        double began_s = clock_s();
        pool_run(b->pool, POSITIONS, process_position, b);
        stack_s[runs] = clock_s() - began_s;
        imager_image(b->imager, b->intensity);
        total_s[runs] = clock_s() - began_s;
        spent_s += total_s[runs];
    }
    release(b);
    if (err)
        return err;
    qsort(total_s, runs, sizeof *total_s, compare);
    qsort(stack_s, runs, sizeof *stack_s, compare);
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    printf(
        "%-15s %zu thread%s  min %.4f  median %.4f s  (to the last ping %.4f, planning "
        "%.2f, %zu runs)  peak so far %ld MB\n",
        method, threads, threads == 1 ? " " : "s", total_s[0], total_s[runs / 2],
        stack_s[runs / 2], planned_s, runs, usage.ru_maxrss / 1024);
    fflush(stdout);
    return 0;
}

int main(int argc, char **argv)
{
    static struct bench b;
    static const char *const both[] = {"fast", "backprojection"};
    const char *const *methods = argc > 1 ? (const char *const *)argv + 1 : both;
    int n = argc > 1 ? argc - 1 : 2;
    struct error why = {0};

    lay_out(&b);
    int err = processing_plan(&b.processing, &b.survey, &why);
    b.processing.ping_samples = b.processing.echo_samples; /* as `anlos recon` does */
    if (!err && b.processing.ping_samples > SLOT + TAIL)
        err = error_say(&why, -EINVAL, "the ping needs %zu samples",
                        b.processing.ping_samples);
    if (!err) {
        b.intensity = malloc(grid_size(&b.processing.grid) * sizeof *b.intensity);
        if (!b.intensity || fill(&b.scene, 1) || fill(&b.background, 2))
            err = error_say(&why, -ENOMEM, "out of memory");
    }
    if (!err)
        printf("%d x %d x %d recordings of %d samples and background, %zu x %zu x %zu "
               "voxels\n",
               POSITIONS, SPEAKERS, MICS, SLOT, b.processing.grid.n[0],
               b.processing.grid.n[1], b.processing.grid.n[2]);
    for (int i = 0; !err && i < n; i++)
        for (size_t threads = 1; !err && threads <= MAX_THREADS; threads++)
            err = run(&b, methods[i], threads, &why);
    if (err)
        fprintf(stderr, "bench_recon: %s\n", why.text);
    free(b.intensity);
    free(b.scene);
    free(b.background);
    return err ? 1 : 0;
}
