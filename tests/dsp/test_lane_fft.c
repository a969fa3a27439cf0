/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <complex.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/lane_fft.h"
#include "tests/dsp/near.h"

static const size_t sizes[] = {4, 8, 12, 16, 32, 48, 64, 128, 192, 20, 80, 320};
#define N_SIZES (sizeof sizes / sizeof *sizes)

enum direction { FORWARD, WHOLE, BACKWARD };

static void transform(const struct lane_fft *f, float *x, enum direction direction)
{
    if (direction == BACKWARD)
        lane_fft_backward(f, x);
    else if (direction == WHOLE)
        lane_fft_whole(f, x);
    else
        lane_fft_forward(f, x);
}

static float *signals(size_t n, unsigned seed)
{
    float *x = malloc(n * LANE_FFT_POINT * sizeof *x);
    assert_non_null(x);
    for (size_t i = 0; i < n * LANE_FFT_POINT; i++) {
        seed = seed * 1664525u + 1013904223u;
        x[i] = (float)(seed >> 8) / 16777216.0f - 0.5f;
    }
    return x;
}

static double complex at(const float *x, size_t point, size_t lane)
{
    const float *p = x + point * LANE_FFT_POINT + lane;
    return (double)p[0] + I * (double)p[VECTOR_LANES];
}

static void check_spectrum(size_t n, enum direction direction, size_t n_used)
{
    float *in = signals(n, (unsigned)n), *x = malloc(n * LANE_FFT_POINT * sizeof *x);
    struct lane_fft *f = NULL;
    assert_int_equal(lane_fft_create(&f, n), 0);
    assert_non_null(x);
    memcpy(x, in, n * LANE_FFT_POINT * sizeof *x);
    transform(f, x, direction);
    for (size_t place = 0; place < n; place++) {
        for (size_t lane = 0; lane < VECTOR_LANES; lane += 5) {
            double complex sum = 0.0;
            for (size_t i = 0; i < n_used; i++)
                sum += at(in, i, lane) *
                       cexp(-2.0 * M_PI * I * (double)(i * f->number[place] % n) /
                            (double)n);
            assert_true(cabs(sum - at(x, place, lane)) < 1e-5);
        }
    }
    lane_fft_destroy(f);
    free(in);
    free(x);
}

/* The upper half of the input is noise that must not matter. */
static void spectra_are_the_sums_that_define_them(void **state)
{
    (void)state;
    for (size_t q = 0; q < N_SIZES; q++)
        check_spectrum(sizes[q], FORWARD, sizes[q] / 2);
}

static void spectra_of_whole_signals_too(void **state)
{
    (void)state;
    for (size_t q = 0; q < N_SIZES; q++)
        check_spectrum(sizes[q], WHOLE, sizes[q]);
}

static void the_way_back_gives_n_times_the_first_half(void **state)
{
    (void)state;
    for (size_t q = 0; q < N_SIZES; q++) {
        size_t n = sizes[q];
        struct lane_fft *f = NULL;
        assert_int_equal(lane_fft_create(&f, n), 0);
        float *in = signals(n, 3 * (unsigned)n),
              *x = malloc(n * LANE_FFT_POINT * sizeof *x);
        memcpy(x, in, n * LANE_FFT_POINT * sizeof *x);
        transform(f, x, FORWARD);
        transform(f, x, BACKWARD);
        for (size_t i = 0; i < n / 2 * LANE_FFT_POINT; i++)
            assert_near(x[i] / (double)n, in[i], 1e-6);
        lane_fft_destroy(f);
        free(in);
        free(x);
    }
}

static void every_frequency_has_one_place(void **state)
{
    (void)state;
    for (size_t q = 0; q < N_SIZES; q++) {
        struct lane_fft *f = NULL;
        int seen[320] = {0};
        assert_int_equal(lane_fft_create(&f, sizes[q]), 0);
        for (size_t place = 0; place < sizes[q]; place++)
            seen[f->number[place]]++;
        for (size_t k = 0; k < sizes[q]; k++)
            assert_int_equal(seen[k], 1);
        lane_fft_destroy(f);
    }
}

static void other_lengths_are_refused_and_the_next_one_is_known(void **state)
{
    (void)state;
    struct lane_fft *f = NULL;
    static const size_t wrong[] = {0, 1, 2, 3, 5, 6, 24, 28, 100};
    for (size_t q = 0; q < sizeof wrong / sizeof *wrong; q++) {
        assert_false(lane_fft_transforms(wrong[q]));
        assert_int_equal(lane_fft_create(&f, wrong[q]), -EINVAL);
    }
    for (size_t q = 0; q < N_SIZES; q++)
        assert_true(lane_fft_transforms(sizes[q]));
    assert_null(f);
    assert_int_equal(lane_fft_size(0), 4);
    assert_int_equal(lane_fft_size(9), 12);
    assert_int_equal(lane_fft_size(33), 48);
    assert_int_equal(lane_fft_size(64), 64);
    assert_int_equal(lane_fft_size(129), 192);
    lane_fft_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(spectra_are_the_sums_that_define_them),
        cmocka_unit_test(spectra_of_whole_signals_too),
        cmocka_unit_test(the_way_back_gives_n_times_the_first_half),
        cmocka_unit_test(every_frequency_has_one_place),
        cmocka_unit_test(other_lengths_are_refused_and_the_next_one_is_known),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
