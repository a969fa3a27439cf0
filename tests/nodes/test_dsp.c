/* SPDX-License-Identifier: MIT */
#include <complex.h>
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "nodes/dsp/dsp.h"
#include "tests/nodes/near.h"
#include "tests/nodes/scene.h"

#define SCENE      ANLOS__PASS__SCENE
#define BACKGROUND ANLOS__PASS__BACKGROUND

struct rig {
    struct scene scene;
    struct dsp *dsp;
    Anlos__Ping ping;
    struct dsp_output out;
};

static int open_rig(void **state, const char *scene, bool background)
{
    const struct frontend_config cfg = {.window = WINDOW_HANN,
                                        .background = background ? BACKGROUND_RECORDED
                                                                 : BACKGROUND_NONE};
    struct rig *r = calloc(1, sizeof *r);

    if (!r || scene_open(&r->scene, scene) || dsp_create(&r->dsp, NULL, &cfg) ||
        dsp_survey(r->dsp, r->scene.survey, NULL))
        return -1;
    *state = r;
    return 0;
}

static int setup(void **state)
{
    return open_rig(state, SOURCE_DIR "/tests/nodes/point.yaml", true);
}

static int setup_changed_air(void **state)
{
    return open_rig(state, SOURCE_DIR "/tests/nodes/air.yaml", true);
}

static int setup_without_background(void **state)
{
    return open_rig(state, SOURCE_DIR "/tests/nodes/point.yaml", false);
}

static int teardown(void **state)
{
    struct rig *r = *state;

    dsp_destroy(r->dsp);
    scene_close(&r->scene);
    free(r);
    return 0;
}

static void send_ping(struct rig *r, Anlos__Pass pass, uint32_t position,
                      uint32_t speaker)
{
    scene_ping(&r->scene, pass, position, speaker, &r->ping);
    dsp_ping(r->dsp, &r->ping, 0, &r->out);
}

static void assert_receipt(const struct rig *r, Anlos__Pass pass, bool usable)
{
    assert_true(r->out.has_receipt);
    assert_false(r->out.has_traces);
    assert_int_equal(r->out.receipt.scan, r->ping.scan);
    assert_int_equal(r->out.receipt.pass, pass);
    assert_int_equal(r->out.receipt.position, r->ping.position);
    assert_int_equal(r->out.receipt.speaker, r->ping.speaker);
    assert_int_equal(r->out.receipt.usable, usable);
}

/* Largest magnitude of a microphone's trace; *at is its sample. */
static double peak(const Anlos__Traces *t, size_t mic, size_t *at)
{
    size_t extents[2];
    double best = 0.0;
    const float complex *y = tensor_c64(t->samples, 2, extents);

    assert_non_null(y);
    *at = 0;
    for (size_t i = 0; i < extents[1]; i++) {
        double a = cabs(y[mic * extents[1] + i]);
        if (a > best) {
            best = a;
            *at = i;
        }
    }
    return best;
}

static void before_the_survey_nothing_can_be_used(void **state)
{
    struct rig *r = *state;
    struct dsp *fresh;
    const struct frontend_config cfg = {.window = WINDOW_HANN};

    assert_int_equal(dsp_create(&fresh, NULL, &cfg), 0);
    assert_false(dsp_is_planned(fresh));
    scene_ping(&r->scene, SCENE, 0, 0, &r->ping);
    dsp_ping(fresh, &r->ping, 0, &r->out);
    assert_receipt(r, SCENE, false);
    assert_string_equal(r->out.note, ""); /* it will come: node_dropped counts */
    dsp_destroy(fresh);
}

static void a_background_ping_ends_here_with_a_receipt(void **state)
{
    struct rig *r = *state;

    send_ping(r, BACKGROUND, 2, 1);
    assert_receipt(r, BACKGROUND, true);
    assert_string_equal(r->out.note, "");
}

static void a_scene_ping_without_its_background_asks_for_it(void **state)
{
    struct rig *r = *state;

    send_ping(r, BACKGROUND, 2, 1);
    send_ping(r, SCENE, 2, 2);
    assert_receipt(r, BACKGROUND, false);
}

static void without_a_background_pass_traces_pass_through(void **state)
{
    struct rig *r = *state;

    send_ping(r, SCENE, 2, 2);
    assert_true(r->out.has_traces);
    assert_false(r->out.has_receipt);
    assert_false(r->out.traces.background_subtracted);
}

static void the_same_sound_twice_leaves_nothing(void **state)
{
    struct rig *r = *state;
    size_t at;

    send_ping(r, BACKGROUND, 1, 0);
    scene_ping(&r->scene, BACKGROUND, 1, 0, &r->ping);
    r->ping.pass = SCENE;
    dsp_ping(r->dsp, &r->ping, 0, &r->out);
    assert_true(r->out.traces.background_subtracted);
    for (size_t m = 0; m < r->scene.survey->n_microphones_m; m++)
        assert_true(peak(&r->out.traces, m, &at) == 0.0);
}

/* All pings of one pass as those of another. */
static void send_as(struct rig *r, Anlos__Pass recorded, uint32_t scan, Anlos__Pass pass,
                    char *said)
{
    const Anlos__Survey *s = r->scene.survey;
    size_t n = s->n_speakers_m * s->n_stage_positions_m;

    for (uint32_t i = 0; i < n; i++) {
        scene_ping(&r->scene, recorded, i / (uint32_t)s->n_speakers_m,
                   i % (uint32_t)s->n_speakers_m, &r->ping);
        r->ping.scan = scan;
        r->ping.pass = pass;
        dsp_ping(r->dsp, &r->ping, 0, &r->out);
        strcat(said, r->out.note);
    }
}

static void a_background_that_is_the_scan_is_warned_of_once(void **state)
{
    struct rig *r = *state;
    char said[2048] = "";

    send_as(r, SCENE, 1, BACKGROUND, said);
    send_as(r, SCENE, 1, SCENE, said);
    assert_string_equal(said,
                        "the background is the same sound as the scan, of which "
                        "nothing is left; expected the room without what is hidden");
}

static void a_background_that_is_louder_than_the_scan_is_warned_of(void **state)
{
    struct rig *r = *state;
    char said[2048] = "";

    send_as(r, BACKGROUND, 1, BACKGROUND, said);
    send_as(r, SCENE, 1, SCENE, said);
    assert_string_equal(said, "");
    send_as(r, SCENE, 1, BACKGROUND, said);
    send_as(r, BACKGROUND, 2, SCENE, said);
    assert_non_null(strstr(said, "dB louder than the scan: have the two been swapped?"));
}

static double power(const Anlos__Traces *t)
{
    size_t extents[2];
    double sum = 0.0;
    const float complex *y = tensor_c64(t->samples, 2, extents);

    assert_non_null(y);
    for (size_t i = 0; i < extents[0] * extents[1]; i++)
        sum += (double)cabsf(y[i]) * cabsf(y[i]);
    return sum;
}

/* A kelvin less makes sound slower, and echoes later, by half its part of 293 K.  The
 * same pings without a background tell how loud the room is. */
static void the_background_is_taken_out_of_air_that_has_changed(void **state)
{
    const struct frontend_config without = {.window = WINDOW_HANN};
    struct rig *r = *state;
    double stretch = survey_sound_speed_m_s(21.0) / survey_sound_speed_m_s(20.0) - 1.0;
    struct dsp_output heard;
    struct dsp *plain;

    assert_int_equal(dsp_create(&plain, NULL, &without), 0);
    assert_int_equal(dsp_survey(plain, r->scene.survey, NULL), 0);
    for (uint32_t i = 0; i < 8; i++) {
        send_ping(r, BACKGROUND, i / 4, i % 4);
        send_ping(r, SCENE, i / 4, i % 4);
        assert_true(r->out.traces.background_subtracted);
        dsp_ping(plain, &r->ping, 0, &heard);
        assert_true(power(&heard.traces) > 0.0);
        assert_true(power(&r->out.traces) < 1e-4 * power(&heard.traces));
    }
    assert_int_equal(dsp_air(r->dsp)->expected, 8);
    assert_int_equal(dsp_air(r->dsp)->pings, 8);
    assert_int_equal(dsp_air(r->dsp)->corrected, 8);
    assert_near(dsp_air(r->dsp)->sum / 8.0, stretch, 1e-5);
    assert_near(dsp_air(r->dsp)->largest, stretch, 2e-5);
    dsp_destroy(plain);
}

static void air_that_has_not_changed_is_not_corrected(void **state)
{
    struct rig *r = *state;

    send_ping(r, BACKGROUND, 0, 0);
    scene_ping(&r->scene, BACKGROUND, 0, 0, &r->ping);
    r->ping.pass = SCENE;
    dsp_ping(r->dsp, &r->ping, 0, &r->out);
    assert_int_equal(dsp_air(r->dsp)->pings, 1);
    assert_int_equal(dsp_air(r->dsp)->corrected, 0);
}

static void another_scan_forgets_the_air_of_the_last_one(void **state)
{
    struct rig *r = *state;

    send_ping(r, BACKGROUND, 0, 0);
    send_ping(r, SCENE, 0, 0);
    assert_true(dsp_air(r->dsp)->largest > 1e-3);
    r->ping.scan++;
    r->ping.pass = BACKGROUND;
    dsp_ping(r->dsp, &r->ping, 0, &r->out);
    r->ping.pass = SCENE;
    dsp_ping(r->dsp, &r->ping, 0, &r->out);
    assert_int_equal(dsp_air(r->dsp)->pings, 1);
    assert_near(dsp_air(r->dsp)->largest, 0.0, 1e-6);
}

static double distance_m(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

/* The point's echo comes after the way speaker - mirrored point - microphone. */
static void the_echo_stands_where_geometry_says(void **state)
{
    struct rig *r = *state;
    const struct survey *s = room_survey(r->scene.room);
    const struct room_object *object;
    const uint32_t position = 3, speaker = 2;
    double shift_m = s->stage_positions_m[position];

    assert_int_equal(room_objects(r->scene.room, &object), 1);
    send_ping(r, BACKGROUND, position, speaker);
    send_ping(r, SCENE, position, speaker);
    assert_true(r->out.has_traces);
    const Anlos__Traces *t = &r->out.traces;
    assert_int_equal(t->position, position);
    assert_int_equal(t->speaker, speaker);
    assert_true(t->stage_m == shift_m);
    for (size_t m = 0; m < s->n_microphones; m++) {
        double from[3], to[3];
        size_t at;
        for (int i = 0; i < 3; i++) {
            from[i] = s->speakers_m[speaker][i] + shift_m * s->stage_axis[i];
            to[i] = s->microphones_m[m][i] + shift_m * s->stage_axis[i];
        }
        double delay_s =
            (distance_m(from, object->virtual_m) + distance_m(object->virtual_m, to)) /
            s->sound_speed_m_s;
        assert_true(peak(t, m, &at) > 0.0);
        assert_near(t->t0_s + (double)at / t->rate_hz, delay_s, 0.75 / t->rate_hz);
        assert_false(t->masked[m]);
    }
}

static void a_ping_that_is_not_valid_is_to_be_taken_again(void **state)
{
    struct rig *r = *state;

    scene_ping(&r->scene, BACKGROUND, 0, 0, &r->ping);
    r->ping.valid = false;
    dsp_ping(r->dsp, &r->ping, 0, &r->out);
    assert_receipt(r, BACKGROUND, false);
}

static void a_ping_of_another_survey_or_shape_is_refused(void **state)
{
    struct rig *r = *state;

    scene_ping(&r->scene, BACKGROUND, 0, 0, &r->ping);
    r->ping.survey_id++;
    dsp_ping(r->dsp, &r->ping, 0, &r->out);
    assert_receipt(r, BACKGROUND, false);
    scene_ping(&r->scene, BACKGROUND, 0, 0, &r->ping);
    r->ping.n_clipped--;
    dsp_ping(r->dsp, &r->ping, 0, &r->out);
    assert_receipt(r, BACKGROUND, false);
    scene_ping(&r->scene, BACKGROUND, 0, 0, &r->ping);
    r->ping.position = 6;
    dsp_ping(r->dsp, &r->ping, 0, &r->out);
    assert_receipt(r, BACKGROUND, false);
    scene_ping(&r->scene, BACKGROUND, 0, 0, &r->ping);
    r->ping.samples = NULL;
    dsp_ping(r->dsp, &r->ping, 0, &r->out);
    assert_receipt(r, BACKGROUND, false);
}

/* The first n samples of each microphone of the ping, in samples[n_microphones][n]. */
static void cut_ping(struct rig *r, size_t n, struct tensor_view *view, float *samples)
{
    size_t n_mics = r->scene.survey->n_microphones_m;

    scene_ping(&r->scene, SCENE, 0, 0, &r->ping);
    for (size_t m = 0; m < n_mics; m++)
        memcpy(samples + m * n, r->scene.samples + m * r->scene.n_samples,
               n * sizeof *samples);
    r->ping.samples = tensor_borrow_f32(view, samples, 2, n_mics, n);
}

static void a_short_ping_keeps_nothing_of_a_longer_one_before(void **state)
{
    struct rig *r = *state;
    size_t n_mics = r->scene.survey->n_microphones_m, n = r->scene.n_samples;
    float *samples = malloc(n_mics * n * sizeof *samples);
    struct tensor_view view;

    assert_non_null(samples);
    cut_ping(r, n / 2, &view, samples);
    dsp_ping(r->dsp, &r->ping, 0, &r->out);
    assert_true(r->out.has_traces);
    for (size_t m = 0, at; m < n_mics; m++) /* what it holds is heard, of each */
        assert_true(peak(&r->out.traces, m, &at) > 0.0);
    size_t size = r->out.traces.samples->data.len;
    void *alone = malloc(size);
    assert_non_null(alone);
    memcpy(alone, r->out.traces.samples->data.data, size);

    cut_ping(r, n - 1, &view, samples);
    dsp_ping(r->dsp, &r->ping, 0, &r->out);
    assert_memory_not_equal(alone, r->out.traces.samples->data.data, size);
    cut_ping(r, n / 2, &view, samples);
    dsp_ping(r->dsp, &r->ping, 0, &r->out);
    assert_memory_equal(alone, r->out.traces.samples->data.data, size);
    free(alone);
    free(samples);
}

static void unfit_microphones_are_masked_and_said_once(void **state)
{
    struct rig *r = *state;

    for (int i = 0; i < 2; i++) {
        scene_ping(&r->scene, SCENE, 0, 0, &r->ping);
        memset(r->scene.samples + r->scene.n_samples, 0,
               r->scene.n_samples * sizeof *r->scene.samples);
        r->scene.not_finite[2] = 1;
        r->scene.clipped[3] = (uint32_t)r->scene.n_samples / 50;
        r->scene.clipped[0] = 2; /* a click */
        dsp_ping(r->dsp, &r->ping, 0, &r->out);
        assert_true(r->out.has_traces);
        assert_false(r->out.traces.masked[0]);
        assert_int_equal(r->out.faults.n, 4);
        assert_int_equal(r->out.faults.silent, 1);
        assert_int_equal(r->out.faults.damaged, 1);
        assert_int_equal(r->out.faults.clipped, 1);
        for (int m = 1; m < 4; m++)
            assert_true(r->out.traces.masked[m]);
        assert_int_equal(r->out.traces.clipped_samples, r->scene.n_samples / 50 + 2);
        assert_string_equal(r->out.note,
                            i ? ""
                              : "microphone 2 is silent; microphone 3 has samples that "
                                "are not finite; microphone 4 is clipped");
    }
}

static void a_microphone_without_background_is_masked_in_the_scene(void **state)
{
    struct rig *r = *state;

    scene_ping(&r->scene, BACKGROUND, 0, 0, &r->ping);
    r->scene.not_finite[2] = 1;
    dsp_ping(r->dsp, &r->ping, 0, &r->out);
    assert_receipt(r, BACKGROUND, true);
    send_ping(r, SCENE, 0, 0);
    assert_true(r->out.traces.masked[2]);
    assert_false(r->out.traces.masked[1]);
}

/* The scene's survey with another gate. */
static Anlos__Survey *survey_with_gate(const struct rig *r, double near_m, double far_m)
{
    struct survey s = *room_survey(r->scene.room); /* borrows its arrays */

    s.gate_m[0] = near_m;
    s.gate_m[1] = far_m;
    Anlos__Survey *m = scene_message(&s);
    assert_non_null(m);
    return m;
}

static void another_survey_forgets_the_background(void **state)
{
    struct rig *r = *state;
    Anlos__Survey *other = survey_with_gate(r, 0.6, 1.7);

    send_ping(r, BACKGROUND, 0, 0);
    assert_int_equal(dsp_survey(r->dsp, r->scene.survey, NULL), 0); /* repeated: kept */
    send_ping(r, SCENE, 0, 0);
    assert_true(r->out.has_traces);
    assert_int_equal(dsp_survey(r->dsp, other, NULL), 0);
    scene_ping(&r->scene, SCENE, 0, 0, &r->ping);
    r->ping.survey_id = other->id;
    dsp_ping(r->dsp, &r->ping, 0, &r->out);
    assert_receipt(r, BACKGROUND, false);
    anlos__survey__free_unpacked(other, NULL);
}

/* A slot of 1500 samples at 48 kHz and 343 m/s reaches 5.36 m. */
static void a_survey_that_cannot_be_planned_is_complained_about(void **state)
{
    struct rig *r = *state;
    struct survey s = *room_survey(r->scene.room); /* borrows its arrays */
    struct error why = {""};

    s.has_gate = false;
    s.volume_m[2][0] = 5.5;
    s.volume_m[2][1] = 6.0;
    Anlos__Survey *other = scene_message(&s);
    assert_non_null(other);
    assert_int_equal(dsp_survey(r->dsp, other, &why), -EINVAL);
    assert_non_null(strstr(why.text, "volume"));
    assert_false(dsp_is_planned(r->dsp));
    anlos__survey__free_unpacked(other, NULL);
}

#define TEST(f)        cmocka_unit_test_setup_teardown(f, setup, teardown)
#define CHANGED_AIR(f) cmocka_unit_test_setup_teardown(f, setup_changed_air, teardown)
#define WITHOUT(f)     cmocka_unit_test_setup_teardown(f, setup_without_background, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(before_the_survey_nothing_can_be_used),
        TEST(a_background_ping_ends_here_with_a_receipt),
        TEST(a_scene_ping_without_its_background_asks_for_it),
        WITHOUT(without_a_background_pass_traces_pass_through),
        TEST(the_same_sound_twice_leaves_nothing),
        TEST(a_background_that_is_the_scan_is_warned_of_once),
        TEST(a_background_that_is_louder_than_the_scan_is_warned_of),
        CHANGED_AIR(the_background_is_taken_out_of_air_that_has_changed),
        CHANGED_AIR(air_that_has_not_changed_is_not_corrected),
        CHANGED_AIR(another_scan_forgets_the_air_of_the_last_one),
        TEST(the_echo_stands_where_geometry_says),
        TEST(a_ping_that_is_not_valid_is_to_be_taken_again),
        TEST(a_ping_of_another_survey_or_shape_is_refused),
        WITHOUT(a_short_ping_keeps_nothing_of_a_longer_one_before),
        WITHOUT(unfit_microphones_are_masked_and_said_once),
        TEST(a_microphone_without_background_is_masked_in_the_scene),
        TEST(another_survey_forgets_the_background),
        TEST(a_survey_that_cannot_be_planned_is_complained_about),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
