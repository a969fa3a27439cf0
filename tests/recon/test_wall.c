#include "tests/recon/near.h"

#include "recon/wall.h"
#include "tests/recon/reference.h"

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void tilt(struct wall *w, unsigned long long *seed)
{
    double length2 = 0.0;
    for (int a = 0; a < 3; a++) {
        w->normal[a] = 2.0 * reference_random(seed) - 1.0;
        length2 += w->normal[a] * w->normal[a];
    }
    for (int a = 0; a < 3; a++)
        w->normal[a] /= sqrt(length2);
    w->distance_m = 4.0 * reference_random(seed) - 2.0;
}

static void scatter(double p[3], unsigned long long *seed)
{
    for (int a = 0; a < 3; a++)
        p[a] = 6.0 * reference_random(seed) - 3.0;
}

static void a_point_behind_an_upright_wall_comes_out_in_front_of_it(void **state)
{
    (void)state;
    const struct wall w = {{0.0, 0.0, 1.0}, 2.0};
    const double p[3] = {1.0, 2.0, 5.0};
    double q[3];
    wall_mirror(&w, p, q);
    assert_near(q[0], 1.0, 1e-15);
    assert_near(q[1], 2.0, 1e-15);
    assert_near(q[2], -1.0, 1e-15);
}

static void the_wall_stands_halfway_and_square_to_the_way(void **state)
{
    (void)state;
    unsigned long long seed = 1;
    for (int n = 0; n < 20; n++) {
        struct wall w;
        double p[3], q[3], middle[3], way[3];
        tilt(&w, &seed);
        scatter(p, &seed);
        wall_mirror(&w, p, q);
        for (int a = 0; a < 3; a++) {
            middle[a] = 0.5 * (p[a] + q[a]);
            way[a] = q[a] - p[a];
        }
        assert_near(dot(w.normal, middle), w.distance_m, 1e-12);
        assert_near(fabs(dot(w.normal, way)), sqrt(dot(way, way)), 1e-12);
    }
}

static void mirrored_twice_is_back(void **state)
{
    (void)state;
    unsigned long long seed = 2;
    for (int n = 0; n < 20; n++) {
        struct wall w;
        double p[3], q[3], back[3];
        tilt(&w, &seed);
        scatter(p, &seed);
        wall_mirror(&w, p, q);
        wall_mirror(&w, q, back);
        for (int a = 0; a < 3; a++)
            assert_near(back[a], p[a], 1e-12);
    }
}

static void distances_stay(void **state)
{
    (void)state;
    unsigned long long seed = 3;
    for (int n = 0; n < 20; n++) {
        struct wall w;
        double p[3], q[3], p1[3], q1[3];
        tilt(&w, &seed);
        scatter(p, &seed);
        scatter(q, &seed);
        wall_mirror(&w, p, p1);
        wall_mirror(&w, q, q1);
        assert_near(reference_distance(p1, q1), reference_distance(p, q), 1e-12);
    }
}

static void a_point_on_the_wall_stays(void **state)
{
    (void)state;
    const struct wall w = {{0.0, 0.6, 0.8}, 1.0};
    const double p[3] = {-3.0, 1.0, 0.5}; /* 0.6 + 0.4 = 1 */
    double q[3];
    wall_mirror(&w, p, q);
    for (int a = 0; a < 3; a++)
        assert_near(q[a], p[a], 1e-15);
}

/* H C H' with H = 1 - 2 n n', written out. */
static void rotate(const struct wall *w, const double c[6], double out[3][3])
{
    const double full[3][3] = {
        {c[0], c[1], c[2]}, {c[1], c[3], c[4]}, {c[2], c[4], c[5]}};
    double h[3][3];
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            h[a][b] = (a == b ? 1.0 : 0.0) - 2.0 * w->normal[a] * w->normal[b];
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b < 3; b++) {
            out[a][b] = 0.0;
            for (int q = 0; q < 9; q++)
                out[a][b] += h[a][q / 3] * full[q / 3][q % 3] * h[b][q % 3];
        }
    }
}

static const double covariance[6] = {4e-4, 1e-4, -2e-4, 9e-4, 5e-5, 1e-3};

static void a_covariance_turns_with_its_point(void **state)
{
    (void)state;
    unsigned long long seed = 4;
    for (int n = 0; n < 20; n++) {
        struct wall w;
        double out[6], expected[3][3];
        tilt(&w, &seed);
        wall_mirror_covariance(&w, covariance, out);
        rotate(&w, covariance, expected);
        for (int a = 0, q = 0; a < 3; a++)
            for (int b = a; b < 3; b++, q++)
                assert_near(out[q], expected[a][b], 1e-15);
        assert_near(out[0] + out[3] + out[5], 2.3e-3, 1e-15); /* the trace */
    }
}

static void a_wall_across_x_turns_the_signs_of_xy_and_xz(void **state)
{
    (void)state;
    const struct wall w = {{-1.0, 0.0, 0.0}, 0.7};
    const double expected[6] = {4e-4, -1e-4, 2e-4, 9e-4, 5e-5, 1e-3};
    double out[6];
    wall_mirror_covariance(&w, covariance, out);
    for (int q = 0; q < 6; q++)
        assert_near(out[q], expected[q], 1e-18);
}

/* The covariance of mirrored sample points is the mirrored covariance of the points. */
static void points_and_covariance_agree(void **state)
{
    (void)state;
    unsigned long long seed = 5;
    struct wall w;
    tilt(&w, &seed);
    const double spread[4][3] = {
        {0.03, 0.01, 0.0}, {-0.02, 0.02, 0.01}, {0.0, -0.04, 0.02}, {-0.01, 0.01, -0.03}};
    const double centre[3] = {0.4, -0.2, 1.5};
    double before[6] = {0}, after[6] = {0}, mirrored[6], at[3];
    wall_mirror(&w, centre, at);
    for (int p = 0; p < 4; p++) {
        double point[3], image[3];
        for (int a = 0; a < 3; a++)
            point[a] = centre[a] + spread[p][a];
        wall_mirror(&w, point, image);
        for (int a = 0, q = 0; a < 3; a++) {
            for (int b = a; b < 3; b++, q++) {
                before[q] += spread[p][a] * spread[p][b];
                after[q] += (image[a] - at[a]) * (image[b] - at[b]);
            }
        }
    }
    wall_mirror_covariance(&w, before, mirrored);
    for (int q = 0; q < 6; q++)
        assert_near(mirrored[q], after[q], 1e-14);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_behind_an_upright_wall_comes_out_in_front_of_it),
        cmocka_unit_test(the_wall_stands_halfway_and_square_to_the_way),
        cmocka_unit_test(mirrored_twice_is_back),
        cmocka_unit_test(distances_stay),
        cmocka_unit_test(a_point_on_the_wall_stays),
        cmocka_unit_test(a_covariance_turns_with_its_point),
        cmocka_unit_test(a_wall_across_x_turns_the_signs_of_xy_and_xz),
        cmocka_unit_test(points_and_covariance_agree),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
