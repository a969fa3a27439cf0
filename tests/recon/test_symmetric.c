/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include "recon/inverse/symmetric.h"

/* value[i] along axes[i]: sum of value u u'. */
static void compose(const double value[3], const double axes[3][3], double out[6])
{
    static const int at[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

    for (int a = 0; a < 3; a++)
        for (int b = a; b < 3; b++) {
            out[at[a][b]] = 0.0;
            for (int i = 0; i < 3; i++)
                out[at[a][b]] += value[i] * axes[i][a] * axes[i][b];
        }
}

static void expect_right_handed(const double axes[3][3])
{
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        assert_near(axes[0][j] * axes[1][k] - axes[0][k] * axes[1][j], axes[2][i], 1e-12);
        assert_near(axes[i][0] * axes[i][0] + axes[i][1] * axes[i][1] +
                        axes[i][2] * axes[i][2],
                    1.0, 1e-12);
    }
}

/* 3 cm along (cos 30, sin 30, 0), 1 cm across, 2 cm up. */
static void a_covariance_has_its_axes_the_longest_first(void **state)
{
    (void)state;
    static const double c[6] = {7e-4, 3.4641016151377546e-4, 0, 3e-4, 0, 4e-4};
    double value[3], axes[3][3];

    symmetric_axes(c, value, axes);
    assert_near(value[0], 9e-4, 1e-12);
    assert_near(value[1], 4e-4, 1e-12);
    assert_near(value[2], 1e-4, 1e-12);
    assert_near(fabs(axes[0][0] * cos(M_PI / 6.0) + axes[0][1] * sin(M_PI / 6.0)), 1.0,
                1e-12);
    assert_near(fabs(axes[1][2]), 1.0, 1e-12);
    expect_right_handed((const double(*)[3])axes);
}

static void eigenvalues_of_any_sign_and_size_come_back(void **state)
{
    (void)state;
    static const double values[4][3] = {
        {5.0, 1.0, -3.0}, {1e4, 1e-2, 1e-6}, {2.0, 2.0, 2.0}, {0.0, 0.0, -1.0}};
    const double c = cos(0.7), s = sin(0.7), k = cos(1.9), l = sin(1.9);
    const double axes[3][3] = {{c, s * k, s * l}, {-s, c * k, c * l}, {0.0, -l, k}};

    for (int q = 0; q < 4; q++) {
        double m[6], value[3], found[3][3], again[6];
        compose(values[q], axes, m);
        symmetric_axes(m, value, found);
        compose(value, (const double(*)[3])found, again);
        expect_right_handed((const double(*)[3])found);
        for (int i = 0; i < 3; i++)
            assert_near(value[i], values[q][i], 1e-12 * fabs(values[q][0]) + 1e-12);
        for (int i = 0; i < 6; i++)
            assert_near(again[i], m[i], 1e-12 * fabs(values[q][0]) + 1e-12);
    }
}

/* So that an axis that nothing couples to stays itself. */
static void what_is_not_coupled_is_not_turned(void **state)
{
    (void)state;
    static const double m[6] = {0.0, 0.0, 0.0, 2.0, 0.5, 1.0};
    double value[3], axes[3][3];

    symmetric_axes(m, value, axes);
    assert_true(value[2] == 0.0);
    assert_true(fabs(axes[2][0]) == 1.0 && axes[2][1] == 0.0 && axes[2][2] == 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_covariance_has_its_axes_the_longest_first),
        cmocka_unit_test(eigenvalues_of_any_sign_and_size_come_back),
        cmocka_unit_test(what_is_not_coupled_is_not_turned),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
