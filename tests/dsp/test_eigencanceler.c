/* SPDX-License-Identifier: MIT */
/* Hum with gains that stay, in eight channels that hear hiss and an echo each at another
 * sample. */
#include <complex.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "dsp/eigencanceler.h"
#include "hal/random.h"

enum { SPEAKERS = 2, CHANNELS = 8, SAMPLES = 400 };
#define HUM 1.0

static const struct eigencanceler_config cfg = {SPEAKERS, CHANNELS, SAMPLES};

static void hear(struct random *random, bool hums, size_t echo_at,
                 float complex y[CHANNELS][SAMPLES])
{
    for (size_t i = 0; i < SAMPLES; i++) {
        double complex hum = random_normal(random) + I * random_normal(random);
        for (size_t c = 0; c < CHANNELS; c++) {
            double complex gain = (0.3 + 0.2 * (double)c) * cexp(I * (double)c);
            double complex x = 1e-3 * (random_normal(random) + I * random_normal(random));
            if (hums)
                x += HUM * gain * hum;
            y[c][i] = (float complex)(x + (i == echo_at + 7 * c ? 0.1 : 0.0));
        }
    }
}

/* What is left of the hum is no more than hiss, and the echo loses what of it lay in the
 * one direction: of channel c gain^2 over the sum of all. */
static void hum_goes_and_an_echo_stays(void **state)
{
    float complex y[CHANNELS][SAMPLES];
    struct eigencanceler *e;
    struct random random;
    double gains = 0;

    (void)state;
    random_seed(&random, (uint64_t[]){3}, 1);
    assert_int_equal(eigencanceler_create(&e, &cfg), 0);
    for (size_t c = 0; c < CHANNELS; c++)
        gains += pow(0.3 + 0.2 * (double)c, 2);
    for (size_t n = 0; n < 12; n++) {
        hear(&random, true, 20 + 3 * n, y);
        size_t taken = eigencanceler_execute(e, n % SPEAKERS, true, &y[0][0]);
        assert_int_equal(taken, n < SPEAKERS ? 0 : 1);
        for (size_t c = 0; n >= SPEAKERS && c < CHANNELS; c++) {
            double rest = 0, left = 1 - pow(0.3 + 0.2 * (double)c, 2) / gains;
            for (size_t i = 200; i < SAMPLES; i++)
                rest += creal(y[c][i] * conj(y[c][i])) / 200;
            assert_true(rest < 4e-6);
            assert_true(fabs(creal(y[c][20 + 3 * n + 7 * c]) / (0.1 * left) - 1) < 0.1);
        }
    }
    eigencanceler_destroy(e);
}

/* Without hum no direction has half of the power; where nothing is to be taken out the
 * traces stay as they are. */
static void without_hum_nothing_is_taken_out(void **state)
{
    float complex y[CHANNELS][SAMPLES], was[CHANNELS][SAMPLES];
    struct eigencanceler *e;
    struct random random;

    (void)state;
    random_seed(&random, (uint64_t[]){4}, 1);
    assert_int_equal(eigencanceler_create(&e, &cfg), 0);
    for (size_t n = 0; n < 24; n++) {
        hear(&random, n >= 12, 20 + 3 * n, y);
        memcpy(was, y, sizeof y);
        assert_int_equal(eigencanceler_execute(e, n % SPEAKERS, n < 12, &y[0][0]), 0);
        assert_memory_equal(was, y, sizeof y);
    }
    eigencanceler_destroy(e);
    assert_int_equal(
        eigencanceler_create(&e, &(struct eigencanceler_config){.n_speakers = 1}), -22);
    assert_null(e);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(hum_goes_and_an_echo_stays),
        cmocka_unit_test(without_hum_nothing_is_taken_out),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
