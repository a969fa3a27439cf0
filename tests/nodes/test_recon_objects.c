/* SPDX-License-Identifier: MIT */
/* The table of objects that `anlos recon` prints. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "command.h"
#include "msgs/detections.pb-c.h"
#include "nodes/anlos/recon/report.h"

static double variance_m2[6]; /* xx xy xz yy yz zz, of the one object */
static bool in_vehicle_frame, height_assumed;

static int print_one(int argc, char **argv)
{
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    Anlos__Detection d = ANLOS__DETECTION__INIT, *all[] = {&d};
    Anlos__Vec3 at = ANLOS__VEC3__INIT;

    (void)argc;
    (void)argv;
    at.x = 4.0;
    d.id = 1;
    d.position_m = &at;
    d.covariance_m2 = variance_m2;
    d.n_covariance_m2 = 6;
    d.height_assumed = height_assumed;
    list.detections = all;
    list.n_detections = 1;
    list.in_vehicle_frame = in_vehicle_frame;
    list.mirrored = true;
    recon_report_print_objects(&list, false, false);
    return 0;
}

static const char *printed(struct command_result *r, const double sigma_m[3])
{
    char *const words[] = {(char *)"recon", NULL};
    static const int diagonal[3] = {0, 3, 5};

    for (int a = 0; a < 3; a++)
        variance_m2[diagonal[a]] = sigma_m[a] * sigma_m[a];
    command_run(r, print_one, words);
    assert_int_equal(r->code, 0);
    return r->out;
}

/* Half a metre is assumed of a height that is not heard: no measure of what is. */
static void a_plane_image_tells_the_sigma_of_what_it_hears(void **state)
{
    static const double in_vehicle[3] = {0.02, 0.034, 0.5},
                        in_array[3] = {0.02, 0.5, 0.034};
    struct command_result r;

    (void)state;
    height_assumed = true;
    in_vehicle_frame = true;
    assert_non_null(strstr(printed(&r, in_vehicle), " 3.4 "));
    assert_null(strstr(r.out, "50.0"));
    assert_non_null(strstr(r.out, "heights: they are assumed"));
    in_vehicle_frame = false;
    assert_non_null(strstr(printed(&r, in_array), " 3.4 "));
    assert_null(strstr(r.out, "50.0"));
}

static void a_height_that_is_heard_counts(void **state)
{
    static const double sigma_m[3] = {0.02, 0.034, 0.5};
    struct command_result r;

    (void)state;
    height_assumed = false;
    in_vehicle_frame = true;
    assert_non_null(strstr(printed(&r, sigma_m), " 50.0 "));
    assert_null(strstr(r.out, "assumed"));
}

static void an_axis_that_the_image_does_not_tell_is_unknown(void **state)
{
    static const double one[3] = {0.02, 20.0, 0.01}, none[3] = {20.0, 20.0, 20.0};
    struct command_result r;

    (void)state;
    height_assumed = false;
    in_vehicle_frame = true;
    assert_non_null(strstr(printed(&r, one), " 2.0 "));
    assert_non_null(strstr(printed(&r, none), " unknown "));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_plane_image_tells_the_sigma_of_what_it_hears),
        cmocka_unit_test(a_height_that_is_heard_counts),
        cmocka_unit_test(an_axis_that_the_image_does_not_tell_is_unknown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
