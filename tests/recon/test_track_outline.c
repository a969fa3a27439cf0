#include "tests/recon/near.h"

#include "recon/track_state.h"

#define YAW_RAD 0.5 /* of the vehicle over ground */

/* Heard at one place, across the vehicle's way to the left: over ground that is turned.
 */
static void start(struct track *k, double speed_m_s, double length_m)
{
    *k = (struct track){.extent_m = {0.2, length_m, 1.0}};
    k->filter.state[2] = -speed_m_s * sin(YAW_RAD);
    k->filter.state[3] = speed_m_s * cos(YAW_RAD);
    k->filter.covariance[2][2] = k->filter.covariance[3][3] = 0.25;
}

/* How far behind the place where it is heard its middle is. */
static double behind_m(const struct track *k)
{
    double u[2], in[2];

    track_outline_heading(&k->filter, u);
    track_outline_turn_in(u, k->outline.middle_m, in);
    assert_near(in[1], 0.0, 1e-12);
    return -in[0];
}

static void what_comes_out_fast_is_behind_its_front(void **state)
{
    struct track k;
    double size_m[2];

    (void)state;
    start(&k, 3.0, 0.3);
    track_outline_update(&k, YAW_RAD);
    assert_near(behind_m(&k), 0.5 * (1.0 - 0.3), 1e-12);
    track_outline_size(&k, YAW_RAD, size_m);
    assert_near(size_m[0], 0.2, 1e-12);
    assert_near(size_m[1], 1.0, 1e-12);
}

static void what_was_heard_whole_is_where_it_is_heard(void **state)
{
    struct track k;

    (void)state;
    start(&k, 3.0, 1.4);
    track_outline_update(&k, YAW_RAD);
    assert_near(behind_m(&k), 0.0, 1e-12);
    k.extent_m[1] = 0.3;
    track_outline_update(&k, YAW_RAD);
    assert_near(behind_m(&k), 0.0, 1e-12);
}

/* A walker, and what may be one: its velocity is not known to a metre a second. */
static void what_walks_is_where_it_is_heard(void **state)
{
    struct track k;
    double size_m[2];

    (void)state;
    start(&k, 1.5, 0.3);
    track_outline_update(&k, YAW_RAD);
    assert_near(behind_m(&k), 0.0, 1e-12);
    track_outline_size(&k, YAW_RAD, size_m);
    assert_near(size_m[1], 0.0, 1e-12);
    start(&k, 3.0, 0.3);
    k.filter.covariance[2][2] = k.filter.covariance[3][3] = 1.1;
    track_outline_update(&k, YAW_RAD);
    assert_near(behind_m(&k), 0.0, 1e-12);
}

/* Parts along 3 m, heard from the right of their way: 0.4 times 3 m wide, to the left. */
static void the_far_side_of_a_car_is_where_no_sound_comes_from(void **state)
{
    struct track k;
    double in[2], size_m[2];

    (void)state;
    start(&k, 4.0, 0.3);
    const double u[2] = {-sin(YAW_RAD), cos(YAW_RAD)}, left[2] = {-u[1], u[0]};
    k.body.n = 2;
    for (int i = 0; i < 2; i++) {
        k.body.parts[i].looks = 1.0;
        for (int a = 0; a < 2; a++)
            k.body.parts[i].offset_m[a] = i ? 3.0 * u[a] : 0.0;
    }
    for (int a = 0; a < 2; a++)
        k.body.sight[a] = left[a];
    for (int n = 0; n < 100; n++)
        track_outline_update(&k, YAW_RAD);
    track_outline_turn_in(u, k.outline.middle_m, in);
    assert_near(in[0], 1.5, 1e-9);
    assert_near(in[1], 0.6, 1e-9);
    track_outline_size(&k, YAW_RAD, size_m);
    assert_near(size_m[0], 1.2, 1e-9);
    assert_near(size_m[1], 3.0, 1e-9);
}

/* The length that is not heard is anywhere, as evenly as can be: its square over 12; and
 * a twentieth of the size. */
static void the_length_that_is_not_heard_is_uncertain(void **state)
{
    double c[2][2] = {{0.01, 0.0}, {0.0, 0.01}};
    struct track k;

    (void)state;
    start(&k, 3.0, 0.4);
    track_outline_update(&k, YAW_RAD);
    track_outline_uncertain(&k, c);
    double along_m2 = 0.01 + 0.6 * 0.6 / 12.0 + 0.05 * 0.05;
    double across_m2 = 0.01 + 0.05 * 0.2 * 0.05 * 0.2;
    double cs = cos(YAW_RAD), sn = sin(YAW_RAD);
    assert_near(c[0][0], along_m2 * sn * sn + across_m2 * cs * cs, 1e-12);
    assert_near(c[1][1], along_m2 * cs * cs + across_m2 * sn * sn, 1e-12);
    assert_near(c[0][1], (across_m2 - along_m2) * sn * cs, 1e-12);
    assert_near(c[1][0], c[0][1], 1e-15);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_comes_out_fast_is_behind_its_front),
        cmocka_unit_test(what_was_heard_whole_is_where_it_is_heard),
        cmocka_unit_test(what_walks_is_where_it_is_heard),
        cmocka_unit_test(the_far_side_of_a_car_is_where_no_sound_comes_from),
        cmocka_unit_test(the_length_that_is_not_heard_is_uncertain),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
