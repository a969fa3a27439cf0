/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/detection/detect.h"
#include "tests/recon/dice.h"
#include "tests/recon/rig.h"

/* Back-projection takes another way when the stage's steps (0.04) are whole voxels. */
#define N_WAYS 3
/* What holds of every method that images this array, of these as well. */
#define N_EVERY 7
static const char *const methods[N_EVERY] = {"fast",  "backprojection", "backprojection",
                                             "paper", "incoherent",     "iterative",
                                             "sparse"};
static const double steps_m[N_EVERY] = {0.015, 0.015, 0.01, 0.015, 0.015, 0.015, 0.015};

static const struct scatterer a_point = {{0.03, -0.02, 1.1}, 1.0};
static const struct scatterer another = {{-0.05, 0.04, 1.13}, 0.8};

struct bench { /* a rig, its imager and an image */
    struct rig rig;
    struct pool *pool;
    struct imager *im;
    float *image;
};

static void bench_open(struct bench *b, int way)
{
    rig_default(&b->rig);
    rig_look_at(&b->rig, 0.0, 0.0, 1.1, 11, steps_m[way]);
    assert_int_equal(pool_create(&b->pool, 1), 0);
    b->im = rig_imager(&b->rig, methods[way], b->pool);
    b->image = calloc(grid_size(&b->rig.grid), sizeof *b->image);
    assert_non_null(b->image);
}

static void bench_close(struct bench *b)
{
    free(b->image);
    imager_destroy(b->im);
    pool_destroy(b->pool);
}

static void expect_silence(struct bench *b)
{
    for (size_t v = 0; v < grid_size(&b->rig.grid); v++)
        b->image[v] = NAN;
    imager_image(b->im, b->image);
    for (size_t v = 0; v < grid_size(&b->rig.grid); v++)
        assert_near(b->image[v], 0.0, 0.0);
}

static float *expected_image(const struct bench *b, const char *method,
                             const struct scatterer *point)
{
    return rig_image(&b->rig, method, point, 1, 1);
}

static bool is_listed(const char *method)
{
    for (const char *name = imager_methods(); *name; name += strlen(name) + 1)
        if (strcmp(name, method) == 0)
            return true;
    return false;
}

static void the_methods_are_listed(void **state)
{
    (void)state;
    for (int q = 0; q < N_EVERY; q++)
        assert_true(is_listed(methods[q]) && imager_has_method(methods[q]));
    assert_false(imager_has_method("fas") || imager_adds("fas") ||
                 imager_isolates("fas") || imager_clips("fas"));
    assert_false(is_listed(""));
    assert_false(is_listed("fas"));
}

static void another_method_is_refused(void **state)
{
    (void)state;
    struct rig r;
    struct pool *pool;
    struct imager *im = NULL;
    const char *why = NULL;
    rig_default(&r);
    assert_int_equal(pool_create(&pool, 1), 0);
    assert_int_equal(rig_try(&r, "slow", pool, &im, &why), -ENOENT);
    assert_int_equal(rig_try(&r, "", pool, &im, NULL), -ENOENT);
    assert_null(im);
    pool_destroy(pool);
    imager_destroy(NULL);
}

static void expect_value_refused(const struct rig *r)
{
    for (int q = 0; q < N_EVERY; q++) {
        struct pool *pool;
        struct imager *im = NULL;
        const char *why = NULL;
        assert_int_equal(pool_create(&pool, 1), 0);
        int err = rig_try(r, methods[q], pool, &im, &why);
        if (err != -EINVAL)
            print_error("%s returns %d\n", methods[q], err);
        assert_int_equal(err, -EINVAL);
        assert_null(im);
        pool_destroy(pool);
    }
}

/* Those that take their ranges from the gate: recon/imaging/method.h, method_span. */
static const char *const spans[] = {"fast", "paper", "lct", "confocal", "iterative"};
#define N_SPANS (sizeof spans / sizeof *spans)

static struct imager *try_span(struct rig *r, size_t method, struct pool *pool,
                               const char **why)
{
    struct imager_options lightcone;
    struct imager *im = NULL;
    imager_options_default(&lightcone);
    lightcone.base = "lct";
    lightcone.iterations = 3;
    struct imager_config cfg = rig_config(r, spans[method], pool);
    cfg.options = &lightcone;
    int err = imager_create(&im, &cfg, why);
    assert_int_equal(err, im ? 0 : -ENOTSUP);
    return im;
}

static void a_gate_past_the_volume_is_refused_by_every_method_with_ranges(void **state)
{
    (void)state;
    struct rig r;
    struct pool *pool;
    const char *why = NULL;
    assert_int_equal(pool_create(&pool, 1), 0);
    rig_pairs(&r);
    for (size_t q = 0; q < N_SPANS; q++) {
        r.gate_m[0] = 1.6; /* the farthest corner of the volume is 1.32 m away */
        r.gate_m[1] = 1.8;
        assert_null(try_span(&r, q, pool, &why));
        assert_string_equal(why, "a gate that overlaps the volume");
    }
    rig_look_at(&r, 0.0, 0.0, 2.2, 9, 0.01); /* beyond the traces */
    r.gate_m[0] = 0.0;
    for (size_t q = 0; q < N_SPANS; q++) {
        assert_null(try_span(&r, q, pool, &why));
        assert_string_equal(why, "a gate that overlaps the volume");
    }
    pool_destroy(pool);
}

/* As of one voxel as far away as the gate begins: there are fewer samples in it than the
 * filters take. */
static void a_voxel_at_the_edge_of_the_gate_is_imaged_by_every_method(void **state)
{
    (void)state;
    const struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
    struct rig r;
    struct pool *pool;
    const char *why = NULL;
    assert_int_equal(pool_create(&pool, 1), 0);
    rig_pairs(&r);
    rig_look_at(&r, 0.0, 0.0, 1.1, 1, 0.01);
    r.gate_m[0] = 1.1;
    for (size_t q = 0; q < N_SPANS; q++) {
        struct imager *im = try_span(&r, q, pool, &why);
        float intensity = NAN;
        assert_non_null(im);
        rig_add(&r, im, &point, 1);
        imager_image(im, &intensity);
        assert_true(isfinite(intensity));
        if (q == 0)
            assert_true(intensity > 0.0f);
        imager_destroy(im);
    }
    pool_destroy(pool);
}

static void a_speed_of_sound_that_makes_no_sense_is_refused(void **state)
{
    (void)state;
    static const double wrong[4] = {0.0, -343.0, NAN, INFINITY};
    for (int q = 0; q < 4; q++) {
        struct rig r;
        rig_default(&r);
        r.geometry.sound_speed_m_s = wrong[q];
        expect_value_refused(&r);
    }
}

static void a_trace_format_that_makes_no_sense_is_refused(void **state)
{
    (void)state;
    static const double wrong[4] = {0.0, -36000.0, NAN, INFINITY};
    struct rig r;
    for (int q = 0; q < 4; q++) {
        rig_default(&r);
        r.format.rate_hz = wrong[q];
        expect_value_refused(&r);
    }
    rig_default(&r);
    r.format.n_samples = 0;
    expect_value_refused(&r);
    rig_default(&r);
    r.format.t0_s = NAN;
    expect_value_refused(&r);
}

static void a_band_that_is_none_is_refused(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    r.band_hz[0] = r.band_hz[1];
    expect_value_refused(&r);
    r.band_hz[0] = 30000.0;
    expect_value_refused(&r);
    r.band_hz[0] = NAN;
    expect_value_refused(&r);
}

static void an_array_without_elements_is_refused(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    r.geometry.n_speakers = 0;
    expect_value_refused(&r);
    rig_default(&r);
    r.geometry.n_microphones = 0;
    expect_value_refused(&r);
    rig_default(&r);
    r.geometry.n_positions = 0;
    expect_value_refused(&r);
}

static void a_grid_without_voxels_is_refused(void **state)
{
    (void)state;
    for (int a = 0; a < 3; a++) {
        struct rig r;
        rig_default(&r);
        r.grid.n[a] = 0;
        expect_value_refused(&r);
    }
}

static void nothing_added_and_silence_added_show_nothing(void **state)
{
    (void)state;
    for (int q = 0; q < N_EVERY; q++) {
        struct bench b;
        bench_open(&b, q);
        expect_silence(&b);
        rig_add(&b.rig, b.im, NULL, 0);
        expect_silence(&b);
        assert_int_equal(imager_pings(b.im), 32);
        bench_close(&b);
    }
}

static void a_ping_added_twice_counts_once(void **state)
{
    (void)state;
    for (int q = 0; q < N_EVERY; q++) {
        struct bench b;
        bench_open(&b, q);
        float *once = expected_image(&b, methods[q], &a_point);
        float complex *traces = malloc(4 * b.rig.format.n_samples * sizeof *traces);
        assert_non_null(traces);
        assert_int_equal(imager_pings(b.im), 0);
        rig_add(&b.rig, b.im, &a_point, 1);
        assert_int_equal(imager_pings(b.im), 32);
        rig_ping(&b.rig, 3, 2, &another, 1, traces);
        assert_false(imager_add(b.im, 3, 2, traces, NULL));
        assert_int_equal(imager_pings(b.im), 32);
        imager_image(b.im, b.image);
        assert_memory_equal(b.image, once, grid_size(&b.rig.grid) * sizeof *once);
        free(traces);
        free(once);
        bench_close(&b);
    }
}

static void reset_forgets_everything(void **state)
{
    (void)state;
    for (int q = 0; q < N_EVERY; q++) {
        struct bench b;
        bench_open(&b, q);
        float *fresh = expected_image(&b, methods[q], &another);
        rig_add(&b.rig, b.im, &a_point, 1);
        imager_image(b.im, b.image);
        imager_reset(b.im);
        assert_int_equal(imager_pings(b.im), 0);
        expect_silence(&b);
        rig_add(&b.rig, b.im, &another, 1);
        imager_image(b.im, b.image);
        assert_memory_equal(b.image, fresh, grid_size(&b.rig.grid) * sizeof *fresh);
        free(fresh);
        bench_close(&b);
    }
}

/* Not even what is no number. */
static void reset_forgets_what_spoils_an_image(void **state)
{
    (void)state;
    for (int q = 0; q < N_EVERY; q++) {
        struct bench b;
        bench_open(&b, q);
        size_t n = 4 * b.rig.format.n_samples;
        float complex *traces = malloc(n * sizeof *traces);
        assert_non_null(traces);
        for (size_t t = 0; t < n; t++)
            traces[t] = t % 2 ? NAN : INFINITY;
        assert_true(imager_add(b.im, 2, 1, traces, NULL));
        imager_image(b.im, b.image);
        imager_reset(b.im);
        expect_silence(&b);
        free(traces);
        bench_close(&b);
    }
}

/* An image of half the scan is one, and does not spoil the whole. */
static void previews_do_not_disturb(void **state)
{
    (void)state;
    for (int q = 0; q < N_EVERY; q++) {
        struct bench b;
        struct peak_fit fit;
        bench_open(&b, q);
        float *straight = expected_image(&b, methods[q], &a_point);
        rig_add_some(&b.rig, b.im, &a_point, 1, 0, 16);
        imager_image(b.im, b.image);
        rig_peak(&b.rig, b.image, &fit);
        for (int a = 0; a < 3; a++)
            assert_near(fit.position_m[a], a_point.at_m[a], a < 2 ? 0.02 : 0.005);
        rig_add_some(&b.rig, b.im, &a_point, 1, 16, 32);
        imager_image(b.im, b.image);
        assert_below(rig_difference(&b.rig, b.image, straight), 1e-5);
        imager_image(b.im, b.image);
        assert_below(rig_difference(&b.rig, b.image, straight), 1e-5);
        free(straight);
        bench_close(&b);
    }
}

struct crowd {
    const struct rig *rig;
    struct imager *im;
};

static void add_one(void *ctx, size_t item, size_t thread)
{
    const struct crowd *c = ctx;
    float complex *traces = malloc(4 * c->rig->format.n_samples * sizeof *traces);
    (void)thread;
    if (!traces)
        return;
    rig_ping(c->rig, item / 4, item % 4, &a_point, 1, traces);
    imager_add(c->im, item / 4, item % 4, traces, NULL);
    free(traces);
}

static void pings_may_come_from_several_threads_at_once(void **state)
{
    (void)state;
    for (int q = 0; q < N_EVERY; q++) {
        struct bench b;
        struct pool *many;
        bench_open(&b, q);
        float *one_by_one = expected_image(&b, methods[q], &a_point);
        struct crowd c = {&b.rig, b.im};
        assert_int_equal(pool_create(&many, 4), 0);
        pool_run(many, 32, add_one, &c);
        pool_destroy(many);
        assert_int_equal(imager_pings(b.im), 32);
        imager_image(b.im, b.image);
        assert_below(rig_difference(&b.rig, b.image, one_by_one), 1e-5);
        free(one_by_one);
        bench_close(&b);
    }
}

static void add_masked(struct bench *b, size_t microphone, float stuffing)
{
    size_t n = b->rig.format.n_samples;
    float complex *traces = malloc(4 * n * sizeof *traces);
    bool masked[4] = {false};
    assert_non_null(traces);
    masked[microphone] = true;
    for (size_t p = 0; p < 32; p++) {
        rig_ping(&b->rig, p / 4, p % 4, &a_point, 1, traces);
        for (size_t t = 0; t < n; t++)
            traces[microphone * n + t] = stuffing;
        assert_true(imager_add(b->im, p / 4, p % 4, traces, masked));
    }
    free(traces);
}

/* The same image but for one factor: fewer midpoints share the same weight. */
static void expect_proportional(const struct rig *r, const float *a, const float *b,
                                double limit)
{
    double ab = 0.0, bb = 0.0, largest = 0.0;
    for (size_t v = 0; v < grid_size(&r->grid); v++) {
        ab += (double)a[v] * b[v];
        bb += (double)b[v] * b[v];
        largest = fmax(largest, a[v]);
    }
    for (size_t v = 0; v < grid_size(&r->grid); v++)
        assert_near(a[v] / largest, b[v] * ab / bb / largest, limit);
}

static void a_masked_microphone_is_as_if_absent(void **state)
{
    (void)state;
    for (int q = 0; q < N_WAYS; q++) {
        struct bench b;
        struct rig without;
        bench_open(&b, q);
        add_masked(&b, 1, NAN);
        imager_image(b.im, b.image);
        rig_default(&without);
        without.grid = b.rig.grid;
        without.geometry.n_microphones = 3;
        for (size_t e = 1; e < 3; e++)
            without.microphones_m[e][1] = b.rig.microphones_m[e + 1][1];
        float *absent = rig_image(&without, methods[q], &a_point, 1, 1);
        /* Dip moveout of other offsets samples log time elsewhere. */
        expect_proportional(&b.rig, b.image, absent,
                            strcmp(methods[q], "fast") ? 1e-4 : 2e-4);
        free(absent);
        bench_close(&b);
    }
}

static void what_a_masked_microphone_says_does_not_matter(void **state)
{
    (void)state;
    for (int q = 0; q < N_EVERY; q++) {
        struct bench b;
        bench_open(&b, q);
        size_t size = grid_size(&b.rig.grid) * sizeof(float);
        float *quiet = malloc(size);
        assert_non_null(quiet);
        add_masked(&b, 2, 0.0f);
        imager_image(b.im, quiet);
        imager_reset(b.im);
        add_masked(&b, 2, 1e30f);
        imager_image(b.im, b.image);
        assert_memory_equal(b.image, quiet, size);
        free(quiet);
        bench_close(&b);
    }
}

static void a_trace_that_is_no_number_counts_as_masked(void **state)
{
    (void)state;
    for (int q = 0; q < N_EVERY; q++) {
        struct bench b;
        bench_open(&b, q);
        size_t n = b.rig.format.n_samples, size = grid_size(&b.rig.grid) * sizeof(float);
        float *masked = malloc(size);
        float complex *traces = malloc(4 * n * sizeof *traces);
        assert_true(masked && traces);
        add_masked(&b, 2, 0.0f);
        imager_image(b.im, masked);
        imager_reset(b.im);
        for (size_t p = 0; p < 32; p++) {
            rig_ping(&b.rig, p / 4, p % 4, &a_point, 1, traces);
            traces[2 * n + n / 2] = NAN;
            assert_true(imager_add(b.im, p / 4, p % 4, traces, NULL));
        }
        imager_image(b.im, b.image);
        assert_memory_equal(b.image, masked, size);
        free(traces);
        free(masked);
        bench_close(&b);
    }
}

static void with_all_microphones_masked_nothing_shows(void **state)
{
    (void)state;
    for (int q = 0; q < N_EVERY; q++) {
        struct bench b;
        const bool masked[4] = {true, true, true, true};
        bench_open(&b, q);
        float complex *traces = malloc(4 * b.rig.format.n_samples * sizeof *traces);
        assert_non_null(traces);
        rig_ping(&b.rig, 0, 0, &a_point, 1, traces);
        assert_true(imager_add(b.im, 0, 0, traces, masked));
        expect_silence(&b);
        free(traces);
        bench_close(&b);
    }
}

/* Microphone 3 five times over has one vote. */
static void a_midpoint_of_many_pairs_counts_as_one(void **state)
{
    (void)state;
    for (int q = 0; q < N_WAYS; q++) {
        struct rig r;
        rig_default(&r);
        rig_look_at(&r, 0.0, 0.0, 1.1, 11, steps_m[q]);
        for (size_t e = 0; e < 4; e++) /* no two of the pairs share a midpoint */
            r.microphones_m[e][1] = 0.02 * ((double)e - 1.5);
        float *single = rig_image(&r, methods[q], &a_point, 1, 1);
        for (size_t e = 4; e < 8; e++)
            r.microphones_m[e][1] = r.microphones_m[3][1];
        r.geometry.n_microphones = 8;
        float *many = rig_image(&r, methods[q], &a_point, 1, 1);
        assert_below(rig_difference(&r, single, many), 1e-5);
        free(single);
        free(many);
    }
}

/* |a + b|^2 + |a - b|^2 = 2 |a|^2 + 2 |b|^2 holds for complex amplitudes that add. */
static void amplitudes_superpose(void **state)
{
    (void)state;
    for (int q = 0; q < N_WAYS; q++) {
        struct rig r;
        struct scatterer both[2] = {a_point, another};
        rig_default(&r);
        rig_look_at(&r, 0.0, 0.0, 1.1, 11, steps_m[q]);
        float *a = rig_image(&r, methods[q], &both[0], 1, 1);
        float *b = rig_image(&r, methods[q], &both[1], 1, 1);
        float *sum = rig_image(&r, methods[q], both, 2, 1);
        both[1].gain = -both[1].gain;
        float *difference = rig_image(&r, methods[q], both, 2, 1);
        struct peak_fit fit;
        float largest = rig_peak(&r, a, &fit);
        for (size_t v = 0; v < grid_size(&r.grid); v++)
            assert_near((sum[v] + difference[v]) / largest,
                        2.0f * (a[v] + b[v]) / largest, 1e-4);
        free(a);
        free(b);
        free(sum);
        free(difference);
    }
}

static void intensity_goes_with_the_square_of_the_gain(void **state)
{
    (void)state;
    static const double gains[4] = {3.0, -0.25, 1e-12, 1e12};
    for (int n = 0; n < 4 * N_WAYS; n++) {
        int q = n % N_WAYS;
        struct rig r;
        struct scatterer louder = a_point;
        struct peak_fit fit;
        double gain = gains[n / N_WAYS];
        rig_default(&r);
        rig_look_at(&r, 0.0, 0.0, 1.1, 11, steps_m[q]);
        float *plain = rig_image(&r, methods[q], &a_point, 1, 1);
        louder.gain = gain;
        float *image = rig_image(&r, methods[q], &louder, 1, 1);
        double peak = rig_peak(&r, plain, &fit);
        rig_peak(&r, image, &fit); /* is finite */
        for (size_t v = 0; v < grid_size(&r.grid); v++)
            assert_near(image[v] / (gain * gain) / peak, plain[v] / peak, 1e-4);
        free(plain);
        free(image);
    }
}

static void the_image_moves_with_array_and_object(void **state)
{
    (void)state;
    static const double ways[3][3] = {{0.4, 0.0, 0.0}, {0.0, -0.7, 0.0}, {0.3, 0.2, 0.5}};
    for (int n = 0; n < 3 * N_WAYS; n++) {
        int q = n % N_WAYS;
        const double *by = ways[n / N_WAYS];
        struct rig r;
        struct scatterer moved = a_point;
        rig_default(&r);
        rig_look_at(&r, 0.0, 0.0, 1.1, 11, steps_m[q]);
        float *here = rig_image(&r, methods[q], &a_point, 1, 1);
        rig_move(&r, by);
        for (int a = 0; a < 3; a++)
            moved.at_m[a] += by[a];
        float *there = rig_image(&r, methods[q], &moved, 1, 1);
        if (!(rig_difference(&r, here, there) < 2e-3))
            print_error("%s by (%g, %g, %g)\n", methods[q], by[0], by[1], by[2]);
        assert_below(rig_difference(&r, here, there), 2e-3);
        free(here);
        free(there);
    }
}

static void the_sampling_of_the_traces_does_not_move_a_point(void **state)
{
    (void)state;
    static const struct trace_format formats[5] = {{.004117, 36000.0, 11000.0, 220},
                                                   {.0041, 38500.0, 11000.0, 240},
                                                   {.00395, 36000.0, 10500.0, 240},
                                                   {.0039, 54000.0, 11000.0, 360},
                                                   {.0, 96000.0, 11000.0, 1000}};
    const double at[3] = {0.031, -0.043, 1.1023};
    for (int q = 0; q < 10; q++) {
        struct rig r;
        rig_default(&r);
        r.format = formats[q / 2];
        rig_look_at(&r, 0.03, -0.04, 1.1, 15, 0.008);
        rig_expect_point(&r, methods[q % 2], at, 2e-3, 1e-3);
    }
}

static void the_speed_of_sound_does_not_move_a_point(void **state)
{
    (void)state;
    static const double speeds[2] = {300.0, 360.0};
    const double at[3] = {0.031, -0.043, 1.1023};
    for (int q = 0; q < 4; q++) {
        struct rig r;
        rig_default(&r);
        r.geometry.sound_speed_m_s = speeds[q / 2];
        rig_listen(&r, 0.7, 1.75);
        rig_look_at(&r, 0.03, -0.04, 1.1, 15, 0.008);
        rig_expect_point(&r, methods[q % 2], at, 2e-3, 1e-3);
    }
}

static void small_arrays_and_grids_still_image(void **state)
{
    (void)state;
    static const size_t counts[4][3] = {{1, 4, 8}, {4, 1, 8}, {4, 4, 1}, {1, 1, 1}};
    for (int q = 0; q < 16; q++) {
        struct rig r;
        struct peak_fit fit;
        const size_t *n = counts[q / 2 % 4];
        rig_default(&r);
        r.geometry.n_speakers = n[0];
        r.geometry.n_microphones = n[1];
        r.geometry.n_positions = n[2];
        rig_look_at(&r, 0.03, -0.02, 1.1, q < 8 ? 9 : 1, 0.02);
        float *image = rig_image(&r, methods[q % 2], &a_point, 1, 1);
        assert_true(rig_peak(&r, image, &fit) > 0.0f);
        free(image);
    }
}

/* What is asked for beside a voxel is not what it holds: points in the middle and at both
 * far corners of a volume, and the dark before and behind the first of them, each imaged
 * again by itself.  Amplitudes are off by what interpolation between ranges does, of a
 * power most, and by the steepest waves of f-k migration: a volume takes in a wider cone
 * of them than a voxel, whose cone ends at the outermost midpoints. */
static void a_voxel_alone_is_what_it_is_in_a_volume(void **state)
{
    (void)state;
    static const struct {
        const char *method;
        double off; /* amplitude, of the brightest */
    } ways[] = {{"fast", 0.1},
                {"backprojection", 1e-4},
                {"confocal", 0.02},
                {"incoherent", 1e-4},
                {"paper", 0.15}};
    static const size_t at[5][3] = {
        {10, 10, 12}, {0, 0, 0}, {20, 20, 24}, {10, 10, 0}, {10, 10, 24}};
    struct rig r;
    rig_pairs(&r);
    const struct grid all = r.grid;
    struct scatterer points[3];
    for (int q = 0; q < 3; q++) {
        points[q].gain = 1.0;
        for (int a = 0; a < 3; a++)
            points[q].at_m[a] = all.origin_m[a] + all.step_m[a] * (double)at[q][a];
    }
    for (size_t m = 0; m < sizeof ways / sizeof *ways; m++) {
        struct peak_fit fit;
        r.grid = all;
        float *volume = rig_image(&r, ways[m].method, points, 3, 1);
        double most = sqrt(rig_peak(&r, volume, &fit));
        for (int q = 0; q < 5; q++) {
            size_t v = (at[q][2] * all.n[1] + at[q][1]) * all.n[0] + at[q][0];
            for (int a = 0; a < 3; a++) {
                r.grid.n[a] = 1;
                r.grid.origin_m[a] = all.origin_m[a] + all.step_m[a] * (double)at[q][a];
            }
            float *alone = rig_image(&r, ways[m].method, points, 3, 1);
            assert_near(sqrt(alone[0]) / most, sqrt(volume[v]) / most, ways[m].off);
            free(alone);
        }
        free(volume);
    }
}

#define NOISE 0.1 /* rms, beside echoes of 0.8 */

static float *noisy_image(const struct rig *r, const char *method,
                          const struct scatterer *point)
{
    size_t n_speakers = r->geometry.n_speakers;
    size_t n = r->geometry.n_microphones * r->format.n_samples;
    float complex *traces = malloc(n * sizeof *traces);
    float *image = malloc(grid_size(&r->grid) * sizeof *image);
    unsigned long long seed = 9;
    struct pool *pool;

    assert_true(traces && image);
    assert_int_equal(pool_create(&pool, 1), 0);
    struct imager *im = rig_imager(r, method, pool);
    for (size_t p = 0; p < r->geometry.n_positions * n_speakers; p++) {
        rig_ping(r, p / n_speakers, p % n_speakers, point, 1, traces);
        for (size_t i = 0; i < n; i++)
            traces[i] += (float complex)(NOISE * M_SQRT1_2 *
                                         (dice_normal(&seed) + I * dice_normal(&seed)));
        assert_true(imager_add(im, p / n_speakers, p % n_speakers, traces, NULL));
    }
    imager_image(im, image);
    imager_destroy(im);
    pool_destroy(pool);
    free(traces);
    return image;
}

/* 32 cm of volume around (0, 0, 1.1).  Those that explain what they hear by points do
 * without a dense array; of the others grating lobes are another matter. */
static void outside_rig(struct rig *r, const char *method)
{
    bool fits = imager_isolates(method) || !strcmp(method, "iterative");
    bool paired = !strcmp(method, "confocal") || !strcmp(method, "lct");

    rig_default(r);
    if (paired)
        rig_pairs(r);
    for (size_t e = 0; !fits && e < RIG_MAX; e++) {
        r->positions_m[e] = 0.02 * ((double)e - 7.5);
        for (int a = 0; a < 3; a++) {
            r->speakers_m[e][a] *= 0.5;
            r->microphones_m[e][a] *= 0.5;
        }
    }
    r->geometry.n_positions = fits ? 8 : 16;
    rig_look_at(r, 0.0, 0.0, 1.1, 17, 0.02);
}

/* Nothing is told, or that it may stand beyond the border; no axis is stated surer than
 * it is. */
static void expect_true(const struct rig *r, const char *method,
                        const struct scatterer *point, bool outside)
{
    static const int diagonal[3] = {0, 3, 5};
    struct detect_config cfg;
    struct detection found[8];
    size_t n, told = 0;

    float *image = noisy_image(r, method, point);
    detect_config_default(&cfg);
    detect_config_method(&cfg, method, &r->grid);
    geometry_resolution(&r->geometry, r->band_hz, 1.1, cfg.resolution_m);
    assert_int_equal(detect_objects(&cfg, &r->grid, image, found, 8, &n), 0);
    free(image);
    for (size_t i = 0; i < n; i++) {
        const struct detection *d = &found[i];
        if (d->existence < 0.5 || (outside && imager_clips(method) && !d->at_border))
            continue; /* images of power have sidelobes anywhere */
        told++;
        for (int a = 0; a < 3; a++) {
            double sigma_m = sqrt(d->covariance_m2[diagonal[a]]);
            double error_m = fabs(d->position_m[a] - point->at_m[a]);
            if (error_m > 4.0 * sigma_m)
                fail_msg("%s: axis %d is %.1f cm off, stated %.2f", method, a,
                         1e2 * error_m, 1e2 * sigma_m);
            if (!outside && strcmp(method, "confocal") != 0)
                assert_below(sigma_m, 2.0 * r->grid.step_m[a]);
        }
    }
    assert_true(outside || told == 1 || (told == 0 && imager_clips(method)));
}

static void what_stands_outside_is_not_placed_surely(void **state)
{
    (void)state;

    for (const char *m = imager_methods(); *m; m += strlen(m) + 1) {
        for (int face = 0; face < 6; face++) {
            struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
            struct rig r;
            outside_rig(&r, m);
            point.at_m[face / 2] += (face % 2 ? 1.0 : -1.0) * (0.16 + 0.03);
            expect_true(&r, m, &point, true);
        }
    }
}

static void what_stands_in_the_middle_is_known(void **state)
{
    (void)state;

    for (const char *m = imager_methods(); *m; m += strlen(m) + 1) {
        const struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
        struct rig r;
        outside_rig(&r, m);
        expect_true(&r, m, &point, false);
    }
}

/* Of volumes of three voxels along an axis, too. */
static void a_fit_of_a_thin_volume_is_told_what_stands_beside_it(void **state)
{
    (void)state;
    static const char *const fits[2] = {"iterative", "sparse"};

    for (int q = 0; q < 12; q++) {
        struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
        int axis = q / 2 % 3;
        struct rig r;
        outside_rig(&r, fits[q / 6]);
        r.grid.n[axis] = 3;
        r.grid.origin_m[axis] = point.at_m[axis] - 0.02;
        point.at_m[axis] += q % 2 ? 0.05 : 0.0;
        expect_true(&r, fits[q / 6], &point, q % 2);
    }
}

/* Where what is heard ends at the volume's other end. */
static void a_fit_is_given_room_on_the_side_where_there_is_some(void **state)
{
    (void)state;
    static const char *const fits[2] = {"iterative", "sparse"};

    for (int q = 0; q < 4; q++) {
        struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
        struct rig r;
        outside_rig(&r, fits[q / 2]);
        double half_m = 0.5 * r.grid.step_m[2] * (double)(r.grid.n[2] - 1);
        point.at_m[2] += (q % 2 ? 1.0 : -1.0) * (half_m + 0.03);
        if (q % 2)
            r.gate_m[0] = r.grid.origin_m[2] - 0.005;
        else
            rig_listen(&r, 0.7, r.grid.origin_m[2] + 2.0 * half_m + 0.015);
        expect_true(&r, fits[q / 2], &point, true);
    }
}

/* How deep that is does not limit it sideways. */
static void a_fit_is_given_room_beside_a_volume_as_deep_as_what_is_heard(void **state)
{
    (void)state;
    static const char *const fits[2] = {"iterative", "sparse"};

    for (int q = 0; q < 8; q++) {
        struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
        struct rig r;
        outside_rig(&r, fits[q / 4]);
        point.at_m[q / 2 % 2] += (q % 2 ? 1.0 : -1.0) * (0.16 + 0.03);
        r.gate_m[0] = r.grid.origin_m[2] - 0.005;
        rig_listen(&r, 0.7, 1.1 + 0.16 + 0.005);
        expect_true(&r, fits[q / 4], &point, true);
    }
}

/* Two voxels before a column and three behind it, which it then images as a column of all
 * that is heard does. */
static void a_fit_is_given_the_depths_that_are_heard_and_no_more(void **state)
{
    (void)state;
    const struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
    float *image[2];
    struct rig r;

    for (int all = 0; all < 2; all++) {
        rig_default(&r);
        rig_look_at(&r, 0.0, 0.0, 1.1, 1, 0.005);
        r.grid.n[2] = all ? 22 : 17;
        r.grid.origin_m[2] = all ? 1.05 : 1.06;
        r.gate_m[0] = 1.06 - 0.0125;
        rig_listen(&r, 0.7, 1.14 + 0.0175);
        image[all] = rig_image(&r, "iterative", &point, 1, 1);
    }
    r.grid.n[2] = 17;
    assert_below(rig_difference(&r, image[0], image[1] + 2), 1e-5);
    free(image[0]);
    free(image[1]);
}

/* Its fit has no place outside: what is within half a width is more than -6 dB of a point
 * in the section. */
static void a_section_shows_what_stands_beside_it(void **state)
{
    (void)state;

    for (int axis = 0; axis < 2; axis++) {
        struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
        double peak[2], width_m[3];
        for (int beside = 0; beside < 2; beside++) {
            struct peak_fit fit;
            struct rig r;
            rig_default(&r);
            geometry_resolution(&r.geometry, r.band_hz, 1.1, width_m);
            point.at_m[axis] = beside ? 0.3 * width_m[axis] : 0.0;
            r.grid.n[axis] = 1;
            r.grid.origin_m[axis] = 0.0;
            float *image = rig_image(&r, "sparse", &point, 1, 1);
            peak[beside] = (double)rig_peak(&r, image, &fit);
            free(image);
        }
        assert_true(peak[1] > 0.25 * peak[0]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_methods_are_listed),
        cmocka_unit_test(what_stands_outside_is_not_placed_surely),
        cmocka_unit_test(what_stands_in_the_middle_is_known),
        cmocka_unit_test(a_fit_of_a_thin_volume_is_told_what_stands_beside_it),
        cmocka_unit_test(a_fit_is_given_room_on_the_side_where_there_is_some),
        cmocka_unit_test(a_fit_is_given_room_beside_a_volume_as_deep_as_what_is_heard),
        cmocka_unit_test(a_fit_is_given_the_depths_that_are_heard_and_no_more),
        cmocka_unit_test(a_section_shows_what_stands_beside_it),
        cmocka_unit_test(another_method_is_refused),
        cmocka_unit_test(nothing_added_and_silence_added_show_nothing),
        cmocka_unit_test(a_ping_added_twice_counts_once),
        cmocka_unit_test(reset_forgets_everything),
        cmocka_unit_test(reset_forgets_what_spoils_an_image),
        cmocka_unit_test(previews_do_not_disturb),
        cmocka_unit_test(pings_may_come_from_several_threads_at_once),
        cmocka_unit_test(a_masked_microphone_is_as_if_absent),
        cmocka_unit_test(what_a_masked_microphone_says_does_not_matter),
        cmocka_unit_test(a_trace_that_is_no_number_counts_as_masked),
        cmocka_unit_test(with_all_microphones_masked_nothing_shows),
        cmocka_unit_test(a_midpoint_of_many_pairs_counts_as_one),
        cmocka_unit_test(amplitudes_superpose),
        cmocka_unit_test(intensity_goes_with_the_square_of_the_gain),
        cmocka_unit_test(the_image_moves_with_array_and_object),
        cmocka_unit_test(the_sampling_of_the_traces_does_not_move_a_point),
        cmocka_unit_test(the_speed_of_sound_does_not_move_a_point),
        cmocka_unit_test(small_arrays_and_grids_still_image),
        cmocka_unit_test(a_gate_past_the_volume_is_refused_by_every_method_with_ranges),
        cmocka_unit_test(a_voxel_at_the_edge_of_the_gate_is_imaged_by_every_method),
        cmocka_unit_test(a_voxel_alone_is_what_it_is_in_a_volume),
        cmocka_unit_test(a_speed_of_sound_that_makes_no_sense_is_refused),
        cmocka_unit_test(a_trace_format_that_makes_no_sense_is_refused),
        cmocka_unit_test(a_band_that_is_none_is_refused),
        cmocka_unit_test(an_array_without_elements_is_refused),
        cmocka_unit_test(a_grid_without_voxels_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
