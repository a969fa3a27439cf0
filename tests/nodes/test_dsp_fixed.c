/* SPDX-License-Identifier: MIT */
/* The dsp of an array that stands: frames without receipts, and its two backgrounds. */
#include <complex.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "nodes/dsp/dsp.h"
#include "recon/frontend/backgrounds.h"
#include "tests/nodes/scene.h"

#define SCENE      ANLOS__PASS__SCENE
#define BACKGROUND ANLOS__PASS__BACKGROUND
#define MS         1000000LL
#define FRAME_MS   400

struct rig {
    struct scene scene;
    struct dsp *dsp;
    Anlos__Ping ping;
    struct dsp_output out;
    uint32_t frame, speaker;
    int64_t now_ns;
};

static int open_as(void **state, enum background_mode mode, bool hears_walls)
{
    const struct frontend_config cfg = {.window = WINDOW_HANN,
                                        .background = mode,
                                        .background_s = 4.0,
                                        .hears_walls = hears_walls,
                                        .wall_reach_m = 2.0};
    struct rig *r = calloc(1, sizeof *r);

    if (!r || scene_open(&r->scene, SOURCE_DIR "/tests/nodes/point.yaml") ||
        dsp_create(&r->dsp, NULL, &cfg) || dsp_survey(r->dsp, r->scene.survey, NULL))
        return -1;
    r->now_ns = 1000 * MS;
    r->speaker = 1;
    *state = r;
    return 0;
}

static int open_rig(void **state, enum background_mode mode)
{
    return open_as(state, mode, false);
}

static int setup_hearing(void **state)
{
    return open_as(state, BACKGROUND_RECORDED, true);
}

static int setup_none(void **state)
{
    return open_rig(state, BACKGROUND_NONE);
}

static int setup_recorded(void **state)
{
    return open_rig(state, BACKGROUND_RECORDED);
}

static int setup_adaptive(void **state)
{
    return open_rig(state, BACKGROUND_ADAPTIVE);
}

static int teardown(void **state)
{
    struct rig *r = *state;

    dsp_destroy(r->dsp);
    scene_close(&r->scene);
    free(r);
    return 0;
}

/* The next frame's ping: the sound of `heard`, whatever the pass says, times gain. */
static void send(struct rig *r, Anlos__Pass heard, Anlos__Pass pass, float gain)
{
    scene_ping(&r->scene, heard, 0, r->speaker, &r->ping);
    for (size_t i = 0; i < r->scene.survey->n_microphones_m * r->scene.n_samples; i++)
        r->scene.samples[i] *= gain;
    r->ping.pass = pass;
    r->ping.frame = ++r->frame;
    r->now_ns += FRAME_MS * MS;
    dsp_ping(r->dsp, &r->ping, r->now_ns, &r->out);
    assert_false(r->out.has_receipt);
}

/* Energy of what came out. */
static double energy(const struct rig *r)
{
    size_t extents[2];
    double sum = 0;

    assert_true(r->out.has_traces);
    const float complex *y = tensor_c64(r->out.traces.samples, 2, extents);
    for (size_t i = 0; i < extents[0] * extents[1]; i++)
        sum += (double)(crealf(y[i]) * crealf(y[i]) + cimagf(y[i]) * cimagf(y[i]));
    return sum;
}

static void move(struct rig *r, double speed_m_s, bool valid)
{
    Anlos__EgoMotion ego = ANLOS__EGO_MOTION__INIT;

    ego.speed_m_s = speed_m_s;
    ego.valid = valid;
    dsp_ego(r->dsp, &ego, r->now_ns + FRAME_MS * MS); /* when the next ping is taken */
}

static void frame_direction_and_temperature_come_through(void **state)
{
    struct rig *r = *state;
    Anlos__Ambient air = ANLOS__AMBIENT__INIT;

    air.temperature_c = -3.5;
    dsp_ambient(r->dsp, &air);
    scene_ping(&r->scene, SCENE, 0, 1, &r->ping);
    r->ping.frame = 17;
    r->ping.temperature_c = 21.5;
    dsp_ping(r->dsp, &r->ping, r->now_ns, &r->out);
    assert_true(r->out.has_traces);
    assert_int_equal(r->out.traces.frame, 17);
    assert_true(r->out.traces.temperature_c == 21.5);
    assert_false(r->out.traces.down);
    r->ping.temperature_c = NAN; /* not measured: what the vehicle says */
    dsp_ping(r->dsp, &r->ping, r->now_ns, &r->out);
    assert_true(r->out.traces.temperature_c == -3.5);
}

static void what_cannot_be_used_asks_for_nothing(void **state)
{
    struct rig *r = *state;

    send(r, SCENE, SCENE, 1);
    assert_false(r->out.has_traces);
    assert_non_null(strstr(r->out.note, "speaker 1 has no background"));
    send(r, SCENE, SCENE, 1);
    assert_string_equal(r->out.note, ""); /* said once */
    scene_ping(&r->scene, BACKGROUND, 0, 1, &r->ping);
    r->ping.frame = 1;
    r->ping.valid = false;
    dsp_ping(r->dsp, &r->ping, r->now_ns, &r->out);
    assert_false(r->out.has_receipt || r->out.has_traces);
    r->ping.valid = r->ping.down = true; /* no chirp of this survey runs that way */
    dsp_ping(r->dsp, &r->ping, r->now_ns, &r->out);
    assert_false(r->out.has_receipt || r->out.has_traces);
    assert_string_equal(r->out.note, "a ping does not have the survey's shape");
}

/* 0.5, 1 and 1.5 of it: their mean is what the scene sounds like. */
static void a_recorded_background_is_the_mean_of_its_frames(void **state)
{
    struct rig *r = *state;

    send(r, BACKGROUND, BACKGROUND, 0.5f);
    send(r, BACKGROUND, BACKGROUND, 1.0f);
    send(r, BACKGROUND, BACKGROUND, 1.5f);
    r->frame = 0;
    send(r, BACKGROUND, SCENE, 2.0f);
    double whole = energy(r); /* once the background is left */
    send(r, BACKGROUND, SCENE, 1.0f);
    assert_true(energy(r) < 1e-5 * whole);
    assert_true(r->out.traces.background_subtracted);
    /* The pass restarts: what was recorded before does not count any more. */
    r->frame = 0;
    r->ping.scan = 1;
    send(r, BACKGROUND, BACKGROUND, 3.0f);
    send(r, BACKGROUND, SCENE, 3.0f);
    assert_true(energy(r) < 1e-5 * whole);
}

/* The first is heard as it is. */
static void learn(struct rig *r, Anlos__Pass heard)
{
    for (unsigned i = 0; i < 4; i++) {
        send(r, heard, SCENE, 1);
        assert_true(r->out.has_traces);
        assert_true(r->out.traces.background_subtracted == (i > 0));
        assert_false(r->out.traces.masked[0]);
    }
}

/* Of the point alone: scene less background. */
static double energy_by_hand(void)
{
    void *state = NULL;

    assert_int_equal(setup_recorded(&state), 0);
    struct rig *r = state;
    send(r, BACKGROUND, BACKGROUND, 1);
    send(r, SCENE, SCENE, 1);
    double point = energy(r);
    assert_int_equal(teardown(&state), 0);
    return point;
}

static void what_stands_still_is_gone_and_what_comes_is_seen(void **state)
{
    struct rig *r = *state;

    learn(r, BACKGROUND);
    for (int64_t ms = 0; ms < 8000; ms += FRAME_MS)
        send(r, BACKGROUND, SCENE, 1);
    double rest = energy(r);
    send(r, SCENE, SCENE, 1); /* the point is there */
    double point = energy(r);
    assert_true(r->out.traces.background_subtracted);
    assert_true(rest < 1e-6 * point);
    assert_true(fabs(energy_by_hand() / point - 1) < 1e-3);
    /* In 4 s, the time constant, it fades to 1/e: its energy to 1/e^2. */
    for (int64_t ms = 0; ms < 4000; ms += FRAME_MS)
        send(r, SCENE, SCENE, 1);
    assert_true(fabs(energy(r) / point / exp(-2) - 1) < 0.05);
}

static void while_the_vehicle_moves_no_background_is_subtracted(void **state)
{
    struct rig *r = *state;

    learn(r, BACKGROUND);
    send(r, BACKGROUND, SCENE, 1);
    double rest = energy(r);
    move(r, 2.0, true);
    send(r, BACKGROUND, SCENE, 1);
    double whole = energy(r);
    assert_true(whole > 1e6 * rest);
    assert_false(r->out.traces.background_subtracted);
    assert_false(r->out.traces.masked[0]);
    move(r, 0.0, true); /* it stands: elsewhere, so it learns anew */
    send(r, BACKGROUND, SCENE, 1);
    assert_true(energy(r) > 1e6 * rest);
    assert_false(r->out.traces.background_subtracted);
    move(r, 0.0, true);
    send(r, BACKGROUND, SCENE, 1);
    assert_true(energy(r) < 1e-6 * whole);
    assert_true(r->out.traces.background_subtracted);
}

/* From the fourth ping on; a point that comes is heard as with a recorded background. */
static void what_stays_while_the_vehicle_moves_is_the_arrays_own_sound(void **state)
{
    struct rig *r = *state;
    double whole = 0;

    for (int i = 0; i < 4; i++) {
        move(r, 1.0, true);
        send(r, BACKGROUND, SCENE, 1);
        assert_false(r->out.traces.background_subtracted);
        assert_true(i == 0 || i == 3 || fabs(energy(r) / whole - 1) < 1e-3);
        whole = i == 0 ? energy(r) : whole;
    }
    assert_true(energy(r) < 1e-6 * whole);
    move(r, 1.0, true);
    send(r, SCENE, SCENE, 1);
    assert_true(fabs(energy(r) / energy_by_hand() - 1) < 1e-3);
}

static void each_speaker_of_an_array_on_the_move_has_its_own_sound(void **state)
{
    struct rig *r = *state;
    double whole[2] = {0};

    for (int i = 0; i < 4; i++)
        for (r->speaker = 0; r->speaker < 2; r->speaker++) {
            move(r, 1.0, true);
            send(r, BACKGROUND, SCENE, 1);
            whole[r->speaker] += i == 0 ? energy(r) : 0;
            assert_true((energy(r) < 1e-6 * whole[r->speaker]) == (i == 3));
        }
}

/* Its background is what it is told to be. */
static void without_an_adaptive_background_own_sound_stays(void **state)
{
    struct rig *r = *state;
    double whole = 0;

    for (int i = 0; i < 5; i++) {
        move(r, 1.0, true);
        send(r, BACKGROUND, SCENE, 1);
        whole = i == 0 ? energy(r) : whole;
        assert_true(fabs(energy(r) / whole - 1) < 1e-3);
    }
}

/* What stands about it is not its own: when it sets off, all of it is heard. */
static void expect_learns_nothing_standing(struct rig *r, bool tells)
{
    double whole = 0;

    for (int i = 0; i < 5; i++) {
        if (tells)
            move(r, 0.0, true);
        send(r, BACKGROUND, SCENE, 1);
        whole = i == 0 ? energy(r) : whole;
    }
    assert_true(energy(r) < 1e-6 * whole);
    move(r, 1.0, true);
    send(r, BACKGROUND, SCENE, 1);
    assert_true(fabs(energy(r) / whole - 1) < 1e-3);
}

static void of_a_vehicle_that_stands_no_own_sound_is_learnt(void **state)
{
    expect_learns_nothing_standing(*state, true);
}

static void of_a_vehicle_that_never_tells_no_own_sound_is_learnt(void **state)
{
    expect_learns_nothing_standing(*state, false);
}

/* It may stand: what stands about it is not its own. */
static void of_a_vehicle_that_fell_silent_no_own_sound_is_learnt(void **state)
{
    struct rig *r = *state;

    move(r, 1.0, true);
    send(r, BACKGROUND, SCENE, 1);
    double whole = energy(r);
    for (int i = 0; i < 5; i++) {
        send(r, BACKGROUND, SCENE, 1);
        assert_true(fabs(energy(r) / whole - 1) < 1e-3);
    }
}

static void tell(struct rig *r, double speed_m_s, int64_t after_ms)
{
    Anlos__EgoMotion ego = ANLOS__EGO_MOTION__INIT;

    ego.speed_m_s = speed_m_s;
    ego.valid = true;
    dsp_ego(r->dsp, &ego, r->now_ns + (FRAME_MS + after_ms) * MS);
}

/* Each is a chirp and its echoes, 60 ms and more. */
static void a_ping_during_which_the_vehicle_sets_off_or_stops_does_not_count(void **state)
{
    struct rig *r = *state;

    for (int i = 0; i < 2; i++) {
        tell(r, 0.0, -5);
        tell(r, 0.0, 15);
        send(r, BACKGROUND, SCENE, 1);
    }
    assert_true(r->out.traces.background_subtracted);
    tell(r, 0.0, -5);
    tell(r, 0.0, 15);
    tell(r, 0.3, 35); /* sets off */
    send(r, BACKGROUND, SCENE, 1);
    assert_false(r->out.traces.background_subtracted);
    tell(r, 0.3, -5);
    tell(r, 0.0, 15); /* stops */
    send(r, BACKGROUND, SCENE, 1);
    assert_false(r->out.traces.background_subtracted);
    tell(r, 0.0, -5);
    tell(r, 0.1, 15); /* a jerk */
    tell(r, 0.0, 35);
    send(r, BACKGROUND, SCENE, 1);
    assert_false(r->out.traces.background_subtracted);
    tell(r, 0.0, -5);
    send(r, BACKGROUND, SCENE, 1); /* the first that was heard standing */
    assert_false(r->out.traces.background_subtracted);
    tell(r, 0.0, -5);
    send(r, BACKGROUND, SCENE, 1);
    assert_true(r->out.traces.background_subtracted);
}

static void a_vehicle_that_fell_silent_counts_as_moving(void **state)
{
    struct rig *r = *state;

    for (unsigned i = 0; i < 2; i++) {
        move(r, 0.0, true);
        send(r, BACKGROUND, SCENE, 1);
    }
    assert_true(r->out.traces.background_subtracted);
    send(r, BACKGROUND, SCENE, 1); /* 400 ms after the last message */
    assert_false(r->out.traces.background_subtracted);
    move(r, 0.0, false);
    send(r, BACKGROUND, SCENE, 1);
    assert_false(r->out.traces.background_subtracted);
}

static double energy_of(const struct rig *r, size_t microphone)
{
    size_t extents[2];
    double sum = 0;
    const float complex *y = tensor_c64(r->out.traces.samples, 2, extents);

    for (size_t i = 0; i < extents[1]; i++)
        sum += pow(cabsf(y[microphone * extents[1] + i]), 2);
    return sum;
}

/* A ping of the background; masked: some of what microphone 2 hears is no number. */
static void hear_of_2(struct rig *r, bool masked)
{
    scene_ping(&r->scene, BACKGROUND, 0, 1, &r->ping);
    r->scene.not_finite[2] = masked;
    r->ping.pass = SCENE;
    r->ping.frame = ++r->frame;
    r->now_ns += FRAME_MS * MS;
    dsp_ping(r->dsp, &r->ping, r->now_ns, &r->out);
    assert_int_equal(r->out.traces.masked[2], masked);
}

static void a_microphone_that_was_masked_while_others_learned_comes_later(void **state)
{
    struct rig *r = *state;

    hear_of_2(r, true);
    hear_of_2(r, false);
    double plain = energy_of(r, 2);
    assert_true(energy_of(r, 1) < 1e-6 * plain);
    send(r, BACKGROUND, SCENE, 1);
    assert_true(energy_of(r, 2) < 1e-6 * plain);
}

static void a_microphone_that_is_masked_on_the_move_has_no_own_sound(void **state)
{
    struct rig *r = *state;
    double plain = 0;

    for (unsigned i = 0; i < 6; i++) {
        move(r, 1.0, true);
        hear_of_2(r, i == 4);
        plain = i == 0 ? energy_of(r, 2) : plain;
        if (i == 4)
            assert_true(energy_of(r, 2) == 0.0);
    }
    assert_true(energy_of(r, 2) < 1e-6 * plain);
}

/* A slam: noise that is as loud as the direct sound, at all microphones. */
static void slam(struct rig *r, Anlos__Pass heard)
{
    uint32_t seed = 5;

    scene_ping(&r->scene, heard, 0, 1, &r->ping);
    for (size_t i = 0; i < r->scene.survey->n_microphones_m * r->scene.n_samples; i++) {
        seed = seed * 1664525u + 1013904223u;
        r->scene.samples[i] += (float)(seed >> 8) / 8388608.0f - 1.0f;
    }
    r->ping.pass = SCENE;
    r->ping.frame = ++r->frame;
    r->now_ns += FRAME_MS * MS;
    dsp_ping(r->dsp, &r->ping, r->now_ns, &r->out);
}

/* Neither it nor the ping before it, in which it may begin. */
static void what_a_slam_drowned_shows_nothing_and_spoils_no_background(void **state)
{
    struct rig *r = *state;

    learn(r, BACKGROUND);
    send(r, BACKGROUND, SCENE, 1);
    assert_false(r->out.traces.blanked);
    double rest = energy(r);
    send(r, SCENE, SCENE, 1); /* what should not count */
    assert_false(r->out.traces.blanked);
    double point = energy(r);
    for (int k = 0; k < 2; k++) {
        if (k == 0)
            slam(r, BACKGROUND);
        else
            send(r, BACKGROUND, SCENE, 1); /* may hold its end */
        assert_true(r->out.traces.blanked);
        assert_true(r->out.traces.background_subtracted);
        for (size_t m = 0; m < r->out.traces.n_masked; m++)
            assert_true(r->out.traces.masked[m]);
        assert_true(energy(r) == 0);
    }
    send(r, BACKGROUND, SCENE, 1);
    assert_false(r->out.traces.blanked);
    assert_true(rest < 1e-6 * point);
    assert_true(energy(r) < 1e-6 * point);
}

static void while_the_vehicle_moves_a_slam_is_blanked_too(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 4; k++) {
        move(r, 1.0, true);
        send(r, BACKGROUND, SCENE, 1);
        assert_false(r->out.traces.blanked);
    }
    move(r, 1.0, true);
    slam(r, BACKGROUND);
    assert_true(r->out.traces.blanked);
    assert_false(r->out.traces.background_subtracted);
}

/* The point's echo by way of the wall, which stands at 0.8 m: loudest behind the direct
 * sound, heard by every microphone at the length of its path. */
static void assert_point_heard(const struct rig *r)
{
    const double image[3] = {0.13, 0.11, 2 * 0.8 - 0.4};
    const Anlos__Echoes *e = &r->out.echoes;
    size_t next = 0;

    assert_true(r->out.has_echoes && e->usable);
    assert_int_equal(e->speaker, 1);
    assert_int_equal(e->n_arrivals, r->scene.survey->n_microphones_m);
    for (size_t m = 0; m < e->n_arrivals; m++) {
        const Anlos__Vec3 *at = r->scene.survey->microphones_m[m];
        const Anlos__Vec3 *from = r->scene.survey->speakers_m[1];
        double path_m =
            hypot(hypot(image[0] - at->x, image[1] - at->y), image[2] - at->z) +
            hypot(hypot(image[0] - from->x, image[1] - from->y), image[2] - from->z);
        double nearest_m = INFINITY;
        assert_true(e->heard[m] && e->arrivals[m] > 0);
        for (size_t k = 0; k < e->arrivals[m]; k++, next++)
            nearest_m = fmin(nearest_m, fabs(e->path_m[next] - path_m));
        assert_true(nearest_m < 0.005);
    }
    assert_int_equal(next, e->n_path_m);
}

/* Whatever becomes of a ping otherwise; and of one that is none, that it is none. */
static void walls_are_heard_in_every_ping(void **state)
{
    struct rig *r = *state;

    send(r, SCENE, SCENE, 1); /* it lacks its background */
    assert_false(r->out.has_traces);
    assert_point_heard(r);
    send(r, SCENE, BACKGROUND, 1);
    assert_point_heard(r);
    send(r, SCENE, SCENE, 1); /* all of it is background: nothing is subtracted here */
    assert_true(r->out.has_traces && r->out.traces.background_subtracted);
    assert_point_heard(r);
    r->ping.valid = false;
    dsp_ping(r->dsp, &r->ping, r->now_ns, &r->out);
    assert_true(r->out.has_echoes && !r->out.echoes.usable);
    assert_int_equal(r->out.echoes.n_arrivals, 0);
}

static void where_nobody_hears_walls_there_are_no_echoes(void **state)
{
    struct rig *r = *state;

    send(r, SCENE, SCENE, 1);
    assert_true(r->out.has_traces && !r->out.has_echoes);
}

#define TEST(name, setup) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(frame_direction_and_temperature_come_through, setup_none),
        TEST(walls_are_heard_in_every_ping, setup_hearing),
        TEST(where_nobody_hears_walls_there_are_no_echoes, setup_none),
        TEST(what_cannot_be_used_asks_for_nothing, setup_recorded),
        TEST(a_recorded_background_is_the_mean_of_its_frames, setup_recorded),
        TEST(what_stands_still_is_gone_and_what_comes_is_seen, setup_adaptive),
        TEST(while_the_vehicle_moves_no_background_is_subtracted, setup_adaptive),
        TEST(what_stays_while_the_vehicle_moves_is_the_arrays_own_sound, setup_adaptive),
        TEST(each_speaker_of_an_array_on_the_move_has_its_own_sound, setup_adaptive),
        TEST(without_an_adaptive_background_own_sound_stays, setup_none),
        TEST(of_a_vehicle_that_stands_no_own_sound_is_learnt, setup_adaptive),
        TEST(of_a_vehicle_that_never_tells_no_own_sound_is_learnt, setup_adaptive),
        TEST(of_a_vehicle_that_fell_silent_no_own_sound_is_learnt, setup_adaptive),
        TEST(a_ping_during_which_the_vehicle_sets_off_or_stops_does_not_count,
             setup_adaptive),
        TEST(a_vehicle_that_fell_silent_counts_as_moving, setup_adaptive),
        TEST(a_microphone_that_was_masked_while_others_learned_comes_later,
             setup_adaptive),
        TEST(a_microphone_that_is_masked_on_the_move_has_no_own_sound, setup_adaptive),
        TEST(what_a_slam_drowned_shows_nothing_and_spoils_no_background, setup_adaptive),
        TEST(while_the_vehicle_moves_a_slam_is_blanked_too, setup_adaptive),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
