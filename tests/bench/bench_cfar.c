/* Does the false-alarm rate hold?  Coherent images of a line array, of noise alone and of
 * clutter (so many scatterers around that each voxel hears several), at set rates; what
 * part of the voxels is brighter than its threshold.
 *
 *     bench_cfar [SEEDS]        default: 10 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#include "hal/room/room.h"
#include "nodes/rt/compressor.h"
#include "nodes/rt/processing.h"
#include "recon/detect.h"

enum { KINDS = 2, RATES = 3, ELEMENTS = 16, SPEAKERS = 4 };

static const double rates[RATES] = {1e-2, 1e-3, 1e-4};
static const enum cfar_kind kinds[KINDS] = {CFAR_AVERAGING, CFAR_ORDERED};
static const char *const kind_names[KINDS] = {"averaging", "ordered"};

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

struct bench {
    char path[64];
    struct room *room;
    struct processing processing;
    float *intensity;
    double above[KINDS][RATES], cells, shape, heavy, seconds, tested;
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

static int image(struct bench *b, struct complaint *why)
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
        err = room_record(b->room, ANLOS__PASS__BACKGROUND, 0, speakers, SPEAKERS, 0,
                          sound);
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
        compressor_execute(compressor, sound + j * s->slot_samples, frames, traces);
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

static int judge(struct bench *b)
{
    struct processing *p = &b->processing;
    double resolution_m[3];
    size_t n = grid_size(&p->grid);

    geometry_resolution(&p->geometry, p->band_hz, 2.5, resolution_m);
    for (int k = 0; k < KINDS; k++) {
        for (int r = 0; r < RATES; r++) {
            struct cfar *cfar;
            int err = detect_cfar(&cfar, kinds[k], rates[r], &p->grid, resolution_m);
            if (err)
                return err;
            cfar_learn(cfar, b->intensity);
            b->shape = cfar_noise(cfar)->shape;
            b->heavy += cfar_noise(cfar)->heavy;
            clock_t start = clock();
            for (size_t v = 0; v < n; v++)
                b->above[k][r] += (double)b->intensity[v] >
                                  cfar_at(cfar, b->intensity, v).threshold;
            b->seconds += (double)(clock() - start) / CLOCKS_PER_SEC;
            b->tested += (double)n;
            cfar_destroy(cfar);
        }
    }
    b->cells += (double)n;
    return 0;
}

static int run_seed(struct bench *b, const char *world, unsigned seed,
                    struct complaint *why)
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
        err = judge(b);
    free(b->intensity);
    room_destroy(b->room);
    return err;
}

int main(int argc, char **argv)
{
    unsigned seeds = argc > 1 ? (unsigned)strtoul(argv[1], NULL, 10) : 10;
    int err = 0;

    printf("%-13s %-10s %6s  measured over set rate, at", "", "", "shape");
    for (int r = 0; r < RATES; r++)
        printf(" %8.0e", rates[r]);
    printf("\n");
    for (size_t c = 0; !err && c < sizeof cases / sizeof *cases; c++) {
        struct bench b = {.path = "/tmp/bench_cfar_XXXXXX"};
        struct complaint why = {""};
        int fd = mkstemp(b.path);
        if (fd >= 0)
            close(fd);
        for (unsigned seed = 1; !err && seed <= seeds; seed++)
            err = run_seed(&b, cases[c].world, seed, &why);
        for (int k = 0; !err && k < KINDS; k++) {
            printf("%-13s %-10s %6.2f %27s", cases[c].name, kind_names[k], b.shape, "");
            for (int r = 0; r < RATES; r++)
                printf(" %8.2f", b.above[k][r] / b.cells / rates[r]);
            printf("   tail fitted %3.0f %%, %.1f us a cell\n",
                   100.0 * b.heavy / (seeds * KINDS * RATES), 1e6 * b.seconds / b.tested);
        }
        unlink(b.path);
        if (err)
            fprintf(stderr, "bench_cfar: %s (%d)\n", why.text, err);
    }
    return err ? 1 : 0;
}
