/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <limits.h>
#include <string.h>

#include "recon/tracking/object_tracker.h"
#include "tests/recon/reference.h"

#define SLOT_NS  INT64_C(24000000)
#define BEGIN_NS INT64_C(1000000000)
#define EGO_M_S  2.0
#define MIDDLE_S 0.084 /* before the newest of 8 pings */
#define WALL_M   2.0
#define GATE_M   3.5
#define IMAGES   20

enum { NX = 160, NZ = 200, CELLS = NX * NZ };

/* A bumper's array that looks ahead, on a vehicle that drives ahead. */
static struct object_tracker *begin(uint64_t *survey_id)
{
    static double speakers[2][3] = {{-0.4, 0, 0}, {0.4, 0, 0}};
    static double microphones[4][3] = {
        {-0.5, 0, 0}, {-0.2, 0, 0}, {0.2, 0, 0}, {0.5, 0, 0}};
    const struct survey s = {.speakers_m = speakers,
                             .n_speakers = 2,
                             .microphones_m = microphones,
                             .n_microphones = 4,
                             .sample_rate_hz = 48000.0,
                             .sound_speed_m_s = 343.0,
                             .slot_samples = 1152,
                             .chirp_start_hz = 2000.0,
                             .chirp_stop_hz = 20000.0,
                             .chirp_duration_s = 0.02,
                             .has_gate = true,
                             .gate_m = {0.5, GATE_M},
                             .has_mount = true,
                             .mount_origin_m = {3.6, 0.0, 0.4},
                             .mount_x_axis = {0.0, 1.0, 0.0},
                             .mount_y_axis = {0.0, 0.0, 1.0}};
    struct object_tracker_config cfg;
    struct object_tracker *t;

    object_tracker_config_default(&cfg, true);
    assert_int_equal(object_tracker_create(&t, &cfg), 0);
    assert_int_equal(object_tracker_survey(t, &s), 0);
    *survey_id = object_tracker_survey_id(t);
    return t;
}

/* Who is imaged at a place in the middle of the first image's time, and goes like this
 * over ground. */
struct walker {
    float at_m[2], velocity_m_s[2]; /* x, z */
    bool ambiguous; /* he may rest by what the phases of single images say */
    bool beside;    /* beside a bright spot of what rests, whose sidelobe he may be */
    bool taken;     /* what stands is taken from the images, and he is all that is left */
    bool straight;  /* half of the time heard straight there and back by the wall, too */
    float sure;     /* that he goes by with 1.2 m/s; 0: no course is told */
};

static double told_m_s;  /* how fast, of who was told last */
static size_t told_most; /* how many at once, of all images of one who is seen straight */

/* A spot of noise's level times power. */
static void add_spot(float *image, double x_m, double z_m, float power)
{
    for (int z = -2; z <= 2; z++)
        for (int x = -2; x <= 2; x++) {
            int ix = (int)lround((x_m + 1.6) / 0.02) + x;
            int iz = (int)lround((z_m - 0.5) / 0.02) + z;
            if (ix >= 0 && ix < NX && iz >= 0 && iz < NZ)
                image[iz * NX + ix] += power * (float)exp(-0.5 * (x * x + z * z));
        }
}

/* 3 dB louder.  The array is in the middle of the image's frame. */
static void add_straight(float *image, double x_m, double z_m)
{
    double straight_m = hypot(x_m, 2.0 * WALL_M - z_m), image_m = hypot(x_m, z_m);
    double part = 0.5 + 0.5 * straight_m / image_m;

    add_spot(image, part * x_m, part * z_m, 12000.0f);
}

/* Images until somebody is told, of a vehicle at ego_m_s; walls end at gate_m. */
static int images_until(const struct walker *w, double ego_m_s, double gate_m)
{
    static float image[CELLS];
    uint64_t survey_id;
    struct object_tracker *t = begin(&survey_id);
    struct object_list list;
    struct error why;
    unsigned long long seed = 4;
    int told = INT_MAX;

    told_most = 0;
    for (int k = 0; k < IMAGES && (told == INT_MAX || w->straight); k++) {
        int64_t now_ns = BEGIN_NS + 2 * SLOT_NS * k;
        double now_s = 2e-9 * (double)SLOT_NS * k, at_s = now_s - MIDDLE_S;
        const struct ego_motion ego = {.speed_m_s = ego_m_s};
        struct walls walls = {.n = 1, .existence = {1.0}, .origin = {WALL_GIVEN}};
        walls.list[0].plane = (struct wall){.normal = {0.0, 0.0, 1.0},
                                            .distance_m = WALL_M - ego_m_s * now_s};
        walls.list[0].id = 1;
        walls.list[0].gate_m[1] = gate_m;
        const struct volume_mover it = {
            {w->at_m[0] + w->velocity_m_s[0] * (float)at_s, 0.0f,
             w->at_m[1] + w->velocity_m_s[1] * (float)at_s - (float)(ego_m_s * now_s)},
            {w->velocity_m_s[0], 0.0f, w->velocity_m_s[1]},
            40.0f};
        for (int64_t ago = k ? 0 : 12; ago >= 0; ago--)
            object_tracker_ego(t, &ego, now_ns - ago * SLOT_NS);
        assert_int_equal(object_tracker_walls(t, &walls, now_ns), 0);
        for (size_t i = 0; i < CELLS; i++)
            image[i] = (float)-log(reference_random(&seed));
        if (w->beside) {
            add_spot(image, (double)it.at_m[0], (double)it.at_m[2], 60.0f);
            add_spot(image, (double)w->at_m[0] + 1.0,
                     (double)w->at_m[1] - ego_m_s * now_s, 6000.0f);
        }
        if (w->taken)
            add_spot(image, (double)it.at_m[0], (double)it.at_m[2], 6000.0f);
        if (w->straight && k >= IMAGES / 2)
            add_straight(image, (double)it.at_m[0], (double)it.at_m[2]);
        const struct volume_course by = {
            {{it.at_m[0], it.at_m[1], it.at_m[2]}, {1.2f, 0.0f, 0.0f}, 40.0f}, w->sure};
        const struct volume v = {
            .survey_id = survey_id,
            .capture_ns = now_ns,
            .frame = (uint32_t)k + 1,
            .grid = {{-1.6, 0, 0.5}, {0.02, 0.02, 0.02}, {NX, 1, NZ}},
            .intensity = image,
            .method = "frames",
            .sound_speed_m_s = 343.0,
            .pings_used = 8,
            .pings_expected = 8,
            .standing_left = !w->taken,
            .standing_taken = w->taken,
            .movers = &it,
            .n_movers = !w->ambiguous && !w->taken,
            .ambiguous = &it,
            .n_ambiguous = w->ambiguous,
            .courses = &by,
            .n_courses = w->sure > 0.0f};
        assert_int_equal(object_tracker_volume(t, &v, &list, &why), 0);
        told_most = list.n > told_most ? list.n : told_most;
        for (size_t i = 0; i < list.n; i++)
            if (list.objects[i].tracked && told == INT_MAX) {
                const double *v_m_s = list.objects[i].velocity_m_s;
                told = k;
                told_m_s = hypot(v_m_s[0], v_m_s[1]);
            }
    }
    object_tracker_destroy(t);
    return told;
}

static int images_until_told(float x_m_s, float z_m_s)
{
    const struct walker w = {
        .at_m = {0.3f, 3.4f}, .velocity_m_s = {x_m_s, z_m_s}, .ambiguous = true};

    return images_until(&w, EGO_M_S, WALLS_FAR_M);
}

/* From a vehicle that drives ahead, what rests overhead is imaged going ahead, too, 0 to
 * 2 times as fast. */
static void who_crosses_is_told_from_what_rests_overhead(void **state)
{
    (void)state;
    assert_in_range(images_until_told(-1.4f, 0.0f), 4, 12);
    assert_in_range(images_until_told(0.0f, -1.4f), 4, 12);
    assert_int_equal(images_until_told(0.0f, 1.4f), INT_MAX);
}

static int images_until_told_at(float z_m)
{
    const struct walker w = {.at_m = {0.3f, z_m}, .velocity_m_s = {1.2f, 0.0f}};

    return images_until(&w, 0.0, GATE_M);
}

/* The array is in the middle of the image's frame, and he is 0.3 m aside. */
static void who_comes_is_told_from_a_step_beyond_the_gate_on(void **state)
{
    (void)state;
    assert_in_range(images_until_told_at((float)GATE_M - 0.2f), 1, 3);
    assert_in_range(images_until_told_at((float)GATE_M + 0.2f), 1, 3);
    assert_int_equal(images_until_told_at((float)GATE_M + 0.75f), INT_MAX);
    const struct walker w = {.at_m = {0.3f, (float)GATE_M + 0.2f},
                             .velocity_m_s = {1.2f, 0.0f}};
    /* another wall's gate ends there */
    assert_int_equal(images_until(&w, 0.0, GATE_M - 0.1), INT_MAX);
}

/* It may be a sidelobe of who is beside the image. */
static void what_a_background_leaves_beyond_the_gate_has_to_move(void **state)
{
    (void)state;
    struct walker w = {.at_m = {0.3f, (float)GATE_M - 0.2f}, .taken = true};
    assert_in_range(images_until(&w, 0.0, GATE_M), 1, 12);
    w.at_m[1] = (float)GATE_M + 0.2f;
    assert_int_equal(images_until(&w, 0.0, GATE_M), INT_MAX);
    w.velocity_m_s[0] = 1.2f;
    w.at_m[0] = -0.6f;
    assert_in_range(images_until(&w, 0.0, GATE_M), 1, 18);
}

static void who_goes_a_way_of_his_own_is_no_sidelobe_of_what_rests(void **state)
{
    (void)state;
    struct walker w = {
        .at_m = {-0.5f, 3.0f}, .velocity_m_s = {1.2f, 0.0f}, .beside = true};

    assert_in_range(images_until(&w, 0.0, GATE_M), 1, 3);
    w.ambiguous = true;
    assert_int_equal(images_until(&w, 0.0, GATE_M), INT_MAX);
}

/* He stands, and a course of 1.2 m/s is told of him. */
static void a_course_counts_as_much_as_it_is_sure(void **state)
{
    (void)state;
    struct walker w = {.at_m = {0.3f, (float)GATE_M - 0.2f}, .taken = true};

    w.sure = 1.0f;
    assert_in_range(images_until(&w, 0.0, GATE_M), 1, 12);
    double sure_m_s = told_m_s;
    w.sure = 0.02f;
    assert_in_range(images_until(&w, 0.0, GATE_M), 1, 12);
    assert_true(sure_m_s > 0.4); /* between that and his places */
    assert_true(told_m_s < 0.5 * sure_m_s);
}

/* At (-1.38, 0.8) and imaged at (-1.38, 3.2) by then: heard so at (-1.01, 2.33), too. */
static void who_is_seen_straight_is_told_once(void **state)
{
    (void)state;
    const struct walker w = {.at_m = {-1.5f, 3.2f},
                             .velocity_m_s = {0.25f, 0.0f},
                             .taken = true,
                             .straight = true};

    assert_in_range(images_until(&w, 0.0, GATE_M), 1, 12);
    assert_int_equal(told_most, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(who_crosses_is_told_from_what_rests_overhead),
        cmocka_unit_test(who_comes_is_told_from_a_step_beyond_the_gate_on),
        cmocka_unit_test(what_a_background_leaves_beyond_the_gate_has_to_move),
        cmocka_unit_test(who_goes_a_way_of_his_own_is_no_sidelobe_of_what_rests),
        cmocka_unit_test(a_course_counts_as_much_as_it_is_sure),
        cmocka_unit_test(who_is_seen_straight_is_told_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
