/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <complex.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "tests/recon/bumper.h"
#include "tests/recon/reference.h"
#include "tests/worse.h"

enum { SPEAKERS = 4, MICROPHONES = 6, SIDE = 21, VOXELS = SIDE * SIDE };

static const double carrier_hz = 11000.0;

/* -- closed form ------------------------------------------------------------------------
 */

struct heard { /* which pings of a row, which of their microphones */
    size_t n_pings;
    bool missing[64], masked[64][MICROPHONES];
    double away_m[3]; /* all of it, from where the others are */
};

struct still { /* do not copy: a standing array with traces in closed form */
    struct bumper bumper;
    struct scatterer point;
    float complex *traces;
};

static void still_start_at(struct still *s, enum frames_sum sum, size_t n_pings,
                           const double away_m[3])
{
    struct bumper *b = &s->bumper;
    double look_m[3] = {0.36, 0.03, 1.44};
    s->point = (struct scatterer){{0.37, 0.02, 1.43}, 1.0};
    bumper_default(b);
    bumper_elements(b, SPEAKERS, MICROPHONES);
    for (int a = 0; a < 3; a++) {
        s->point.at_m[a] += away_m[a];
        look_m[a] += away_m[a];
        for (size_t j = 0; j < SPEAKERS; j++)
            b->speakers_m[j][a] += away_m[a];
        for (size_t i = 0; i < MICROPHONES; i++)
            b->microphones_m[i][a] += away_m[a];
    }
    bumper_look_at(b, look_m, SIDE, 0.012);
    bumper_start(b);
    b->cfg.format = (struct trace_format){0.0041, 36000.0, carrier_hz, 360};
    b->cfg.sum = sum;
    b->cfg.n_pings = n_pings;
    s->traces = malloc(MICROPHONES * b->cfg.format.n_samples * sizeof *s->traces);
    if (!s->traces)
        abort();
}

static void still_start(struct still *s, enum frames_sum sum, size_t n_pings)
{
    still_start_at(s, sum, n_pings, (const double[3]){0.0, 0.0, 0.0});
}

static void still_stop(struct still *s)
{
    free(s->traces);
    bumper_stop(&s->bumper);
}

static void still_add(struct still *s, struct frames *f, size_t k, const bool *masked)
{
    const struct bumper *b = &s->bumper;
    size_t n = b->cfg.format.n_samples;
    for (size_t i = 0; i < MICROPHONES; i++)
        reference_trace(&b->cfg.format, b->cfg.band_hz, b->world.sound_speed_m_s,
                        b->speakers_m[k % SPEAKERS], b->microphones_m[i], &s->point, 1,
                        s->traces + i * n);
    const struct frames_ping ping = {.stamp_ns = (int64_t)k * 24000000,
                                     .speaker = k % SPEAKERS,
                                     .traces = s->traces,
                                     .masked = masked};
    assert_true(frames_add(f, &ping));
}

static double complex echo(const struct still *s, size_t speaker, size_t microphone,
                           const double voxel[3])
{
    const struct bumper *b = &s->bumper;
    const double *from = b->speakers_m[speaker], *to = b->microphones_m[microphone];
    double c = b->world.sound_speed_m_s;
    double there = reference_distance(from, s->point.at_m);
    double back = reference_distance(to, s->point.at_m);
    double t = (reference_distance(from, voxel) + reference_distance(to, voxel)) / c;
    return reference_echo(b->cfg.band_hz, carrier_hz, (there + back) / c, t) *
           cexp(2.0 * M_PI * I * carrier_hz * t) / (there * back);
}

/* Pairs of one midpoint become their mean, midpoints the mean of those that are heard; a
 * naive search finds which share one. */
static double intensity(const struct still *s, const struct heard *h, size_t first,
                        size_t end, const double voxel[3])
{
    const struct bumper *b = &s->bumper;
    double x[64 * MICROPHONES];
    double complex sum[64 * MICROPHONES], total = 0.0;
    size_t fold[64 * MICROPHONES], n = 0;
    for (size_t k = first; k < end; k++) {
        for (size_t i = 0; i < MICROPHONES; i++) {
            size_t q = 0, j = k % SPEAKERS;
            double middle = 0.5 * (b->speakers_m[j][0] + b->microphones_m[i][0]);
            if (h->missing[k] || h->masked[k][i])
                continue;
            while (q < n && fabs(x[q] - middle) > 1e-6)
                q++;
            if (q == n) {
                x[n] = middle;
                sum[n] = 0.0;
                fold[n++] = 0;
            }
            sum[q] += echo(s, j, i, voxel);
            fold[q]++;
        }
    }
    for (size_t q = 0; q < n; q++)
        total += sum[q] / (double)fold[q];
    return n ? pow(cabs(total) / (double)n, 2.0) : NAN;
}

/* Of the elements: mean square distance to a voxel. */
static double range2(const struct bumper *b, const double voxel[3])
{
    double sum = 0.0;
    for (size_t j = 0; j < SPEAKERS; j++)
        sum += pow(reference_distance(b->speakers_m[j], voxel), 2.0);
    for (size_t i = 0; i < MICROPHONES; i++)
        sum += pow(reference_distance(b->microphones_m[i], voxel), 2.0);
    return sum / (SPEAKERS + MICROPHONES);
}

static void expect_exact(struct still *s, const struct heard *h, const float *image)
{
    const struct grid *g = &s->bumper.cfg.grid;
    double most = 0.0, worst = 0.0;
    for (size_t v = 0; v < VOXELS; v += 3) {
        const double at[3] = {g->origin_m[0] + g->step_m[0] * (double)(v % SIDE),
                              g->origin_m[1],
                              g->origin_m[2] + g->step_m[2] * (double)(v / SIDE)};
        double exact = 0.0;
        size_t n = 0;
        if (s->bumper.cfg.sum == FRAMES_COHERENT)
            exact = intensity(s, h, 0, h->n_pings, at), n = 1;
        for (size_t k = 0; s->bumper.cfg.sum == FRAMES_POWER && k < h->n_pings; k++) {
            double one = intensity(s, h, k, k + 1, at);
            exact += isnan(one) ? 0.0 : one;
            n += !isnan(one);
        }
        exact *= range2(&s->bumper, at) / (double)n;
        most = fmax(most, exact);
        worst = worse(worst, fabs(exact - (double)image[v]));
    }
    assert_true(most > 0.0);
    assert_below(worst / most, 8e-3); /* -50 dB of the amplitude, twice, and its sum */
}

static void compare(enum frames_sum sum, const struct heard *h)
{
    static float image[VOXELS];
    struct still s;
    struct frames_made made;
    size_t present = 0;
    still_start_at(&s, sum, h->n_pings, h->away_m);
    struct frames *f = bumper_frames(&s.bumper);
    for (size_t k = 0; k < h->n_pings; k++) {
        present += !h->missing[k];
        if (!h->missing[k])
            still_add(&s, f, k, h->masked[k]);
    }
    frames_image(f, NULL, image, &made);
    assert_int_equal(made.pings, present);
    expect_exact(&s, h, image);
    frames_destroy(f);
    still_stop(&s);
}

/* -- tests ------------------------------------------------------------------------------
 */

static void an_image_is_the_direct_sum(void **state)
{
    (void)state;
    const struct heard all = {.n_pings = SPEAKERS};
    compare(FRAMES_COHERENT, &all);
    compare(FRAMES_POWER, &all);
}

/* The origin is nowhere in particular. */
static void so_it_is_of_an_array_that_is_elsewhere(void **state)
{
    (void)state;
    const struct heard away = {.n_pings = SPEAKERS, .away_m = {0.8, -0.3, 0.6}};
    compare(FRAMES_COHERENT, &away);
    compare(FRAMES_POWER, &away);
}

static void so_it_is_with_more_pings_than_speakers_and_fewer(void **state)
{
    (void)state;
    const struct heard more = {.n_pings = 2 * SPEAKERS + 1}, fewer = {.n_pings = 3};
    compare(FRAMES_COHERENT, &more);
    compare(FRAMES_POWER, &more);
    compare(FRAMES_COHERENT, &fewer);
    compare(FRAMES_POWER, &fewer);
}

static void a_missing_ping_leaves_the_others_with_their_weights(void **state)
{
    (void)state;
    const struct heard h = {.n_pings = SPEAKERS, .missing = {[2] = true}};
    compare(FRAMES_COHERENT, &h);
    compare(FRAMES_POWER, &h);
}

static void masked_microphones_do_not_count(void **state)
{
    (void)state;
    const struct heard h = {.n_pings = SPEAKERS,
                            .masked = {[0] = {[1] = true},
                                       [1] = {true, true, true, true, true, true},
                                       [2] = {[1] = true, [4] = true},
                                       [3] = {[0] = true}}};
    compare(FRAMES_COHERENT, &h);
    compare(FRAMES_POWER, &h);
}

static void expect_same(const float *a, const float *b)
{
    double most = 0.0, worst = 0.0;
    for (size_t v = 0; v < VOXELS; v++) {
        most = fmax(most, (double)fabsf(b[v]));
        worst = worse(worst, (double)fabsf(a[v] - b[v]));
    }
    assert_true(most > 0.0);
    assert_below(worst / most, 1e-5);
}

/* Each image of a row in which pings go missing and microphones come and go, against one
 * of its own pings alone. */
static void slide(enum frames_sum sum, size_t window)
{
    static float slid[VOXELS], scratch[VOXELS];
    struct still s;
    struct frames_made made;
    still_start(&s, sum, window);
    struct frames *f = bumper_frames(&s.bumper);
    for (size_t k = 0; k < 20; k++) {
        struct frames *fresh = bumper_frames(&s.bumper);
        for (size_t p = k < window ? 0 : k + 1 - window; p <= k; p++) {
            bool masked[MICROPHONES] = {[3] = p > 8 && p < 12};
            still_add(&s, fresh, p, masked);
            if (p == k)
                still_add(&s, f, p, masked);
        }
        frames_image(f, NULL, slid, &made);
        frames_image(fresh, NULL, scratch, &made);
        expect_same(slid, scratch);
        frames_destroy(fresh);
    }
    frames_destroy(f);
    still_stop(&s);
}

static void a_sliding_image_is_one_made_from_scratch(void **state)
{
    (void)state;
    slide(FRAMES_COHERENT, SPEAKERS);
    slide(FRAMES_COHERENT, 3);
    slide(FRAMES_POWER, SPEAKERS);
}

static void where_nothing_moves_a_new_image_costs_one_ping(void **state)
{
    (void)state;
    static float image[VOXELS];
    struct still s;
    struct frames_made made;
    still_start(&s, FRAMES_COHERENT, SPEAKERS);
    struct frames *f = bumper_frames(&s.bumper);
    for (size_t k = 0; k < 3 * SPEAKERS; k++) {
        still_add(&s, f, k, NULL);
        frames_image(f, NULL, image, &made);
        if (k >= SPEAKERS)
            assert_int_equal(made.kept, SPEAKERS - 1);
    }
    frames_destroy(f);
    still_stop(&s);
}

static double mean_of_block(const struct still *s, const float *image, size_t x, size_t z,
                            size_t side)
{
    const struct grid *g = &s->bumper.cfg.grid;
    double sum = 0.0;
    size_t n = 0;
    for (size_t k = z * side; k < (z + 1) * side && k < g->n[2]; k++)
        for (size_t i = x * side; i < (x + 1) * side && i < g->n[0]; i++, n++)
            sum += image[k * g->n[0] + i];
    return sum / (double)n;
}

/* Blocks of 7 x 7 voxels, 8.4 cm, and what is left of the grid at its end. */
static void the_newest_ping_alone_is_told_in_means_over_blocks(void **state)
{
    (void)state;
    enum { BLOCK = 7 };
    static float image[VOXELS], alone[VOXELS];
    struct still s;
    struct grid blocks;
    struct frames_made made;
    still_start(&s, FRAMES_POWER, SPEAKERS);
    struct frames *f = bumper_frames(&s.bumper);
    s.bumper.cfg.n_pings = 1;
    struct frames *one = bumper_frames(&s.bumper);
    for (size_t k = 0; k < 2 * SPEAKERS; k++) {
        still_add(&s, f, k, NULL);
        still_add(&s, one, k, NULL);
        frames_image(f, NULL, image, &made);
        frames_image(one, NULL, alone, &made);
        const float *newest = frames_newest(f, &blocks);
        assert_non_null(newest);
        assert_int_equal(blocks.n[0], SIDE / BLOCK);
        assert_int_equal(blocks.n[1], 1);
        assert_int_equal(blocks.n[2], SIDE / BLOCK);
        assert_near(blocks.step_m[2], 0.084, 1e-9);
        assert_near(blocks.origin_m[0], s.bumper.cfg.grid.origin_m[0] + 0.036, 1e-9);
        for (size_t z = 0; z < blocks.n[2]; z++)
            for (size_t x = 0; x < blocks.n[0]; x++) {
                double mean = mean_of_block(&s, alone, x, z, BLOCK);
                assert_near(newest[z * blocks.n[0] + x], mean, 1e-5 * mean);
            }
    }
    frames_spoil(f);
    frames_image(f, NULL, image, &made);
    assert_null(frames_newest(f, &blocks));
    frames_destroy(one);
    frames_destroy(f);
    still_stop(&s);
}

static void phases_that_add_up_tell_of_no_ping_alone(void **state)
{
    (void)state;
    static float image[VOXELS];
    struct still s;
    struct grid blocks;
    struct frames_made made;
    still_start(&s, FRAMES_COHERENT, SPEAKERS);
    struct frames *f = bumper_frames(&s.bumper);
    still_add(&s, f, 0, NULL);
    frames_image(f, NULL, image, &made);
    assert_null(frames_newest(f, &blocks));
    frames_destroy(f);
    still_stop(&s);
}

static void what_lies_before_the_gate_is_mute(void **state)
{
    (void)state;
    static float image[VOXELS];
    struct still s;
    struct frames_made made;
    still_start(&s, FRAMES_COHERENT, SPEAKERS);
    s.bumper.cfg.gate_m[0] = 2.0; /* the point is 1.5 m away */
    struct frames *f = bumper_frames(&s.bumper);
    for (size_t k = 0; k < SPEAKERS; k++)
        still_add(&s, f, k, NULL);
    frames_image(f, NULL, image, &made);
    for (size_t v = 0; v < VOXELS; v++)
        assert_near(image[v], 0.0, 1e-8);
    frames_destroy(f);
    still_stop(&s);
}

/* Of one ping that is loud up to its last sample. */
static void image_loud(struct still *s, float *image)
{
    struct frames_made made;
    struct frames *f = bumper_frames(&s->bumper);
    size_t n = MICROPHONES * s->bumper.cfg.format.n_samples;
    for (size_t q = 0; q < n; q++)
        s->traces[q] = cexpf(1.7f * (float)(q * q % 97) * I);
    const struct frames_ping ping = {.traces = s->traces};
    assert_true(frames_add(f, &ping));
    frames_image(f, NULL, image, &made);
    frames_destroy(f);
}

/* Where the traces end within the image: each voxel is as in an image of itself alone. */
static void what_is_imaged_ends_where_the_traces_do(void **state)
{
    (void)state;
    static float image[VOXELS];
    size_t n_beyond = 0, n_within = 0;
    struct still s;
    still_start(&s, FRAMES_POWER, 1);
    bumper_look_at(&s.bumper, (const double[3]){0.3, 0.0, 2.3}, SIDE, 0.04);
    const struct grid whole = s.bumper.cfg.grid;
    image_loud(&s, image);
    for (size_t v = 0; v < VOXELS; v += 5) {
        float alone;
        s.bumper.cfg.grid = (struct grid){
            .n = {1, 1, 1},
            .origin_m = {whole.origin_m[0] + whole.step_m[0] * (double)(v % SIDE),
                         whole.origin_m[1],
                         whole.origin_m[2] + whole.step_m[2] * (double)(v / SIDE)},
            .step_m = {whole.step_m[0], whole.step_m[1], whole.step_m[2]}};
        image_loud(&s, &alone);
        assert_near(image[v], alone, 1e-5);
        n_beyond += alone == 0.0f;
        n_within += alone > 0.0f;
    }
    assert_true(n_beyond > 10 && n_within > 10);
    still_stop(&s);
}

static void pings_that_are_too_old_are_left_out(void **state)
{
    (void)state;
    static float image[VOXELS];
    struct still s;
    struct frames_made made;
    still_start(&s, FRAMES_COHERENT, SPEAKERS);
    s.bumper.cfg.max_age_ns = 48000000;
    struct frames *f = bumper_frames(&s.bumper);
    still_add(&s, f, 0, NULL);
    still_add(&s, f, 1, NULL);
    still_add(&s, f, 3, NULL);
    frames_image(f, NULL, image, &made);
    assert_int_equal(made.pings, 2);
    assert_int_equal(made.stamp_ns, 72000000);
    assert_true(fabs(made.age_s - 0.024) < 1e-9); /* one is 48 ms older, one is not */
    frames_destroy(f);
    still_stop(&s);
}

static void a_ping_from_before_makes_a_new_start(void **state)
{
    (void)state;
    static float image[VOXELS];
    struct still s;
    struct frames_made made;
    still_start(&s, FRAMES_COHERENT, SPEAKERS);
    struct frames *f = bumper_frames(&s.bumper);
    still_add(&s, f, 100, NULL);
    still_add(&s, f, 101, NULL);
    const struct frames_ping back = {
        .stamp_ns = 24000000, .speaker = 1, .traces = s.traces};
    assert_false(frames_add(f, &back));
    frames_image(f, NULL, image, &made);
    assert_int_equal(made.pings, 1);
    assert_int_equal(made.stamp_ns, 24000000);
    frames_destroy(f);
    still_stop(&s);
}

static void a_damaged_trace_counts_as_masked(void **state)
{
    (void)state;
    static float image[VOXELS], without[VOXELS];
    const bool masked[MICROPHONES] = {[2] = true};
    struct still s;
    struct frames_made made;
    still_start(&s, FRAMES_COHERENT, 1);
    struct frames *f = bumper_frames(&s.bumper);
    still_add(&s, f, 0, masked);
    frames_image(f, NULL, without, &made);
    s.traces[2 * s.bumper.cfg.format.n_samples + 17] = NAN;
    const struct frames_ping ping = {.stamp_ns = 24000000, .traces = s.traces};
    frames_add(f, &ping);
    frames_image(f, NULL, image, &made);
    assert_int_equal(made.microphones_masked, 1);
    assert_memory_equal(image, without, sizeof image);
    frames_destroy(f);
    still_stop(&s);
}

static void an_array_that_a_stage_carries_is_refused(void **state)
{
    (void)state;
    struct still s;
    struct frames *f;
    still_start(&s, FRAMES_COHERENT, SPEAKERS);
    s.bumper.geometry.n_positions = 2;
    assert_int_equal(frames_create(&f, &s.bumper.cfg), -ENOTSUP);
    s.bumper.geometry.n_positions = 1;
    s.bumper.cfg.n_pings = 0;
    assert_int_equal(frames_create(&f, &s.bumper.cfg), -EINVAL);
    still_stop(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_image_is_the_direct_sum),
        cmocka_unit_test(so_it_is_of_an_array_that_is_elsewhere),
        cmocka_unit_test(so_it_is_with_more_pings_than_speakers_and_fewer),
        cmocka_unit_test(a_missing_ping_leaves_the_others_with_their_weights),
        cmocka_unit_test(masked_microphones_do_not_count),
        cmocka_unit_test(a_sliding_image_is_one_made_from_scratch),
        cmocka_unit_test(where_nothing_moves_a_new_image_costs_one_ping),
        cmocka_unit_test(the_newest_ping_alone_is_told_in_means_over_blocks),
        cmocka_unit_test(phases_that_add_up_tell_of_no_ping_alone),
        cmocka_unit_test(what_lies_before_the_gate_is_mute),
        cmocka_unit_test(what_is_imaged_ends_where_the_traces_do),
        cmocka_unit_test(pings_that_are_too_old_are_left_out),
        cmocka_unit_test(a_ping_from_before_makes_a_new_start),
        cmocka_unit_test(a_damaged_trace_counts_as_masked),
        cmocka_unit_test(an_array_that_a_stage_carries_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
