/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "recon/detection/lobes.h"
#include "tests/recon/rig.h"

#define STEP_M 0.065 /* of the stage: a wavelength of 5.3 kHz, four times too long */

struct scene {
    struct rig rig;
    struct trace_set set;
};

/* 2 to 6 kHz: traces of 16 positions, 4 speakers, 4 microphones. */
static void open_scene(struct scene *s, const struct scatterer *points, size_t n)
{
    struct rig *r = &s->rig;
    struct geometry *g = &r->geometry;

    rig_default(r);
    g->n_positions = 16;
    for (size_t k = 0; k < g->n_positions; k++)
        r->positions_m[k] = STEP_M * ((double)k - 7.5);
    r->band_hz[0] = 2000.0;
    r->band_hz[1] = 6000.0;
    r->format.rate_hz = 10000.0;
    r->format.carrier_hz = 4000.0;
    rig_listen(r, 0.7, 4.0);
    s->set = rig_traces(r, points, n);
    s->set.gate_m[0] = 0.3;
    s->set.gate_m[1] = 4.0;
}

static void close_scene(struct scene *s)
{
    rig_free_traces(&s->set);
}

static struct detection seen(double range_m, double u_x, double level_db)
{
    return (struct detection){
        .position_m = {range_m * u_x, 0.0, range_m * sqrt(1.0 - u_x * u_x)},
        .level_db = level_db,
        .existence = 1.0};
}

static struct scatterer at(const struct detection *d, double gain)
{
    return (struct scatterer){{d->position_m[0], d->position_m[1], d->position_m[2]},
                              gain};
}

/* Waves of 5.5 kHz agree about sin 0.78 and about sin 0.78 - c / (2 f step) = 0.30. */
static void a_lobe_of_what_is_strong_hardly_exists(void **state)
{
    (void)state;
    struct detection found[2] = {seen(2.3, 0.78, 30.0), seen(2.3, 0.30, 25.0)};
    const struct scatterer point = at(&found[0], 1.0);
    struct scene s;

    open_scene(&s, &point, 1);
    lobes_judge(&s.set, found, 2);
    assert_true(found[0].existence > 0.95);
    assert_true(found[1].existence < 0.3);
    close_scene(&s);
}

static void an_object_where_a_lobe_would_be_exists(void **state)
{
    (void)state;
    struct detection found[2] = {seen(2.3, 0.78, 30.0), seen(2.3, 0.30, 25.0)};
    const struct scatterer points[2] = {at(&found[0], 1.0), at(&found[1], 0.5)};
    struct scene s;

    open_scene(&s, points, 2);
    lobes_judge(&s.set, found, 2);
    assert_true(found[0].existence > 0.9);
    assert_true(found[1].existence > 0.9);
    close_scene(&s);
}

/* No lobe comes from a range that no element has. */
static void what_is_at_another_range_is_left_alone(void **state)
{
    (void)state;
    struct detection found[2] = {seen(1.4, 0.78, 30.0), seen(2.3, 0.30, 25.0)};
    const struct scatterer point = at(&found[0], 1.0);
    struct scene s;

    open_scene(&s, &point, 1);
    lobes_judge(&s.set, found, 2);
    assert_true(found[0].existence == 1.0 && found[1].existence == 1.0);
    close_scene(&s);
}

/* -- without traces ---------------------------------------------------------------------
 */

static double suspected(double fainter_db, unsigned at_border, double other_m)
{
    struct detection found[2] = {seen(2.3, 0.78, 30.0),
                                 seen(other_m, 0.30, 30.0 - fainter_db)};
    struct scene s;

    open_scene(&s, NULL, 0);
    found[0].at_border = at_border;
    lobes_suspect(s.set.geometry, found, 2);
    close_scene(&s);
    return found[1].existence;
}

static void what_is_faint_beside_a_border_may_be_a_lobe_of_what_lies_beyond(void **state)
{
    (void)state;

    assert_true(suspected(8.0, PEAK_BORDER(0, 1), 2.3) < 0.2);
    assert_true(suspected(0.0, PEAK_BORDER(0, 1), 2.3) > 0.8);
    assert_true(suspected(-8.0, PEAK_BORDER(0, 1), 2.3) > 0.99);
    assert_true(suspected(8.0, PEAK_BORDER(0, 1), 3.9) == 1.0);
    assert_true(suspected(8.0, 0, 2.3) == 1.0);
}

/* A point 3 cm beyond a side of 32 cm of volume: its grating lobes are at the other one.
 */
static void nothing_is_reported_at_the_other_border(void **state)
{
    (void)state;

    for (int face = 0; face < 4; face++) {
        struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
        struct detect_config cfg;
        struct detection found[8];
        struct rig r;
        size_t n, reported = 0;
        rig_default(&r);
        rig_look_at(&r, 0.0, 0.0, 1.1, 17, 0.02);
        point.at_m[face / 2] += (face % 2 ? 1.0 : -1.0) * (0.16 + 0.03);
        float *image = rig_image(&r, "fast", &point, 1, 1);
        detect_config_default(&cfg);
        geometry_resolution(&r.geometry, r.band_hz, 1.1, cfg.resolution_m);
        assert_int_equal(detect_objects(&cfg, &r.grid, image, found, 8, &n), 0);
        free(image);
        assert_true(n >= 2);
        lobes_suspect(&r.geometry, found, n);
        for (size_t i = 0; i < n; i++) {
            if (found[i].existence < 0.5)
                continue;
            reported++;
            assert_below(fabs(found[i].position_m[face / 2] - point.at_m[face / 2]), 0.1);
        }
        assert_int_equal(reported, 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_lobe_of_what_is_strong_hardly_exists),
        cmocka_unit_test(an_object_where_a_lobe_would_be_exists),
        cmocka_unit_test(what_is_at_another_range_is_left_alone),
        cmocka_unit_test(what_is_faint_beside_a_border_may_be_a_lobe_of_what_lies_beyond),
        cmocka_unit_test(nothing_is_reported_at_the_other_border),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
