/* SPDX-License-Identifier: MIT */
/* Emissions at any pace, against the chirp's formula. */
#include "scratch.h"

#include <errno.h>
#include <math.h>

#include "hal/room/emitter.h"

enum { N_CHIRP = 960, N = 1400 };
#define RATE_HZ 48000.0

/* A chirp from 2 to 20 kHz of 20 ms at time u, in samples, and its slope by the sample.
 */
static double chirp(double u, double *slope)
{
    double t = u / RATE_HZ, rate = 18000 / 0.02;
    double phase = 2 * M_PI * (2000 * t + rate / 2 * t * t);
    *slope = -sin(phase) * 2 * M_PI * (2000 + rate * t) / RATE_HZ;
    return cos(phase);
}

static struct wave *create(int derivative)
{
    struct wave *w;
    float samples[N_CHIRP];
    double slope;
    for (int i = 0; i < N_CHIRP; i++)
        samples[i] = (float)chirp(i, &slope);
    assert_int_equal(wave_create(&w, samples, N_CHIRP, derivative), 0);
    return w;
}

/* How far y is from the chirp on an axis, in dB; its first and last 100 samples do not
 * count, where a chirp that ends at once is not band-limited. */
static double error_db(const float *y, const struct wave_axis *axis, double amplitude,
                       int derivative)
{
    double error = 0, power = 0;
    for (int i = 0; i < N; i++) {
        double u = ((double)i - axis->start) / axis->length, slope;
        double t = N_CHIRP * (u + axis->bend * u * (1 - u));
        double value = chirp(t, &slope);
        double expected = amplitude * (derivative ? slope : value);
        if (t < 100 || t > N_CHIRP - 100)
            continue;
        error += pow(y[i] - expected, 2);
        power += expected * expected;
    }
    return 10 * log10(error / power);
}

static void on_its_own_axis_an_emission_is_itself(void **state)
{
    struct wave *w = create(0);
    struct wave_axis axis = {.start = 100, .length = N_CHIRP};
    float y[N] = {0};
    double slope;
    (void)state;
    wave_add(w, &axis, 0.5f, y, N);
    for (int i = 0; i < N_CHIRP; i++)
        assert_true(fabs(y[100 + i] - 0.5 * chirp(i, &slope)) < 1e-4);
    for (int i = 0; i < 36; i++)
        assert_true(y[i] == 0 && y[N - 1 - i] == 0);
    wave_destroy(w);
}

static void a_shifted_stretched_and_bent_axis_is_followed(void **state)
{
    static const struct wave_axis axes[] = {{100.37, N_CHIRP, 0},
                                            {100.37, N_CHIRP * 1.013, 0},
                                            {250.9, N_CHIRP * 0.96, 0},
                                            {80.2, N_CHIRP * 1.01, 5e-4},
                                            {-300.6, N_CHIRP * 0.99, -5e-4},
                                            {900.1, N_CHIRP * 1.02, 0}};
    (void)state;
    for (int derivative = 0; derivative < 2; derivative++) {
        struct wave *w = create(derivative);
        for (size_t k = 0; k < sizeof axes / sizeof *axes; k++) {
            float y[N] = {0};
            wave_add(w, &axes[k], 0.25f, y, N);
            assert_true(error_db(y, &axes[k], 0.25, derivative) < -55);
        }
        wave_destroy(w);
    }
}

/* A tone under Hann's window: band-limited but for 1 / f^3. */
static double tone(double u, double hz)
{
    double w = u < 0 || u > N_CHIRP ? 0 : 0.5 - 0.5 * cos(2 * M_PI * u / N_CHIRP);
    return w * cos(2 * M_PI * hz / RATE_HZ * u + 0.3);
}

static void a_tone_is_read_to_90_db_at_any_pace(void **state)
{
    static const double paces[] = {1, 1.0002, 0.9999, 1.012, 0.988, 1.06, 0.93};
    static const double tones_hz[] = {300, 2000, 11000, 20000};
    (void)state;
    for (size_t f = 0; f < sizeof tones_hz / sizeof *tones_hz; f++) {
        float samples[N_CHIRP];
        struct wave *w;
        for (int i = 0; i < N_CHIRP; i++)
            samples[i] = (float)tone(i, tones_hz[f]);
        assert_int_equal(wave_create(&w, samples, N_CHIRP, 0), 0);
        for (size_t k = 0; k < sizeof paces / sizeof *paces; k++) {
            struct wave_axis axis = {141.59, N_CHIRP * paces[k], 0};
            double error = 0, power = 0;
            float y[N] = {0};
            wave_add(w, &axis, 1, y, N);
            for (int i = 0; i < N; i++) {
                double u = N_CHIRP * (i - axis.start) / axis.length;
                error += pow(y[i] - tone(u, tones_hz[f]), 2);
                power += pow(tone(u, tones_hz[f]), 2);
            }
            assert_true(10 * log10(error / power) < -90);
        }
        wave_destroy(w);
    }
}

static void what_falls_outside_of_the_recording_is_left_out(void **state)
{
    struct wave *w = create(0);
    static const struct wave_axis axes[] = {{-1200, N_CHIRP, 0}, {N + 80, N_CHIRP, 0}};
    float y[N] = {0};
    (void)state;
    for (size_t k = 0; k < 2; k++)
        wave_add(w, &axes[k], 1, y, N);
    for (int i = 0; i < N; i++)
        assert_true(y[i] == 0);
    wave_destroy(w);
    assert_int_equal(wave_create(&w, y, 0, 0), -EINVAL);
    assert_null(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(on_its_own_axis_an_emission_is_itself),
        cmocka_unit_test(a_shifted_stretched_and_bent_axis_is_followed),
        cmocka_unit_test(a_tone_is_read_to_90_db_at_any_pace),
        cmocka_unit_test(what_falls_outside_of_the_recording_is_left_out),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
