/* SPDX-License-Identifier: MIT */
/* nodes/recon/steady.c, fed with what a fixed array records (tests/recon/moving.h) and
 * the compressor makes of it. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "msgs/convert.h"
#include "msgs/tensor.h"
#include "nodes/recon/steady.h"
#include "recon/frontend/compressor.h"
#include "recon/imaging/image_plan.h"
#include "tests/recon/moving.h"

enum { SPEAKERS = 4, MICROPHONES = 6, SLOT = 1152, MS = 1000000 };

struct rig {
    struct survey survey;
    double speakers_m[SPEAKERS][3], microphones_m[MICROPHONES][3], position_m;
    Anlos__Survey *message;
    struct processing processing;
    struct trace_format format;
    struct compressor *compressor;
    struct moving world;
    struct steady *steady;
    float *rx;
    float complex *y;
    struct tensor_view view;
    protobuf_c_boolean masked[MICROPHONES];
    bool subtracted; /* pings have a background */
    bool blanked;
    int more; /* samples of traces than the compressor gives */
    char note[128];
};

static void describe(struct rig *r, bool has_mount)
{
    const struct moving *w = &r->world;
    r->survey = (struct survey){
        .source = SURVEY_SIMULATION,
        .sound_speed_m_s = w->sound_speed_m_s,
        .temperature_c = 20.0,
        .sample_rate_hz = w->sample_rate_hz,
        .chirp_start_hz = w->chirp_hz[0],
        .chirp_stop_hz = w->chirp_hz[1],
        .chirp_duration_s = w->chirp_s,
        .slot_samples = SLOT,
        .n_speakers = SPEAKERS,
        .n_microphones = MICROPHONES,
        .n_positions = 1,
        .speakers_m = r->speakers_m,
        .microphones_m = r->microphones_m,
        .stage_axis = {1.0, 0.0, 0.0},
        .stage_positions_m = &r->position_m,
        .has_gate = true,
        .gate_m = {0.6, 2.5},
        .has_volume = true,
        .volume_m = {{0.0, 0.6, 0.01}, {0.05, 0.05, 0.1}, {1.0, 1.8, 0.01}},
        .has_mount = has_mount,
        .mount_origin_m = {3.5, 0.0, 0.5},
        .mount_x_axis = {0.0, 1.0, 0.0},
        .mount_y_axis = {0.0, 0.0, 1.0}};
}

static Anlos__Survey *message_of(const struct survey *s)
{
    uint8_t *packed;
    size_t size;
    assert_int_equal(survey_pack(s, &packed, &size), 0);
    Anlos__Survey *m = anlos__survey__unpack(NULL, size, packed);
    free(packed);
    assert_non_null(m);
    return m;
}

/* The gate ends at far_m; beyond: traces go on as far as an array listens. */
static void start_gated(struct rig *r, bool has_mount,
                        const struct static_array_config *cfg, double far_m, bool beyond)
{
    *r = (struct rig){.world = {.sound_speed_m_s = 343.0,
                                .sample_rate_hz = 48000.0,
                                .chirp_hz = {2000.0, 20000.0},
                                .chirp_s = 5e-3,
                                .mount_m = {3.5, 0.0, 0.5},
                                .at_m = {5.0, 0.3, 0.55}}};
    for (int j = 0; j < SPEAKERS; j++)
        r->speakers_m[j][0] = j / 3.0 - 0.5;
    for (int i = 0; i < MICROPHONES; i++)
        r->microphones_m[i][0] = i / 5.0 - 0.5;
    describe(r, has_mount);
    r->survey.gate_m[1] = far_m;
    r->message = message_of(&r->survey);
    assert_int_equal(processing_plan(&r->processing, &r->survey, NULL), 0);
    if (beyond)
        processing_listen_beyond(&r->processing, &r->survey);
    assert_int_equal(compressor_create(&r->compressor, &r->processing, &r->survey,
                                       COMPRESSION_MATCHED_FILTER, WINDOW_HANN, NULL),
                     0);
    compressor_format(r->compressor, &r->format);
    r->rx = malloc(MICROPHONES * r->processing.ping_samples * sizeof *r->rx);
    r->y = calloc(MICROPHONES * (r->format.n_samples + 1), sizeof *r->y);
    assert_non_null(r->rx);
    assert_non_null(r->y);
    assert_int_equal(steady_create(&r->steady, NULL, cfg), 0);
    assert_int_equal(steady_survey(r->steady, r->message, NULL), 0);
}

static void start(struct rig *r, bool has_mount, const struct static_array_config *cfg)
{
    start_gated(r, has_mount, cfg, 2.5, false);
}

static void stop(struct rig *r)
{
    steady_destroy(r->steady);
    compressor_destroy(r->compressor);
    anlos__survey__free_unpacked(r->message, NULL);
    free(r->rx);
    free(r->y);
}

static int64_t stamp_ns(size_t k)
{
    return 1000 * (int64_t)MS + (int64_t)k * 24 * MS;
}

/* Ping k of the endless shot, frames counted from 1.  Is an image due? */
static bool ping(struct rig *r, size_t k)
{
    size_t n = r->processing.ping_samples;
    Anlos__Traces t = ANLOS__TRACES__INIT;
    memset(r->rx, 0, MICROPHONES * n * sizeof *r->rx);
    for (size_t i = 0; i < MICROPHONES; i++)
        moving_record(&r->world, 0.024 * (double)k, 0.024 * (double)k, false,
                      r->speakers_m[k % SPEAKERS], r->microphones_m[i], n, r->rx + i * n);
    compressor_execute(r->compressor, false, r->rx, n, r->y);
    t.survey_id = r->message->id;
    t.scan = 1;
    t.frame = (uint32_t)(1 + k / SPEAKERS);
    t.speaker = (uint32_t)(k % SPEAKERS);
    size_t whole = r->format.n_samples, n_samples = whole + (size_t)r->more;
    for (size_t i = 0; i < MICROPHONES && r->more < 0; i++)
        memmove(r->y + i * n_samples, r->y + i * whole, n_samples * sizeof *r->y);
    t.samples = tensor_borrow_c64(&r->view, r->y, 2, (size_t)MICROPHONES, n_samples);
    t.t0_s = r->format.t0_s;
    t.rate_hz = r->format.rate_hz;
    t.carrier_hz = r->format.carrier_hz;
    t.n_masked = MICROPHONES;
    t.masked = r->masked;
    t.clipped_samples = k;
    t.background_subtracted = r->subtracted;
    t.blanked = r->blanked;
    for (size_t i = 0; r->blanked && i < MICROPHONES; i++)
        r->masked[i] = true;
    return steady_traces(r->steady, &t, stamp_ns(k), r->note, sizeof r->note);
}

static void drive(struct rig *r, int64_t until_ns)
{
    for (int64_t t = 900 * (int64_t)MS; t <= until_ns; t += 20 * MS) {
        Anlos__EgoMotion m = ANLOS__EGO_MOTION__INIT;
        m.speed_m_s = r->world.speed_m_s;
        m.yaw_rate_rad_s = r->world.yaw_rate_rad_s;
        m.valid = true;
        steady_ego(r->steady, &m, t);
    }
}

/* How far the strongest voxel is from where the point is at ping k. */
static double off_m(const struct rig *r, const Anlos__Volume *v, size_t k)
{
    size_t n[3], best = 0;
    const float *x = tensor_f32(v->intensity, 3, n);
    double at[3];
    assert_non_null(x);
    for (size_t q = 0; q < n[0] * n[1] * n[2]; q++)
        best = x[q] > x[best] ? q : best;
    moving_to_array(&r->world, 0.024 * (double)k, r->world.at_m, at);
    return hypot(v->origin_m->x + 0.01 * (double)(best % n[2]) - at[0],
                 v->origin_m->z + 0.01 * (double)(best / n[2]) - at[2]);
}

static const struct static_array_config each_frame = {.threads = 1,
                                                      .sum = FRAMES_COHERENT};
static const struct static_array_config listening = {
    .threads = 1, .sum = FRAMES_COHERENT, .moving_only = true};
static const struct static_array_config each_ping = {
    .threads = 1, .pings = 3, .sum = FRAMES_POWER, .every_ping = true};

static void a_frame_is_imaged_with_its_last_ping(void **state)
{
    (void)state;
    struct rig r;
    Anlos__Volume v;
    start(&r, true, &each_frame);
    for (size_t k = 0; k < 3 * SPEAKERS; k++)
        assert_int_equal(ping(&r, k), k % SPEAKERS == SPEAKERS - 1);
    steady_image(r.steady, &v);
    assert_int_equal(steady_capture_ns(r.steady), stamp_ns(3 * SPEAKERS - 1));
    assert_int_equal(v.frame, 3);
    assert_int_equal(v.scan, 1);
    assert_int_equal(v.pings_used, SPEAKERS);
    assert_int_equal(v.pings_expected, SPEAKERS);
    assert_int_equal(v.clipped_samples, 8 + 9 + 10 + 11);
    assert_int_equal(v.source, ANLOS__SOURCE__SIMULATION);
    assert_string_equal(v.method, "frames");
    assert_false(v.preview);
    assert_true(off_m(&r, &v, 11) < 0.011);
    assert_int_equal(static_array_motion(steady_array(r.steady)), STATIC_ARRAY_STANDS);
    stop(&r);
}

static void a_frame_without_its_last_ping_is_imaged_with_the_next_ones_first(void **state)
{
    (void)state;
    struct rig r;
    start(&r, true, &each_frame);
    for (size_t k = 0; k < SPEAKERS - 1; k++)
        assert_false(ping(&r, k));
    assert_true(ping(&r, SPEAKERS));
    for (size_t k = SPEAKERS + 1; k < 2 * SPEAKERS; k++)
        assert_int_equal(ping(&r, k), k == 2 * SPEAKERS - 1);
    assert_false(ping(&r, 2 * SPEAKERS));
    stop(&r);
}

/* Images of three pings: the fourth is blanked, in which a sound began with the third. */
static void a_blanked_ping_and_the_one_before_it_are_in_no_image(void **state)
{
    static const size_t used[] = {1, 2, 3, 1, 1, 2, 3, 3};
    static const size_t blanked[] = {0, 0, 0, 2, 2, 1, 0, 0};
    (void)state;
    struct rig r;
    Anlos__Volume v;
    start(&r, true, &each_ping);
    for (size_t k = 0; k < sizeof used / sizeof *used; k++) {
        r.blanked = k == 3;
        memset(r.masked, 0, sizeof r.masked);
        assert_true(ping(&r, k));
        steady_image(r.steady, &v);
        assert_int_equal(v.pings_blanked, blanked[k]);
        assert_int_equal(v.pings_used, used[k]);
        assert_int_equal(v.microphones_masked, 0);
        assert_int_equal(steady_capture_ns(r.steady), stamp_ns(k));
        assert_true(off_m(&r, &v, k) < 0.021);
    }
    stop(&r);
}

static void every_ping_may_have_an_image(void **state)
{
    (void)state;
    struct rig r;
    Anlos__Volume v;
    start(&r, true, &each_ping);
    for (size_t k = 0; k < 2 * SPEAKERS; k++) {
        assert_true(ping(&r, k));
        steady_image(r.steady, &v);
        assert_int_equal(v.pings_used, k < 3 ? k + 1 : 3);
        assert_int_equal(steady_capture_ns(r.steady), stamp_ns(k));
    }
    assert_int_equal(static_array_counts(steady_array(r.steady))->images, 2 * SPEAKERS);
    stop(&r);
}

static void a_vehicle_that_says_how_it_moves_sees_where_things_are(void **state)
{
    (void)state;
    struct rig r;
    Anlos__Volume v;
    start(&r, true, &each_frame);
    r.world.speed_m_s = 2.0;
    r.world.yaw_rate_rad_s = 0.3;
    drive(&r, stamp_ns(4));
    for (size_t k = 0; k < SPEAKERS; k++)
        ping(&r, k);
    steady_image(r.steady, &v);
    assert_int_equal(static_array_motion(steady_array(r.steady)), STATIC_ARRAY_MOVES);
    assert_true(off_m(&r, &v, SPEAKERS - 1) < 0.011);
    stop(&r);
}

static void motion_that_is_no_longer_said_is_unknown_and_counted(void **state)
{
    (void)state;
    struct rig r;
    Anlos__Volume v;
    start(&r, true, &each_frame);
    drive(&r, stamp_ns(0));
    for (size_t k = 0; k < 3 * SPEAKERS; k++)
        ping(&r, k);
    steady_image(r.steady, &v);
    assert_int_equal(static_array_motion(steady_array(r.steady)), STATIC_ARRAY_UNKNOWN);
    assert_int_equal(static_array_counts(steady_array(r.steady))->unknown, 1);
    drive(&r, stamp_ns(13));
    steady_image(r.steady, &v);
    assert_int_equal(static_array_motion(steady_array(r.steady)), STATIC_ARRAY_MOVES);
    assert_int_equal(static_array_counts(steady_array(r.steady))->unknown, 1);
    stop(&r);
}

static void motion_called_invalid_is_not_taken(void **state)
{
    (void)state;
    struct rig r;
    Anlos__Volume v;
    Anlos__EgoMotion m = ANLOS__EGO_MOTION__INIT;
    start(&r, true, &each_frame);
    m.speed_m_s = 2.0;
    steady_ego(r.steady, &m, stamp_ns(0));
    ping(&r, 0);
    steady_image(r.steady, &v);
    assert_int_equal(static_array_motion(steady_array(r.steady)), STATIC_ARRAY_UNKNOWN);
    stop(&r);
}

static void without_a_mount_motion_cannot_be_made_up_for_and_that_is_said(void **state)
{
    (void)state;
    struct rig r;
    Anlos__Volume v;
    start(&r, false, &each_frame);
    drive(&r, stamp_ns(4));
    for (size_t k = 0; k < SPEAKERS; k++)
        ping(&r, k);
    steady_image(r.steady, &v);
    assert_int_equal(static_array_motion(steady_array(r.steady)), STATIC_ARRAY_STANDS);
    stop(&r);
    start(&r, false, &each_frame);
    r.world.speed_m_s = 2.0;
    drive(&r, stamp_ns(4));
    for (size_t k = 0; k < SPEAKERS; k++)
        ping(&r, k);
    steady_image(r.steady, &v);
    assert_int_equal(static_array_motion(steady_array(r.steady)), STATIC_ARRAY_NO_MOUNT);
    stop(&r);
}

static void traces_of_another_survey_are_refused_and_counted(void **state)
{
    (void)state;
    struct rig r;
    start(&r, true, &each_ping);
    r.message->id++;
    assert_false(ping(&r, 0));
    assert_non_null(strstr(r.note, "do not fit"));
    assert_int_equal(static_array_counts(steady_array(r.steady))->unfit, 1);
    r.message->id--;
    assert_true(ping(&r, 1));
    stop(&r);
}

/* The point is 1.5 m away: the gate ends before it, or behind.  Both lengths are of one
 * rate. */
static void traces_may_end_with_the_gate_or_go_on_beyond(void **state)
{
    static const double far_m[] = {1.3, 1.95};
    (void)state;
    for (int k = 0; k < 4; k++) {
        bool beyond = k & 1, heard = beyond || k >> 1;
        struct rig r;
        Anlos__Volume v;
        size_t n[3];
        start_gated(&r, true, &listening, far_m[k >> 1], beyond);
        for (size_t p = 0; p < SPEAKERS; p++)
            assert_int_equal(ping(&r, p), p == SPEAKERS - 1);
        assert_string_equal(r.note, "");
        steady_image(r.steady, &v);
        assert_int_equal(v.pings_used, SPEAKERS);
        const float *x = tensor_f32(v.intensity, 3, n);
        assert_non_null(x);
        assert_true((off_m(&r, &v, SPEAKERS - 1) < 0.011) == heard);
        assert_true((x[(size_t)50 * n[2] + 30] > 0.0f) == heard); /* its place */
        stop(&r);
    }
}

/* Whether or not an array listens beyond its gate. */
static void traces_of_any_other_length_are_refused(void **state)
{
    static const struct static_array_config *const cfgs[] = {&each_frame, &listening};
    (void)state;
    for (int c = 0; c <= 1; c++)
        for (int beyond = 0; beyond <= 1; beyond++)
            for (int more = -1; more <= 1; more++) {
                struct rig r;
                bool fits = more == 0 && beyond <= c;
                start_gated(&r, true, cfgs[c], 1.3, beyond);
                r.more = more;
                ping(&r, 0);
                assert_string_equal(
                    r.note,
                    fits ? "" : "traces that do not fit the survey cannot be used");
                assert_int_equal(static_array_counts(steady_array(r.steady))->unfit,
                                 !fits);
                stop(&r);
            }
}

static void only_with_a_matched_filter_traces_go_on_beyond_the_gate(void **state)
{
    static const enum compression by[] = {COMPRESSION_MATCHED_FILTER, COMPRESSION_DERAMP};
    struct rig r;
    struct image_plan p;
    (void)state;
    start_gated(&r, true, &each_frame, 1.3, false);
    for (int c = 0; c <= 1; c++)
        for (int beyond = 0; beyond <= 1; beyond++) {
            assert_int_equal(image_plan_create(&p, &r.survey, by[c], beyond, NULL), 0);
            double more_s = beyond && c == 0
                                ? 2.0 * PROCESSING_BEYOND_M / r.survey.sound_speed_m_s
                                : 0.0;
            double more = more_s * p.format.rate_hz;
            assert_true(fabs((double)(p.format.n_samples - p.gate_samples) - more) < 1.0);
            assert_true(fabs(p.processing.gate_s[1] - r.processing.gate_s[1] - more_s) <
                        1e-12);
            image_plan_clear(&p);
        }
    stop(&r);
}

static void a_survey_of_a_stage_is_refused(void **state)
{
    (void)state;
    struct rig r;
    struct error why = {""};
    double positions_m[2] = {0.0, 0.1};
    start(&r, true, &each_frame);
    r.survey.n_positions = 2;
    r.survey.stage_positions_m = positions_m;
    Anlos__Survey *moved = message_of(&r.survey);
    assert_int_equal(steady_survey(r.steady, moved, &why), -ENOTSUP);
    assert_non_null(strstr(why.text, "2 positions"));
    assert_memory_equal(why.text, "scan.mode: ", 11); /* as the launch file has it */
    anlos__survey__free_unpacked(moved, NULL);
    stop(&r);
}

static void what_cannot_be_planned_of_a_survey_is_told(void **state)
{
    (void)state;
    struct rig r;
    struct error why = {""};
    struct image_plan p;
    start(&r, true, &each_frame);
    r.survey.gate_m[1] = 100.0;
    assert_int_equal(
        image_plan_create(&p, &r.survey, COMPRESSION_MATCHED_FILTER, true, &why),
        -EINVAL);
    assert_non_null(strstr(why.text, "gate_m: far end 100 m"));
    stop(&r);
}

static float brightest(const Anlos__Volume *v)
{
    size_t n[3];
    const float *x = tensor_f32(v->intensity, 3, n);
    float most = 0.0f;
    for (size_t q = 0; q < n[0] * n[1] * n[2]; q++) {
        assert_true(isfinite(x[q]));
        most = fmaxf(most, x[q]);
    }
    return most;
}

static void image_of(struct rig *r, size_t frame, Anlos__Volume *v)
{
    for (size_t k = frame * SPEAKERS; k < (frame + 1) * SPEAKERS; k++)
        ping(r, k);
    steady_image(r->steady, v);
}

/* The point is beyond the gate, where the third frame's traces end. */
static void what_was_heard_beyond_the_gate_is_in_no_image_of_shorter_traces(void **state)
{
    (void)state;
    struct rig r;
    Anlos__Volume v;
    size_t n[3];
    start_gated(&r, true, &listening, 1.3, false);
    int gate = (int)r.format.n_samples;
    stop(&r);
    start_gated(&r, true, &listening, 1.3, true);
    r.subtracted = true;
    for (size_t frame = 0; frame < 3; frame++) {
        r.more = frame < 2 ? 0 : gate - (int)r.format.n_samples;
        image_of(&r, frame, &v);
        assert_string_equal(r.note, "");
        const float *x = tensor_f32(v.intensity, 3, n);
        assert_non_null(x);
        assert_true((x[(size_t)50 * n[2] + 30] > 0.0f) == (frame < 2));
    }
    stop(&r);
}

static void tell_wall(struct rig *r, double distance_m)
{
    Anlos__WallList list = ANLOS__WALL_LIST__INIT;
    Anlos__Wall wall = ANLOS__WALL__INIT, *walls[1] = {&wall};
    Anlos__Vec3 normal = ANLOS__VEC3__INIT;
    normal.z = 1.0;
    wall.id = 1;
    wall.normal = &normal;
    wall.distance_m = distance_m;
    list.walls = walls;
    list.n_walls = 1;
    assert_int_equal(steady_walls(r->steady, &list, stamp_ns(0), NULL), 0);
    double covariance[5] = {0}; /* no message of a wall: they stay as they are */
    wall.distance_m = 100.0;
    wall.covariance = covariance;
    wall.n_covariance = 5;
    assert_int_equal(steady_walls(r->steady, &list, stamp_ns(0), NULL), -EINVAL);
}

/* The point is imaged 1.5 m away. */
static void what_is_heard_before_the_wall_is_muted(void **state)
{
    (void)state;
    struct rig r;
    Anlos__Volume v;
    start(&r, true, &each_frame);
    tell_wall(&r, 1.0);
    image_of(&r, 0, &v);
    assert_true(off_m(&r, &v, SPEAKERS - 1) < 0.011);
    float whole = brightest(&v);
    tell_wall(&r, 1.7);
    image_of(&r, 1, &v);
    assert_true(brightest(&v) < 1e-4f * whole);
    stop(&r);
}

/* After 0.36 s the point is 1.34 m away, closer than the wall was at first and its echo
 * ends. */
static void the_wall_comes_along_with_the_vehicle(void **state)
{
    (void)state;
    struct rig r;
    Anlos__Volume v;
    start(&r, true, &each_frame);
    r.world.speed_m_s = 1.0;
    r.world.at_m[0] = 5.2;
    drive(&r, stamp_ns(20));
    tell_wall(&r, 1.3);
    image_of(&r, 0, &v);
    assert_true(off_m(&r, &v, SPEAKERS - 1) < 0.011);
    float whole = brightest(&v);
    image_of(&r, 3, &v);
    assert_true(off_m(&r, &v, 4 * SPEAKERS - 1) < 0.011);
    assert_true(brightest(&v) > 0.5f * whole);
    stop(&r);
}

static void what_stands_still_is_muted_and_what_moved_is_not(void **state)
{
    (void)state;
    struct rig r;
    Anlos__Volume v;
    struct static_array_config cfg = each_frame;
    cfg.moving_only = true;
    start(&r, true, &cfg);
    r.world.speed_m_s = 1.0;
    drive(&r, stamp_ns(20));
    image_of(&r, 0, &v);
    assert_true(off_m(&r, &v, SPEAKERS - 1) < 0.011);
    float whole = brightest(&v);
    image_of(&r, 1, &v);
    assert_true(brightest(&v) < 0.01f * whole);
    r.world.at_m[0] += 0.3;
    r.world.at_m[1] -= 0.25;
    image_of(&r, 2, &v);
    assert_true(off_m(&r, &v, 3 * SPEAKERS - 1) < 0.011);
    assert_true(brightest(&v) > 0.5f * whole);
    stop(&r);
}

/* A track node believes what is in an image without what stands. */
static void an_image_says_whether_what_stands_is_left_in_it(void **state)
{
    (void)state;
    struct rig r;
    Anlos__Volume v;
    struct static_array_config cfg = each_frame;
    start(&r, true, &cfg);
    image_of(&r, 0, &v);
    assert_false(v.standing_left || v.standing_taken); /* nobody wanted it */
    stop(&r);
    cfg.moving_only = true;
    start(&r, true, &cfg);
    r.subtracted = true;
    image_of(&r, 0, &v);
    assert_true(!v.standing_left && v.standing_taken);
    r.subtracted = false;
    ping(&r, SPEAKERS);
    r.subtracted = true;
    for (size_t k = SPEAKERS + 1; k < 2 * SPEAKERS; k++)
        ping(&r, k);
    steady_image(r.steady, &v);
    assert_true(v.standing_left && !v.standing_taken);
    image_of(&r, 2, &v);
    assert_true(!v.standing_left && v.standing_taken);
    stop(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_frame_is_imaged_with_its_last_ping),
        cmocka_unit_test(what_is_heard_before_the_wall_is_muted),
        cmocka_unit_test(the_wall_comes_along_with_the_vehicle),
        cmocka_unit_test(what_stands_still_is_muted_and_what_moved_is_not),
        cmocka_unit_test(an_image_says_whether_what_stands_is_left_in_it),
        cmocka_unit_test(
            a_frame_without_its_last_ping_is_imaged_with_the_next_ones_first),
        cmocka_unit_test(every_ping_may_have_an_image),
        cmocka_unit_test(a_blanked_ping_and_the_one_before_it_are_in_no_image),
        cmocka_unit_test(a_vehicle_that_says_how_it_moves_sees_where_things_are),
        cmocka_unit_test(motion_that_is_no_longer_said_is_unknown_and_counted),
        cmocka_unit_test(motion_called_invalid_is_not_taken),
        cmocka_unit_test(without_a_mount_motion_cannot_be_made_up_for_and_that_is_said),
        cmocka_unit_test(traces_may_end_with_the_gate_or_go_on_beyond),
        cmocka_unit_test(what_was_heard_beyond_the_gate_is_in_no_image_of_shorter_traces),
        cmocka_unit_test(traces_of_any_other_length_are_refused),
        cmocka_unit_test(only_with_a_matched_filter_traces_go_on_beyond_the_gate),
        cmocka_unit_test(traces_of_another_survey_are_refused_and_counted),
        cmocka_unit_test(a_survey_of_a_stage_is_refused),
        cmocka_unit_test(what_cannot_be_planned_of_a_survey_is_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
