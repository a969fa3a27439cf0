/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/drift.h"
#include "tests/dsp/near.h"

#define N           700
#define MAX_STRETCH 0.005

static const struct trace_format format = {
    .t0_s = 0.004, .rate_hz = 36000.0, .carrier_hz = 11000.0, .n_samples = N};

/* A Gaussian echo at a delay that is stretched, as the real and imaginary part of a
 * baseband trace. */
static void add_echo(float *re, float *im, double tau_s)
{
    for (size_t n = 0; n < N; n++) {
        double past_s = format.t0_s + (double)n / format.rate_hz - tau_s;
        double a = exp(-0.5 * past_s * past_s / (4e-5 * 4e-5));
        double phase = -2.0 * M_PI * format.carrier_hz * tau_s;
        re[n] += (float)(a * cos(phase));
        im[n] += (float)(a * sin(phase));
    }
}

/* The late echo alone fits at several stretches as well as at the right one, each a turn
 * of the carrier apart; the early one has turned less. */
static void the_grid_point_next_to_the_stretch_is_found(void **state)
{
    static const double stretches[] = {0.0, 3e-3, -4.2e-3, 1e-3};
    const double last_s = format.t0_s + N / format.rate_hz;
    struct interpolator *ip;
    struct drift_search *ds;

    (void)state;
    assert_int_equal(interpolator_create(&ip, 0.5), 0);
    assert_int_equal(drift_search_create(&ds, &format, 20000.0, MAX_STRETCH, ip), 0);
    size_t padding = drift_search_padding(ds), stride = N + 2 * padding;
    for (size_t i = 0; i < sizeof(stretches) / sizeof(*stretches); i++) {
        float *x = calloc(4 * stride, sizeof(*x));
        assert_non_null(x);
        const struct drift_planes planes = {.n_channels = 1,
                                            .stride = stride,
                                            .background_re = x + padding,
                                            .background_im = x + stride + padding,
                                            .scene_re = x + 2 * stride + padding,
                                            .scene_im = x + 3 * stride + padding};
        for (int k = 0; k < 3; k++) {
            double tau_s = 0.0061 + 0.0078 * k;
            add_echo(planes.background_re, planes.background_im, tau_s);
            add_echo(planes.scene_re, planes.scene_im, tau_s * (1.0 + stretches[i]));
        }
        assert_near(drift_search_best(ds, &planes), stretches[i],
                    1.0 / (8.0 * 20000.0 * last_s));
        free(x);
    }
    drift_search_destroy(ds);
    interpolator_destroy(ip);
}

static void formats_without_sense_are_refused(void **state)
{
    struct trace_format f = format;
    struct drift_search *ds = NULL;
    struct interpolator *ip;

    (void)state;
    assert_int_equal(interpolator_create(&ip, 0.5), 0);
    assert_int_equal(drift_search_create(&ds, &f, 0.0, MAX_STRETCH, ip), -EINVAL);
    f.t0_s = 1e9;
    assert_int_equal(drift_search_create(&ds, &f, 20000.0, MAX_STRETCH, ip), -EINVAL);
    assert_null(ds);
    drift_search_destroy(NULL);
    interpolator_destroy(ip);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_grid_point_next_to_the_stretch_is_found),
        cmocka_unit_test(formats_without_sense_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
