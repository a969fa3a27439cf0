/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "recon/processing.h"
#include "tests/nodes/near.h"

/* The paper's array: 16 speakers over 1 m, microphones 0.08 m beside them. */
struct fixture {
    struct survey s;
    double speakers[16][3], microphones[16][3], positions[3];
    struct processing p;
    struct error why;
};

static struct fixture paper_array(void)
{
    struct fixture f = {0};
    for (int i = 0; i < 16; i++) {
        f.speakers[i][1] = f.microphones[i][1] = i / 15.0;
        f.microphones[i][0] = 0.08;
    }
    f.positions[1] = 0.5;
    f.positions[2] = 1.0;
    f.s.sound_speed_m_s = 340.0;
    f.s.temperature_c = NAN;
    f.s.sample_rate_hz = 48000.0;
    f.s.chirp_start_hz = 2000.0;
    f.s.chirp_stop_hz = 20000.0;
    f.s.chirp_duration_s = 0.0625;
    f.s.slot_samples = 3000;
    f.s.n_speakers = f.s.n_microphones = 16;
    f.s.n_positions = 3;
    f.s.stage_axis[0] = 1.0;
    return f;
}

static int plan(struct fixture *f)
{
    f->s.speakers_m = f->speakers;
    f->s.microphones_m = f->microphones;
    f->s.stage_positions_m = f->positions;
    memset(&f->why, 0, sizeof f->why);
    return processing_plan(&f->p, &f->s, &f->why);
}

static void set_volume(struct fixture *f, double z_min, double z_max, double step)
{
    const double limits[3][3] = {
        {0.0, 1.0, step}, {0.0, 1.0, step}, {z_min, z_max, step}};
    memcpy(f->s.volume_m, limits, sizeof limits);
    f->s.has_volume = true;
}

static void the_gate_begins_behind_the_longest_direct_path(void **state)
{
    (void)state;
    struct fixture f = paper_array();
    assert_int_equal(plan(&f), 0);
    assert_near(f.p.gate_m[0], 0.5 * sqrt(1.0 + 0.08 * 0.08) + 0.1, 1e-12);
    assert_near(f.p.gate_m[1], 4.0, 1e-12);
}

static void a_small_array_still_gates_the_first_30_cm(void **state)
{
    (void)state;
    struct fixture f = paper_array();
    f.s.n_speakers = f.s.n_microphones = 1;
    assert_int_equal(plan(&f), 0);
    assert_near(f.p.gate_m[0], 0.3, 1e-12);
}

static void a_short_slot_limits_the_default_gate(void **state)
{
    (void)state;
    struct fixture f = paper_array();
    f.s.slot_samples = 960;
    f.s.chirp_duration_s = 0.02;
    assert_int_equal(plan(&f), 0);
    assert_near(f.p.gate_m[1], 0.5 * 340.0 * 960 / 48000.0, 1e-9);
}

static void a_slot_that_ends_before_the_gate_begins_is_an_error(void **state)
{
    (void)state;
    struct fixture f = paper_array();
    f.s.slot_samples = 100;
    f.s.chirp_duration_s = 0.002;
    assert_int_equal(plan(&f), -EINVAL);
    assert_non_null(strstr(f.why.text, "slot_samples"));
}

static void a_gate_beyond_the_slot_names_the_field_and_the_limit(void **state)
{
    (void)state;
    struct fixture f = paper_array();
    f.s.has_gate = true;
    f.s.gate_m[0] = 1.0;
    f.s.gate_m[1] = 10.63;
    assert_int_equal(plan(&f), -EINVAL);
    assert_non_null(strstr(f.why.text, "gate_m"));
    assert_non_null(strstr(f.why.text, "10.62"));
    f.s.gate_m[1] = 10.62;
    assert_int_equal(plan(&f), 0);
}

static void latency_takes_its_part_of_the_slot(void **state)
{
    (void)state;
    struct fixture f = paper_array();
    f.s.latency_samples = 300.0;
    f.s.has_gate = true;
    f.s.gate_m[0] = 1.0;
    f.s.gate_m[1] = 0.5 * 340.0 * 2700 / 48000.0 + 0.01;
    assert_int_equal(plan(&f), -EINVAL);
    f.s.gate_m[1] -= 0.02;
    assert_int_equal(plan(&f), 0);
}

static void an_inverted_gate_is_an_error(void **state)
{
    (void)state;
    struct fixture f = paper_array();
    f.s.has_gate = true;
    f.s.gate_m[0] = 3.0;
    f.s.gate_m[1] = 2.0;
    assert_int_equal(plan(&f), -EINVAL);
    assert_non_null(strstr(f.why.text, "gate_m"));
}

static double distance(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

/* Least and greatest two-way delay between the corners of a box and all pairs. */
static void corner_delays(const struct fixture *f, double least_most[2])
{
    least_most[0] = INFINITY;
    least_most[1] = 0.0;
    for (int corner = 0; corner < 8; corner++) {
        double v[3];
        for (int a = 0; a < 3; a++)
            v[a] = f->s.volume_m[a][corner >> a & 1];
        for (size_t k = 0; k < f->s.n_positions; k++) {
            for (int j = 0; j < 16; j++) {
                for (int i = 0; i < 16; i++) {
                    double s[3], m[3];
                    memcpy(s, f->speakers[j], sizeof s);
                    memcpy(m, f->microphones[i], sizeof m);
                    s[0] += f->positions[k];
                    m[0] += f->positions[k];
                    double t = (distance(s, v) + distance(m, v)) / 340.0;
                    least_most[0] = fmin(least_most[0], t);
                    least_most[1] = fmax(least_most[1], t);
                }
            }
        }
    }
}

static void the_delays_of_a_given_volume_are_in_the_gate(void **state)
{
    (void)state;
    struct fixture f = paper_array();
    double delays[2];
    set_volume(&f, 2.0, 3.0, 0.25);
    assert_int_equal(plan(&f), 0);
    corner_delays(&f, delays);
    assert_true(f.p.gate_s[0] <= delays[0]);
    assert_true(f.p.gate_s[1] >= delays[1] - 1e-12);
    assert_true(f.p.gate_s[1] <= delays[1] + 0.001);
    assert_true(f.p.gate_m[0] > 1.8 && f.p.gate_m[0] <= 2.0);
    double echo_end = (f.p.gate_s[1] + 0.0625) * 48000.0;
    assert_true((double)f.p.echo_samples >= echo_end);
    assert_true((double)f.p.echo_samples <= echo_end + 100.0);
    /* Also the whole next emission: here not longer than a second slot. */
    assert_int_equal(f.p.ping_samples, 6000);
    assert_int_equal(f.p.grid.n[2], 5);
}

static void what_lies_behind_the_far_end_of_a_gate_is_not_heard(void **state)
{
    (void)state;
    struct fixture f = paper_array();
    set_volume(&f, 2.0, 3.0, 0.25);
    f.s.has_gate = true;
    f.s.gate_m[0] = 1.0;
    f.s.gate_m[1] = 2.5;
    assert_int_equal(plan(&f), 0);
    assert_near(f.p.gate_s[1], 5.0 / 340.0, 1e-12);
    f.s.has_volume = false; /* nor in the corners of the default volume */
    assert_int_equal(plan(&f), 0);
    assert_near(f.p.gate_s[1], 5.0 / 340.0, 1e-12);
}

static void a_volume_partly_beyond_the_slot_is_cut_at_two_slots(void **state)
{
    (void)state;
    struct fixture f = paper_array();
    set_volume(&f, 9.0, 14.0, 0.5);
    assert_int_equal(plan(&f), 0);
    /* Ten over the band before the next emission has come the shortest way. */
    assert_near(f.p.gate_s[1], 0.0625 + 0.08 / 340.0 - 10.0 / 18000.0, 1e-12);
    assert_int_equal(f.p.ping_samples, 6000);
}

static void a_volume_beyond_the_slot_or_the_gate_is_an_error(void **state)
{
    (void)state;
    struct fixture f = paper_array();
    set_volume(&f, 12.0, 14.0, 0.5);
    assert_int_equal(plan(&f), -EINVAL);
    assert_non_null(strstr(f.why.text, "volume"));
    set_volume(&f, 2.0, 3.0, 0.5);
    f.s.has_gate = true;
    f.s.gate_m[0] = 5.0;
    f.s.gate_m[1] = 6.0;
    assert_int_equal(plan(&f), -EINVAL);
    assert_non_null(strstr(f.why.text, "gate_m"));
}

/* Its echoes end within a third of a millisecond, between two of an interpolator's taps.
 */
static void a_volume_of_one_voxel_has_samples_for_every_interpolator(void **state)
{
    (void)state;
    static const double nearest_m[] = {0.7, 1.5, 3.9};
    static const char *const methods[] = {"fast", "lct", "backprojection"};
    for (size_t k = 0; k < 3; k++) {
        struct fixture f = paper_array();
        double delays_s[2], z = nearest_m[k];
        memcpy(f.s.volume_m,
               (const double[3][3]){{1, 1, .01}, {.5, .5, .01}, {z, z, .01}},
               sizeof f.s.volume_m);
        f.s.has_volume = true;
        f.s.n_positions = 1;
        f.s.n_speakers = f.s.n_microphones = 2;
        assert_int_equal(plan(&f), 0);
        grid_delays(&f.p.grid, &f.p.geometry, delays_s);
        assert_true(delays_s[1] - delays_s[0] < 0.3e-3);
        assert_true(f.p.gate_s[1] - f.p.gate_s[0] > 15.9 / 18e3);
        assert_true(f.p.gate_s[0] < delays_s[0] - 4.0 / 36e3);
        assert_true(f.p.gate_s[1] > delays_s[1] + 4.0 / 36e3);
        for (size_t m = 0; m < 3; m++) {
            struct pulse_compress *pc;
            struct imager *im;
            struct pool *pool;
            assert_int_equal(processing_compressor(&pc, &f.p, &f.s, WINDOW_HANN, &f.why),
                             0);
            assert_int_equal(pool_create(&pool, 1), 0);
            struct trace_format format;
            pulse_compress_format(pc, &format);
            if (processing_imager(&im, &f.p, methods[m], &format, pool, &f.why))
                fail_msg("%s", f.why.text);
            imager_destroy(im);
            pool_destroy(pool);
            pulse_compress_destroy(pc);
        }
    }
}

static void a_volume_of_too_many_voxels_is_refused(void **state)
{
    (void)state;
    struct fixture f = paper_array();
    set_volume(&f, 1.0, 2.0, 1e-4);
    assert_int_equal(plan(&f), -EFBIG);
    assert_non_null(strstr(f.why.text, "voxels"));
    set_volume(&f, 1.0, 2.0, 0.0);
    assert_int_equal(plan(&f), -EINVAL);
}

static void a_falling_chirp_has_the_same_band(void **state)
{
    (void)state;
    struct fixture f = paper_array();
    f.s.chirp_start_hz = 20000.0;
    f.s.chirp_stop_hz = 2000.0;
    assert_int_equal(plan(&f), 0);
    assert_near(f.p.band_hz[0], 2000.0, 0.0);
    assert_near(f.p.band_hz[1], 20000.0, 0.0);
}

/* A static one, whose slot of 24 ms reaches 4.08 m. */
static struct fixture bumper(double far_m)
{
    struct fixture f = paper_array();

    f.s.n_positions = 1;
    f.s.slot_samples = 1152;
    f.s.chirp_duration_s = 0.02;
    f.s.has_gate = true;
    f.s.gate_m[0] = 1.5;
    f.s.gate_m[1] = far_m;
    set_volume(&f, 2.0, 6.0, 0.1);
    return f;
}

static double listen(struct fixture *f)
{
    assert_int_equal(plan(f), 0);
    processing_listen_beyond(&f->p, &f->s);
    return f->p.gate_s[1];
}

static void a_static_array_listens_beyond_its_gate(void **state)
{
    (void)state;
    struct fixture f = bumper(3.0);
    assert_near(listen(&f), 2.0 * 3.6 / 340.0, 1e-12);
    assert_near(f.p.gate_m[1], 3.0, 0.0);
    f = bumper(4.0);
    assert_near(listen(&f), 2.0 * 4.6 / 340.0, 1e-12);
    /* There the next one is heard, from the nearest microphone on. */
    assert_near(f.p.quiet_s, 0.024 + 0.08 / 340.0 - 10.0 / 18000.0, 1e-12);
}

static void it_listens_as_far_as_there_is_a_whole_chirp_and_a_voxel(void **state)
{
    (void)state;
    struct fixture f = bumper(4.0);
    double delays_s[2];

    /* Of two slots, which a ping has: its echo comes late, and ends with them. */
    f.s.latency_samples = 100.0;
    assert_near(listen(&f), 2.0 * 0.024 - 100.0 / 48000.0 - 0.02, 1e-12);
    /* The farthest voxel, 3.6 m ahead and 1 m aside, of the outermost pair. */
    f = bumper(3.4);
    set_volume(&f, 2.0, 3.6, 0.1);
    corner_delays(&f, delays_s);
    assert_near(delays_s[1],
                (sqrt(1.0 + 1.0 + 3.6 * 3.6) + sqrt(0.92 * 0.92 + 1.0 + 3.6 * 3.6)) /
                    340.0,
                1e-12);
    assert_true(delays_s[1] < 2.0 * (3.4 + 0.6) / 340.0);
    assert_near(listen(&f), delays_s[1], 1e-12);
}

static void an_array_on_a_stage_listens_within_its_gate(void **state)
{
    (void)state;
    struct fixture f = bumper(4.0);
    f.s.n_positions = 3;
    assert_int_equal(plan(&f), 0);
    double until_s = f.p.gate_s[1];
    assert_true(listen(&f) == until_s);
    f = bumper(2.0);
    set_volume(&f, 1.6, 6.0, 0.1);
    f.s.slot_samples = 720; /* shorter than the chirp: emissions overlap */
    assert_int_equal(plan(&f), 0);
    until_s = f.p.gate_s[1];
    assert_true(listen(&f) == until_s);
}

static void a_method_that_does_not_exist_is_told_with_those_that_do(void **state)
{
    (void)state;
    struct fixture f = paper_array();
    struct trace_format format = {
        .t0_s = 0.004, .rate_hz = 36000.0, .carrier_hz = 11000.0, .n_samples = 800};
    struct imager *imager = NULL;
    assert_int_equal(plan(&f), 0);
    assert_int_equal(processing_imager(&imager, &f.p, "magic", &format, NULL, &f.why),
                     -ENOENT);
    assert_null(imager);
    assert_non_null(strstr(f.why.text, "magic"));
    assert_non_null(strstr(f.why.text, imager_methods()));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_gate_begins_behind_the_longest_direct_path),
        cmocka_unit_test(a_small_array_still_gates_the_first_30_cm),
        cmocka_unit_test(a_short_slot_limits_the_default_gate),
        cmocka_unit_test(a_slot_that_ends_before_the_gate_begins_is_an_error),
        cmocka_unit_test(a_gate_beyond_the_slot_names_the_field_and_the_limit),
        cmocka_unit_test(latency_takes_its_part_of_the_slot),
        cmocka_unit_test(an_inverted_gate_is_an_error),
        cmocka_unit_test(the_delays_of_a_given_volume_are_in_the_gate),
        cmocka_unit_test(what_lies_behind_the_far_end_of_a_gate_is_not_heard),
        cmocka_unit_test(a_volume_partly_beyond_the_slot_is_cut_at_two_slots),
        cmocka_unit_test(a_volume_beyond_the_slot_or_the_gate_is_an_error),
        cmocka_unit_test(a_volume_of_one_voxel_has_samples_for_every_interpolator),
        cmocka_unit_test(a_volume_of_too_many_voxels_is_refused),
        cmocka_unit_test(a_falling_chirp_has_the_same_band),
        cmocka_unit_test(a_static_array_listens_beyond_its_gate),
        cmocka_unit_test(it_listens_as_far_as_there_is_a_whole_chirp_and_a_voxel),
        cmocka_unit_test(an_array_on_a_stage_listens_within_its_gate),
        cmocka_unit_test(a_method_that_does_not_exist_is_told_with_those_that_do),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
