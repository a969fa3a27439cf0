/* SPDX-License-Identifier: MIT */
/* Traces are sums of Hann-windowed echoes in closed form, in double precision. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/drift.h"
#include "tests/dsp/near.h"

#define N_CHANNELS 4
#define N_ECHOES   50
#define N          800
#define SIZE       (N_CHANNELS * N)
#define BAND_HZ    18000.0

static const struct drift_config standard = {
    .format = {.t0_s = 0.0035, .rate_hz = 36000.0, .carrier_hz = 11000.0, .n_samples = N},
    .band_hz = {2000.0, 20000.0},
    .n_channels = N_CHANNELS,
};

struct bench {
    struct drift *d;
    struct drift_measurement m;
    float complex background[SIZE], scene[SIZE], object[SIZE];
};

static int setup(void **state)
{
    struct bench *b = calloc(1, sizeof(*b));

    *state = b;
    return b ? drift_create(&b->d, &standard) : -1;
}

static int teardown(void **state)
{
    struct bench *b = *state;

    drift_destroy(b->d);
    free(b);
    return 0;
}

static double uniform(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(*seed >> 11) / 9007199254740992.0;
}

static double sinc(double x)
{
    return fabs(x) < 1e-9 ? 1.0 : sin(M_PI * x) / (M_PI * x);
}

/* The Fourier transform of a Hann window BAND_HZ wide, 1 at 0. */
static double pulse(double t_s)
{
    double x = BAND_HZ * t_s;

    return sinc(x) + 0.5 * (sinc(x - 1.0) + sinc(x + 1.0));
}

/* An echo at tau comes at tau (1 + stretch); a pulse that is stretched too is what
 * stretching a trace makes of it. */
static void add_echo(float complex *y, double tau_s, double gain, double stretch,
                     bool pulse_too)
{
    const struct trace_format *f = &standard.format;
    double scale = 1.0 + stretch;

    for (size_t n = 0; n < N; n++) {
        double t = f->t0_s + (double)n / f->rate_hz;
        double past = pulse_too ? t / scale - tau_s : t - tau_s * scale;
        double turn = f->carrier_hz * (past - t);
        turn -= floor(turn);
        y[n] += (float complex)(gain * pulse(past) * cexp(2.0 * M_PI * I * turn));
    }
}

/* Echoes that fade with the square of their delay, some before and behind the gate. */
static void add_room(float complex *y, uint64_t seed, double gain, double stretch,
                     bool pulse_too)
{
    for (size_t i = 0; i < N_CHANNELS * N_ECHOES; i++) {
        double tau_s = 0.003 + 0.024 * uniform(&seed), a = 2.0 * uniform(&seed) - 1.0;
        add_echo(y + i / N_ECHOES * N, tau_s, gain * a * 1e-4 / (tau_s * tau_s), stretch,
                 pulse_too);
    }
}

static void add_noise(float complex *y, uint64_t seed, double rms)
{
    for (size_t i = 0; i < SIZE; i++) {
        double r = sqrt(-log(1.0 - uniform(&seed))), a = 2.0 * M_PI * uniform(&seed);
        y[i] += (float complex)(rms * r * cexp(I * a));
    }
}

static double power(const float complex *y)
{
    double sum = 0.0;

    for (size_t i = 0; i < SIZE; i++)
        sum += (double)crealf(y[i]) * crealf(y[i]) + (double)cimagf(y[i]) * cimagf(y[i]);
    return sum;
}

static double decibel(double ratio)
{
    return 10.0 * log10(ratio);
}

static void measure(struct bench *b)
{
    drift_measure(b->d, b->background, b->scene, NULL, &b->m);
}

static void a_stretch_is_found_however_the_phase_wraps(void **state)
{
    static const double stretches[] = {2e-5, -2e-4, 1e-3, -3e-3, 4.5e-3, 3e-4};
    struct bench *b = *state;

    add_room(b->background, 1, 1.0, 0.0, false);
    for (size_t i = 0; i < sizeof(stretches) / sizeof(*stretches); i++) {
        memset(b->scene, 0, sizeof(b->scene));
        add_room(b->scene, 1, 1.0, stretches[i], false);
        measure(b);
        assert_near(b->m.stretch, stretches[i], 2e-6 + 2e-3 * fabs(stretches[i]));
        assert_true(b->m.variance < 1e-10);
    }
}

static void a_stretched_trace_is_subtracted_to_the_interpolators_error(void **state)
{
    struct bench *b = *state;

    add_room(b->background, 2, 1.0, 0.0, false);
    add_room(b->scene, 2, 1.0, 1.2e-3, true);
    double before = power(b->scene);
    measure(b);
    assert_near(b->m.stretch, 1.2e-3, 2e-7);
    assert_true(drift_subtract(b->d, b->m.stretch, b->background, b->scene));
    assert_true(decibel(power(b->scene) / before) < -65.0);
}

/* The pulses keep their length, which the subtraction does not know. */
static void of_stretched_air_little_is_left(void **state)
{
    static const struct {
        double stretch, left_db, plain_db;
    } cases[] = {{2e-4, -64.0, -24.0}, {1e-3, -50.0, -10.0}, {3e-3, -41.0, -2.0}};
    struct bench *b = *state;

    for (size_t i = 0; i < 3; i++) {
        memset(b->background, 0, sizeof(b->background));
        memset(b->scene, 0, sizeof(b->scene));
        add_room(b->background, 3, 1.0, 0.0, false);
        add_room(b->scene, 3, 1.0, cases[i].stretch, false);
        memcpy(b->object, b->scene, sizeof(b->scene));
        double before = power(b->scene);
        measure(b);
        drift_subtract(b->d, b->m.stretch, b->background, b->scene);
        drift_subtract(b->d, 0.0, b->background, b->object);
        assert_true(decibel(power(b->scene) / before) < cases[i].left_db);
        assert_true(decibel(power(b->object) / before) > cases[i].plain_db);
    }
}

static void the_same_sound_twice_leaves_nothing_and_loses_no_sample(void **state)
{
    struct bench *b = *state;

    add_room(b->background, 4, 1.0, 0.0, false);
    memcpy(b->scene, b->background, sizeof(b->scene));
    measure(b);
    assert_false(drift_subtract(b->d, b->m.stretch, b->background, b->scene));
    for (size_t i = 0; i < SIZE; i++)
        assert_true(b->scene[i] == 0.0f);
}

/* What is left beside the object is 35 dB below it: none of it went into the stretch. */
static void an_object_as_loud_as_the_room_is_not_eaten(void **state)
{
    struct bench *b = *state;

    for (uint64_t seed = 10; seed < 14; seed++) {
        double stretch = 1e-3 * ((double)seed - 11.5);
        memset(b->background, 0, sizeof(b->background));
        memset(b->scene, 0, sizeof(b->scene));
        memset(b->object, 0, sizeof(b->object));
        add_room(b->background, seed, 1.0, 0.0, false);
        add_room(b->scene, seed, 1.0, stretch, false);
        double room = power(b->scene);
        for (size_t i = 0; i < N_CHANNELS; i++)
            add_echo(b->object + i * N, 0.015 + 1e-4 * (double)i, 1.0, 0.0, false);
        float gain = (float)sqrt(room / power(b->object));
        for (size_t i = 0; i < SIZE; i++)
            b->scene[i] += b->object[i] *= gain;
        measure(b);
        assert_near(b->m.stretch, stretch, 5e-6);
        drift_subtract(b->d, b->m.stretch, b->background, b->scene);
        for (size_t i = 0; i < SIZE; i++)
            b->scene[i] -= b->object[i];
        assert_true(decibel(power(b->scene) / power(b->object)) < -35.0);
    }
}

static void noise_alone_says_nothing(void **state)
{
    struct bench *b = *state;

    for (uint64_t seed = 0; seed < 20; seed++) {
        memset(b->background, 0, sizeof(b->background));
        memset(b->scene, 0, sizeof(b->scene));
        add_noise(b->background, 100 + seed, 1.0);
        add_noise(b->scene, 200 + seed, 1.0);
        measure(b);
        assert_true(isinf(b->m.variance));
        assert_true(b->m.stretch == 0.0);
    }
    memset(b->background, 0, sizeof(b->background));
    measure(b);
    assert_true(isinf(b->m.variance));
}

/* Squared errors over the variances that were claimed for them. */
static void the_variance_is_that_of_the_errors(void **state)
{
    static float complex stretched[SIZE];
    struct bench *b = *state;
    const int n = 40;
    double sum = 0.0;

    memset(stretched, 0, sizeof(stretched));
    add_room(stretched, 5, 1.0, 5e-4, true);
    for (int i = 0; i < n; i++) {
        memset(b->background, 0, sizeof(b->background));
        if (!i)
            add_room(b->object, 5, 1.0, 0.0, true);
        memcpy(b->background, b->object, sizeof(b->object));
        memcpy(b->scene, stretched, sizeof(stretched));
        add_noise(b->background, 1000 + (uint64_t)i, 0.05);
        add_noise(b->scene, 2000 + (uint64_t)i, 0.05);
        measure(b);
        double error = b->m.stretch - 5e-4;
        sum += error * error / b->m.variance;
    }
    assert_true(sum / n > 0.4 && sum / n < 2.5);
}

static void neither_gain_nor_a_masked_channel_matters(void **state)
{
    static const bool masked[N_CHANNELS] = {false, false, true, false};
    static const float gains[] = {1e-9f, 1e9f};
    struct bench *b = *state;
    struct drift_measurement other;

    add_room(b->background, 6, 1.0, 0.0, false);
    add_room(b->scene, 6, 1.0, -7e-4, false);
    drift_measure(b->d, b->background, b->scene, masked, &b->m);
    for (size_t i = 2 * N; i < 3 * N; i++)
        b->scene[i] = NAN;
    drift_measure(b->d, b->background, b->scene, masked, &other);
    assert_true(b->m.stretch == other.stretch && b->m.variance == other.variance);
    for (size_t g = 0; g < 2; g++) {
        for (size_t i = 0; i < SIZE; i++) {
            b->object[i] = gains[g] * b->background[i];
            b->scene[i] *= g ? gains[1] * gains[1] : gains[0];
        }
        drift_measure(b->d, b->object, b->scene, masked, &other);
        assert_near(other.stretch, b->m.stretch, 1e-7);
    }
}

/* A constant stays one when it is stretched: only the carrier's phase differs. */
static void what_lies_beyond_the_gate_is_not_made_up(void **state)
{
    struct bench *b = *state;
    const double stretch = 2e-3; /* 0.25 samples at the gate's start, 1.8 at its end */

    for (size_t i = 0; i < SIZE; i++)
        b->background[i] = b->scene[i] = 1.0f;
    assert_true(drift_subtract(b->d, stretch, b->background, b->scene));
    for (size_t n = 0; n < N; n++) {
        double t = standard.format.t0_s + (double)n / standard.format.rate_hz;
        double turn = standard.format.carrier_hz * t * (1.0 / (1.0 + stretch) - 1.0);
        double complex left = 1.0 - cexp(2.0 * M_PI * I * turn);
        bool inside = n >= 4 && n < N - 2;
        assert_near(cabs(b->scene[n] - (inside ? left : 0.0)), 0.0, 1e-3);
    }
}

static void configurations_without_sense_are_refused(void **state)
{
    struct drift *d = NULL;
    struct drift_config c = standard;

    (void)state;
    assert_int_equal(drift_create(&d, NULL), -EINVAL);
    c.n_channels = 0;
    assert_int_equal(drift_create(&d, &c), -EINVAL);
    c = standard;
    c.format.rate_hz = NAN;
    assert_int_equal(drift_create(&d, &c), -EINVAL);
    c = standard;
    c.band_hz[1] = c.band_hz[0];
    assert_int_equal(drift_create(&d, &c), -EINVAL);
    c = standard;
    c.format.rate_hz = BAND_HZ; /* not oversampled */
    assert_int_equal(drift_create(&d, &c), -EINVAL);
    c = standard;
    c.n_channels = SIZE_MAX / N;
    assert_int_equal(drift_create(&d, &c), -ENOMEM);
    assert_null(d);
    drift_destroy(NULL);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_stretch_is_found_however_the_phase_wraps),
        TEST(a_stretched_trace_is_subtracted_to_the_interpolators_error),
        TEST(of_stretched_air_little_is_left),
        TEST(the_same_sound_twice_leaves_nothing_and_loses_no_sample),
        TEST(an_object_as_loud_as_the_room_is_not_eaten),
        TEST(noise_alone_says_nothing),
        TEST(the_variance_is_that_of_the_errors),
        TEST(neither_gain_nor_a_masked_channel_matters),
        TEST(what_lies_beyond_the_gate_is_not_made_up),
        TEST(configurations_without_sense_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
