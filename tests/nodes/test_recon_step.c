/* SPDX-License-Identifier: MIT */
/* nodes/recon/recon.c, fed with what nodes/dsp makes of a simulated scene. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "msgs/convert.h"
#include "nodes/dsp/dsp.h"
#include "nodes/recon/recon.h"
#include "nodes/recon/volume_room.h"
#include "tests/nodes/near.h"
#include "tests/nodes/scene.h"

#define N_POSITIONS 6
#define N_SPEAKERS  4

struct rig {
    struct scene scene;
    struct dsp *dsp;
    struct recon *recon;
    struct dsp_output traces;
    Anlos__Receipt receipt;
    char note[128];
};

static int setup(void **state)
{
    const struct frontend_config dsp = {.window = WINDOW_HANN,
                                        .background = BACKGROUND_RECORDED};
    const struct scan_imager_config recon = {.method = "fast", .threads = 2};
    struct rig *r = calloc(1, sizeof *r);

    if (!r || scene_open(&r->scene, SOURCE_DIR "/tests/nodes/point.yaml") ||
        dsp_create(&r->dsp, NULL, &dsp) || dsp_survey(r->dsp, r->scene.survey, NULL) ||
        recon_create(&r->recon, NULL, &recon) ||
        recon_survey(r->recon, r->scene.survey, NULL))
        return -1;
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    recon_destroy(r->recon);
    dsp_destroy(r->dsp);
    scene_close(&r->scene);
    free(r);
    return 0;
}

static void make_traces_of(struct rig *r, uint64_t survey_id, uint32_t position,
                           uint32_t speaker)
{
    Anlos__Ping ping;

    for (int pass = 0; pass < 2; pass++) {
        scene_ping(&r->scene, pass ? ANLOS__PASS__SCENE : ANLOS__PASS__BACKGROUND,
                   position, speaker, &ping);
        ping.survey_id = survey_id;
        dsp_ping(r->dsp, &ping, 0, &r->traces);
    }
    assert_true(r->traces.has_traces);
}

static void make_traces(struct rig *r, uint32_t position, uint32_t speaker)
{
    make_traces_of(r, r->scene.survey->id, position, speaker);
}

static void take(struct rig *r, int64_t capture_ns)
{
    recon_traces(r->recon, &r->traces.traces, capture_ns, capture_ns + 5, &r->receipt,
                 r->note, sizeof r->note);
}

static void add(struct rig *r, uint32_t position, uint32_t speaker)
{
    make_traces(r, position, speaker);
    take(r, 1000);
    assert_true(r->receipt.usable);
}

static void add_all(struct rig *r)
{
    for (uint32_t p = 0; p < N_POSITIONS; p++)
        for (uint32_t s = 0; s < N_SPEAKERS; s++)
            add(r, p, s);
}

static void a_receipt_names_the_ping(void **state)
{
    struct rig *r = *state;

    make_traces(r, 3, 1);
    take(r, 77);
    assert_int_equal(r->receipt.scan, 1);
    assert_int_equal(r->receipt.pass, ANLOS__PASS__SCENE);
    assert_int_equal(r->receipt.position, 3);
    assert_int_equal(r->receipt.speaker, 1);
    assert_true(r->receipt.usable);
    assert_string_equal(r->note, "");
    assert_int_equal(recon_capture_ns(r->recon), 77);
    assert_int_equal(recon_taken_ns(r->recon), 82);
}

static void a_ping_taken_twice_counts_once_and_is_acknowledged_twice(void **state)
{
    struct rig *r = *state;

    add(r, 0, 0);
    add(r, 0, 0);
    assert_int_equal(recon_pings(r->recon), 1);
}

static void a_position_is_new_when_all_its_speakers_are_in(void **state)
{
    struct rig *r = *state;
    Anlos__Volume v;

    for (uint32_t s = 0; s < N_SPEAKERS; s++) {
        assert_false(recon_has_new_position(r->recon));
        add(r, 2, s);
    }
    assert_true(recon_has_new_position(r->recon));
    recon_image(r->recon, true, &v);
    assert_true(v.preview);
    assert_false(recon_has_new_position(r->recon));
}

static void the_brightest_voxel_is_the_mirrored_point(void **state)
{
    struct rig *r = *state;
    const struct room_object *object;
    struct grid grid;
    Anlos__Volume v;
    size_t best = 0;

    add_all(r);
    assert_true(recon_is_complete(r->recon));
    recon_image(r->recon, false, &v);
    const float *x = volume_grid(&v, &grid);
    assert_non_null(x);
    for (size_t i = 0; i < grid_size(&grid); i++)
        best = x[i] > x[best] ? i : best;
    size_t at[3] = {best % grid.n[0], best / grid.n[0] % grid.n[1],
                    best / grid.n[0] / grid.n[1]};
    assert_int_equal(room_objects(r->scene.room, &object), 1);
    for (int i = 0; i < 3; i++)
        assert_near(grid.origin_m[i] + (double)at[i] * grid.step_m[i],
                    object->virtual_m[i], grid.step_m[i]);
    assert_int_equal(v.pings_used, N_POSITIONS * N_SPEAKERS);
    assert_int_equal(v.pings_expected, N_POSITIONS * N_SPEAKERS);
    assert_string_equal(v.method, "fast");
    assert_int_equal(v.source, ANLOS__SOURCE__SIMULATION);
    assert_int_equal(v.microphones_masked, 0);
}

/* A preview does not look there. */
static void what_stands_beside_the_volume_comes_with_the_image(void **state)
{
    struct rig *r = *state;
    const struct room_object *object;
    struct error why = {""};
    struct volume v;
    Anlos__Volume m;
    struct survey s;

    assert_int_equal(room_objects(r->scene.room, &object), 1);
    assert_int_equal(survey_from_message(&s, r->scene.survey, &why), 0);
    s.volume_m[0][0] = object->virtual_m[0] + 0.08;
    Anlos__Survey *beside = scene_message(&s);
    assert_non_null(beside);
    assert_int_equal(recon_survey(r->recon, beside, &why), 0);
    assert_int_equal(dsp_survey(r->dsp, beside, NULL), 0);
    for (uint32_t p = 0; p < N_POSITIONS; p++)
        for (uint32_t k = 0; k < N_SPEAKERS; k++) {
            make_traces_of(r, beside->id, p, k);
            take(r, 1000);
            assert_true(r->receipt.usable);
        }
    recon_image(r->recon, true, &m);
    assert_null(m.coarse);
    recon_image(r->recon, false, &m);
    volume_from_message(&v, &m, 0);
    assert_non_null(v.around.intensity);
    bool seen = false; /* among its repetitions */
    for (size_t i = 0; i < v.around.n_spots; i++) {
        double away2 = 0.0;
        for (int a = 0; a < 3; a++)
            away2 += pow(v.around.spots[i][a] - object->virtual_m[a], 2.0);
        seen |= away2 < 0.08 * 0.08 &&
                v.around.spots[i][3] > 0.25f * v.around.spots[0][3];
    }
    assert_true(seen);
    anlos__survey__free_unpacked(beside, NULL);
    survey_clear(&s);
}

static void traces_of_another_survey_or_format_are_refused(void **state)
{
    struct rig *r = *state;

    make_traces(r, 0, 0);
    r->traces.traces.survey_id++;
    take(r, 0);
    assert_false(r->receipt.usable);
    assert_true(r->note[0]);
    make_traces(r, 0, 0);
    r->traces.traces.rate_hz *= 2;
    take(r, 0);
    assert_false(r->receipt.usable);
    make_traces(r, 0, 0);
    r->traces.traces.speaker = N_SPEAKERS;
    take(r, 0);
    assert_false(r->receipt.usable);
    make_traces(r, 0, 0);
    r->traces.traces.n_masked = 3;
    take(r, 0);
    assert_false(r->receipt.usable);
    assert_int_equal(recon_pings(r->recon), 0);
}

static void a_new_scan_begins_with_nothing(void **state)
{
    struct rig *r = *state;
    Anlos__Volume v;

    add(r, 0, 0);
    add(r, 0, 1);
    make_traces(r, 0, 0);
    r->traces.traces.clipped_samples = 7;
    r->traces.traces.masked[2] = true;
    r->traces.traces.scan = 2;
    take(r, 0);
    assert_int_equal(recon_pings(r->recon), 1);
    make_traces(r, 0, 0);
    r->traces.traces.scan = 3;
    take(r, 0);
    recon_image(r->recon, false, &v);
    assert_int_equal(v.scan, 3);
    assert_int_equal(v.clipped_samples, 0);
    assert_int_equal(v.microphones_masked, 0);
    recon_reset(r->recon);
    assert_int_equal(recon_pings(r->recon), 0);
}

static void masked_microphones_and_clipped_samples_are_summed_up(void **state)
{
    struct rig *r = *state;
    Anlos__Volume v;

    make_traces(r, 0, 0);
    r->traces.traces.masked[1] = true;
    r->traces.traces.clipped_samples = 10;
    take(r, 0);
    make_traces(r, 0, 1);
    r->traces.traces.masked[1] = true;
    r->traces.traces.masked[3] = true;
    r->traces.traces.clipped_samples = 5;
    take(r, 0);
    recon_image(r->recon, false, &v);
    assert_int_equal(v.microphones_masked, 2);
    assert_int_equal(v.clipped_samples, 15);
}

static void an_unknown_method_is_complained_about(void **state)
{
    struct rig *r = *state;
    const struct scan_imager_config cfg = {.method = "magic", .threads = 1};
    struct error why = {""};
    struct recon *recon;

    assert_int_equal(recon_create(&recon, NULL, &cfg), 0);
    assert_int_equal(recon_survey(recon, r->scene.survey, &why), -ENOENT);
    assert_non_null(strstr(why.text, "magic"));
    assert_false(recon_is_planned(recon));
    recon_destroy(recon);
}

static void a_volume_that_no_message_takes_is_complained_about(void **state)
{
    struct rig *r = *state;
    struct error why = {""};
    struct survey s;

    assert_int_equal(survey_from_message(&s, r->scene.survey, &why), 0);
    s.volume_m[0][2] = s.volume_m[1][2] = 0.0005; /* 441 x 441 x 601 voxels: 468 MB */
    s.volume_m[2][2] = 0.001;
    Anlos__Survey *large = scene_message(&s);
    assert_non_null(large);
    assert_int_equal(recon_survey(r->recon, large, &why), -EINVAL);
    if (!strstr(why.text, "116883081 voxels do not fit a message"))
        fail_msg("%s", why.text);
    anlos__survey__free_unpacked(large, NULL);
    survey_clear(&s);
}

/* 256 MB are 64 Mi voxels, with some KB beside them. */
static void what_lies_around_is_left_out_where_both_do_not_fit(void **state)
{
    (void)state;
    const float some = 1.0f;

    for (int i = 0; i < 2; i++) {
        struct volume v = {
            .grid = {.n = {1024, 1024, i ? 63 : 62}},
            .around = {.grid = {.n = {1024, 1024, 1}}, .intensity = &some}};
        volume_room_fit(&v);
        assert_true((v.around.intensity != NULL) == (i == 0));
        assert_int_equal(v.grid.n[2], i ? 63 : 62);
    }
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_receipt_names_the_ping),
        TEST(a_ping_taken_twice_counts_once_and_is_acknowledged_twice),
        TEST(a_position_is_new_when_all_its_speakers_are_in),
        TEST(the_brightest_voxel_is_the_mirrored_point),
        TEST(what_stands_beside_the_volume_comes_with_the_image),
        TEST(traces_of_another_survey_or_format_are_refused),
        TEST(a_new_scan_begins_with_nothing),
        TEST(masked_microphones_and_clipped_samples_are_summed_up),
        TEST(an_unknown_method_is_complained_about),
        TEST(a_volume_that_no_message_takes_is_complained_about),
        TEST(what_lies_around_is_left_out_where_both_do_not_fit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
