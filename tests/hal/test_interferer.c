/* SPDX-License-Identifier: MIT */
/* Another array in the street, tones in the cables, and slots with jitter. */
#include "drive.h"

#include <errno.h>
#include <math.h>

#include "hal/room/noise.h"
#include "hal/room/room.h"

#define SOUND_M_S 340.0
#define RATE_HZ   48000.0

static const uint32_t speaker = 0;

static double chirp(double t_s)
{
    return t_s < 0 || t_s > 0.02
               ? 0
               : cos(2 * M_PI * (2000 * t_s + 18000 / 0.02 / 2 * t_s * t_s));
}

static struct room_stream *listen(struct room *r)
{
    const struct room_stream_config cfg = {
        .pass = PASS_SCENE, .speakers = &speaker, .n_speakers = 1};
    struct room_stream *s;

    assert_int_equal(room_stream_create(&s, r, &cfg), 0);
    return s;
}

/* One speaker and one microphone in the middle of either array, 4 m apart; ours is mute.
 */
#define QUIET                                                                            \
    "sound_speed_m_s: 340\nsample_rate_hz: 48000\n"                                      \
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.02}\n"                        \
    "slot_samples: 1152\ngate_m: [0.2, 4]\n"                                             \
    "mount: {origin_m: [3.6, 0.2, 0.4], x_axis: [0, 1, 0], y_axis: [0, 0, 1]}\n"         \
    "level: 1\ndirect_level: 0\nspeakers_m: [[0, 0, 0]]\nmicrophones_m: [[0, 0, 0]]\n"   \
    "drive: {period_s: 10}\n"
#define NO_ECHO "wall_sound: {reflectivity: 0, echo: 0}\n"
#define BESIDE  "wall: {normal: [0, 0, 1], distance_m: 6}\n"

/* What is left of a ping's power, in dB, once emissions of another array are taken away
 * that begin at start_s + k slot_s of the stream, and are heard after way_m / c. */
static double rest_db(struct room *r, uint64_t n, double start_s, double slot_s,
                      const double *way_m, const double *gain, size_t n_ways)
{
    struct room_stream *s = listen(r);
    const float *x;
    double error = 0, power = 0;

    assert_int_equal(room_stream_ping(s, n, &x), 0);
    double begins_s = (double)room_stream_start(s, n) / RATE_HZ;
    for (size_t i = 0; i < room_frames(r, 1); i++) {
        double t_s = begins_s + (double)i / RATE_HZ, expected = 0;
        bool edge = false;
        for (int k = 0; k < 8000; k++)
            for (size_t w = 0; w < n_ways; w++) {
                double since_s = t_s - start_s - k * slot_s - way_m[w] / SOUND_M_S;
                if (since_s < -0.001 || since_s > 0.021)
                    continue;
                edge |= since_s < 0.001 || since_s > 0.019;
                expected += gain[w] / way_m[w] * chirp(since_s);
            }
        if (edge) /* the band ends where a chirp begins */
            continue;
        error += pow(x[i] - expected, 2);
        power += expected * expected;
    }
    room_stream_destroy(s);
    assert_true(power > 0);
    return 10 * log10(error / power);
}

static void it_is_heard_by_the_clock_and_slots_of_its_own(void **state)
{
    static const double way_m = 4, one = 1;
    struct room *r =
        drive_load(state, QUIET BESIDE NO_ECHO
                   "interferers:\n  - {position_m: [0, 0, 4], start_s: 0.005, "
                   "clock_ppm: 200, slot_samples: 1440, stagger: no}\n");
    double slot_s = 1440 / (RATE_HZ * (1 + 200e-6));

    assert_true(rest_db(r, 0, 0.005, slot_s, &way_m, &one, 1) < -40);
    assert_true(rest_db(r, 200, 0.005, slot_s, &way_m, &one, 1) < -30);
    /* After 160 slots of 30 ms a clock without its 200 ppm is 1 ms off. */
    assert_true(rest_db(r, 200, 0.005, 1440 / RATE_HZ, &way_m, &one, 1) > -3);
    room_destroy(r);
}

/* It stands 4 m away and the wall 6: its image is 8 m away. */
static void it_is_heard_by_way_of_the_wall_too(void **state)
{
    static const double ways_m[] = {4, 8}, gains[] = {1, 0.5};
    struct room *r =
        drive_load(state, QUIET BESIDE
                   "wall_sound: {reflectivity: 0.5, echo: 0}\n"
                   "interferers:\n  - {position_m: [0, 0, 4], start_s: 0.005, stagger: "
                   "no}\n");

    assert_true(rest_db(r, 3, 0.005, 0.024, ways_m, gains, 2) < -40);
    assert_true(rest_db(r, 3, 0.005, 0.024, ways_m, gains, 1) > -14); /* 12 dB below */
    room_destroy(r);
}

static double power_of(struct room *r)
{
    struct room_stream *s = listen(r);
    const float *x;
    double power = 0;

    assert_int_equal(room_stream_ping(s, 5, &x), 0);
    for (size_t i = 0; i < room_frames(r, 1); i++)
        power += (double)x[i] * x[i];
    room_stream_destroy(s);
    return power;
}

static void beyond_the_wall_it_is_heard_through_an_opening_alone(void **state)
{
#define BEYOND                                                                           \
    "wall: {normal: [0, 0, 1], distance_m: 2}\n"                                         \
    "interferers:\n  - {position_m: [1, 0, 4], start_s: 0.005}\n"
    struct room *r = drive_load(state, QUIET BEYOND NO_ECHO);

    assert_true(power_of(r) == 0);
    room_destroy(r);
    r = drive_load(state, QUIET BEYOND "wall_sound: {reflectivity: 0, echo: 0, spans_m: "
                                       "[[-9, 0.4], [0.6, 9]]}\n"); /* x = 0.5 */
    assert_true(power_of(r) > 1);
    room_destroy(r);
}

static void it_is_there_while_the_scene_says_so(void **state)
{
    struct room *r = drive_load(state, QUIET BESIDE NO_ECHO
                                "interferers:\n  - {position_m: [0, 0, 4], during_s: [1, "
                                "2]}\n");
    struct room_stream *s = listen(r);
    const float *x;

    for (uint64_t n = 0; n < 3 * 41; n++) {
        double t_s = (double)room_stream_start(s, n) / RATE_HZ, power = 0;
        assert_int_equal(room_stream_ping(s, n, &x), 0);
        for (size_t i = 0; i < room_frames(r, 1); i++)
            power += (double)x[i] * x[i];
        if (t_s < 0.94 || t_s > 2.04)
            assert_true(power < 1e-6); /* rounding */
        else if (t_s > 1.02 && t_s < 1.97)
            assert_true(power > 1);
    }
    room_stream_destroy(s);
    room_destroy(r);
}

/* 1000 Hz and its double, half as loud, in phase from ping to ping. */
static void a_tone_goes_on_in_phase_with_its_harmonics(void **state)
{
    struct room *r =
        drive_load(state, QUIET BESIDE NO_ECHO
                   "noise: {tones: [{frequency_hz: 1000, rms: 0.1, harmonics: "
                   "2}]}\n");
    struct room_stream *s = listen(r);
    const float *x;

    for (uint64_t n = 0; n < 40; n += 13) {
        assert_int_equal(room_stream_ping(s, n, &x), 0);
        for (size_t i = 0; i < room_frames(r, 1); i++) {
            double t = 2 * M_PI * 1000 *
                       ((double)(room_stream_start(s, n) + i) / RATE_HZ);
            double expected = 0.1 * M_SQRT2 * (sin(t) + 0.5 * sin(2 * t));
            assert_true(fabs(x[i] - expected) < 1e-5);
        }
    }
    room_stream_destroy(s);
    room_destroy(r);
}

/* 2000, 2050 and 2100 Hz: again after 20 ms, and all together as loud as said. */
static void a_comb_comes_again_after_its_period(void **state)
{
    enum { PERIOD = 960 };
    struct room *r = drive_load(state, QUIET BESIDE NO_ECHO
                                "noise: {tones: [{frequency_hz: 50, rms: 0.1, comb: [40, "
                                "42]}]}\n");
    struct room_stream *s = listen(r);
    const float *x;

    for (uint64_t n = 0; n < 40; n += 13) {
        double power = 0;
        assert_int_equal(room_stream_ping(s, n, &x), 0);
        for (size_t i = 0; i < PERIOD; i++) {
            power += (double)x[i] * x[i] / PERIOD;
            if (i + PERIOD < room_frames(r, 1))
                assert_true(fabs(x[i] - x[i + PERIOD]) < 1e-5);
        }
        assert_true(fabs(sqrt(power) / 0.1 - 1) < 1e-3);
    }
    room_stream_destroy(s);
    room_destroy(r);
}

/* Zero crossings of 1 kHz that goes to and fro by 10 %: 10 % more a second at a
 * quarter of 10 s, less at three. */
static void a_tone_wanders_to_and_fro(void **state)
{
    struct room *r = drive_load(state, QUIET BESIDE NO_ECHO
                                "noise: {tones: [{frequency_hz: 1000, rms: 0.1, wander: "
                                "0.1}]}\n");
    struct room_stream *s = listen(r);
    size_t n_samples = room_frames(r, 1);
    static const struct {
        uint64_t ping;
        double hz;
    } at[] = {{0, 1000}, {104, 1100}, {208, 1000}, {312, 900}};
    const float *x;

    for (size_t k = 0; k < sizeof at / sizeof *at; k++) {
        double t_s, turns;
        size_t first = 0, last = 0, crossings = 0;
        assert_int_equal(room_stream_ping(s, at[k].ping, &x), 0);
        for (size_t i = 1; i < n_samples; i++) {
            if ((x[i - 1] < 0) == (x[i] < 0))
                continue;
            first = crossings++ ? first : i;
            last = i;
        }
        t_s = (double)(last - first) / RATE_HZ;
        turns = 0.5 * (double)(crossings - 1);
        assert_true(fabs(turns / t_s / at[k].hz - 1) < 0.01);
    }
    room_stream_destroy(s);
    room_destroy(r);
}

/* In decibels the microphones have it normally distributed, the same at each time; mean
 * and deviation of 16 draws within four of their standard errors. */
static void microphones_have_a_tone_differently_loud(void **state)
{
    enum { MICS = 16, N = 1056 /* 22 periods */ };
    struct scene_tone tone = {.frequency_hz = 1000, .rms = 0.1, .spread_db = 6};
    const struct scene_noise scene = {.tones = &tone, .n_tones = 1};
    const struct noise noise = {
        .scene = &scene, .seed = 7, .n_microphones = MICS, .sample_rate_hz = RATE_HZ};
    double first[MICS], sum = 0, squares = 0;
    float x[MICS][N];

    (void)state;
    for (int time = 0; time < 2; time++) {
        memset(x, 0, sizeof x);
        noise_add(&noise, NULL, 0.37 * time, NULL, 0, &x[0][0], N, N);
        for (size_t m = 0; m < MICS; m++) {
            double power = 0;
            for (size_t i = 0; i < N; i++)
                power += (double)x[m][i] * x[m][i] / N;
            double level = 10 * log10(power / (0.1 * 0.1));
            if (time) {
                assert_true(fabs(level - first[m]) < 1e-3);
                continue;
            }
            first[m] = level;
            sum += level;
            squares += level * level;
        }
    }
    double mean = sum / MICS, deviation = sqrt((squares - sum * mean) / (MICS - 1));
    assert_true(fabs(mean) < 4 * 6 / sqrt(MICS));
    assert_true(fabs(deviation - 6) < 4 * 6 / sqrt(2 * (MICS - 1)));
}

#define JITTER 96

/* Slots are longer by it, starts lie anywhere in it, and our echo is at its sample. */
static void with_jitter_each_emission_comes_later_and_its_echo_with_it(void **state)
{
    const char *path = scratch_write(*state, "scene.yaml",
                                     QUIET "wall: {normal: [0, 0, 1], distance_m: 2}\n"
                                           "wall_sound: {reflectivity: 1, echo: 1}\n");
    const struct firing firing = {.jitter_samples = JITTER};
    struct room *r;
    double sum = 0, squares = 0;

    assert_int_equal(room_load_drawn(&r, path, &firing, 0, NULL), 0);
    struct room_stream *s = listen(r);
    for (uint64_t n = 0; n < 400; n++) {
        uint64_t slot = n * (1152 + JITTER), start = room_stream_start(s, n);
        assert_true(start >= slot && start <= slot + JITTER);
        assert_int_equal(start, room_stream_start(s, n));
        sum += (double)(start - slot);
        squares += pow((double)(start - slot), 2);
    }
    /* Even from 0 to 96: mean 48, variance (97^2 - 1) / 12; five deviations of the mean.
     */
    double variance = (97.0 * 97.0 - 1) / 12;
    assert_true(fabs(sum / 400 - 48) < 5 * sqrt(variance / 400));
    assert_true(fabs((squares / 400 - pow(sum / 400, 2)) / variance - 1) < 0.2);
    for (uint64_t n = 400; n < 405; n++) {
        const float *x;
        double error = 0, power = 0;
        assert_int_equal(room_stream_ping(s, n, &x), 0);
        for (size_t i = 0; i < 1152; i++) {
            double t_s = (double)i / RATE_HZ - 4 / SOUND_M_S;
            if (t_s < 0.001 || t_s > 0.019)
                continue;
            error += pow(x[i] - chirp(t_s) / 4, 2);
            power += pow(chirp(t_s) / 4, 2);
        }
        assert_true(error < 1e-4 * power);
    }
    room_stream_destroy(s);
    room_destroy(r);
}

static void what_makes_no_sense_is_refused(void **state)
{
    static const struct {
        const char *text, *key;
    } bad[] = {
        {"interferers: [{position_m: [0, 0, 400]}]\n", "interferers[0].position_m"},
        {"interferers: [{position_m: [0, 0, 4], clock_ppm: 1e6}]\n",
         "interferers[0].clock_ppm"},
        {"interferers: [{position_m: [0, 0, 4], slot_samples: 0}]\n",
         "interferers[0].slot_samples"},
        {"interferers: [{position_m: [0, 0, 4], during_s: [3, 2]}]\n",
         "interferers[0].during_s"},
        {"noise: {tones: [{frequency_hz: 0, rms: 1}]}\n", "noise.tones[0].frequency_hz"},
        {"noise: {tones: [{frequency_hz: 50, rms: -1}]}\n", "noise.tones[0].rms"},
        {"noise: {tones: [{frequency_hz: 50, rms: 1, comb: [9, 8]}]}\n",
         "noise.tones[0].comb"},
        {"noise: {tones: [{frequency_hz: 50, rms: 1, comb: [8, 9], harmonics: 3}]}\n",
         "not both"},
        {"noise: {tones: [{frequency_hz: 50, rms: 1, wander: 0.2}]}\n",
         "noise.tones[0].wander"},
        {"noise: {tones: [{frequency_hz: 50, rms: 1, spread_db: -1}]}\n",
         "noise.tones[0].spread_db"},
    };
    char text[1024];

    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        struct error why = {""};
        struct room *r;
        snprintf(text, sizeof text, "%s%s%s", QUIET, BESIDE, bad[i].text);
        assert_int_equal(room_load(&r, scratch_write(*state, "scene.yaml", text), &why),
                         -EINVAL);
        if (!strstr(why.text, bad[i].key))
            fail_msg("%s: %s", bad[i].key, why.text);
    }
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(it_is_heard_by_the_clock_and_slots_of_its_own),
        TEST(it_is_heard_by_way_of_the_wall_too),
        TEST(beyond_the_wall_it_is_heard_through_an_opening_alone),
        TEST(it_is_there_while_the_scene_says_so),
        TEST(a_tone_goes_on_in_phase_with_its_harmonics),
        TEST(a_comb_comes_again_after_its_period),
        TEST(a_tone_wanders_to_and_fro),
        TEST(microphones_have_a_tone_differently_loud),
        TEST(with_jitter_each_emission_comes_later_and_its_echo_with_it),
        TEST(what_makes_no_sense_is_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
