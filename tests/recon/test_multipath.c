/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <complex.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "recon/detection/multipath.h"
#include "tests/recon/rig.h"

#define MAX 16

/* -- places alone -----------------------------------------------------------------------
 */

static const struct multipath_config place = {
    .centre_m = {0.0, 0.0, 0.0}, .lowest_m = -0.5, .volume_m3 = 3.0};

static struct detection object(double x, double y, double z, double level_db)
{
    return (struct detection){.position_m = {x, y, z},
                              .covariance_m2 = {1e-5, 0, 0, 1e-5, 0, 1e-5},
                              .level_db = level_db,
                              .existence = 1.0};
}

static double range(const struct detection *d)
{
    return reference_distance(d->position_m, (const double[3]){0});
}

/* Where an echo is imaged that leaves towards `there` and comes back from `back`, after
 * `way_m` in all: half the way off, in the mean of both directions. */
static struct detection bounce(const struct detection *there,
                               const struct detection *back, double way_m,
                               double level_db)
{
    double u[3] = {0}, square = 0.0;

    for (int a = 0; a < 2; a++) {
        u[a] = 0.5 * there->position_m[a] / range(there) +
               0.5 * back->position_m[a] / range(back);
        square += u[a] * u[a];
    }
    u[2] = sqrt(1.0 - square);
    return object(0.5 * way_m * u[0], 0.5 * way_m * u[1], 0.5 * way_m * u[2], level_db);
}

static struct detection between(const struct detection *p, const struct detection *b,
                                double level_db)
{
    double way_m = range(p) + range(b) + reference_distance(p->position_m, b->position_m);

    return bounce(p, b, way_m, level_db);
}

static void expect_object(const struct detection *d)
{
    assert_int_equal(d->multipath, MULTIPATH_NONE);
    assert_true(d->existence > 0.8);
}

static void expect_echo(const struct detection *d, enum multipath kind, size_t p,
                        size_t b)
{
    assert_int_equal(d->multipath, kind);
    assert_true(d->existence < 0.25);
    assert_true((d->of[0] == p && d->of[1] == b) || (d->of[0] == b && d->of[1] == p));
}

static void an_echo_between_two_objects_names_both(void **state)
{
    (void)state;
    struct detection all[3] = {object(-0.5, 0.1, 1.4, 30.0),
                               object(0.6, -0.1, 1.6, 28.0)};

    all[2] = between(&all[0], &all[1], 26.0);
    multipath_judge(&place, all, 3);
    expect_object(&all[0]);
    expect_object(&all[1]);
    expect_echo(&all[2], MULTIPATH_PAIR, 0, 1);
}

/* The order of a list says nothing. */
static void the_strongest_may_be_the_echo_of_nearly_as_strong_ones(void **state)
{
    (void)state;
    struct detection all[3] = {object(0.0, 0.0, 1.0, 0.0), object(-0.5, 0.1, 1.4, 28.0),
                               object(0.6, -0.1, 1.6, 28.0)};

    all[0] = between(&all[1], &all[2], 29.0);
    multipath_judge(&place, all, 3);
    expect_echo(&all[0], MULTIPATH_PAIR, 1, 2);
    expect_object(&all[1]);
    expect_object(&all[2]);
}

static void what_is_far_louder_than_its_makers_is_an_object(void **state)
{
    (void)state;
    struct detection all[3] = {object(-0.5, 0.1, 1.4, 20.0),
                               object(0.6, -0.1, 1.6, 18.0)};

    all[2] = between(&all[0], &all[1], 26.0);
    multipath_judge(&place, all, 3);
    for (int i = 0; i < 3; i++)
        expect_object(&all[i]);
}

/* A plane x = 0.3 that an object at x = -0.4 sees itself in, though nothing of the plane
 * echoes back to the array. */
static void a_flat_face_that_is_not_seen_makes_two_images(void **state)
{
    (void)state;
    struct detection p = object(0.1, 0.0, 1.3, 30.0), m = object(0.9, 0.1, 1.7, 24.0);
    struct detection all[3] = {m, bounce(&p, &m, range(&p) + range(&m), 29.0), p};

    multipath_judge(&place, all, 3);
    expect_object(&all[2]);
    expect_echo(&all[1], MULTIPATH_FACE, 2, 0);
    expect_echo(&all[0], MULTIPATH_FACE, 2, 1);
}

static void an_echo_straight_behind_a_body_is_its_own(void **state)
{
    (void)state;
    struct detection all[2] = {object(-0.5, 0.1, 1.4, 30.0)};

    all[1] = object(-0.5 * 1.3, 0.1 * 1.3, 1.4 * 1.3, 18.0);
    multipath_judge(&place, all, 2);
    expect_object(&all[0]);
    expect_echo(&all[1], MULTIPATH_SHADOW, 0, 0);
}

/* A wall at z = 0.9 shows an object at z = 0.3 behind itself; heard by way of the wall
 * there and through the panel before it back, it is nearer than its image. */
static void what_hides_an_object_lets_a_little_through(void **state)
{
    (void)state;
    const struct wall wall = {.normal = {0.0, 0.0, 1.0}, .distance_m = 0.9};
    struct multipath_config cfg = place;
    struct detection p = object(1.0, 0.1, 1.5, 30.0), real = object(1.0, 0.1, 0.3, 0.0);
    struct detection all[2] = {p, bounce(&p, &real, range(&p) + range(&real), 15.0)};

    multipath_judge(&cfg, all, 2);
    expect_object(&all[1]);
    cfg.walls = &wall;
    cfg.n_walls = 1;
    all[1].existence = 1.0;
    multipath_judge(&cfg, all, 2);
    expect_object(&all[0]);
    expect_echo(&all[1], MULTIPATH_FACE, 0, 0);
}

/* Ground at y = -0.8: an object at 0.4 has its mirror image at -2.0. */
static void the_ground_mirrors_what_stands_over_it(void **state)
{
    (void)state;
    struct detection p = object(-0.5, 0.4, 1.4, 30.0), m = object(-0.5, -2.0, 1.4, 0.0);
    struct detection all[2] = {p, bounce(&p, &m, range(&p) + range(&m), 24.0)};

    multipath_judge(&place, all, 2);
    expect_object(&all[0]);
    expect_echo(&all[1], MULTIPATH_FACE, 0, 0);
}

static void the_feet_of_a_body_are_no_image_of_it(void **state)
{
    (void)state;
    struct detection all[2] = {object(-0.5, 0.2, 1.4, 30.0),
                               object(-0.5, -0.7, 1.45, 20.0)};

    all[0].extent_m[1] = 0.9;
    multipath_judge(&place, all, 2);
    assert_int_equal(all[1].multipath, MULTIPATH_NONE);
}

/* Two points of which one is just behind the other. */
static void parts_of_a_body_are_no_echoes_of_each_other(void **state)
{
    (void)state;
    struct detection all[2] = {object(-0.50, 0.10, 1.40, 30.0),
                               object(-0.52, 0.10, 1.45, 28.0)};

    multipath_judge(&place, all, 2);
    assert_int_equal(all[1].multipath, MULTIPATH_NONE);
    assert_true(all[1].existence == 1.0);
}

/* What has no known direction agrees with all, and so tells nothing. */
static void what_is_not_known_explains_nothing(void **state)
{
    (void)state;
    struct detection all[3] = {object(-0.5, 0.1, 1.4, 30.0),
                               object(0.6, -0.1, 1.6, 28.0)};

    all[2] = between(&all[0], &all[1], 26.0);
    for (int i = 0; i < 2; i++)
        all[i].covariance_m2[0] = all[i].covariance_m2[3] = 1e4;
    multipath_judge(&place, all, 3);
    expect_object(&all[2]);
}

static double spread(unsigned long long *seed, double low, double high)
{
    return low + (high - low) * reference_random(seed);
}

/* Existence is a probability: as many objects as echoes, anywhere, with bodies that turn
 * other sides to each other than to the array.  Of those that it gives up few exist; of
 * those that exist it gives up few, and tells apart nearly all. */
static void existence_is_as_true_as_it_says(void **state)
{
    enum { SCENES = 2000 };
    unsigned long long seed = 5;
    size_t given_up = 0, wrong = 0, echoes = 0, found = 0;

    (void)state;
    for (int k = 0; k < SCENES; k++) {
        struct detection all[3];
        bool real = k % 2;
        for (int i = 0; i < 3; i++)
            all[i] = object(spread(&seed, -0.8, 0.8), spread(&seed, -0.5, 0.5),
                            spread(&seed, 1.2, 2.6), 30.0 - i);
        if (!real) {
            all[2] = between(&all[0], &all[1], 24.0);
            for (int a = 0; a < 3; a++)
                all[2].position_m[a] += spread(&seed, -0.05, 0.05);
        }
        multipath_judge(&place, all, 3);
        echoes += !real;
        found += !real && all[2].existence < 0.5;
        given_up += all[2].existence < 0.5;
        wrong += real && all[2].existence < 0.5;
    }
    assert_true(found > 0.9 * (double)echoes);
    assert_true(wrong < 0.12 * (SCENES - (double)echoes));
    assert_true(wrong < 0.25 * (double)given_up);
}

/* -- sound ------------------------------------------------------------------------------
 */

/* The trace of one pair that hears two points, and what went from one to the other,
 * either way: gains over all distances, delays over the whole way. */
static void hear(const struct rig *r, const double s[3], const double m[3],
                 const struct scatterer at[2], double bounced, float complex *out)
{
    const double *p = at[0].at_m, *b = at[1].at_m;
    double sp = reference_distance(s, p), sb = reference_distance(s, b);
    double pm = reference_distance(p, m), bm = reference_distance(b, m);
    double pb = reference_distance(p, b);
    const double way_m[4] = {sp + pm, sb + bm, sp + pb + bm, sb + pb + pm};
    const double gain[4] = {at[0].gain / (sp * pm), at[1].gain / (sb * bm),
                            bounced / (sp * pb * bm), bounced / (sb * pb * pm)};

    for (size_t n = 0; n < r->format.n_samples; n++) {
        double complex sum = 0.0;
        double t_s = r->format.t0_s + (double)n / r->format.rate_hz;
        for (int e = 0; e < 4; e++)
            sum += gain[e] * reference_echo(r->band_hz, r->format.carrier_hz,
                                            way_m[e] / r->geometry.sound_speed_m_s, t_s);
        out[n] = (float complex)sum;
    }
}

static size_t image_and_find(const struct rig *r, const struct scatterer at[2],
                             double bounced, struct detection found[MAX])
{
    const struct geometry *g = &r->geometry;
    size_t n_samples = r->format.n_samples, n = 0;
    float complex *traces = malloc(g->n_microphones * n_samples * sizeof *traces);
    float *image = malloc(grid_size(&r->grid) * sizeof *image);
    struct multipath_config cfg;
    struct detect_config detect;
    struct pool *pool;

    assert_true(traces && image);
    assert_int_equal(pool_create(&pool, 1), 0);
    struct imager *im = rig_imager(r, "fast", pool);
    for (size_t q = 0; q < g->n_positions; q++)
        for (size_t s = 0; s < g->n_speakers; s++) {
            for (size_t m = 0; m < g->n_microphones; m++) {
                double speaker[3], microphone[3];
                geometry_speaker(g, q, s, speaker);
                geometry_microphone(g, q, 0, m, microphone);
                hear(r, speaker, microphone, at, bounced, traces + m * n_samples);
            }
            imager_add(im, q, s, traces, NULL);
        }
    imager_image(im, image);
    detect_config_default(&detect);
    assert_int_equal(detect_objects(&detect, &r->grid, image, found, MAX, &n), 0);
    multipath_config_fill(&cfg, g, &r->grid);
    multipath_judge(&cfg, found, n);
    imager_destroy(im);
    pool_destroy(pool);
    free(image);
    free(traces);
    return n;
}

static const struct detection *nearest(const struct detection *found, size_t n,
                                       const double at_m[3])
{
    const struct detection *best = found;

    assert_true(n > 0);
    for (size_t i = 0; i < n; i++)
        if (reference_distance(found[i].position_m, at_m) <
            reference_distance(best->position_m, at_m))
            best = &found[i];
    assert_true(reference_distance(best->position_m, at_m) < 0.05);
    return best;
}

/* As loud as the objects, as between a post and the side of a box. */
static void an_echo_of_two_bounces_is_imaged_but_not_believed(void **state)
{
    (void)state;
    const struct scatterer at[2] = {{{-0.14, -0.06, 0.96}, 1.0},
                                    {{0.16, 0.06, 1.02}, 1.0}};
    struct detection found[MAX];
    struct rig r;

    rig_default(&r);
    rig_look_at(&r, 0.0, 0.0, 1.12, 31, 0.015);
    size_t n = image_and_find(&r, at, 0.2, found);
    const struct detection *p = nearest(found, n, at[0].at_m);
    const struct detection *b = nearest(found, n, at[1].at_m);
    expect_object(p);
    expect_object(b);
    struct detection expected = between(p, b, 0.0); /* the rig's middle is the origin */
    const struct detection *g = nearest(found, n, expected.position_m);
    expect_echo(g, MULTIPATH_PAIR, (size_t)(p - found), (size_t)(b - found));
    n = image_and_find(&r, at, 0.0, found);
    for (size_t i = 0; i < n; i++)
        assert_int_equal(found[i].multipath, MULTIPATH_NONE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_echo_between_two_objects_names_both),
        cmocka_unit_test(the_strongest_may_be_the_echo_of_nearly_as_strong_ones),
        cmocka_unit_test(what_is_far_louder_than_its_makers_is_an_object),
        cmocka_unit_test(a_flat_face_that_is_not_seen_makes_two_images),
        cmocka_unit_test(an_echo_straight_behind_a_body_is_its_own),
        cmocka_unit_test(what_hides_an_object_lets_a_little_through),
        cmocka_unit_test(the_ground_mirrors_what_stands_over_it),
        cmocka_unit_test(the_feet_of_a_body_are_no_image_of_it),
        cmocka_unit_test(parts_of_a_body_are_no_echoes_of_each_other),
        cmocka_unit_test(what_is_not_known_explains_nothing),
        cmocka_unit_test(existence_is_as_true_as_it_says),
        cmocka_unit_test(an_echo_of_two_bounces_is_imaged_but_not_believed),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
