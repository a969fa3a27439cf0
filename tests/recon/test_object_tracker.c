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

/* Images until somebody is told who is imaged going at (x, z) over ground, and may rest
 * by what the phases of single images say. */
static int images_until_told(float x_m_s, float z_m_s)
{
    static float image[CELLS];
    uint64_t survey_id;
    struct object_tracker *t = begin(&survey_id);
    struct object_list list;
    struct error why;
    unsigned long long seed = 4;
    int told = INT_MAX;

    for (int k = 0; k < IMAGES && told == INT_MAX; k++) {
        int64_t now_ns = BEGIN_NS + 2 * SLOT_NS * k;
        double now_s = 2e-9 * (double)SLOT_NS * k, at_s = now_s - MIDDLE_S;
        const struct ego_motion ego = {.speed_m_s = EGO_M_S};
        struct walls walls = {.n = 1, .existence = {1.0}, .origin = {WALL_GIVEN}};
        walls.list[0].plane = (struct wall){.normal = {0.0, 0.0, 1.0},
                                            .distance_m = WALL_M - EGO_M_S * now_s};
        walls.list[0].id = 1;
        walls.list[0].gate_m[1] = WALLS_FAR_M;
        const struct volume_mover it = {
            {0.3f + x_m_s * (float)at_s, 0.0f,
             3.4f + z_m_s * (float)at_s - (float)(EGO_M_S * now_s)},
            {x_m_s, 0.0f, z_m_s},
            40.0f};
        for (int64_t ago = k ? 0 : 12; ago >= 0; ago--)
            object_tracker_ego(t, &ego, now_ns - ago * SLOT_NS);
        assert_int_equal(object_tracker_walls(t, &walls, now_ns), 0);
        for (size_t i = 0; i < CELLS; i++)
            image[i] = (float)-log(reference_random(&seed));
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
            .standing_left = true,
            .ambiguous = &it,
            .n_ambiguous = 1};
        assert_int_equal(object_tracker_volume(t, &v, &list, &why), 0);
        for (size_t i = 0; i < list.n; i++)
            if (list.objects[i].tracked)
                told = k;
    }
    object_tracker_destroy(t);
    return told;
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(who_crosses_is_told_from_what_rests_overhead),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
