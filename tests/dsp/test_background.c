/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/background.h"
#include "dsp/pulse_compress.h"

#define N_CHANNELS 3
#define N          5

static void fill(float complex *x, float seed)
{
    for (int i = 0; i < N_CHANNELS * N; i++)
        x[i] = seed + (float)i + I * (seed * 0.5f - (float)(2 * i));
}

static void what_is_stored_is_kept_as_a_copy(void **state)
{
    float complex a[N_CHANNELS * N], b[N_CHANNELS * N];
    struct background *bg;

    (void)state;
    assert_int_equal(background_create(&bg, 4, N_CHANNELS, N), 0);
    fill(a, 8.0f);
    memcpy(b, a, sizeof(a));
    background_store(bg, 2, a);
    fill(a, 100.0f);
    assert_memory_equal(background_traces(bg, 2), b, sizeof(b));
    background_destroy(bg);
}

static void a_ping_that_was_never_stored_has_none(void **state)
{
    float complex a[N_CHANNELS * N];
    struct background *bg;

    (void)state;
    assert_int_equal(background_create(&bg, 2, N_CHANNELS, N), 0);
    fill(a, 1.0f);
    background_store(bg, 0, a);
    assert_null(background_traces(bg, 1));
    background_store(bg, 2, a); /* there is no such ping */
    assert_null(background_traces(bg, 2));
    background_destroy(bg);
}

static void a_second_store_replaces_the_first(void **state)
{
    float complex a[N_CHANNELS * N];
    struct background *bg;

    (void)state;
    assert_int_equal(background_create(&bg, 1, N_CHANNELS, N), 0);
    fill(a, 1.0f);
    background_store(bg, 0, a);
    fill(a, 4.0f);
    background_store(bg, 0, a);
    assert_memory_equal(background_traces(bg, 0), a, sizeof(a));
    background_destroy(bg);
}

static void sizes_of_nothing_or_beyond_memory_are_refused(void **state)
{
    struct background *bg = NULL;

    (void)state;
    assert_int_equal(background_create(&bg, 0, 1, 1), -EINVAL);
    assert_int_equal(background_create(&bg, 1, 0, 1), -EINVAL);
    assert_int_equal(background_create(&bg, 1, 1, 0), -EINVAL);
    assert_int_equal(background_create(&bg, SIZE_MAX / 2, 3, 1), -ENOMEM);
    assert_int_equal(background_create(&bg, SIZE_MAX / 8, 1, 2), -ENOMEM);
    assert_null(bg);
    background_destroy(NULL);
}

/* compress(a) - compress(b) == compress(a - b): the room can be taken out before or
 * after. */
static void subtraction_commutes_with_compression(void **state)
{
    const struct pulse_compress_config cfg = {
        .sample_rate_hz = 48000.0,
        .n_samples = 700,
        .chirp = {2000.0, 20000.0, 0.0125, false},
        .window = WINDOW_HANN,
        .gate_s = {0.0005, 0.002},
        .oversampling = 1.5,
        .n_channels = 2,
    };
    static float a[1400], b[1400], d[1400];
    struct pulse_compress *pc;
    struct trace_format f;
    float complex *ya, *yb, *yd;
    unsigned seed = 7;

    (void)state;
    assert_int_equal(pulse_compress_create(&pc, &cfg), 0);
    pulse_compress_format(pc, &f);
    ya = calloc(2 * f.n_samples, sizeof(*ya));
    yb = calloc(2 * f.n_samples, sizeof(*yb));
    yd = calloc(2 * f.n_samples, sizeof(*yd));
    assert_true(ya && yb && yd);
    for (int i = 0; i < 1400; i++) {
        seed = seed * 1664525u + 1013904223u;
        b[i] = (float)(seed >> 8) / 8388608.0f - 1.0f;
        seed = seed * 1664525u + 1013904223u;
        d[i] = 0.01f * ((float)(seed >> 8) / 8388608.0f - 1.0f);
        a[i] = b[i] + d[i];
    }
    pulse_compress_execute(pc, a, 700, ya);
    pulse_compress_execute(pc, b, 700, yb);
    pulse_compress_execute(pc, d, 700, yd);
    for (size_t i = 0; i < 2 * f.n_samples; i++)
        assert_true(cabsf(ya[i] - yb[i] - yd[i]) < 1e-6f);
    pulse_compress_destroy(pc);
    free(ya);
    free(yb);
    free(yd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_stored_is_kept_as_a_copy),
        cmocka_unit_test(a_ping_that_was_never_stored_has_none),
        cmocka_unit_test(a_second_store_replaces_the_first),
        cmocka_unit_test(sizes_of_nothing_or_beyond_memory_are_refused),
        cmocka_unit_test(subtraction_commutes_with_compression),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
