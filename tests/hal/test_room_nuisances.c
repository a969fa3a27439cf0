/* SPDX-License-Identifier: MIT */
/* What a real place has besides what is looked for: a vehicle that rocks, air that warms,
 * slams, a wall that ends, clutter that it mirrors. */
#include "drive.h"

#include <math.h>

#include "hal/room/room.h"

#define SOUND_M_S 340.0
#define RATE_HZ   48000.0

static double chirp(double t_s)
{
    return t_s < 0 || t_s > 0.02
               ? 0
               : cos(2 * M_PI * (2000 * t_s + 18000 / 0.02 / 2 * t_s * t_s));
}

/* What is left of samples[n] when a chirp that comes after so many metres is taken away,
 * of its power; dB. */
static double rest_db(const float *x, size_t n, double way_m, double sound_m_s,
                      double strength)
{
    double error = 0, power = 0;
    for (size_t i = 0; i < n; i++) {
        double t_s = (double)i / RATE_HZ - way_m / sound_m_s;
        if (t_s < 0.001 || t_s > 0.019)
            continue;
        double expected = strength / way_m * chirp(t_s);
        error += pow(x[i] - expected, 2);
        power += expected * expected;
    }
    assert_true(power > 0);
    return 10 * log10(error / power);
}

/* From the speaker's image in a wall at a distance to the microphone. */
static double wall_way_m(double distance_m)
{
    return hypot(0.05, 2 * distance_m);
}

#define ECHO                                                                             \
    DRIVE_TIMING DRIVE_PAIR DRIVE_WALL "wall_sound: {reflectivity: 1, echo: 0.8}\n"

/* A quarter of a swing in, the array is nearest to the wall, and for an instant at rest;
 * half a swing later it is farthest: 2 mm of way, 42 degrees of phase at 20 kHz. */
static void a_vehicle_that_rocks_is_heard_where_it_is_just_now(void **state)
{
    struct room *r = drive_load(state, ECHO "drive: {period_s: 10, rock: "
                                            "{frequency_hz: 1, forward_m: 0.0005}}\n");
    float *near = drive_emit(r, 2.25 - 0.01, PASS_SCENE, 0);
    float *far = drive_emit(r, 2.75 - 0.01, PASS_SCENE, 0);
    size_t n = room_frames(r, 1);
    assert_true(rest_db(near, n, wall_way_m(1.9995), SOUND_M_S, 0.8) < -35);
    assert_true(rest_db(far, n, wall_way_m(2.0005), SOUND_M_S, 0.8) < -35);
    assert_true(rest_db(far, n, wall_way_m(1.9995), SOUND_M_S, 0.8) > -15);
    struct room_ego ego; /* its wheels do not turn */
    room_ego(r, 2.25, &ego);
    assert_true(ego.x_m == 0 && ego.speed_m_s == 0 && ego.standstill);
    free(near);
    free(far);
    room_destroy(r);
}

/* The drive repeats, and so does what fits into it a whole number of times. */
static void it_rocks_on_where_the_drive_begins_again(void **state)
{
    struct room *r = drive_load(state, ECHO "drive: {period_s: 10, rock: "
                                            "{frequency_hz: 1.04, left_m: 0.001, "
                                            "yaw_deg: 0.1}}\n");
    double n[3], before_m, after_m;
    room_wall(r, 9.9999, n, &before_m);
    double turn = atan2(n[0], n[2]);
    room_wall(r, 10.0001, n, &after_m);
    assert_true(fabs(turn) > 0.05 * M_PI / 180); /* a third of a turn from the middle */
    assert_true(fabs(atan2(n[0], n[2]) - turn) < 1e-5);
    assert_true(fabs(before_m - after_m) < 1e-5);
    room_destroy(r);
}

/* 2 K a minute for half a minute, and back: sound is faster as the root of the absolute
 * temperature. */
static void air_that_warms_brings_echoes_sooner(void **state)
{
    static const struct {
        double t_s, warmer_c;
    } times[] = {{0, 0}, {30, 1}, {59.99, 0}, {45, 0.5}};
    struct room *r = drive_load(state, ECHO "temperature_c: 20\n"
                                            "drift: {rate_c_min: 2}\n"
                                            "drive: {period_s: 60}\n");
    for (size_t i = 0; i < sizeof times / sizeof *times; i++) {
        float *x = drive_emit(r, times[i].t_s, PASS_SCENE, 0);
        double speed_m_s = SOUND_M_S * sqrt((293.15 + times[i].warmer_c) / 293.15);
        double db = rest_db(x, room_frames(r, 1), wall_way_m(2), speed_m_s, 0.8);
        assert_true(db < -35);
        db = rest_db(x, room_frames(r, 1), wall_way_m(2), SOUND_M_S, 0.8);
        assert_true(times[i].warmer_c < 0.9 || db > -10); /* 6.8 mm */
        free(x);
    }
    room_destroy(r);
}

#define TWO "speakers_m: [[0, 0, 0]]\nmicrophones_m: [[-0.3, 0, 0], [0.4, 0, 0]]\n"

static size_t first_sound(const float *x, size_t n)
{
    size_t i = 0;
    while (i < n && x[i] == 0)
        i++;
    return i;
}

static void a_slam_is_heard_by_all_microphones_at_once(void **state)
{
    struct room *r =
        drive_load(state, DRIVE_TIMING TWO DRIVE_WALL
                   "drive: {period_s: 4}\nnoise: {slams: [{during_s: [1, 1], peak: 0.3, "
                   "decay_s: 0.01}]}\n");
    size_t n = room_frames(r, 1);
    float *x = drive_emit(r, 0.99, PASS_SCENE, 0),
          *later = drive_emit(r, 1, PASS_SCENE, 7);
    double first = 0, second = 0;
    assert_int_equal(first_sound(x, n), 480);
    assert_memory_equal(x, x + n, n * sizeof *x);
    assert_memory_equal(x + 480, later,
                        (n - 480) * sizeof *x); /* one sound, at any time */
    for (int i = 0; i < 480; i++) {             /* a decay each */
        first += pow(later[i], 2);
        second += pow(later[480 + i], 2);
    }
    /* The mean of exp(-2 t) over a decay, within four sigma of 480 samples. */
    double expected = 480 * 0.09 * (1 - exp(-2)) / 2;
    assert_true(fabs(first / expected - 1) < 0.3);
    assert_true(fabs(second / expected / exp(-2) - 1) < 0.3);
    float *before = drive_emit(r, 0.9, PASS_SCENE, 0);
    assert_int_equal(first_sound(before, n), n);
    free(x);
    free(later);
    free(before);
    room_destroy(r);
}

static void a_slam_goes_from_where_it_is_to_each_microphone(void **state)
{
    struct room *r =
        drive_load(state, DRIVE_TIMING TWO DRIVE_WALL
                   "drive: {period_s: 4}\nnoise: {slams: [{during_s: [1, 1], peak: 0.3, "
                   "decay_s: 0.01, position_m: [3.8, 0, 0]}]}\n");
    size_t n = room_frames(r, 1);
    float *x = drive_emit(r, 1, PASS_SCENE, 0);
    size_t left = first_sound(x, n), right = first_sound(x + n, n);
    assert_true(labs((long)left - lround(4.1 / SOUND_M_S * RATE_HZ)) <= 1);
    assert_true(labs((long)right - lround(3.4 / SOUND_M_S * RATE_HZ)) <= 1);
    assert_memory_equal(x + left, x + n + right, (n - left) * sizeof *x);
    free(x);
    room_destroy(r);
}

/* When a slam of 0..4 s begins, in the recording of an endless shot of 4 s. */
static double slam_begins_s(void **state, uint32_t draw)
{
    const char *path = scratch_write(
        *state, "scene.yaml",
        DRIVE_TIMING DRIVE_PAIR DRIVE_WALL
        "drive: {period_s: 4}\nnoise: {slams: [{during_s: [0, 4], peak: 0.3, "
        "decay_s: 0.001}]}\n");
    static const uint32_t speaker = 0;
    const struct room_stream_config cfg = {
        .pass = PASS_SCENE, .speakers = &speaker, .n_speakers = 1};
    struct room_stream *s;
    struct room *r;
    const float *x;
    double begins_s = NAN;
    assert_int_equal(room_load_drawn(&r, path, NULL, draw, NULL), 0);
    assert_int_equal(room_stream_create(&s, r, &cfg), 0);
    for (uint64_t k = 0; k < 4 * 48000 / 1152 && isnan(begins_s); k++) {
        assert_int_equal(room_stream_ping(s, k, &x), 0);
        size_t at = first_sound(x, room_frames(r, 1));
        if (at < room_frames(r, 1))
            begins_s = (double)(room_stream_start(s, k) + at) / RATE_HZ;
    }
    room_stream_destroy(s);
    room_destroy(r);
    return begins_s;
}

static void the_seed_draws_when_it_slams(void **state)
{
    double one_s = slam_begins_s(state, 1), two_s = slam_begins_s(state, 2);
    assert_true(one_s > 0 && two_s > 0);
    assert_true(fabs(one_s - two_s) > 0.01);
    assert_true(slam_begins_s(state, 1) == one_s);
}

/* An object's way meets the wall at x = -0.667, two thirds of the way from the array's
 * image at z = 4 to it at z = 1; the array's own echo meets it straight ahead. */
#define BEHIND                                                                           \
    "objects:\n  - {name: p, kind: point, scattering_length_m: 0.1, "                    \
    "position_m: [-1, 0, 1]}\n"
#define WALL_SPANS(spans, echo)                                                          \
    "wall_sound: {reflectivity: 0.9, echo: " echo ", spans_m: " spans "}\n"

static double power_of(void **state, const char *text)
{
    struct room *r = drive_load(state, text);
    float *x = drive_emit(r, 1, PASS_SCENE, 0);
    double sum = 0;
    for (size_t i = 0; i < room_frames(r, 1); i++)
        sum += x[i] * x[i];
    free(x);
    room_destroy(r);
    return sum;
}

static void no_echo_comes_through_an_opening(void **state)
{
#define BASE_OF(drive) DRIVE_TIMING DRIVE_PAIR DRIVE_WALL BEHIND drive
#define CASES(drive)                                                                     \
    {                                                                                    \
        BASE_OF(drive)                                                                   \
        "wall_sound: {reflectivity: 0.9, echo: 0}\n",                                    \
            BASE_OF(drive) WALL_SPANS("[[-0.72, 0.5]]", "0"),                            \
            BASE_OF(drive) WALL_SPANS("[[-3, -0.72], [-0.62, 3]]", "0"),                 \
            BASE_OF(drive) WALL_SPANS("[[-0.62, 3]]", "0"),                              \
            BASE_OF(drive) WALL_SPANS("[[-3, -0.1], [0.1, 3]]", "0.5"),                  \
            BASE_OF(drive) WALL_SPANS("[[-0.1, 0.1]]", "0.5"),                           \
            DRIVE_TIMING DRIVE_PAIR DRIVE_WALL drive                                     \
            "wall_sound: {reflectivity: 0.9, echo: 0.5}\n"                               \
    }
    static const char *const cases[2][7] = {CASES("drive: {period_s: 4}\n"), CASES("")};
    for (int k = 0; k < 2; k++) { /* of a drive, and of a standing scene */
        double whole = power_of(state, cases[k][0]);
        assert_true(whole > 0);
        assert_true(power_of(state, cases[k][1]) == whole);
        assert_true(power_of(state, cases[k][2]) == 0);
        assert_true(power_of(state, cases[k][3]) == 0);
        assert_true(power_of(state, cases[k][4]) == whole); /* but no echo of the wall */
        double echo = power_of(state, cases[k][5]);         /* that alone */
        assert_true(echo > 0);
        assert_true(fabs(echo / power_of(state, cases[k][6]) - 1) < 1e-3);
    }
}

static void what_is_rough_on_a_wall_is_not_in_its_openings(void **state)
{
#define ROUGH(spans)                                                                     \
    DRIVE_TIMING DRIVE_PAIR DRIVE_WALL                                                   \
        "drive: {period_s: 4}\nwall_sound: {reflectivity: 0.9, patches: 40, "            \
        "scattering_length_m: 0.02" spans "}\n"
    double whole = power_of(state, ROUGH(""));
    assert_true(whole > 0);
    assert_true(power_of(state, ROUGH(", spans_m: [[-9, 9]]")) == whole);
    assert_true(power_of(state, ROUGH(", spans_m: [[-9, -1.6], [1.6, 9]]")) == 0);
}

/* The lag, in samples, at which a chirp fits samples[n] best, and how strong it is. */
static double find_chirp(const float *x, size_t n, double *strength)
{
    double best = 0, at = 0;
    for (int eighth = 0; eighth < 8; eighth++) {
        double replica[960], power = 0;
        for (int i = 0; i < 960; i++) {
            replica[i] = chirp((i + 1 - eighth / 8.0) / RATE_HZ);
            power += replica[i] * replica[i];
        }
        for (size_t lag = 0; lag + 961 < n; lag++) {
            double sum = 0;
            for (size_t i = 0; i < 960; i++)
                sum += replica[i] * x[lag + 1 + i];
            if (fabs(sum) / power > fabs(best)) {
                best = sum / power;
                at = (double)lag + eighth / 8.0;
            }
        }
    }
    *strength = best;
    return at;
}

/* One piece of clutter, 1.2 m from the middle between a speaker at z = 0 and a
 * microphone at z = 1: when it is heard tells its z, and that how far its image is. */
static void clutter_is_heard_once_more_by_way_of_the_wall(void **state)
{
#define ONE(mirrored)                                                                    \
    DRIVE_TIMING "speakers_m: [[0, 0, 0]]\nmicrophones_m: [[0, 0, 1]]\n" DRIVE_WALL      \
                 "seed: 2\nwall_sound: {reflectivity: 0.9}\n"                            \
                 "clutter: {points: 1, scattering_length_m: 0.1, near_m: 1.2, "          \
                 "far_m: 1.2" mirrored "}\n"
    static const char *const scenes[2][2] = {
        {ONE("") "drive: {period_s: 4}\n",
         ONE(", mirrored: yes") "drive: {period_s: 4}\n"},
        {ONE(""), ONE(", mirrored: yes")}};
    for (int k = 0; k < 2; k++) {
        struct room *plain = drive_load(state, scenes[k][0]);
        struct room *with = drive_load(state, scenes[k][1]);
        size_t n = room_frames(plain, 1);
        float *x = drive_emit(plain, 1, PASS_SCENE, 0);
        float *y = drive_emit(with, 1, PASS_SCENE, 0);
        assert_true(room_frames(with, 1) == n);
        for (size_t i = 0; i < n; i++)
            y[i] -= x[i];
        double direct, mirrored, lag = find_chirp(x, n, &direct);
        /* a + b = way, and a2 = rho2 + z2, b2 = rho2 + (1 - z)2 with the middle at 0.5
         * and rho2 + (z - 0.5)2 = 1.44. */
        double way_m = lag / RATE_HZ * SOUND_M_S, product, a, b, z, rho2;
        product = (way_m * way_m - 2 * 1.44 - 0.5) / 2; /* a2 + b2 = 2 1.44 + 0.5 */
        a = (way_m + sqrt(fmax(way_m * way_m - 4 * product, 0))) / 2;
        b = way_m - a;
        bool near_speaker = false;
        double best = 1e9, lag2 = find_chirp(y, n, &mirrored);
        for (int turn = 0; turn < 2; turn++, near_speaker = true) {
            double to = near_speaker ? b : a, from = near_speaker ? a : b;
            z = (to * to - from * from + 1) / 2;
            rho2 = fmax(to * to - z * z, 0);
            double in = sqrt(rho2 + pow(4 - z, 2)), out = sqrt(rho2 + pow(3 - z, 2));
            double off = fabs((in + out) / SOUND_M_S * RATE_HZ - lag2);
            double ratio = mirrored / direct / (0.81 * a * b / (in * out));
            if (off < best && fabs(ratio - 1) < 0.1)
                best = off;
        }
        assert_true(best < 8); /* samples; z is known to some centimetres */
        free(x);
        free(y);
        room_destroy(plain);
        room_destroy(with);
    }
}

/* A car passes, its flank 0.875 m before its middle, whose image is 4 m away.  The flank
 * is a sphere's along it, of 16 m, and 1.5 m upright: it glints on the line from the
 * array to the sphere's middle, all but straight ahead wherever the car's middle is. */
static void the_flank_of_a_car_glints_where_it_mirrors(void **state)
{
    struct room *r = drive_load(state, DRIVE_TIMING DRIVE_PAIR DRIVE_WALL
                                "drive: {period_s: 10}\n"
                                "objects:\n  - name: c\n    kind: car\n    opaque: yes\n"
                                "    present_s: [0, 10]\n"
                                "    path: [{t_s: 0, position_m: [-0.6, 0.15, 0]}, "
                                "{t_s: 10, position_m: [0.6, 0.15, 0]}]\n");
    for (int k = 0; k < 3; k++) {
        double t_s = 1 + 4 * k, x_m = -0.6 + 0.12 * (t_s + 0.02), strength;
        double way_m = hypot(16 + 3.125, x_m) - 16;
        double length_m = 1 / sqrt((2 / way_m + 2 / 16.0) * (2 / way_m + 2 / 1.5));
        float *x = drive_emit(r, t_s, PASS_SCENE, 0);
        double lag = find_chirp(x, room_frames(r, 1), &strength);
        assert_true(fabs(lag - 2 * way_m / SOUND_M_S * RATE_HZ) < 0.3);
        assert_true(fabs(fabs(strength) / (length_m / (way_m * way_m)) - 1) < 0.1);
        free(x);
    }
    room_destroy(r);
}

/* Who walks across is 0.2 m wide there: seen through, his far limbs are heard, too. */
static void an_opaque_walker_is_not_heard_from_behind(void **state)
{
#define WALKS(opaque)                                                                    \
    DRIVE_TIMING DRIVE_PAIR DRIVE_WALL                                                   \
        "drive: {period_s: 4}\nobjects:\n  - name: p\n    kind: person\n" opaque         \
        "    present_s: [0, 4]\n    path: [{t_s: 0, position_m: [-2, 0.2, 1]}, "         \
        "{t_s: 4, position_m: [2, 0.2, 1]}]\n"
    struct room *through = drive_load(state, WALKS(""));
    struct room *opaque = drive_load(state, WALKS("    opaque: yes\n"));
    size_t n = room_frames(opaque, 1);
    /* All of his near side is heard before one way over his middle and back. */
    size_t middle = (size_t)(2 * 3.1 / SOUND_M_S * RATE_HZ), until = middle + 960;
    double behind[2] = {0, 0}, all[2] = {0, 0};
    for (int k = 0; k < 2; k++) {
        float *x = drive_emit(k ? opaque : through, 2, PASS_SCENE, 0);
        for (size_t i = 0; i < n; i++) {
            all[k] += x[i] * x[i];
            behind[k] += i > until + 8 ? x[i] * x[i] : 0;
        }
        free(x);
    }
    assert_true(all[1] > all[0] / 10 && all[1] < 10 * all[0]);
    assert_true(behind[0] / all[0] > 1e-4);
    assert_true(behind[1] / all[1] < 1e-6);
    room_destroy(through);
    room_destroy(opaque);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_vehicle_that_rocks_is_heard_where_it_is_just_now),
        TEST(it_rocks_on_where_the_drive_begins_again),
        TEST(air_that_warms_brings_echoes_sooner),
        TEST(a_slam_is_heard_by_all_microphones_at_once),
        TEST(a_slam_goes_from_where_it_is_to_each_microphone),
        TEST(the_seed_draws_when_it_slams),
        TEST(no_echo_comes_through_an_opening),
        TEST(what_is_rough_on_a_wall_is_not_in_its_openings),
        TEST(clutter_is_heard_once_more_by_way_of_the_wall),
        TEST(the_flank_of_a_car_glints_where_it_mirrors),
        TEST(an_opaque_walker_is_not_heard_from_behind),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
