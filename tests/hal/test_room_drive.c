/* SPDX-License-Identifier: MIT */
/* The sound of what moves, against the chirp's formula at the time of emission that is
 * found by halving: where does the sound that is heard now come from? */
#include "drive.h"

#include <errno.h>
#include <math.h>

#define SOUND_M_S 340.0
#define RATE_HZ   48000.0

struct line { /* straight motion from time 0 of the emission on */
    double at[3], v[3];
};

static double distance_at(const struct line *a, double ta, const struct line *b,
                          double tb)
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += pow(a->at[k] + ta * a->v[k] - b->at[k] - tb * b->v[k], 2);
    return sqrt(sum);
}

/* The time t in [lo, hi] at which sound must leave `from` to be at `to` at tb. */
static double left_at(const struct line *from, const struct line *to, double tb)
{
    double lo = tb - 1, hi = tb;
    for (int i = 0; i < 60; i++) {
        double t = (lo + hi) / 2;
        if (t + distance_at(from, t, to, tb) / SOUND_M_S < tb)
            lo = t;
        else
            hi = t;
    }
    return (lo + hi) / 2;
}

static double chirp(double t_s)
{
    return cos(2 * M_PI * (2000 * t_s + 18000 / 0.02 / 2 * t_s * t_s));
}

/* What a microphone hears of a speaker by way of a reflector (NULL: directly), with the
 * amplitude of a scattering length or of 1, against samples[n]; dB. */
static double error_db(const float *samples, size_t n, const struct line *speaker,
                       const struct line *reflector, const struct line *microphone,
                       double strength)
{
    double error = 0, power = 0;
    for (size_t i = 0; i < n; i++) {
        double heard_s = (double)i / RATE_HZ, met_s = heard_s, amplitude = strength;
        if (reflector) {
            met_s = left_at(reflector, microphone, heard_s);
            amplitude /= distance_at(reflector, met_s, microphone, heard_s);
        }
        double t_s = left_at(speaker, reflector ? reflector : microphone, met_s);
        amplitude /= distance_at(speaker, t_s, reflector ? reflector : microphone, met_s);
        if (t_s < 0.001 || t_s > 0.019)
            continue;
        double expected = amplitude * chirp(t_s);
        error += pow(samples[i] - expected, 2);
        power += expected * expected;
    }
    assert_true(power > 0);
    return 10 * log10(error / power);
}

static const struct line speaker = {{-0.02, 0, 0}, {0}};
static const struct line microphone = {{0.03, 0, 0}, {0}};

/* A point runs past the vehicle at 5 m/s; what is really at z is mirrored to 4 - z. */
static void the_echo_of_a_moving_point_is_stretched(void **state)
{
    struct room *r = drive_load(state, DRIVE_TIMING DRIVE_PAIR DRIVE_WALL
                                "wall_sound: {reflectivity: 0.9}\n"
                                "drive: {period_s: 10}\n"
                                "objects:\n  - name: p\n    kind: point\n"
                                "    scattering_length_m: 0.1\n    present_s: [0, 2]\n"
                                "    path: [{t_s: 0, position_m: [-3, 0.3, 1.5]}, "
                                "{t_s: 1, position_m: [1, 0.3, -1.5]}]\n");
    struct line image = {{-3 + 4 * 0.4, 0.3, 4 - (1.5 - 3 * 0.4)}, {4, 0, 3}};
    float *x = drive_emit(r, 0.4, PASS_SCENE, 0);
    double db = error_db(x, room_frames(r, 1), &speaker, &image, &microphone, 0.081);
    assert_true(db < -40);       /* the gain is that of the middle */
    image.v[0] = image.v[2] = 0; /* which it would not be if it stood */
    assert_true(error_db(x, room_frames(r, 1), &speaker, &image, &microphone, 0.0081) >
                -3);
    free(x);
    room_destroy(r);
}

static void a_person_is_heard_from_where_he_walks(void **state)
{
    struct room *r = drive_load(state, DRIVE_TIMING DRIVE_PAIR DRIVE_WALL
                                "drive: {period_s: 10}\n"
                                "objects:\n  - name: p\n    kind: person\n"
                                "    present_s: [0, 4]\n"
                                "    path: [{t_s: 0, position_m: [-2, 0, 1]}, "
                                "{t_s: 3, position_m: [1, 0, 1]}]\n");
    float *x = drive_emit(r, 1.5, PASS_SCENE, 0);
    double range = sqrt(0.25 + 9), first = 2 * (range - 0.9) / SOUND_M_S * RATE_HZ;
    double last = (2 * (range + 0.9) / SOUND_M_S + 0.02) * RATE_HZ, sum = 0;
    double expected = pow(0.14 / (range * range), 2) / 2 * 960;
    for (size_t i = 0; i < room_frames(r, 1); i++) {
        sum += x[i] * x[i];
        if ((double)i < first - 60 || (double)i > last + 60)
            assert_true(fabsf(x[i]) < 1e-5);
    }
    assert_true(sum > expected / 3 && sum < expected * 3); /* the points interfere */
    free(x);
    room_destroy(r);
}

/* At 2 m/s towards the wall, its echo of the array comes to meet the microphone. */
static void the_wall_of_a_moving_vehicle_is_heard_higher(void **state)
{
    struct room *r = drive_load(state, DRIVE_TIMING DRIVE_PAIR DRIVE_WALL
                                "wall_sound: {reflectivity: 1, echo: 0.8}\n"
                                "drive: {period_s: 10, ego: [{t_s: 0, speed_m_s: 2}]}\n");
    struct line image = {{-0.02, 0, 4 - 0.6}, {0, 0, -2}};
    struct line moving = {{0.03, 0, 0.6}, {0, 0, 2}};
    float *x = drive_emit(r, 0.3, PASS_BACKGROUND, 0);
    assert_true(error_db(x, room_frames(r, 1), &image, NULL, &moving, 0.8) < -40);
    free(x);
    room_destroy(r);
}

/* From 1 s to 2 s the microphone stands 5 cm aside and 3 back, and the speaker where it
 * was. */
static void a_knocked_microphone_hears_from_elsewhere_while_it_is(void **state)
{
    struct room *r =
        drive_load(state, DRIVE_TIMING DRIVE_PAIR DRIVE_WALL
                   "wall_sound: {reflectivity: 1, echo: 0.8}\ndrive: {period_s: 10}\n"
                   "faults: {microphones: [{channel: 0, moved_m: [0.05, 0, -0.03], "
                   "during_s: [1, 2]}]}\n");
    const struct line image = {{-0.02, 0, 4}, {0}};
    const struct line at[2] = {{{0.03, 0, 0}, {0}}, {{0.08, 0, -0.03}, {0}}};

    for (int i = 0; i < 4; i++) { /* it is back in a later round, too */
        bool away = i % 2;
        float *x = drive_emit(r, away ? 1.5 + 10 * (i / 2) : 0.5 + i, PASS_SCENE, 0);
        size_t n = room_frames(r, 1);
        assert_true(error_db(x, n, &image, NULL, &at[away], 0.8) < -40);
        assert_true(error_db(x, n, &image, NULL, &at[!away], 0.8) > -3);
        free(x);
    }
    room_destroy(r);
}

/* What rides along keeps its distance, but the sound has to catch up with it. */
static void the_direct_way_keeps_its_pitch(void **state)
{
    struct room *r = drive_load(
        state,
        "sound_speed_m_s: 340\nsample_rate_hz: 48000\n"
        "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.02}\n"
        "slot_samples: 1152\n"
        "mount: {origin_m: [0, 0, 0], x_axis: [1, 0, 0], y_axis: [0, 1, 0]}\n"
        "level: 1\n" DRIVE_WALL "speakers_m: [[0, 0, 0]]\nmicrophones_m: [[1, 0, 0]]\n"
        "drive: {period_s: 10, ego: [{t_s: 0, speed_m_s: 20}]}\n");
    struct line source = {{1, 0, 0}, {20, 0, 0}}, ahead = {{2, 0, 0}, {20, 0, 0}};
    float *x = drive_emit(r, 0.05, PASS_SCENE, 0);
    double met_s = 1 / (SOUND_M_S - 20); /* and the way is 340 times that */
    for (int i = 0; i < 900; i++) {
        double t_s = (i + 30) / RATE_HZ - met_s;
        if (t_s > 0.001)
            assert_true(fabs(x[i + 30] - chirp(t_s) / (met_s * SOUND_M_S)) < 2e-3);
    }
    assert_true(error_db(x, room_frames(r, 1), &source, NULL, &ahead, 1) < -50);
    free(x);
    room_destroy(r);
}

#define TWO "speakers_m: [[-0.02, 0, 0]]\nmicrophones_m: [[0.03, 0, 0], [0.3, 0, 0.1]]\n"
#define STANDING                                                                         \
    "wall_sound: {reflectivity: 0.9, echo: 0.3, patches: 20, "                           \
    "scattering_length_m: 0.02}\n"                                                       \
    "clutter: {points: 10, scattering_length_m: 0.03, near_m: 1, far_m: 3}\n"            \
    "latency_samples: 2.6\nmicrophones: {ripple_db: 2}\nerrors: {gain_db: 1, "           \
    "element_m: 0.002}\n"                                                                \
    "faults: {speakers: [{channel: 0, limit: 0.8}], "                                    \
    "microphones: [{channel: 0, swapped_with: 1}, {channel: 1, gain_db: -6}]}\n"         \
    "objects:\n"                                                                         \
    "  - {name: a, kind: point, position_m: [-1, 0.2, 1], scattering_length_m: 0.1}\n"   \
    "  - {name: b, kind: rectangle, position_m: [0.6, 0, 1], size_m: [0.1, 0.1]}\n"      \
    "  - {name: c, kind: corner, position_m: [0.2, 0.1, 0.5], side_m: 0.12}\n"           \
    "  - {name: d, kind: person, position_m: [-1.2, 0.3, 0.6]}\n"                        \
    "  - {name: e, kind: car, position_m: [2, 0.3, -1.5]}\n"

/* Two ways of rendering that share no more than the world. */
static void a_drive_in_which_nothing_moves_sounds_like_a_standing_scene(void **state)
{
    static const uint32_t first = 0;
    struct room *moving =
        drive_load(state, DRIVE_TIMING TWO DRIVE_WALL STANDING "drive: {period_s: 10}\n");
    struct room *still = drive_load(state, DRIVE_TIMING TWO DRIVE_WALL STANDING);
    size_t n = room_frames(still, 1);
    float *x = drive_emit(moving, 3.21, PASS_SCENE, 0);
    float *y = drive_emit(still, 3.21, PASS_SCENE, 0);
    float *z = malloc(2 * n * sizeof *z);
    double error = 0, power = 0;
    assert_non_null(z);
    assert_int_equal(room_record(still, PASS_SCENE, 0, &first, 1, 0, z), 0);
    for (size_t i = 0; i < 2 * n; i++) {
        error += pow(x[i] - y[i], 2);
        power += pow(y[i], 2);
        assert_true(y[i] == z[i]); /* without noise an emission is a shot of one */
    }
    assert_true(10 * log10(error / power) < -45);
    assert_int_equal(room_record(moving, PASS_SCENE, 0, &first, 1, 0, z), -ENOTSUP);
    free(x);
    free(y);
    free(z);
    room_destroy(moving);
    room_destroy(still);
}

#define NOISY                                                                            \
    DRIVE_TIMING DRIVE_PAIR DRIVE_WALL                                                   \
        "noise: {snr_db: 6, at_m: 3}\nwall_sound: {reflectivity: 0.8}\n"

/* A person at 3 m: echoes of 0.64 0.14 / 9 in 960 of 1152 samples, 6 dB over the noise.
 */
static void the_noise_is_a_persons_echo_at_a_range(void **state)
{
    struct room *r = drive_load(state, NOISY "drive: {period_s: 10}\n");
    double expected = pow(0.64 * 0.14 / 9, 2) / 2 * 960 / 1152 / pow(10, 0.6), sum = 0;
    for (uint32_t take = 0; take < 8; take++) {
        float *x = drive_emit(r, 1, PASS_SCENE, take);
        for (size_t i = 0; i < room_frames(r, 1); i++)
            sum += x[i] * x[i] / 8 / (double)room_frames(r, 1);
        free(x);
    }
    assert_true(fabs(sum / expected - 1) < 0.05); /* 18432 samples: 1 % is one sigma */
    room_destroy(r);
}

#define WALKER                                                                           \
    NOISY "drive: {period_s: 4}\n"                                                       \
          "objects:\n  - name: p\n    kind: point\n    scattering_length_m: 0.5\n"       \
          "    present_s: [1, 3]\n"                                                      \
          "    path: [{t_s: 1, position_m: [-1, 0, 1]}, "                                \
          "{t_s: 3, position_m: [1, 0, 1]}]\n"

static bool are_equal(struct room *r, double t_s, enum pass pass, uint32_t take,
                      const float *expected)
{
    float *x = drive_emit(r, t_s, pass, take);
    bool equal = !memcmp(x, expected, room_frames(r, 1) * sizeof *x);
    free(x);
    return equal;
}

static void an_emission_depends_on_time_pass_and_take_alone(void **state)
{
    struct room *r = drive_load(state, WALKER);
    float *x = drive_emit(r, 1.5, PASS_SCENE, 3);
    assert_false(are_equal(r, 1.75, PASS_SCENE, 3, x));
    assert_false(are_equal(r, 1.5, PASS_SCENE, 4, x));
    assert_false(are_equal(r, 1.5, PASS_BACKGROUND, 3, x));
    assert_true(are_equal(r, 1.5, PASS_SCENE, 3, x));
    assert_true(are_equal(r, 1.5 + 4, PASS_SCENE, 3, x));
    assert_true(are_equal(r, 1.5 - 8, PASS_SCENE, 3, x));
    struct room *again = drive_load(state, WALKER);
    assert_true(are_equal(again, 1.5, PASS_SCENE, 3, x));
    free(x);
    room_destroy(again);
    room_destroy(r);
}

static void what_is_not_there_is_not_heard(void **state)
{
    struct room *r = drive_load(state, WALKER);
    struct room *empty = drive_load(state, NOISY "drive: {period_s: 4}\n");
    float *x = drive_emit(empty, 0, PASS_SCENE, 0);
    assert_true(are_equal(r, 0.5, PASS_SCENE, 0, x));
    assert_true(are_equal(r, 3.5, PASS_SCENE, 0, x));
    assert_false(are_equal(r, 2.5, PASS_SCENE, 0, x));
    free(x);
    room_destroy(empty);
    room_destroy(r);
}

static void emissions_that_cannot_be_are_refused(void **state)
{
    struct room *r = drive_load(state, WALKER);
    float x[4608];
    struct room_emission absent = {.speaker = 1}, down = {.down = true};
    assert_int_equal(room_emit(r, &absent, x), -EINVAL);
    assert_int_equal(room_emit(r, &down, x), -EINVAL);
    room_destroy(r);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

/* Its correlation coefficient with another one. */
static double alike(const float *a, const float *b, size_t n)
{
    double ab = 0, aa = 0, bb = 0;
    for (size_t i = 0; i < n; i++) {
        ab += (double)a[i] * b[i];
        aa += (double)a[i] * a[i];
        bb += (double)b[i] * b[i];
    }
    return ab / sqrt(aa * bb);
}

static void each_draw_has_clutter_and_noise_of_its_own(void **state)
{
    static const char *const worlds[] = {
        "clutter: {points: 30, scattering_length_m: 0.05, near_m: 1, far_m: 4}\n",
        "noise: {rms: 0.01}\n"};
    for (size_t k = 0; k < 2; k++) {
        char text[1024];
        snprintf(text, sizeof text,
                 DRIVE_TIMING DRIVE_PAIR DRIVE_WALL "drive: {period_s: 1}\nseed: 3\n%s",
                 worlds[k]);
        const char *path = scratch_write(*state, "scene.yaml", text);
        struct room *rooms[4];
        float *heard[4];
        static const uint32_t draws[4] = {0, 0, 1, 2};
        assert_int_equal(room_load(&rooms[0], path, NULL), 0);
        for (int i = 1; i < 4; i++)
            assert_int_equal(room_load_drawn(&rooms[i], path, NULL, draws[i], NULL), 0);
        for (int i = 0; i < 4; i++)
            heard[i] = drive_emit(rooms[i], 0.3, PASS_SCENE, 1);
        size_t n = room_frames(rooms[0], 1);
        assert_memory_equal(heard[0], heard[1], n * sizeof(float));
        assert_true(fabs(alike(heard[0], heard[2], n)) < 0.3);
        assert_true(fabs(alike(heard[0], heard[3], n)) < 0.3);
        assert_true(fabs(alike(heard[2], heard[3], n)) < 0.3);
        for (int i = 0; i < 4; i++) {
            room_destroy(rooms[i]);
            free(heard[i]);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(the_echo_of_a_moving_point_is_stretched),
        TEST(a_person_is_heard_from_where_he_walks),
        TEST(the_wall_of_a_moving_vehicle_is_heard_higher),
        TEST(a_knocked_microphone_hears_from_elsewhere_while_it_is),
        TEST(the_direct_way_keeps_its_pitch),
        TEST(a_drive_in_which_nothing_moves_sounds_like_a_standing_scene),
        TEST(the_noise_is_a_persons_echo_at_a_range),
        TEST(an_emission_depends_on_time_pass_and_take_alone),
        TEST(what_is_not_there_is_not_heard),
        TEST(emissions_that_cannot_be_are_refused),
        TEST(each_draw_has_clutter_and_noise_of_its_own),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
