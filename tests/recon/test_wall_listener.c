/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "hal/room/room.h"
#include "msgs/convert.h"
#include "recon/walls/wall_finder.h"
#include "recon/walls/wall_listener.h"
#include "recon/walls/wall_receiver.h"
#include "tests/nodes/near.h"
#include "tests/nodes/scene.h"

#define SECOND 1000000000LL

static const struct wall_listener_config config = {
    .vertical = true, .vertical_rad = 0.035, .reach_m = 4.0, .every_s = 0.5};

struct hall {
    struct scene scene;
    struct survey survey;
    struct wall_receiver receiver;
    struct wall_listener *listener;
    int64_t now_ns;
};

/* A scene as text; {0}: not to be opened. */
static void open_hall(struct hall *h, const char *text,
                      const struct wall_listener_config *cfg)
{
    char path[] = "/tmp/anlos-wall-XXXXXX";
    struct error why = {""};
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, strlen(text)), (ssize_t)strlen(text));
    close(fd);
    *h = (struct hall){.now_ns = SECOND};
    int err = scene_open(&h->scene, path);
    unlink(path);
    assert_int_equal(err, 0);
    assert_int_equal(survey_from_message(&h->survey, h->scene.survey, &why), 0);
    if (wall_receiver_open(&h->receiver, &h->survey, cfg->reach_m, NULL, &why) ||
        wall_listener_create(&h->listener, cfg, &h->survey, &why))
        fail_msg("%s", why.text);
}

static void close_hall(struct hall *h)
{
    wall_listener_destroy(h->listener);
    wall_receiver_clear(&h->receiver);
    survey_clear(&h->survey);
    scene_close(&h->scene);
}

static bool take(struct hall *h, const Anlos__Ping *m, int64_t capture_ns,
                 const struct ego_path *path, struct wall_estimates *out, bool *blind)
{
    struct wall_returns returns;
    struct ping ping;
    ping_from_message(&ping, m, capture_ns);
    wall_receiver_take(&h->receiver, &ping, NULL, &returns);
    return wall_listener_take(h->listener, &returns, path, out, blind);
}

/* One ping; the next one is 25 ms later. */
static bool hear(struct hall *h, uint32_t position, uint32_t speaker,
                 struct wall_estimates *out)
{
    Anlos__Ping ping;
    bool blind;
    scene_ping(&h->scene, ANLOS__PASS__SCENE, position, speaker, &ping);
    bool done = take(h, &ping, h->now_ns, NULL, out, &blind);
    assert_false(done && blind);
    h->now_ns += SECOND / 40;
    return done;
}

#define BUMPER                                                                           \
    "array: bumper\ntemperature_c: 20\nseed: 3\nlevel: 0.03\n"                           \
    "objects: [{name: p, kind: point, position_m: [0, 0.3, 0.2], "                       \
    "scattering_length_m: 0.05}]\n"
#define ROOM                                                                             \
    "clutter: {points: 30, scattering_length_m: 0.03, near_m: 1, far_m: 5}\n"            \
    "errors: {gain_db: 0.5, element_m: 0.0005}\nnoise: {rms: 0.0001}\n"

/* 1.3 m away, its normal 20 degrees to the side. */
static void a_bumper_hears_the_wall_that_it_stands_before(void **state)
{
    (void)state;
    struct hall h;
    struct wall_estimates found = {.n = 0};
    open_hall(&h,
              BUMPER ROOM "wall: {normal: [0.342020143, 0, 0.939692621], "
                          "distance_m: 1.3}\n"
                          "wall_sound: {reflectivity: 0.9, echo: 0.7, patches: 50, "
                          "scattering_length_m: 0.01, roughness_m: 0.02}\n",
              &config);
    for (uint32_t k = 0; k < 16; k++)
        assert_int_equal(hear(&h, 0, k, &found), k == 15);
    assert_int_equal(found.n, 1);
    const struct wall *w = &found.list[0].wall;
    assert_near(atan2(w->normal[0], w->normal[2]), 20 * M_PI / 180, 0.003);
    assert_near(w->distance_m, 1.3, 0.004);
    assert_near(sqrt(w->covariance[3]), 0.035, 0.001); /* the prior's */
    assert_true(sqrt(w->covariance[5]) < 0.005);
    close_hall(&h);
}

static void where_no_wall_sounds_none_is_found(void **state)
{
    (void)state;
    struct hall h;
    struct wall_estimates found = {.n = 1};
    open_hall(&h, BUMPER ROOM "wall: {normal: [0, 0, 1], distance_m: 1.3}\n", &config);
    for (uint32_t k = 0; k < 16; k++)
        hear(&h, 0, k, &found);
    assert_int_equal(found.n, 0);
    close_hall(&h);
}

/* A microphone that is dead says nothing, also not that there is no wall. */
static void dead_microphones_do_not_speak_against_a_wall(void **state)
{
    (void)state;
    struct hall h;
    struct wall_estimates found = {.n = 0};
    open_hall(&h,
              BUMPER "wall: {normal: [0, 0, 1], distance_m: 1.3}\n"
                     "wall_sound: {reflectivity: 0.9, echo: 0.7}\n",
              &config);
    for (uint32_t k = 0; k < 16; k++) {
        Anlos__Ping m;
        bool blind;
        scene_ping(&h.scene, ANLOS__PASS__SCENE, 0, k, &m);
        for (size_t i = 0; i < 16; i++)
            if (i % 4)
                memset(h.scene.samples + i * h.scene.n_samples, 0,
                       h.scene.n_samples * sizeof *h.scene.samples);
        assert_int_equal(take(&h, &m, h.now_ns, NULL, &found, &blind), k == 15);
        h.now_ns += SECOND / 40;
    }
    assert_int_equal(found.n, 1);
    assert_near(found.list[0].wall.distance_m, 1.3, 0.004);
    assert_near(found.list[0].share, 1.0, 0.2);
    close_hall(&h);
}

static void looks_are_as_far_apart_as_they_are_to_be(void **state)
{
    (void)state;
    struct hall h;
    struct wall_estimates found;
    unsigned looks = 0;
    open_hall(&h,
              BUMPER "wall: {normal: [0, 0, 1], distance_m: 1.3}\n"
                     "wall_sound: {reflectivity: 0.9, echo: 0.7}\n",
              &config);
    for (uint32_t k = 0; k < 60; k++) /* 1.5 s: at 0, 0.5 and 1.0 a look of 0.4 begins */
        looks += hear(&h, 0, k % 16, &found);
    assert_int_equal(looks, 3);
    close_hall(&h);
}

static void pings_that_cannot_be_used_are_counted(void **state)
{
    (void)state;
    struct hall h;
    struct wall_estimates found;
    bool blind;
    open_hall(&h, BUMPER "wall: {normal: [0, 0, 1], distance_m: 1.3}\n", &config);
    for (int k = 0; k < 5; k++) {
        Anlos__Ping ping;
        scene_ping(&h.scene, ANLOS__PASS__SCENE, 0, 0, &ping);
        if (k == 0)
            ping.valid = false;
        else if (k == 1)
            ping.survey_id++;
        else if (k == 2)
            ping.samples = NULL;
        else if (k == 3)
            ping.speaker = 16;
        else
            ping.down = true; /* of a survey without */
        take(&h, &ping, h.now_ns, NULL, &found, &blind);
        assert_int_equal(wall_listener_unusable(h.listener), k + 1);
    }
    close_hall(&h);
}

/* An upright line that goes along a stage: the tilt is heard, and after some places the
 * azimuth too.  No prior. */
static void a_scan_hears_both_turns_of_a_wall(void **state)
{
    (void)state;
    struct hall h;
    struct wall_estimates found = {.n = 0}, first = {.n = 9};
    struct wall_listener_config cfg = config;
    cfg.vertical = false;
    cfg.every_s = 0.1;
    open_hall(&h,
              "sound_speed_m_s: 343\nsample_rate_hz: 48000\n"
              "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.02}\n"
              "slot_samples: 1200\nseed: 1\nlevel: 0.03\n"
              "speakers_m: [[0, 0, 0], [0, 0.25, 0], [0, 0.5, 0], [0, 0.75, 0]]\n"
              "microphones_m: [[0, 0.1, 0], [0, 0.35, 0], [0, 0.6, 0], "
              "[0, 0.85, 0]]\n"
              "stage: {axis: [1, 0, 0], positions_m: [0, 0.2, 0.4, 0.6]}\n"
              "objects: [{name: p, kind: point, position_m: [0, 0.3, 0.2], "
              "scattering_length_m: 0.05}]\nnoise: {rms: 0.0001}\n"
              "wall: {normal: [0.3, -0.1, 0.948683298], distance_m: 1.5}\n"
              "wall_sound: {reflectivity: 0.9, echo: 0.7}\n",
              &cfg);
    for (uint32_t p = 0; p < 4; p++)
        for (uint32_t k = 0; k < 4; k++)
            if (hear(&h, p, k, &found) && first.n == 9)
                first = found;
    assert_int_equal(first.n, 0); /* of one place */
    assert_int_equal(found.n, 1);
    const struct wall *w = &found.list[0].wall;
    assert_near(w->normal[0], 0.3, 0.002);
    assert_near(w->normal[1], -0.1, 0.002);
    assert_near(w->distance_m, 1.5, 0.004);
    close_hall(&h);
}

#define BESIDE                                                                           \
    "array: bumper\ntemperature_c: 20\nseed: 3\nlevel: 0.03\ndirect_level: 0.3\n"        \
    "objects: [{name: p, kind: point, position_m: [0, 0.3, 0.2], "                       \
    "scattering_length_m: 0.05}]\ntogether: 2\n"

/* A round of two speakers at a time, each slot with what rings on of the one before; the
 * walls that are heard. */
static void hear_two_at_a_time(const char *wall, double chirp_s,
                               struct wall_estimates *found)
{
    char text[1024];
    struct hall h;
    struct room_stream *stream;
    uint32_t speakers[16];
    snprintf(text, sizeof text,
             BESIDE ROOM "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: %g, "
                         "alternates: true}\n"
                         "wall: {%s}\n"
                         "wall_sound: {reflectivity: 0.9, echo: 0.7}\n",
             chirp_s, wall);
    open_hall(&h, text, &config);
    for (uint32_t k = 0; k < 16; k++)
        speakers[k] = k;
    const struct room_stream_config cfg = {
        .pass = PASS_SCENE, .speakers = speakers, .n_speakers = 16};
    assert_int_equal(room_stream_create(&stream, h.scene.room, &cfg), 0);
    for (uint32_t k = 0; k < 16; k++) {
        Anlos__Ping ping;
        const float *samples;
        bool blind;
        scene_ping(&h.scene, ANLOS__PASS__SCENE, 0, k, &ping);
        assert_int_equal(room_stream_ping(stream, k, &samples), 0);
        ping.samples =
            tensor_borrow_f32(&h.scene.view, samples, 2, (size_t)16, h.scene.n_samples);
        ping.down = k % 2;
        double t = (double)room_stream_start(stream, k) / h.survey.sample_rate_hz;
        assert_int_equal(
            take(&h, &ping, SECOND + (int64_t)(1e9 * t), NULL, found, &blind), k == 15);
    }
    room_stream_destroy(stream);
    close_hall(&h);
}

/* 1 m away, 45 degrees aside; 2.2 m, straight ahead; 3 m, 20 degrees aside. */
static void two_speakers_at_a_time_hear_the_wall_as_one_does(void **state)
{
    (void)state;
    static const char *const walls[] = {
        "normal: [-0.707106781, 0, 0.707106781], distance_m: 1",
        "normal: [0, 0, 1], distance_m: 2.2",
        "normal: [0.342020143, 0, 0.939692621], distance_m: 3"};
    static const double truth[][2] = {{-45, 1}, {0, 2.2}, {20, 3}};
    for (size_t i = 0; i < 3; i++) {
        struct wall_estimates found = {.n = 0};
        hear_two_at_a_time(walls[i], 0.02, &found);
        assert_int_equal(found.n, 1);
        const struct wall *w = &found.list[0].wall;
        assert_near(atan2(w->normal[0], w->normal[2]) * 180 / M_PI, truth[i][0], 0.2);
        assert_near(w->distance_m, truth[i][1], 0.002);
    }
}

static void two_short_chirps_at_a_time_hear_the_wall_too(void **state)
{
    (void)state;
    struct wall_estimates found = {.n = 0};
    hear_two_at_a_time("normal: [0, 0, 1], distance_m: 2.2", 0.01, &found);
    assert_int_equal(found.n, 1);
    assert_near(found.list[0].wall.distance_m, 2.2, 0.002);
}

/* The slot before still sounds then. */
static void open_short_slots(struct hall *h)
{
    struct error why = {""};
    open_hall(h, BUMPER "gate_m: [0.5, 3]\nwall: {normal: [0, 0, 1], distance_m: 1.3}\n",
              &config);
    h->survey.chirp_alternates = true;
    h->survey.together = 2;
    h->survey.slot_samples = 900;
    assert_int_equal(survey_check(&h->survey, &why), 0);
}

static void two_chirps_longer_than_their_slot_are_refused(void **state)
{
    (void)state;
    struct hall h;
    struct wall_listener *listener = NULL;
    struct error why = {""};
    open_short_slots(&h);
    assert_int_equal(wall_listener_create(&listener, &config, &h.survey, &why), -EINVAL);
    assert_null(listener);
    assert_non_null(strstr(why.text, "use longer slots"));
    close_hall(&h);
}

/* A survey comes every second: the second one must not pass for heard. */
static void what_was_refused_is_refused_again(void **state)
{
    (void)state;
    const struct wall_finder_config cfg = {
        .map = {.from = WALL_FROM_ECHOES, .lost_s = 3.0}, .listener = config};
    struct hall h;
    struct wall_finder *finder;
    int64_t stamp_ns;
    open_short_slots(&h);
    assert_int_equal(wall_finder_create(&finder, &cfg), 0);
    for (int k = 0; k < 2; k++) {
        struct error why = {""};
        assert_int_equal(wall_finder_survey(finder, &h.survey, &why), -EINVAL);
        assert_non_null(strstr(why.text, "use longer slots"));
        assert_true(wall_finder_survey_id(finder) == 0);
        assert_null(wall_finder_list(finder, 10 * SECOND, &stamp_ns));
    }
    h.survey.slot_samples = 4800;
    struct error why = {""};
    assert_int_equal(wall_finder_survey(finder, &h.survey, &why), 0);
    assert_true(wall_finder_survey_id(finder) == survey_id(&h.survey));
    assert_non_null(wall_finder_list(finder, 10 * SECOND, &stamp_ns));
    wall_finder_destroy(finder);
    close_hall(&h);
}

/* When the finder is asked and what stamp its list has; 0: it has none to tell. */
static int64_t list_stamp_ms(struct wall_finder *f, int64_t now_ms)
{
    int64_t stamp_ns;
    return wall_finder_list(f, now_ms * 1000000, &stamp_ns) ? stamp_ns / 1000000 : 0;
}

static bool find_ping(struct wall_finder *f, struct hall *h, int64_t capture_ms,
                      int64_t now_ms)
{
    Anlos__Ping m;
    struct wall_returns returns;
    struct ping ping;
    scene_ping(&h->scene, ANLOS__PASS__SCENE, 0, 0, &m);
    ping_from_message(&ping, &m, capture_ms * 1000000);
    wall_receiver_take(&h->receiver, &ping, NULL, &returns);
    return wall_finder_returns(f, &returns, now_ms * 1000000);
}

/* Ten a second at most, of the newest ping; after a second without any, of the present.
 */
static void what_is_heard_is_told_as_of_its_ping_until_pings_end(void **state)
{
    (void)state;
    const struct wall_finder_config cfg = {
        .map = {.from = WALL_FROM_ECHOES, .lost_s = 3.0}, .listener = config};
    struct hall h;
    struct wall_finder *f;
    open_hall(&h, BUMPER "wall: {normal: [0, 0, 1], distance_m: 1.3}\n", &config);
    assert_int_equal(wall_finder_create(&f, &cfg), 0);
    assert_false(find_ping(f, &h, 9000, 9000)); /* before the survey */
    assert_int_equal(list_stamp_ms(f, 9000), 0);
    assert_int_equal(wall_finder_survey(f, &h.survey, NULL), 0);
    assert_int_equal(list_stamp_ms(f, 10000), 10000); /* none was heard yet */
    assert_int_equal(list_stamp_ms(f, 10099), 0);
    assert_int_equal(list_stamp_ms(f, 10100), 10100);
    assert_true(find_ping(f, &h, 10080, 10120));
    assert_int_equal(list_stamp_ms(f, 10120), 10080); /* the first: at once */
    assert_true(find_ping(f, &h, 10130, 10190));
    assert_int_equal(list_stamp_ms(f, 10190), 0);
    assert_true(find_ping(f, &h, 10180, 10220));
    assert_int_equal(list_stamp_ms(f, 10220), 10180);
    assert_int_equal(list_stamp_ms(f, 11219), 0);
    assert_int_equal(list_stamp_ms(f, 11220), 11220);
    wall_finder_destroy(f);
    close_hall(&h);
}

static void walls_of_the_survey_need_no_ears(void **state)
{
    (void)state;
    const struct wall_finder_config cfg = {
        .map = {.from = WALL_FROM_SURVEY, .lost_s = 3.0}, .listener = config};
    struct hall h;
    struct wall_finder *f;
    int64_t stamp_ns;
    open_hall(&h, BUMPER "wall: {normal: [0, 0, 1], distance_m: 1.3}\n", &config);
    assert_int_equal(wall_finder_create(&f, &cfg), 0);
    assert_int_equal(wall_finder_survey(f, &h.survey, NULL), 0);
    assert_false(find_ping(f, &h, 1000, 1000));
    const struct walls *list = wall_finder_list(f, SECOND, &stamp_ns);
    assert_non_null(list);
    assert_int_equal(stamp_ns, SECOND);
    assert_int_equal(list->n, 1);
    assert_near(list->list[0].plane.distance_m, 1.3, 1e-12);
    assert_int_equal(list_stamp_ms(f, 1099), 0);
    assert_int_equal(list_stamp_ms(f, 500), 500); /* time begins again */
    wall_finder_destroy(f);
    close_hall(&h);
}

/* As far as asked for, by the longest way from a speaker to a microphone, but not into
 * the half millisecond before the next emission. */
static void walls_are_looked_for_until_the_next_emission(void **state)
{
    (void)state;
    struct wall_receiver r = {0};
    struct hall h;
    double longest_m = 0.0;
    open_hall(&h, BUMPER "wall: {normal: [0, 0, 1], distance_m: 1.3}\n", &config);
    const struct survey *s = &h.survey;
    for (size_t j = 0; j < s->n_speakers; j++)
        for (size_t i = 0; i < s->n_microphones; i++)
            longest_m =
                fmax(longest_m, geometry_distance(s->speakers_m[j], s->microphones_m[i]));
    double slot_s = (double)s->slot_samples / s->sample_rate_hz;
    assert_int_equal(wall_receiver_open(&r, s, 1.5, NULL, NULL), 0);
    assert_near(r.until_s, (3.0 + longest_m) / s->sound_speed_m_s, 1e-12);
    wall_receiver_clear(&r);
    r = (struct wall_receiver){0};
    assert_int_equal(wall_receiver_open(&r, s, 100.0, NULL, NULL), 0);
    assert_near(r.until_s, slot_s - 0.0005, 1e-12);
    wall_receiver_clear(&r);
    close_hall(&h);
}

/* The vehicle comes nearer by up to 2 m/s; the room tells where the wall is then. */
static void a_moving_array_hears_the_wall_where_it_is_now(void **state)
{
    (void)state;
    static struct ego_path path;
    struct hall h;
    struct room_stream *stream;
    uint32_t speakers[16];
    unsigned looks = 0;
    double pushed_s = 0.0;
    open_hall(&h,
              BUMPER "wall: {normal: [0.1, 0, 0.994987437], distance_m: 3.5}\n"
                     "mount: {origin_m: [3, 0, 0.4], x_axis: [0, 1, 0], "
                     "y_axis: [0, 0, 1]}\n"
                     "drive: {period_s: 4, ego: [{t_s: 0, speed_m_s: 0}, "
                     "{t_s: 0.3, speed_m_s: 2}, {t_s: 0.9, speed_m_s: 2}, "
                     "{t_s: 1.2, speed_m_s: 0}, {t_s: 2, speed_m_s: 0}, "
                     "{t_s: 2.3, speed_m_s: -2}, {t_s: 2.9, speed_m_s: -2}, "
                     "{t_s: 3.2, speed_m_s: 0}]}\n"
                     "wall_sound: {reflectivity: 0.9, echo: 0.7}\n"
                     "noise: {rms: 0.0001}\n",
              &config);
    for (uint32_t k = 0; k < 16; k++)
        speakers[k] = k;
    const struct room_stream_config cfg = {
        .pass = PASS_SCENE, .speakers = speakers, .n_speakers = 16};
    assert_int_equal(room_stream_create(&stream, h.scene.room, &cfg), 0);
    for (uint64_t e = 0; e < 64; e++) { /* 1.5 s */
        Anlos__Ping ping;
        const float *samples;
        struct wall_estimates found;
        bool blind;
        double t = (double)room_stream_start(stream, e) / h.survey.sample_rate_hz;
        for (; pushed_s < t + 0.04; pushed_s += 0.02) {
            struct room_ego ego;
            room_ego(h.scene.room, pushed_s, &ego);
            const struct ego_motion motion = {ego.speed_m_s, ego.yaw_rate_rad_s};
            ego_path_add(&path, SECOND + (int64_t)(1e9 * pushed_s), &motion);
        }
        assert_int_equal(room_stream_ping(stream, e, &samples), 0);
        scene_ping(&h.scene, ANLOS__PASS__SCENE, 0, (uint32_t)(e % 16), &ping);
        ping.samples =
            tensor_borrow_f32(&h.scene.view, samples, 2, (size_t)16, h.scene.n_samples);
        if (!take(&h, &ping, SECOND + (int64_t)(1e9 * t), &path, &found, &blind))
            continue;
        double normal[3], distance_m;
        room_wall(h.scene.room, t, normal, &distance_m);
        looks++;
        assert_false(blind);
        assert_int_equal(found.n, 1);
        assert_near(found.list[0].wall.distance_m, distance_m, 0.008);
        assert_near(found.list[0].wall.normal[0], normal[0], 0.006);
    }
    assert_true(looks >= 3);
    room_stream_destroy(stream);
    close_hall(&h);
}

/* Nobody has told how it moves for longer than that counts as known. */
static void a_look_without_ego_motion_is_blind(void **state)
{
    (void)state;
    static struct ego_path path;
    struct hall h;
    struct wall_estimates found;
    bool blind = false, done = false;
    open_hall(&h,
              BUMPER "wall: {normal: [0, 0, 1], distance_m: 1.3}\n"
                     "wall_sound: {reflectivity: 0.9, echo: 0.7}\n",
              &config);
    for (uint32_t k = 0; k < 16; k++) {
        Anlos__Ping ping;
        scene_ping(&h.scene, ANLOS__PASS__SCENE, 0, k, &ping);
        done = take(&h, &ping, h.now_ns, &path, &found, &blind);
        h.now_ns += SECOND / 40;
    }
    assert_true(done && blind);
    close_hall(&h);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_bumper_hears_the_wall_that_it_stands_before),
        cmocka_unit_test(where_no_wall_sounds_none_is_found),
        cmocka_unit_test(dead_microphones_do_not_speak_against_a_wall),
        cmocka_unit_test(looks_are_as_far_apart_as_they_are_to_be),
        cmocka_unit_test(pings_that_cannot_be_used_are_counted),
        cmocka_unit_test(a_scan_hears_both_turns_of_a_wall),
        cmocka_unit_test(a_moving_array_hears_the_wall_where_it_is_now),
        cmocka_unit_test(two_speakers_at_a_time_hear_the_wall_as_one_does),
        cmocka_unit_test(two_short_chirps_at_a_time_hear_the_wall_too),
        cmocka_unit_test(two_chirps_longer_than_their_slot_are_refused),
        cmocka_unit_test(what_was_refused_is_refused_again),
        cmocka_unit_test(what_is_heard_is_told_as_of_its_ping_until_pings_end),
        cmocka_unit_test(walls_of_the_survey_need_no_ears),
        cmocka_unit_test(walls_are_looked_for_until_the_next_emission),
        cmocka_unit_test(a_look_without_ego_motion_is_blind),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
