/* SPDX-License-Identifier: MIT */
/* Back-projection of 8192 traces of noise: how many pairs of trace and voxel a second,
 * for a scan (stage steps of whole voxels), the same array on a grid that does not fit
 * it, and pings with places of their own; without and with the coherence factor.
 *
 *     bench_backprojection [scan|any|pings]...        default: all */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "recon/imaging/imager.h"
#include "recon/imaging/imager_options.h"

enum { POSITIONS = 32, ELEMENTS = 16, MAX_THREADS = 2, MAX_RUNS = 40 };
#define ENOUGH_S 1.0 /* of one case */

enum { TRACES = POSITIONS * ELEMENTS * ELEMENTS };

struct work {
    const char *name;
    double step_x_m;
    size_t n[3];
};

static const struct work works[] = {
    {"scan", 1.0 / 31.0 / 3.0, {97, 24, 8}},
    {"any", 0.011, {97, 12, 4}},
    {"pings", 0.011, {97, 12, 2}},
};

struct bench {
    double speakers[ELEMENTS][3], microphones[ELEMENTS][3], positions[TRACES];
    double pings[TRACES][2][3];
    struct trace_format format;
    float complex *traces; /* [TRACES][format.n_samples] */
};

static void lay_out(struct bench *b)
{
    for (int e = 0; e < ELEMENTS; e++) {
        b->speakers[e][1] = b->microphones[e][1] = e / 15.0;
        b->microphones[e][0] = 0.08;
    }
    for (int k = 0; k < POSITIONS; k++)
        b->positions[k] = k / 31.0;
    for (int t = 0; t < TRACES; t++) {
        double x = b->positions[t / (ELEMENTS * ELEMENTS)];
        memcpy(b->pings[t][0], b->speakers[t / ELEMENTS % ELEMENTS], 3 * sizeof(double));
        memcpy(b->pings[t][1], b->microphones[t % ELEMENTS], 3 * sizeof(double));
        b->pings[t][0][0] += x;
        b->pings[t][1][0] += x;
    }
    b->format = (struct trace_format){0.0105, 36000.0, 11000.0, 320};
}

static bool fill(struct bench *b)
{
    size_t n = TRACES * b->format.n_samples * 2;
    float *x = malloc(n * sizeof *x);
    uint32_t seed = 1;
    b->traces = (float complex *)x;
    for (size_t i = 0; x && i < n; i++) {
        seed = seed * 1664525u + 1013904223u;
        x[i] = (float)(int32_t)seed * 0x1p-31f;
    }
    return x;
}

static double clock_s(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void add_all(const struct bench *b, struct imager *im, size_t n_pings)
{
    size_t per_ping = TRACES / n_pings * b->format.n_samples;
    size_t n_s = n_pings == TRACES ? 1 : ELEMENTS;
    for (size_t p = 0; p < n_pings; p++)
        imager_add(im, p / n_s, p % n_s, b->traces + p * per_ping, NULL);
}

static int run(struct bench *b, const struct work *w, size_t threads, double coherence)
{
    bool pings = strcmp(w->name, "pings") == 0;
    struct imager_options options;
    imager_options_default(&options);
    options.coherence = coherence;
    struct geometry g = {.sound_speed_m_s = 340.0,
                         .n_speakers = pings ? 1 : ELEMENTS,
                         .n_microphones = pings ? 1 : ELEMENTS,
                         .n_positions = pings ? TRACES : POSITIONS,
                         .speakers_m = (const double(*)[3])b->speakers,
                         .microphones_m = (const double(*)[3])b->microphones,
                         .stage_axis = {1.0, 0.0, 0.0},
                         .stage_positions_m = b->positions,
                         .pings_m = pings ? (const double(*)[2][3])b->pings : NULL};
    struct imager_config cfg = {.method = "backprojection",
                                .geometry = &g,
                                .format = b->format,
                                .band_hz = {2000.0, 20000.0},
                                .gate_m = {0.3, 4.0},
                                .options = &options};
    cfg.grid = (struct grid){.n = {w->n[0], w->n[1], w->n[2]},
                             .origin_m = {0.0, 0.0, 2.2},
                             .step_m = {w->step_x_m, 0.01, 0.005}};
    float *image = malloc(grid_size(&cfg.grid) * sizeof *image);
    struct imager *im = NULL;
    int err = image ? pool_create(&cfg.pool, threads) : -1;
    if (!err)
        err = imager_create(&im, &cfg, NULL);
    double wall = 1e9, cpu = 1e9, first = 0.0, all = 0.0;
    for (int r = 0; !err && r < MAX_RUNS && all < ENOUGH_S; r++) {
        if (r == 0)
            add_all(b, im, TRACES / (pings ? 1 : ELEMENTS));
        double took = -clock_s(CLOCK_MONOTONIC),
               used = -clock_s(CLOCK_PROCESS_CPUTIME_ID);
        imager_image(im, image);
        took += clock_s(CLOCK_MONOTONIC);
        used += clock_s(CLOCK_PROCESS_CPUTIME_ID);
        all += took;
        first = r == 0 ? took : first;
        wall = took < wall ? took : wall;
        cpu = used < cpu ? used : cpu;
    }
    double pairs = (double)TRACES * (double)grid_size(&cfg.grid) * 1e-9;
    if (!err)
        printf(
            "%-5s coherence %.0f  %zu thread%s  %5.2f G pairs/s (%.3f s, the first %.3f)"
            "  %5.2f G a CPU second\n",
            w->name, coherence, threads, threads == 1 ? " " : "s", pairs / wall, wall,
            first, pairs / cpu);
    fflush(stdout);
    imager_destroy(im);
    pool_destroy(cfg.pool);
    free(image);
    return err;
}

static bool wanted(const char *name, int argc, char **argv)
{
    for (int i = 1; i < argc; i++)
        if (strcmp(argv[i], name) == 0)
            return true;
    return argc < 2;
}

int main(int argc, char **argv)
{
    static struct bench b;
    int err = 0;
    lay_out(&b);
    if (!fill(&b)) {
        fprintf(stderr, "bench_backprojection: out of memory\n");
        return 1;
    }
    for (size_t w = 0; w < sizeof works / sizeof *works; w++)
        for (int coherence = 0; coherence <= 1; coherence++)
            for (size_t threads = 1; !err && threads <= MAX_THREADS; threads++)
                if (wanted(works[w].name, argc, argv))
                    err = run(&b, &works[w], threads, coherence);
    free(b.traces);
    if (err)
        fprintf(stderr, "bench_backprojection: error %d\n", err);
    return err ? 1 : 0;
}
