/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "recon/static_array/first_return.h"
#include "tests/nodes/near.h"

enum { MICS = 2, SAMPLES = 1200 };

static const struct trace_format format = {
    .t0_s = 1e-3, .rate_hz = 40000.0, .n_samples = SAMPLES};

/* On the nose of a vehicle, looking ahead at a wall 1.5 m away. */
static struct survey facing_a_wall(void)
{
    static double speakers[1][3] = {{-0.3, 0, 0}};
    static double microphones[MICS][3] = {{0.3, 0, 0}, {-0.1, 0, 0}};

    return (struct survey){.sound_speed_m_s = 340.0,
                           .n_speakers = 1,
                           .n_microphones = MICS,
                           .n_positions = 1,
                           .speakers_m = speakers,
                           .microphones_m = microphones,
                           .has_wall = true,
                           .wall_normal = {0, 0, 1},
                           .wall_distance_m = 1.5,
                           .has_mount = true,
                           .mount_origin_m = {3.6, 0, 0.4},
                           .mount_x_axis = {0, 1, 0},
                           .mount_y_axis = {0, 0, 1}};
}

static void mute(const struct first_return *f, const struct survey *s,
                 const struct ego_path *path, int64_t stamp_ns,
                 float complex traces[MICS][SAMPLES])
{
    for (int i = 0; i < MICS * SAMPLES; i++)
        traces[i / SAMPLES][i % SAMPLES] = 1.0f;
    first_return_mute(f, s, path, 0, stamp_ns, &format, traces[0]);
}

/* The wall's echo comes by way of the microphone's mirror image; to it belongs what is
 * 0.15 m behind the wall, and an edge of eight samples. */
static void expect_muted_to(double wall_m, const struct first_return *f,
                            const struct survey *s, const struct ego_path *path,
                            int64_t stamp_ns)
{
    static const double apart_m[MICS] = {0.6, 0.2};
    static float complex traces[MICS][SAMPLES];

    mute(f, s, path, stamp_ns, traces);
    for (int m = 0; m < MICS; m++) {
        double path_m = hypot(apart_m[m], 2.0 * wall_m) + 0.3;
        double end = (path_m / 340.0 - format.t0_s) * format.rate_hz;
        for (int k = 0; k < SAMPLES; k++) {
            if (k < end - 8.0)
                assert_near(cabsf(traces[m][k]), 0.0, 1e-6);
            else if (k < end)
                assert_in_range(
                    lrintf(1000.0f * (crealf(traces[m][k]) - crealf(traces[m][k - 1]))),
                    0, 200); /* an eighth of half a cosine at most */
            else
                assert_near(crealf(traces[m][k]), 1.0, 0.0);
        }
    }
}

static void expect_nothing_muted(const struct first_return *f, const struct survey *s)
{
    static float complex traces[MICS][SAMPLES];

    mute(f, s, NULL, 0, traces);
    assert_near(crealf(traces[0][0]), 1.0, 0.0);
    assert_near(crealf(traces[1][0]), 1.0, 0.0);
}

static void nothing_before_the_wall_and_all_behind_it_is_heard(void **state)
{
    (void)state;
    struct survey s = facing_a_wall();
    struct first_return f = {.told = false};

    expect_nothing_muted(&f, &s);
    first_return_survey(&f, &s);
    expect_muted_to(1.5, &f, &s, NULL, 0);
    s.n_walls = 2; /* the nearest counts */
    s.walls[0] = (struct survey_wall){{0, 0, 1}, 2.5, {0, 9}};
    s.walls[1] = (struct survey_wall){{0, 0, 1}, 0.9, {0, 9}};
    first_return_survey(&f, &s);
    expect_muted_to(0.9, &f, &s, NULL, 0);
}

static struct walls wall_ahead(double distance_m)
{
    struct walls w = {.n = 1};

    w.list[0] =
        (struct wall_gate){.id = 1,
                           .plane = {.normal = {0, 0, 1}, .distance_m = distance_m},
                           .gate_m = {0, WALLS_FAR_M}};
    return w;
}

static void what_is_found_is_better_than_the_survey(void **state)
{
    (void)state;
    const struct survey s = facing_a_wall();
    struct first_return f = {.told = false};
    const struct walls ahead = wall_ahead(2.0), none = {.n = 0};

    first_return_survey(&f, &s);
    /* it is silent about what the survey knows, as long as it never saw a wall */
    first_return_walls(&f, &none, 0);
    expect_muted_to(1.5, &f, &s, NULL, 0);
    first_return_walls(&f, &ahead, 0);
    expect_muted_to(2.0, &f, &s, NULL, 0);
    first_return_survey(&f, &s);
    expect_muted_to(2.0, &f, &s, NULL, 0);
    first_return_walls(&f, &none, 0); /* it is lost */
    expect_nothing_muted(&f, &s);
}

/* 2 m/s towards it for 0.3 s; before the path begins nothing is known. */
static void a_wall_that_was_told_comes_nearer_as_the_vehicle_drives(void **state)
{
    (void)state;
    static const int64_t ms = 1000000;
    const struct survey s = facing_a_wall();
    const struct ego_motion motion = {.speed_m_s = 2.0};
    struct ego_path path = {.n = 0};
    struct first_return f = {.told = false};
    const struct walls ahead = wall_ahead(2.0);

    for (int k = 10; k <= 20; k++)
        assert_int_equal(ego_path_add(&path, k * 50 * ms, &motion), 0);
    first_return_walls(&f, &ahead, 600 * ms);
    expect_muted_to(1.4, &f, &s, &path, 900 * ms);
    expect_muted_to(2.0, &f, &s, &path, 600 * ms);
    expect_muted_to(2.0, &f, &s, &path, 100 * ms);
    expect_muted_to(2.0, &f, &s, NULL, 900 * ms);
    f.told = false; /* a survey's walls are where they are */
    first_return_survey(&f, &s);
    expect_muted_to(1.5, &f, &s, &path, 900 * ms);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_before_the_wall_and_all_behind_it_is_heard),
        cmocka_unit_test(what_is_found_is_better_than_the_survey),
        cmocka_unit_test(a_wall_that_was_told_comes_nearer_as_the_vehicle_drives),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
