/* SPDX-License-Identifier: MIT */
/* Recordings of any loudness, down to denormal numbers, for every method: the image only
 * scales, by the square of the gain. */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "tests/recon/hard.h"

static struct hard hard; /* as recorded */
static struct hard other;
static double gain;

static size_t n_samples(void)
{
    return hard_pings(&hard) * hard.rig.geometry.n_microphones *
           hard.rig.format.n_samples;
}

static int record(void **state)
{
    (void)state;
    hard_create(&hard, 343.0, 10, 8, 8);
    hard_create(&other, 343.0, 10, 8, 8);
    return 0;
}

static int forget(void **state)
{
    (void)state;
    hard_clear(&hard);
    hard_clear(&other);
    return 0;
}

/* Largest difference over the maximum. */
static void expect_same(const char *method, const float *image, const float *expected,
                        double scale, double tolerance)
{
    double worst = 0.0, largest = 0.0;
    for (size_t v = 0; v < grid_size(&hard.rig.grid); v++) {
        double error = fabs(image[v] / scale - expected[v]);
        worst = error >= worst ? error : worst;
        if (isnan(error))
            fail_msg("%s: voxel %zu is %g", method, v, image[v]);
        largest = fmax(largest, expected[v]);
    }
    if (!(worst <= tolerance * largest))
        fail_msg("%s: off by %.2g of the maximum", method, worst / largest);
}

/* Most differ by 1e-6; those that stop by a rule of their own, by 1e-4. */
static void expect_scaled(const char *method)
{
    float *plain = hard_image(&hard, method, NULL);
    float *scaled = hard_image(&other, method, NULL);
    expect_same(method, scaled, plain, gain * gain, 1e-4);
    hard_expect_point(&other, method, scaled);
    free(plain);
    free(scaled);
}

static void gains_of_twelve_decades_up_and_down_only_scale(void **state)
{
    (void)state;
    static const double gains[4] = {1e-12, 0.03, -30.0, 1e12};
    for (int q = 0; q < 4; q++) {
        gain = gains[q];
        for (size_t n = 0; n < n_samples(); n++)
            other.traces[n] = (float)gain * hard.traces[n];
        hard_every_method(expect_scaled);
    }
}

/* The squares of such numbers are none: the image is dark, or as dim as they are. */
static void expect_dim(const char *method)
{
    float *image = hard_image(&other, method, NULL);
    for (size_t v = 0; v < grid_size(&other.rig.grid); v++)
        if (!(image[v] >= 0.0f && image[v] <= 1e-30f))
            fail_msg("%s: voxel %zu is %g", method, v, image[v]);
    free(image);
}

static void a_recording_of_denormal_numbers_is_dim(void **state)
{
    (void)state;
    for (size_t n = 0; n < n_samples(); n++)
        other.traces[n] = 1e-40f * hard.traces[n];
    hard_every_method(expect_dim);
}

static void expect_as_without(const char *method)
{
    float *zeros = hard_image(&hard, method, NULL);
    float *denormals = hard_image(&other, method, NULL);
    expect_same(method, denormals, zeros, 1.0, 1e-6);
    free(zeros);
    free(denormals);
}

/* What is 40 dB below the echo is made denormal in one recording, 0 in the other. */
static void denormal_numbers_are_as_good_as_zeros(void **state)
{
    (void)state;
    for (size_t n = 0; n < n_samples(); n++) {
        bool quiet = cabsf(hard.traces[n]) < 1e-2f;
        other.traces[n] = quiet ? 1e-38f * hard.traces[n] : hard.traces[n];
        hard.traces[n] = quiet ? 0.0f : hard.traces[n];
    }
    hard_every_method(expect_as_without);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gains_of_twelve_decades_up_and_down_only_scale),
        cmocka_unit_test(a_recording_of_denormal_numbers_is_dim),
        cmocka_unit_test(denormal_numbers_are_as_good_as_zeros), /* changes hard: last */
    };
    return cmocka_run_group_tests(tests, record, forget);
}
