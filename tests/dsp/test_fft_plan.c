/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <complex.h>
#include <math.h>
#include <string.h>

#include "dsp/fft.h"
#include "tests/dsp/near.h"

enum { N = 96 };

struct buffers {
    float in[2 * N], out[2 * N];
};

static int setup(void **state)
{
    struct buffers *b = fftwf_malloc(sizeof *b);

    if (!b)
        return -1;
    for (int i = 0; i < 2 * N; i++)
        b->in[i] = (float)((37 * i + 11) % 64) / 32.0f - 1.0f;
    *state = b;
    return 0;
}

static int teardown(void **state)
{
    fftwf_free(*state);
    return 0;
}

static void check_direction(struct buffers *b, int direction)
{
    struct buffers before = *b;
    fftwf_plan p = fft_plan(N, b->in, b->out, direction);

    assert_non_null(p);
    memcpy(b->in, before.in, sizeof before.in);
    fftwf_execute(p);
    assert_memory_equal(b->in, before.in, sizeof before.in);
    for (int k = 0; k < N; k++) {
        double complex sum = 0.0;
        for (int i = 0; i < N; i++)
            sum += ((double)before.in[2 * i] + I * (double)before.in[2 * i + 1]) *
                   cexp(direction * 2.0 * M_PI * I * (k * i % N) / N);
        assert_near(b->out[2 * k], creal(sum), 1e-4);
        assert_near(b->out[2 * k + 1], cimag(sum), 1e-4);
    }
    fftwf_destroy_plan(p);
}

static void a_plan_computes_the_sum_and_keeps_its_input(void **state)
{
    check_direction(*state, FFTW_FORWARD);
    check_direction(*state, FFTW_BACKWARD);
}

/* What was measured would be known afterwards, and could differ from run to run. */
static void nothing_is_measured(void **state)
{
    struct buffers *b = *state;
    fftwf_plan p;

    fftwf_forget_wisdom();
    p = fft_plan(N, b->in, b->out, FFTW_FORWARD);
    assert_non_null(p);
    fftwf_destroy_plan(p);
    assert_null(fftwf_plan_dft_1d(N, (fftwf_complex *)b->in, (fftwf_complex *)b->out,
                                  FFTW_FORWARD,
                                  FFTW_MEASURE | FFTW_PRESERVE_INPUT | FFTW_WISDOM_ONLY));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_plan_computes_the_sum_and_keeps_its_input,
                                        setup, teardown),
        cmocka_unit_test_setup_teardown(nothing_is_measured, setup, teardown),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
