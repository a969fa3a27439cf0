/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <stdlib.h>

#include "recon/power/shares.h"

static const double in_edges[5] = {0.0, 1.0, 2.5, 3.0, 5.0};
static const double out_edges[7] = {0.5, 0.75, 2.0, 2.0, 4.0, 6.0, 7.0};
static const double in_gain[4] = {1.0, 2.0, 1.0, 0.5}, out_gain[6] = {1, 1, 1, 3, 1, 1};

/* Lengths of the overlaps, by hand, times gains. */
static const double expected[6][4] = {
    {0.25, 0, 0, 0},    {0.25, 2.0, 0, 0}, {0, 0, 0, 0},
    {0, 3.0, 1.5, 1.5}, {0, 0, 0, 0.5},    {0, 0, 0, 0},
};

static void entries(const struct shares *s, double *out)
{
    for (size_t i = 0; i < s->n_in; i++) {
        float x[6] = {0}, y[6];
        x[i] = 1.0f;
        shares_apply(s, x, 1, 1, y, 1);
        for (size_t o = 0; o < s->n_out; o++)
            out[o * s->n_in + i] = y[o];
    }
}

static void weights_are_what_intervals_share(void **state)
{
    (void)state;
    struct shares *s = NULL;
    double found[24];
    assert_int_equal(shares_create(&s, out_edges, 6, in_edges, 4, out_gain, in_gain), 0);
    entries(s, found);
    for (size_t q = 0; q < 24; q++)
        assert_near(found[q], expected[q / 4][q % 4], 1e-7);
    shares_destroy(s);
}

static void the_transpose_is_the_transpose(void **state)
{
    (void)state;
    struct shares *s = NULL, *t = NULL;
    double found[24];
    assert_int_equal(shares_create(&s, out_edges, 6, in_edges, 4, out_gain, in_gain), 0);
    assert_int_equal(shares_transpose(&t, s), 0);
    assert_int_equal(t->n_out, 4);
    assert_int_equal(t->n_in, 6);
    entries(t, found);
    for (size_t q = 0; q < 24; q++)
        assert_near(found[q], expected[q % 6][q / 6], 1e-7);
    shares_destroy(s);
    shares_destroy(t);
    shares_destroy(NULL);
}

static void vectors_side_by_side_do_not_mix(void **state)
{
    (void)state;
    enum { WIDTH = 37, STRIDE = 41 };
    struct shares *s = NULL;
    float x[4 * STRIDE], y[6 * STRIDE] = {0};
    assert_int_equal(shares_create(&s, out_edges, 6, in_edges, 4, out_gain, in_gain), 0);
    for (size_t i = 0; i < 4 * STRIDE; i++)
        x[i] = (float)(i % 11) - 4.0f;
    shares_apply(s, x, STRIDE, WIDTH, y, STRIDE);
    for (size_t o = 0; o < 6; o++) {
        for (size_t a = 0; a < STRIDE; a++) {
            double sum = 0.0;
            for (size_t i = 0; i < 4 && a < WIDTH; i++)
                sum += expected[o][i] * x[i * STRIDE + a];
            assert_near(y[o * STRIDE + a], sum, 1e-5);
        }
    }
    shares_destroy(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(weights_are_what_intervals_share),
        cmocka_unit_test(the_transpose_is_the_transpose),
        cmocka_unit_test(vectors_side_by_side_do_not_mix),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
