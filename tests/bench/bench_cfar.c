/* SPDX-License-Identifier: MIT */
/* Does the false-alarm rate hold?  Coherent images of a line array, of noise alone and of
 * clutter (so many scatterers around that each voxel hears several), at set rates; what
 * part of the voxels is brighter than its threshold, and between what that lies with 95 %
 * confidence: bright voxels come in groups, so it is the seeds, new noise and clutter
 * each, that are counted as independent (Student's t).  Of a detector that knows no image
 * but the one it judges, and of one that has learnt from all before, from the 21st on.
 *
 *     bench_cfar [SEEDS]        default: 100, from 22 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#include "hal/room/room.h"
#include "recon/detection/detect.h"
#include "recon/frontend/compressor.h"
#include "recon/processing.h"

enum { KINDS = 2, RATES = 3, ELEMENTS = 16, SPEAKERS = 4, LEARNING = 20 };
enum { FIRST, LATER, STATES };

static const double rates[RATES] = {1e-2, 1e-3, 1e-4};
static const enum cfar_kind kinds[KINDS] = {CFAR_AVERAGING, CFAR_ORDERED};
static const char *const kind_names[KINDS] = {"averaging", "ordered"};
static const char *const state_names[STATES] = {"first", "later"};

static const struct {
    const char *name, *world;
} cases[] = {
    {"noise", "noise: {rms: 0.02}\n"},
    {"clutter 200", "clutter: {points: 200, scattering_length_m: 0.05, near_m: 0.5, "
                    "far_m: 5}\nnoise: {rms: 0.00001}\n"},
    {"clutter 2000", "clutter: {points: 2000, scattering_length_m: 0.03, near_m: 0.5, "
                     "far_m: 5}\nnoise: {rms: 0.00001}\n"},
    {"rough wall",
     "wall_sound: {reflectivity: 0.9, patches: 2000, scattering_length_m: 0.02, "
     "roughness_m: 0.02}\nnoise: {rms: 0.0001}\n"},
};

/* Of one kind, in one state. */
struct tally {
    double sum[RATES], squares[RATES]; /* of the seeds' rates */
    double shape, heavy, seconds, tested, seeds;
};

struct bench {
    char path[64];
    struct room *room;
    struct processing processing;
    float *intensity;
    struct tally tally[STATES][KINDS];
    struct cfar *later[KINDS][RATES];
};

static int write_scene(const struct bench *b, const char *world, unsigned seed)
{
    FILE *f = fopen(b->path, "w");

    if (!f)
        return -errno;
    fprintf(f,
            "temperature_c: 20\nsample_rate_hz: 48000\nslot_samples: 1500\n"
            "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.02}\n"
            "gate_m: [1.2, 4.2]\nvolume: {x_m: [-2, 2, 0.04], y_m: [0, 0, 0.1], "
            "z_m: [1.2, 4, 0.01]}\nwall: {normal: [0, 0, 1], distance_m: 1}\n"
            "seed: %u\n%sspeakers_m: [",
            seed, world);
    for (int j = 0; j < SPEAKERS; j++)
        fprintf(f, "%s[%g, 0, 0]", j ? ", " : "", 0.02 + 0.2 * j);
    fputs("]\nmicrophones_m: [", f);
    for (int m = 0; m < ELEMENTS; m++)
        fprintf(f, "%s[%g, 0, 0]", m ? ", " : "", m / 15.0);
    fputs("]\nobjects: [{name: none, kind: point, position_m: [0, 0, 0], "
          "scattering_length_m: 0.1}]\n",
          f);
    return fclose(f) ? -EIO : 0;
}

static int image(struct bench *b, struct error *why)
{
    static const uint32_t speakers[SPEAKERS] = {0, 1, 2, 3};
    const struct survey *s = room_survey(b->room);
    size_t frames = room_frames(b->room, SPEAKERS);
    struct compressor *compressor = NULL;
    struct imager *imager = NULL;
    struct pool *pool = NULL;
    struct trace_format format;
    float *sound = malloc(ELEMENTS * frames * sizeof *sound);
    float complex *traces = NULL;
    int err = sound ? 0 : -ENOMEM;

    if (!err)
        err = room_record(b->room, PASS_BACKGROUND, 0, speakers, SPEAKERS, 0, sound);
    if (!err)
        err = compressor_create(&compressor, &b->processing, s,
                                COMPRESSION_MATCHED_FILTER, WINDOW_HANN, why);
    if (!err)
        err = pool_create(&pool, 2);
    if (!err) {
        compressor_format(compressor, &format);
        traces = malloc(ELEMENTS * format.n_samples * sizeof *traces);
        err = traces ? processing_imager(&imager, &b->processing, "backprojection",
                                         &format, pool, why)
                     : -ENOMEM;
    }
    for (size_t j = 0; !err && j < SPEAKERS; j++) {
        compressor_execute(compressor, false, sound + j * s->slot_samples, frames,
                           traces);
        imager_add(imager, 0, j, traces, NULL);
    }
    if (!err)
        imager_image(imager, b->intensity);
    imager_destroy(imager);
    compressor_destroy(compressor);
    pool_destroy(pool);
    free(traces);
    free(sound);
    return err;
}

/* The voxels above their thresholds at one rate, of those that were at the one before. */
static size_t pick(struct cfar *cfar, const float *intensity, uint32_t *voxels, size_t n)
{
    size_t above = 0;

    for (size_t i = 0; i < n; i++)
        if ((double)intensity[voxels[i]] > cfar_at(cfar, intensity, voxels[i]).threshold)
            voxels[above++] = voxels[i];
    return above;
}

static void count(struct tally *t, int r, struct cfar *cfar, const float *intensity,
                  uint32_t *voxels, size_t *left, size_t n)
{
    clock_t start = clock();

    *left = pick(cfar, intensity, voxels, *left);
    t->sum[r] += (double)*left / (double)n;
    t->squares[r] += pow((double)*left / (double)n, 2.0);
    if (r)
        return;
    t->seconds += (double)(clock() - start) / CLOCKS_PER_SEC;
    t->shape += cfar_noise(cfar)->shape;
    t->heavy += cfar_noise(cfar)->heavy;
    t->tested += (double)n;
    t->seeds++;
}

/* The rates fall: thresholds rise, and what is below one is below the next. */
static int judge_kind(struct bench *b, int state, int k, unsigned seed, uint32_t *voxels)
{
    const struct processing *p = &b->processing;
    size_t n = grid_size(&p->grid), left = n;
    double resolution_m[3];

    geometry_resolution(&p->geometry, p->band_hz, 2.5, resolution_m);
    for (size_t v = 0; v < n; v++)
        voxels[v] = (uint32_t)v;
    for (int r = 0; r < RATES; r++) {
        struct cfar *cfar = state == LATER ? b->later[k][r] : NULL;
        int err = cfar ? 0
                       : detect_cfar(&cfar, kinds[k], rates[r], &p->grid, resolution_m);
        if (err)
            return err;
        cfar_learn(cfar, b->intensity);
        if (state == FIRST || seed > LEARNING)
            count(&b->tally[state][k], r, cfar, b->intensity, voxels, &left, n);
        if (state == FIRST)
            cfar_destroy(cfar);
        else
            b->later[k][r] = cfar;
    }
    return 0;
}

static int judge(struct bench *b, unsigned seed)
{
    uint32_t *voxels = malloc(grid_size(&b->processing.grid) * sizeof *voxels);
    int err = voxels ? 0 : -ENOMEM;

    for (int state = 0; state < STATES; state++)
        for (int k = 0; !err && k < KINDS; k++)
            err = judge_kind(b, state, k, seed, voxels);
    free(voxels);
    return err;
}

static int run_seed(struct bench *b, const char *world, unsigned seed, struct error *why)
{
    int err = write_scene(b, world, seed);

    if (!err)
        err = room_load(&b->room, b->path, why);
    if (err)
        return err;
    err = processing_plan(&b->processing, room_survey(b->room), why);
    b->intensity = calloc(grid_size(&b->processing.grid), sizeof *b->intensity);
    if (!err && !b->intensity)
        err = -ENOMEM;
    if (!err)
        err = image(b, why);
    if (!err)
        err = judge(b, seed);
    free(b->intensity);
    room_destroy(b->room);
    return err;
}

/* Student's t for 95 % on both sides, by its series about the normal distribution
 * (Abramowitz and Stegun 26.7.5). */
static double student(double freedom)
{
    double z = 1.959964, z3 = pow(z, 3.0), z5 = pow(z, 5.0);

    return z + (z3 + z) / (4.0 * freedom) +
           (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * freedom * freedom);
}

static void print_rate(const struct tally *t, int r)
{
    double n = t->seeds, mean = t->sum[r] / n;
    double variance = fmax(t->squares[r] / n - mean * mean, 0.0) * n / (n - 1.0);
    if (t->sum[r] == 0.0) { /* which says little of how far off that is */
        printf("  %5.2f %11s", 0.0, "(none)");
        return;
    }
    double sigma = student(n - 1.0) * sqrt(variance / n);

    printf("  %5.2f (%.2f-%.2f)", mean / rates[r], fmax(mean - sigma, 0.0) / rates[r],
           (mean + sigma) / rates[r]);
}

static void print_case(const struct bench *b, const char *name)
{
    for (int row = 0; row < STATES * KINDS; row++) {
        int state = row / KINDS, k = row % KINDS;
        const struct tally *t = &b->tally[state][k];
        printf("%-12s %-5s %-9s %6.2f", name, state_names[state], kind_names[k],
               t->shape / t->seeds);
        for (int r = 0; r < RATES; r++)
            print_rate(t, r);
        printf("   tail fitted %3.0f %%, %.1f us a cell\n", 100.0 * t->heavy / t->seeds,
               1e6 * t->seconds / t->tested);
    }
    fflush(stdout);
}

static int run_case(size_t c, unsigned seeds)
{
    struct bench b = {.path = "/tmp/bench_cfar_XXXXXX"};
    struct error why = {""};
    int fd = mkstemp(b.path), err = 0;

    if (fd >= 0)
        close(fd);
    for (unsigned seed = 1; !err && seed <= seeds; seed++)
        err = run_seed(&b, cases[c].world, seed, &why);
    if (err)
        fprintf(stderr, "bench_cfar: %s (%d)\n", why.text, err);
    else
        print_case(&b, cases[c].name);
    for (int k = 0; k < KINDS; k++)
        for (int r = 0; r < RATES; r++)
            cfar_destroy(b.later[k][r]);
    unlink(b.path);
    return err;
}

int main(int argc, char **argv)
{
    unsigned seeds = argc > 1 ? (unsigned)strtoul(argv[1], NULL, 10) : 100;
    int err = seeds < LEARNING + 2 ? -EINVAL : 0;

    if (err)
        fprintf(stderr, "usage: bench_cfar [SEEDS], from %d\n", LEARNING + 2);
    else
        printf("%u seeds %23s measured over set rate (95 %% confidence), at\n%34s", seeds,
               "", "shape");
    for (int r = 0; !err && r < RATES; r++)
        printf("  %5.0e            ", rates[r]);
    printf("\n");
    for (size_t c = 0; !err && c < sizeof cases / sizeof *cases; c++)
        err = run_case(c, seeds);
    return err ? 1 : 0;
}
