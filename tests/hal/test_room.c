/* SPDX-License-Identifier: MIT */
/* The simulated room against sums and integrals in double precision at single
 * frequencies, which share nothing with how the room computes. */
#include "scratch.h"

#include <complex.h>
#include <errno.h>
#include <math.h>

#include "hal/room/room.h"

#define SOUND_M_S 340.0
#define RATE_HZ   48000.0
enum { SLOT = 1500, N_CHIRP = 1500 };

/* One speaker, one microphone, 340 m/s, chirp 2 to 20 kHz in a slot of 1500 samples, and
 * a wall where x + z = 1.6: what is really at (x, y, z) is imaged at (1.6 - z, y,
 * 1.6 - x). */
#define TIMING                                                                           \
    "sound_speed_m_s: 340\nsample_rate_hz: 48000\n"                                      \
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.03125}\n"                     \
    "slot_samples: 1500\ngate_m: [0.2, 5]\n"
#define SLANTED  "wall: {normal: [1, 0, 1], distance_m: 1.131370849898476}\n"
#define FRONTAL  "wall: {normal: [0, 0, 1], distance_m: 1}\n"
#define ONE_PAIR "speakers_m: [[-0.02, 0, 0]]\nmicrophones_m: [[0.02, 0, 0]]\n"
#define SILENT   "level: 1\ndirect_level: 0\n"

static const double speaker_m[3] = {-0.02, 0, 0}, microphone_m[3] = {0.02, 0, 0};

static struct room *load(void **state, const char *text)
{
    struct error why = {.text = ""};
    struct room *r;
    if (room_load(&r, scratch_write(*state, "scene.yaml", text), &why))
        fail_msg("%s", why.text);
    return r;
}

static float *record(struct room *r, enum pass pass, size_t position, uint32_t take)
{
    static const uint32_t speakers[] = {0, 1, 2, 3};
    const struct survey *s = room_survey(r);
    size_t n = s->n_microphones * room_frames(r, s->n_speakers);
    float *samples = malloc(n * sizeof *samples);
    assert_non_null(samples);
    assert_int_equal(
        room_record(r, pass, position, speakers, s->n_speakers, take, samples), 0);
    return samples;
}

static double complex spectrum(const float *x, size_t n, double f_hz)
{
    double complex sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += x[i] * cexp(-2 * M_PI * I * f_hz * (double)i / RATE_HZ);
    return sum;
}

static double complex chirp_spectrum(double f_hz)
{
    double complex sum = 0;
    for (int i = 0; i < N_CHIRP; i++) {
        double t = i / RATE_HZ;
        double phase = 2 * M_PI * (2000 * t + 0.5 * 18000 / 0.03125 * t * t);
        sum += cos(phase) * cexp(-2 * M_PI * I * f_hz * t);
    }
    return sum;
}

static double distance(const double a[3], const double b[3])
{
    return sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
}

/* The transfer function from chirp to samples at a frequency. */
static double complex transfer(const float *x, size_t n, double f_hz)
{
    return spectrum(x, n, f_hz) / chirp_spectrum(f_hz);
}

static void a_point_echoes_with_the_right_delay_and_amplitude(void **state)
{
    struct room *r = load(state, TIMING SLANTED ONE_PAIR SILENT
                          "latency_samples: 3.25\n"
                          "wall_sound: {reflectivity: 0.9}\n"
                          "objects: [{name: p, kind: point, position_m: [-1.1, 0.3, 1.2],"
                          " scattering_length_m: 0.05}]\n");
    static const double virtual_m[3] = {1.6 - 1.2, 0.3, 1.6 + 1.1};
    double rt = distance(speaker_m, virtual_m), rr = distance(microphone_m, virtual_m);
    double delay_s = (rt + rr) / SOUND_M_S + 3.25 / RATE_HZ;
    double amplitude = 0.9 * 0.9 * 0.05 / (rt * rr);
    float *x = record(r, PASS_SCENE, 0, 0);
    size_t n = room_frames(r, 1);
    double error = 0, power = 0, slope = 0, weight = 0, gain = 0;
    for (int k = 0; k <= 200; k++) {
        double f = 2000 + 90.0 * k;
        double complex expected = amplitude * chirp_spectrum(f) *
                                  cexp(-2 * M_PI * I * f * delay_s);
        double complex found = spectrum(x, n, f);
        error += pow(cabs(found - expected), 2);
        power += pow(cabs(expected), 2);
        slope += (f - 11000) * carg(found / expected);
        weight += (f - 11000) * (f - 11000);
        gain += cabs(found / expected) / 201;
    }
    double delay_error = -slope / weight / (2 * M_PI) * RATE_HZ; /* samples */
    assert_true(10 * log10(error / power) < -60);
    assert_true(fabs(delay_error) < 0.01);
    assert_true(fabs(gain - 1) < 1e-3);
    free(x);
    room_destroy(r);
}

/* The direct path and the wall's echo of the array itself. */
static void the_wall_is_heard_as_the_speakers_image(void **state)
{
    struct room *r = load(state, TIMING FRONTAL ONE_PAIR
                          "level: 0.5\ndirect_level: 0.7\n"
                          "wall_sound: {reflectivity: 1, echo: 0.8}\n");
    float *x = record(r, PASS_BACKGROUND, 0, 0);
    double image = sqrt(0.04 * 0.04 + 4);
    double error = 0, power = 0;
    for (double f = 2000; f <= 20000; f += 180) {
        double complex expected =
            0.5 *
            (0.7 / 0.04 * cexp(-2 * M_PI * I * f * 0.04 / SOUND_M_S) +
             0.8 / image * cexp(-2 * M_PI * I * f * image / SOUND_M_S)) *
            chirp_spectrum(f);
        error += pow(cabs(spectrum(x, room_frames(r, 1), f) - expected), 2);
        power += pow(cabs(expected), 2);
    }
    assert_true(10 * log10(error / power) < -60);
    free(x);
    room_destroy(r);
}

/* Against the Kirchhoff integral over 1 mm patches; the plate looks past the array, so
 * the error is measured against what it would return if it did not. */
static void a_tilted_plate_is_its_kirchhoff_integral(void **state)
{
    struct room *r = load(state, TIMING FRONTAL ONE_PAIR SILENT
                          "wall_sound: {reflectivity: 0.9}\n"
                          "objects: [{name: p, kind: rectangle, size_m: [0.1, 0.06], "
                          "position_m: [0.1, 0.05, 0.6], facing: [0.3, -0.1, 1], "
                          "reflectivity: 0.8}]\n");
    /* The real plate faces the array's image behind the wall, at z = 2. */
    static const double s[3] = {-0.02, 0, 2}, m[3] = {0.02, 0, 2};
    double n[3] = {0.3, -0.1, 1}, length = sqrt(1.1), u[3], v[3];
    for (int a = 0; a < 3; a++)
        n[a] /= length;
    double across = sqrt(n[0] * n[0] + n[2] * n[2]); /* u = y cross n */
    u[0] = n[2] / across, u[1] = 0, u[2] = -n[0] / across;
    v[0] = n[1] * u[2], v[1] = n[2] * u[0] - n[0] * u[2], v[2] = -n[1] * u[0];
    float *x = record(r, PASS_SCENE, 0, 0);
    for (double f = 3000; f <= 19000; f += 4000) {
        double complex sum = 0;
        for (int i = 0; i < 100; i++)
            for (int j = 0; j < 60; j++) {
                double a = (i + 0.5) * 1e-3 - 0.05, b = (j + 0.5) * 1e-3 - 0.03;
                double p[3] = {0.1 + a * u[0] + b * v[0], 0.05 + a * u[1] + b * v[1],
                               0.6 + a * u[2] + b * v[2]};
                double rs = distance(p, s), rm = distance(p, m), cs = 0, cm = 0;
                for (int c = 0; c < 3; c++) {
                    cs += n[c] * (s[c] - p[c]) / rs;
                    cm += n[c] * (m[c] - p[c]) / rm;
                }
                sum += 1e-6 * 0.5 * (cs + cm) / (rs * rm) *
                       cexp(-2 * M_PI * I * f * (rs + rm) / SOUND_M_S);
            }
        double complex expected = 0.9 * 0.9 * 0.8 * I * f / SOUND_M_S * sum;
        double complex found = transfer(x, room_frames(r, 1), f);
        double broadside = 0.8 * f / SOUND_M_S * 0.1 * 0.06 / (1.4 * 1.4);
        if (cabs(found - expected) > 0.004 * broadside)
            fail_msg("at %g Hz %g%+gi, expected %g%+gi", f, creal(found), cimag(found),
                     creal(expected), cimag(expected));
    }
    free(x);
    room_destroy(r);
}

/* The plate is 1.5 m away and reaches far beyond the first Fresnel zone, and what its
 * edges send comes 56 samples later. */
static void a_large_plate_is_a_mirror(void **state)
{
    struct room *r = load(state, TIMING FRONTAL ONE_PAIR SILENT
                          "objects: [{name: p, kind: rectangle, size_m: [1.6, 1.6], "
                          "position_m: [0, 0, 0.5], facing: [0, 0, 1]}]\n");
    double image = sqrt(0.04 * 0.04 + 9);
    float *x = record(r, PASS_SCENE, 0, 0);
    size_t n = room_frames(r, 1);
    double best = 0, best_at = 0;
    /* Correlation with the chirp at fractions of a sample. */
    for (double t = image / SOUND_M_S * RATE_HZ - 3; t < image / SOUND_M_S * RATE_HZ + 3;
         t += 0.05) {
        double sum = 0, norm = 0;
        for (size_t i = 0; i < n; i++) {
            double at = ((double)i - t) / RATE_HZ;
            if (at < 0 || at >= 0.03125)
                continue;
            double c = cos(2 * M_PI * (2000 * at + 0.5 * 18000 / 0.03125 * at * at));
            sum += x[i] * c;
            norm += c * c;
        }
        if (sum / norm > best) {
            best = sum / norm;
            best_at = t;
        }
    }
    assert_true(fabs(best_at - image / SOUND_M_S * RATE_HZ) < 0.15);
    assert_true(fabs(best * image - 1) < 0.05);
    free(x);
    room_destroy(r);
}

/* On its axis (f / c) A / r^2 with A = side^2 / sqrt(3), and hardly less 10 degrees off
 * it, where a plate of that area would be silent. */
static void a_corner_returns_sound_to_where_it_came_from(void **state)
{
    static const char *const facings[] = {"[0, 0, 1]", "[0.17365, 0, 0.98481]"};
    double area = 0.2 * 0.2 / sqrt(3), f = 10000, r_m = 1.5;
    for (int i = 0; i < 2; i++) {
        char text[1024];
        snprintf(text, sizeof text,
                 TIMING FRONTAL SILENT
                 "speakers_m: [[0, 0, 0]]\nmicrophones_m: [[0, 0, 0]]\n"
                 "objects: [{name: c, kind: corner, side_m: 0.2, "
                 "position_m: [0, 0, 0.5], facing: %s}]\n",
                 facings[i]);
        struct room *r = load(state, text);
        float *x = record(r, PASS_SCENE, 0, 0);
        double found = cabs(transfer(x, room_frames(r, 1), f));
        double expected = f / SOUND_M_S * area / (r_m * r_m) * (i ? 0.98481 : 1);
        assert_true(fabs(found / expected - 1) < 0.04);
        free(x);
        room_destroy(r);
    }
}

#define OBJECT                                                                           \
    "objects: [{name: p, kind: point, position_m: [0, 0, 0.2], scattering_length_m: "    \
    "0.1}]\n"
#define FOUR                                                                             \
    "speakers_m: [[0, 0, 0], [0, 0.2, 0], [0, 0.4, 0]]\n"                                \
    "microphones_m: [[0.1, 0, 0], [0.1, 0.3, 0]]\n"                                      \
    "stage: {axis: [1, 0, 0], positions_m: [0, 0.1, 0.2]}\n"
#define SURROUNDINGS                                                                     \
    "wall_sound: {reflectivity: 1, patches: 20, scattering_length_m: 0.02, "             \
    "roughness_m: 0.05}\n"                                                               \
    "clutter: {points: 20, scattering_length_m: 0.05, near_m: 0.8, far_m: 2}\n"

static void the_background_is_the_scene_without_its_objects(void **state)
{
    struct room *all = load(state, TIMING FRONTAL FOUR OBJECT SURROUNDINGS);
    struct room *alone = load(state, TIMING FRONTAL FOUR OBJECT "direct_level: 0\n");
    size_t n = 2 * room_frames(all, 3);
    float *scene = record(all, PASS_SCENE, 1, 0);
    float *background = record(all, PASS_BACKGROUND, 1, 0);
    float *object = record(alone, PASS_SCENE, 1, 0);
    double echo = 0, error = 0, around = 0;
    for (size_t i = 0; i < n; i++) {
        error += pow(scene[i] - background[i] - object[i], 2);
        echo += pow(object[i], 2);
        around += pow(background[i], 2);
    }
    assert_true(echo > 0);
    assert_true(error < 1e-8 * around);
    free(scene);
    free(background);
    free(object);
    room_destroy(all);
    room_destroy(alone);
}

/* Slots add up: three speakers in turn are the sum of each alone, a slot later each. */
static void a_shot_is_the_sum_of_its_emissions(void **state)
{
    static const uint32_t order[] = {2, 0, 1};
    struct room *r = load(state, TIMING FRONTAL FOUR OBJECT SURROUNDINGS);
    size_t n = room_frames(r, 3), n_one = room_frames(r, 1);
    float *all = malloc(2 * n * sizeof *all), *one = malloc(2 * n_one * sizeof *one);
    assert_non_null(all);
    assert_non_null(one);
    assert_int_equal(n, 3 * SLOT + room_tail(r));
    assert_int_equal(room_record(r, PASS_SCENE, 2, order, 3, 0, all), 0);
    for (uint32_t j = 0; j < 3; j++) {
        assert_int_equal(room_record(r, PASS_SCENE, 2, &order[j], 1, 0, one), 0);
        for (size_t m = 0; m < 2; m++)
            for (size_t i = 0; i < n_one; i++)
                all[m * n + j * SLOT + i] -= one[m * n_one + i];
    }
    for (size_t m = 0; m < 2; m++)
        for (size_t i = 0; i < n; i++)
            assert_true(fabsf(all[m * n + i]) < 1e-5f);
    assert_int_equal(room_record(r, PASS_SCENE, 3, order, 3, 0, all), -EINVAL);
    assert_int_equal(room_record(r, PASS_SCENE, 0, (uint32_t[]){3}, 1, 0, all), -EINVAL);
    free(all);
    free(one);
    room_destroy(r);
}

static double mean_square(const float *x, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += (double)x[i] * x[i];
    return sum / (double)n;
}

static void noise_has_the_power_asked_for(void **state)
{
    struct room *quiet = load(state, TIMING FRONTAL FOUR OBJECT "direct_level: 0\n");
    struct room *noisy =
        load(state, TIMING FRONTAL FOUR OBJECT "direct_level: 0\nnoise: {snr_db: 10}\n");
    size_t n = 2 * room_frames(quiet, 3);
    double echo = 0, noise = 0;
    for (size_t position = 0; position < 3; position++) {
        float *x = record(quiet, PASS_SCENE, position, 0);
        float *y = record(noisy, PASS_SCENE, position, 0);
        echo += mean_square(x, n) * (double)n / (2 * 3 * SLOT);
        for (size_t i = 0; i < n; i++)
            y[i] -= x[i];
        noise += mean_square(y, n);
        free(x);
        free(y);
    }
    assert_true(fabs(10 * log10(echo / noise) - 10) < 0.3);
    room_destroy(quiet);
    room_destroy(noisy);
}

static void noise_repeats_only_with_pass_position_and_take(void **state)
{
    struct room *r = load(state, TIMING FRONTAL FOUR "level: 0\nnoise: {rms: 0.1}\n");
    size_t n = 2 * room_frames(r, 3);
    float *x = record(r, PASS_SCENE, 1, 5);
    const struct {
        enum pass pass;
        size_t position;
        uint32_t take;
        bool same;
    } cases[] = {{PASS_SCENE, 1, 5, true},
                 {PASS_BACKGROUND, 1, 5, false},
                 {PASS_SCENE, 2, 5, false},
                 {PASS_SCENE, 1, 6, false}};
    assert_true(fabs(sqrt(mean_square(x, n)) / 0.1 - 1) < 0.02);
    for (size_t i = 0; i < 4; i++) {
        float *y = record(r, cases[i].pass, cases[i].position, cases[i].take);
        double together = 0;
        for (size_t k = 0; k < n; k++)
            together += (double)x[k] * y[k] / (double)n;
        assert_true(cases[i].same ? !memcmp(x, y, n * sizeof *x)
                                  : fabs(together) < 0.05 * 0.01);
        free(y);
    }
    free(x);
    room_destroy(r);
}

static double direct_delay_s(void **state, const char *drift, enum pass pass,
                             size_t position, double *temperature_c)
{
    char text[1024];
    snprintf(text, sizeof text,
             "temperature_c: 10\nsample_rate_hz: 48000\n"
             "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.03125}\n"
             "slot_samples: 1500\n" FRONTAL
             "speakers_m: [[0, 0, 0]]\nmicrophones_m: [[0, 3, 0]]\n"
             "stage: {axis: [1, 0, 0], positions_m: [0, 1, 2]}\n%s",
             drift);
    struct room *r = load(state, text);
    float *x = record(r, pass, position, 0);
    double complex last = 0;
    double turns = 0;
    /* Steps of 10 Hz turn the phase of 9 ms by less than half a turn. */
    for (double f = 5000; f <= 15000; f += 10) {
        double complex h = transfer(x, room_frames(r, 1), f);
        if (last != 0)
            turns -= carg(h / last) / (2 * M_PI);
        last = h;
    }
    *temperature_c = room_temperature_c(r, pass, position);
    free(x);
    room_destroy(r);
    return turns / 10000;
}

static void sound_runs_at_the_temperature_of_pass_and_position(void **state)
{
    static const char drift[] = "drift: {background_c: 4, scan_c: -6}\n";
    const struct {
        const char *drift;
        enum pass pass;
        size_t position;
        double temperature_c;
    } cases[] = {{"", PASS_SCENE, 2, 10},
                 {drift, PASS_SCENE, 0, 10},
                 {drift, PASS_SCENE, 1, 7},
                 {drift, PASS_BACKGROUND, 0, 14},
                 {drift, PASS_BACKGROUND, 2, 8}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        double temperature_c;
        double delay_s = direct_delay_s(state, cases[i].drift, cases[i].pass,
                                        cases[i].position, &temperature_c);
        double expected_s = 3 / survey_sound_speed_m_s(cases[i].temperature_c);
        assert_true(fabs(temperature_c - cases[i].temperature_c) < 1e-12);
        assert_true(fabs(delay_s / expected_s - 1) < 1e-4);
    }
}

/* The survey stays nominal while the array is not. */
static void position_errors_are_heard_but_not_told(void **state)
{
    struct room *exact = load(state, TIMING FRONTAL FOUR);
    struct room *crooked =
        load(state, TIMING FRONTAL FOUR "errors: {element_m: 0.002, stage_m: 0.002}\n");
    size_t n = 2 * room_frames(exact, 3);
    float *x = record(exact, PASS_SCENE, 0, 0);
    float *y = record(crooked, PASS_SCENE, 0, 0);
    assert_int_equal(survey_id(room_survey(exact)), survey_id(room_survey(crooked)));
    double power = mean_square(x, n);
    for (size_t i = 0; i < n; i++)
        y[i] -= x[i];
    /* 2 mm rms for each axis, of both ends: some tenths of a radian at 11 kHz. */
    assert_true(mean_square(y, n) > 0.01 * power && mean_square(y, n) < power);
    free(x);
    free(y);
    room_destroy(exact);
    room_destroy(crooked);
}

static void microphones_sound_as_their_curves_say(void **state)
{
    struct room *flat = load(state, TIMING FRONTAL FOUR);
    struct room *curved =
        load(state, TIMING FRONTAL FOUR "microphones: {ripple_db: 3}\n");
    const struct survey *s = room_survey(curved);
    size_t n = room_frames(flat, 3);
    float *x = record(flat, PASS_SCENE, 0, 0);
    float *y = record(curved, PASS_SCENE, 0, 0);
    double spread = 0;
    assert_int_equal(s->n_responses, 2);
    assert_int_equal(room_survey(flat)->n_responses, 0);
    for (size_t m = 0; m < 2; m++)
        for (double f = 2500; f < 19500; f += 1000) {
            const struct survey_response *c = &s->responses[m];
            size_t i = 1;
            while (c->frequency_hz[i] < f)
                i++;
            double t = (f - c->frequency_hz[i - 1]) /
                       (c->frequency_hz[i] - c->frequency_hz[i - 1]);
            double expected_db = c->gain_db[i - 1] +
                                 t * (c->gain_db[i] - c->gain_db[i - 1]);
            double found_db = 20 * log10(cabs(spectrum(y + m * n, n, f)) /
                                         cabs(spectrum(x + m * n, n, f)));
            assert_true(fabs(found_db - expected_db) < 0.1);
            spread += expected_db * expected_db;
        }
    assert_true(spread > 1);
    free(x);
    free(y);
    room_destroy(flat);
    room_destroy(curved);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_point_echoes_with_the_right_delay_and_amplitude),
        TEST(the_wall_is_heard_as_the_speakers_image),
        TEST(a_tilted_plate_is_its_kirchhoff_integral),
        TEST(a_large_plate_is_a_mirror),
        TEST(a_corner_returns_sound_to_where_it_came_from),
        TEST(the_background_is_the_scene_without_its_objects),
        TEST(a_shot_is_the_sum_of_its_emissions),
        TEST(noise_has_the_power_asked_for),
        TEST(noise_repeats_only_with_pass_position_and_take),
        TEST(sound_runs_at_the_temperature_of_pass_and_position),
        TEST(position_errors_are_heard_but_not_told),
        TEST(microphones_sound_as_their_curves_say),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
