/* SPDX-License-Identifier: MIT */
/* A stage that goes on while the speakers sound: what is heard, against the chirp's
 * formula at the time of emission, which follows from the straight motion in closed form.
 */
#include "drive.h"

#include <errno.h>
#include <math.h>

#include "hal/array.h"
#include "hal/room/room.h"

#define SOUND_M_S 340.0
#define RATE_HZ   48000.0
#define SLOT_S    (1632 / RATE_HZ)
#define CHIRP_S   0.0625
#define SPEED_M_S 0.1

/* Two speakers, two microphones; a round of 68 ms takes the stage 6.8 mm on.  What is
 * really at z is mirrored to 4 - z. */
#define ARRAY                                                                            \
    "sound_speed_m_s: 340\nsample_rate_hz: 48000\nslot_samples: 1632\n"                  \
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.0625}\n"                      \
    "speakers_m: [[0, 0, 0], [0, 0.1, 0]]\n"                                             \
    "microphones_m: [[0.08, 0, 0], [0.08, 0.1, 0]]\n"                                    \
    "stage: {axis: [1, 0, 0], positions_m: [0, 0.0068, 0.0136, 0.0204], "                \
    "continuous: true}\n"                                                                \
    "gate_m: [0.5, 4]\nlevel: 1\ndirect_level: 0\n" DRIVE_WALL
#define POINT                                                                            \
    "objects: [{name: p, kind: point, position_m: [1.1, 0.3, 1.6], "                     \
    "scattering_length_m: 0.1}]\n"

static const double point_m[3] = {1.1, 0.3, 2.4};

/* |a + v t - p| of motion along x. */
static double distance(const double a[3], double v, double t, const double p[3])
{
    double x = a[0] + v * t - p[0], y = a[1] - p[1], z = a[2] - p[2];
    return sqrt(x * x + y * y + z * z);
}

/* The t at which sound must leave a speaker at a + v t to be at p at t_p:
 * |a + v t - p| = c (t_p - t), a quadratic. */
static double left_at(const double a[3], double v, const double p[3], double t_p)
{
    double c2 = SOUND_M_S * SOUND_M_S, x = a[0] - p[0], y = a[1] - p[1], z = a[2] - p[2];
    double A = v * v - c2, B = x * v + c2 * t_p;
    double C = x * x + y * y + z * z - c2 * t_p * t_p;
    return (-B + sqrt(B * B - A * C)) / A;
}

static double chirp(double t_s)
{
    return cos(2 * M_PI * (2000 * t_s + 18000 / CHIRP_S / 2 * t_s * t_s));
}

/* Of the emission of a speaker at a with the stage at stage_m when it begins, which goes
 * on at v, against samples[n] of a microphone at m; dB. */
static double error_db(const float *samples, size_t n, const double speaker[3],
                       const double microphone[3], double stage_m, double v)
{
    const double a[3] = {speaker[0] + stage_m, speaker[1], speaker[2]};
    const double b[3] = {microphone[0] + stage_m, microphone[1], microphone[2]};
    double error = 0, power = 0;
    for (size_t i = 0; i < n; i++) {
        double heard_s = (double)i / RATE_HZ, back_m = distance(b, v, heard_s, point_m);
        double met_s = heard_s - back_m / SOUND_M_S, t_s = left_at(a, v, point_m, met_s);
        if (t_s < 0.001 || t_s > CHIRP_S - 0.001)
            continue;
        double expected = 0.1 * chirp(t_s) / (back_m * distance(a, v, t_s, point_m));
        error += pow(samples[i] - expected, 2);
        power += expected * expected;
    }
    assert_true(power > 0);
    return 10 * log10(error / power);
}

static const double speakers[2][3] = {{0, 0, 0}, {0, 0.1, 0}};
static const double microphones[2][3] = {{0.08, 0, 0}, {0.08, 0.1, 0}};

static struct room_emission emission(uint32_t speaker, double stage_m)
{
    return (struct room_emission){
        .speaker = speaker, .stage_m = stage_m, .stage_m_s = SPEED_M_S};
}

static void an_echo_leaves_and_arrives_where_the_array_has_got_to(void **state)
{
    struct room *r = drive_load(state, ARRAY POINT);
    size_t n = room_frames(r, 1);
    float *x = malloc(2 * n * sizeof *x);
    assert_non_null(x);
    assert_true(fabs(survey_speed_m_s(room_survey(r)) - SPEED_M_S) < 1e-12);
    for (uint32_t j = 0; j < 2; j++) {
        struct room_emission e = emission(j, 0.31);
        assert_int_equal(room_emit(r, &e, x), 0);
        for (size_t m = 0; m < 2; m++) {
            const float *heard = x + m * n;
            double db = error_db(heard, n, speakers[j], microphones[m], 0.31, SPEED_M_S);
            assert_true(db < -55); /* the gain is that of the middle */
            /* It is not what an array hears that stands, wherever in between. */
            double still = error_db(heard, n, speakers[j], microphones[m],
                                    0.31 + SPEED_M_S * CHIRP_S / 2, 0);
            assert_true(still > -12 && still < 0);
        }
    }
    free(x);
    room_destroy(r);
}

/* Three chirps at a time. */
static void emissions_ring_into_each_other_from_their_own_places(void **state)
{
    struct room *r = drive_load(state, ARRAY POINT);
    const uint32_t both[] = {0, 1};
    const struct room_stream_config cfg = {.speakers = both,
                                           .n_speakers = 2,
                                           .stage_m = 0.0068,
                                           .stage_m_s = SPEED_M_S,
                                           .position = 1,
                                           .n_emissions = 6};
    size_t n = room_frames(r, 1);
    float *alone = malloc(2 * n * sizeof *alone);
    double *sum = malloc(2 * n * sizeof *sum);
    struct room_stream *s;
    assert_true(alone && sum);
    assert_int_equal(room_stream_create(&s, r, &cfg), 0);
    for (size_t k = 0; k < 6; k++) {
        const float *x;
        memset(sum, 0, 2 * n * sizeof *sum);
        for (size_t q = 0; q < 6; q++) {
            struct room_emission e =
                emission(q % 2, 0.0068 + SPEED_M_S * SLOT_S * (double)q);
            assert_int_equal(room_emit(r, &e, alone), 0);
            for (size_t i = 0; i < 2 * n; i++) {
                int64_t at = (int64_t)(i % n) + 1632 * ((int64_t)q - (int64_t)k);
                if (at >= 0 && at < (int64_t)n)
                    sum[i / n * n + (size_t)at] += alone[i];
            }
        }
        assert_int_equal(room_stream_ping(s, k, &x), 0);
        /* A ping's own sound, cut off where it ends. */
        for (size_t i = 0; i < 2 * n; i++)
            if (i % n < 1632)
                assert_true(fabs(x[i] - sum[i]) < 1e-6);
    }
    room_stream_destroy(s);
    free(alone);
    free(sum);
    room_destroy(r);
}

static struct array *open_array(void **state, struct fake_clock *clock, const char *text)
{
    struct error why = {""};
    struct array *a;
    char uri[600];
    snprintf(uri, sizeof uri, "sim:%s", scratch_write(*state, "scene.yaml", text));
    fake_clock_set(clock, INT64_C(1700000000000000000));
    if (array_open(&a, uri, &clock->source, &why))
        fail_msg("%s", why.text);
    return a;
}

static const uint32_t both[] = {0, 1};

static int64_t slot_ns(size_t k)
{
    return llrint(1e9 * SLOT_S * (double)k);
}

static void an_array_fires_round_after_round_from_the_stated_time_on(void **state)
{
    struct fake_clock clock;
    struct array *a = open_array(state, &clock, ARRAY POINT);
    int64_t start_ns = clock_now_ns(&clock.source) + 200000000;
    const struct array_shot shot = {.position = 1,
                                    .stage_m = 0.0068,
                                    .speakers = both,
                                    .n_speakers = 2,
                                    .n_rounds = 3,
                                    .start_ns = start_ns,
                                    .stage_m_s = SPEED_M_S};
    struct array_ping ping;
    struct error why;
    assert_int_equal(array_fire(a, &shot), 0);
    for (size_t k = 0; k < 6; k++) {
        assert_int_equal(array_next(a, &ping, &why), 0);
        assert_int_equal(ping.shot_index, k % 2);
        assert_int_equal(ping.frame, k / 2 + 1);
        assert_true(llabs(ping.t0_ns - start_ns - slot_ns(k)) < 1000);
    }
    assert_int_equal(array_next(a, &ping, &why), -ENODATA);
    array_close(a);
}

/* 50 ms after the stated time the stage is 5 mm further on; so are the pings. */
static void what_begins_late_is_heard_from_further_on(void **state)
{
    struct fake_clock clock;
    struct array *a = open_array(state, &clock, ARRAY POINT);
    const struct array_shot shot = {.speakers = both,
                                    .n_speakers = 2,
                                    .n_rounds = 1,
                                    .start_ns = clock_now_ns(&clock.source) - 50000000,
                                    .stage_m_s = SPEED_M_S};
    struct array_ping ping;
    struct error why;
    int64_t now_ns = clock_now_ns(&clock.source);
    assert_int_equal(array_fire(a, &shot), 0);
    assert_int_equal(array_next(a, &ping, &why), 0);
    assert_true(ping.t0_ns == now_ns);
    /* The second speaker has not begun by the end of the first slot. */
    assert_true(error_db(ping.samples, 1632, speakers[0], microphones[0], 0.005,
                         SPEED_M_S) < -55);
    array_halt(a);
    assert_int_equal(array_fire(a, &shot), 0);
    array_close(a);
}

static void a_continuous_shot_is_of_all_speakers_and_within_the_scan(void **state)
{
    struct fake_clock clock;
    struct array *a = open_array(state, &clock, ARRAY POINT);
    struct array_shot shot = {
        .position = 2, .speakers = both, .n_speakers = 2, .n_rounds = 3};
    assert_int_equal(array_fire(a, &shot), -EINVAL);
    shot.n_rounds = 2;
    shot.n_speakers = 1;
    assert_int_equal(array_fire(a, &shot), -EINVAL);
    shot.n_speakers = 2;
    assert_int_equal(array_fire(a, &shot), 0);
    array_close(a);
}

/* Of all eight emissions what falls into the last but one's two slots and their tail. */
static void a_round_is_heard_with_what_rings_on_and_what_begins(void **state)
{
    struct room *r = drive_load(state, ARRAY POINT);
    size_t one = room_frames(r, 1), n = room_frames(r, 2), slots = 2 * 1632;
    float *alone = malloc(2 * one * sizeof *alone), *x = malloc(2 * n * sizeof *x);
    double *sum = calloc(2 * n, sizeof *sum);
    assert_true(alone && x && sum);
    for (size_t q = 0; q < 8; q++) {
        struct room_emission e = emission(q % 2, SPEED_M_S * SLOT_S * (double)q);
        assert_int_equal(room_emit(r, &e, alone), 0);
        for (size_t i = 0; i < 2 * one; i++) {
            int64_t at = (int64_t)(i % one) + 1632 * (int64_t)q - 2 * (int64_t)slots;
            if (at >= 0 && at < (int64_t)n)
                sum[i / one * n + (size_t)at] += alone[i];
        }
    }
    assert_int_equal(room_stream_round(r, PASS_SCENE, 2, x), 0);
    for (size_t i = 0; i < 2 * n; i++)
        if (i % n < slots)
            assert_true(fabs(x[i] - sum[i]) < 1e-6);
    assert_int_equal(room_stream_round(r, PASS_SCENE, 4, x), -EINVAL);
    free(alone);
    free(x);
    free(sum);
    room_destroy(r);
}

static void a_room_records_no_position_of_a_stage_that_goes_on(void **state)
{
    struct room *r = drive_load(state, ARRAY POINT);
    float x;
    assert_int_equal(room_record(r, PASS_SCENE, 0, both, 2, 0, &x), -ENOTSUP);
    room_destroy(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_echo_leaves_and_arrives_where_the_array_has_got_to),
        cmocka_unit_test(emissions_ring_into_each_other_from_their_own_places),
        cmocka_unit_test(an_array_fires_round_after_round_from_the_stated_time_on),
        cmocka_unit_test(what_begins_late_is_heard_from_further_on),
        cmocka_unit_test(a_continuous_shot_is_of_all_speakers_and_within_the_scan),
        cmocka_unit_test(a_round_is_heard_with_what_rings_on_and_what_begins),
        cmocka_unit_test(a_room_records_no_position_of_a_stage_that_goes_on),
    };
    return cmocka_run_group_tests(tests, scratch_open, scratch_close);
}
