/* SPDX-License-Identifier: MIT */
/* What a drive says of itself: where its vehicle and objects are, and what is in view. */
#include "drive.h"

#include <errno.h>
#include <math.h>

#include "hal/room/figure.h"
#include "hal/room/scene.h"

#define BASE DRIVE_TIMING DRIVE_PAIR DRIVE_WALL

static void assert_near(double found, double expected, double tolerance)
{
    if (!(fabs(found - expected) <= tolerance))
        fail_msg("%.9g is not %.9g", found, expected);
}

/* 2 m/s and 36 degrees a second are a circle of 10 s and a radius of 3.183 m. */
static void a_constant_turn_is_a_circle(void **state)
{
    struct room *r = drive_load(state,
                                BASE "drive: {period_s: 12, ego: "
                                     "[{t_s: 0, speed_m_s: 2, yaw_rate_deg_s: 36}]}\n");
    double radius = 10 / M_PI;
    for (double t = 0; t < 12; t += 0.37) {
        struct room_ego e;
        double yaw = t * M_PI / 5;
        room_ego(r, t, &e);
        assert_near(e.x_m, radius * sin(yaw), 1e-7);
        assert_near(e.y_m, radius * (1 - cos(yaw)), 1e-7);
        assert_near(e.yaw_rad, yaw, 1e-9);
        assert_true(e.speed_m_s == 2 && !e.standstill);
    }
    room_destroy(r);
}

/* From 0 to 2 m/s in a second, on for a second, and from there to a stop in half of one:
 * 1 + 2 + 0.5 m. */
static void speed_goes_straight_from_knot_to_knot(void **state)
{
    struct room *r = drive_load(state,
                                BASE "drive: {period_s: 8, ego: [{t_s: 1, speed_m_s: 0}, "
                                     "{t_s: 2, speed_m_s: 2}, {t_s: 3, speed_m_s: 2}, "
                                     "{t_s: 3.5, speed_m_s: 0}]}\n");
    static const double expected[][3] = {/* t, speed, x */
                                         {0.5, 0, 0},      {1.5, 1, 0.25}, {2.5, 2, 2},
                                         {3.25, 1, 3.375}, {6, 0, 3.5},    {8.5, 0, 0},
                                         {-4.75, 1, 3.375}};
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
        struct room_ego e;
        room_ego(r, expected[i][0], &e);
        assert_near(e.speed_m_s, expected[i][1], 1e-9);
        assert_near(e.x_m, expected[i][2], 1e-6);
        assert_true(e.standstill == (expected[i][1] == 0));
    }
    assert_near(room_period_s(r), 8, 0);
    assert_near(room_time_s(r, INT64_C(1700000003250000000)), 3.25, 1e-9);
    room_destroy(r);
}

/* The array is at (3.6, 0.2) in the vehicle and looks forward at a wall 2 m ahead. */
static void the_wall_moves_as_the_vehicle_does(void **state)
{
    struct room *r = drive_load(state,
                                BASE "drive: {period_s: 10, ego: "
                                     "[{t_s: 0, speed_m_s: 0.5, yaw_rate_deg_s: 10}]}\n");
    double normal[3], distance;
    room_wall(r, 0, normal, &distance);
    assert_near(normal[2], 1, 1e-12);
    assert_near(distance, 2, 1e-12);
    struct room_ego e;
    room_ego(r, 2, &e);
    room_wall(r, 2, normal, &distance);
    double yaw = 20 * M_PI / 180;
    /* What was ahead is to the right now: at less x, which points to the left. */
    assert_near(normal[0], -sin(yaw), 1e-9);
    assert_near(normal[1], 0, 1e-9);
    assert_near(normal[2], cos(yaw), 1e-9);
    double array_x = e.x_m + 3.6 * cos(yaw) - 0.2 * sin(yaw);
    assert_near(distance, 3.6 + 2 - array_x, 1e-6);
    room_destroy(r);
}

static const char moving[] = BASE
    "drive: {period_s: 10, ego: [{t_s: 0, speed_m_s: 0.5, yaw_rate_deg_s: 10}]}\n"
    "objects:\n  - name: p\n    kind: person\n    present_s: [0, 9]\n"
    "    path: [{t_s: 0, position_m: [-4, 0.5, -1]}, "
    "{t_s: 8, position_m: [4, 0.5, 0]}]\n";

/* A place over ground, in the vehicle frame of now. */
static void to_vehicle(const struct room_ego *e, double x, double y, double out[2])
{
    double dx = x - e->x_m, dy = y - e->y_m, c = cos(e->yaw_rad), s = sin(e->yaw_rad);
    out[0] = c * dx + s * dy;
    out[1] = -s * dx + c * dy;
}

static void objects_are_told_in_the_vehicles_frame_of_now(void **state)
{
    struct room *r = drive_load(state, moving);
    for (double t = 0.1; t < 7.9; t += 0.4) {
        struct room_truth truth;
        struct room_ego e;
        double p[2], q[2];
        assert_int_equal(room_truth(r, t, &truth, 1), 1);
        room_ego(r, t, &e);
        /* Array x is to the left, z forward: (3.6 + z, 0.2 + x). */
        to_vehicle(&e, 3.6 - 1 + t / 8, 0.2 - 4 + t, p);
        assert_near(truth.position_m[0], p[0], 1e-9);
        assert_near(truth.position_m[1], p[1], 1e-9);
        assert_near(truth.position_m[2], 0.4 + 0.5, 1e-9);
        to_vehicle(&e, 3.6 - 1 + (t + 0.01) / 8, 0.2 - 4 + t + 0.01, q);
        assert_near(truth.velocity_m_s[0], (q[0] - p[0]) / 0.01, 1e-6);
        assert_near(truth.velocity_m_s[1], (q[1] - p[1]) / 0.01, 1e-6);
        assert_near(truth.velocity_m_s[2], 0, 1e-9);
        assert_near(truth.extent_m[2], 1.75, 1e-9);
        assert_true(truth.extent_m[1] > 0.3 && truth.extent_m[1] < 1);
        assert_string_equal(truth.kind, "person");
    }
    room_destroy(r);
}

/* The image is as far behind the wall of now as the object is before it. */
static void the_image_is_behind_the_wall_of_now(void **state)
{
    struct room *r = drive_load(state, moving);
    struct room_truth truth;
    double normal[3], distance, p[3], middle = 0, along = 0;
    assert_int_equal(room_truth(r, 4, &truth, 1), 1);
    room_wall(r, 4, normal, &distance);
    p[0] = truth.position_m[1] - 0.2; /* the array's frame from the vehicle's */
    p[1] = truth.position_m[2] - 0.4;
    p[2] = truth.position_m[0] - 3.6;
    for (int k = 0; k < 3; k++) {
        middle += normal[k] * (p[k] + truth.virtual_m[k]) / 2;
        along += normal[k] * (truth.virtual_m[k] - p[k]);
    }
    assert_near(middle, distance, 1e-9);
    double way = hypot(hypot(truth.virtual_m[0] - p[0], truth.virtual_m[1] - p[1]),
                       truth.virtual_m[2] - p[2]);
    assert_near(fabs(along), way, 1e-9);
    room_destroy(r);
}

/* Seen from the middle of the pair at (0.005, 0) past the corner at (-0.6, 0.9): what
 * walks at z = 1.3 comes into view where the line gets there, and goes behind the other
 * building edge never. */
static void lines_of_sight_pass_corners_when_geometry_says(void **state)
{
    struct room *r = drive_load(
        state, BASE "drive: {period_s: 10}\n"
                    "building: [[-0.6, 0.9], [-9, 0.9], [-9, -6], [-0.6, -6]]\n"
                    "objects:\n  - name: p\n    kind: person\n    present_s: [1, 9]\n"
                    "    path: [{t_s: 2, position_m: [-3, 0.5, 1.3]}, "
                    "{t_s: 8, position_m: [3, 0.5, 1.3]}]\n");
    double at_x = 0.005 + (-0.6 - 0.005) / 0.9 * 1.3, at_s = 2 + (at_x + 3);
    struct room_truth truth;
    assert_int_equal(room_truth(r, 0.9, &truth, 1), 0);
    assert_int_equal(room_truth(r, 9.1, &truth, 1), 0);
    assert_int_equal(room_truth(r, 1.5, &truth, 1), 1);
    assert_false(truth.line_of_sight);
    assert_near(truth.until_sight_s, at_s - 1.5, 1e-6);
    assert_int_equal(room_truth(r, at_s - 0.001, &truth, 1), 1);
    assert_false(truth.line_of_sight);
    assert_int_equal(room_truth(r, at_s + 0.001, &truth, 1), 1);
    assert_true(truth.line_of_sight && truth.until_sight_s == 0);
    assert_int_equal(room_truth(r, 8.9, &truth, 0), 1);
    room_destroy(r);
}

static void what_never_comes_into_view_says_so(void **state)
{
    struct room *r = drive_load(
        state, BASE "drive: {period_s: 10}\n"
                    "building: [[-0.6, 0.9], [-9, 0.9], [-9, -6], [-0.6, -6]]\n"
                    "objects:\n  - {name: b, kind: point, position_m: [-3, 0, 1.2], "
                    "scattering_length_m: 0.1}\n");
    struct room_truth truth;
    assert_int_equal(room_truth(r, 3, &truth, 1), 1);
    assert_true(!truth.line_of_sight && isnan(truth.until_sight_s));
    room_destroy(r);
}

/* The points' squares add up, and the foot that stands does not slip. */
static void a_person_adds_up_and_walks_on_his_feet(void **state)
{
    struct figure_pose pose = {.heading = {1, 0, 0}, .up = {0, 0, 1}};
    struct scatter_piece a[FIGURE_MAX], b[FIGURE_MAX];
    double extent[3], slowest = INFINITY, sum = 0;
    size_t n = figure_size(SCENE_PERSON, false);
    (void)state;
    assert_true(n >= 10 && n <= FIGURE_MAX &&
                figure_size(SCENE_CAR, false) <= FIGURE_MAX &&
                figure_size(SCENE_CYCLIST, false) <= FIGURE_MAX);
    assert_int_equal(figure_size(SCENE_CORNER, false), 0);
    figure_set(SCENE_PERSON, &pose, 0.14, a);
    pose.walked_m = pose.centre_m[0] = 0.01;
    figure_set(SCENE_PERSON, &pose, 0.14, b);
    for (size_t i = 0; i < n; i++) {
        sum += a[i].weight * a[i].weight;
        slowest = fmin(slowest, fabs(b[i].in[0] - a[i].in[0]));
        assert_true(fabs(a[i].in[0]) < 0.4 && fabs(a[i].in[1]) <= 0.25 &&
                    fabs(a[i].in[2]) <= 0.875);
    }
    assert_near(sqrt(sum), 0.14, 1e-12);
    assert_true(slowest < 0.001); /* while he goes on 0.01 */
    figure_extent(SCENE_PERSON, &pose, extent);
    assert_near(extent[0], 0.3, 1e-12);
    assert_near(extent[1], 0.5, 1e-12);
    assert_near(extent[2], 1.75, 1e-12);
}

/* 6 m there in 4 s, 2 s of rest, and back; vehicle x is 3.6 + z of the array. */
#define DRAWN                                                                            \
    BASE                                                                                 \
        "seed: 4\ndrive: {period_s: 40}\ndrawn: {wall_m: 0.3, wall_deg: 5}\n"            \
        "objects:\n  - name: p\n    kind: person\n"                                      \
        "    drawn: {shift_m: [0.2, 0, 0.1], reversed: yes, speed_m_s: [0.5, 2]}\n"      \
        "    path: [{t_s: 1, position_m: [-3, 0, 1]}, {t_s: 5, position_m: [3, 0, 1]}, " \
        "{t_s: 7, position_m: [3, 0, 1]}, {t_s: 11, position_m: [-3, 0, 1]}]\n"

static struct room *load_draw(void **state, uint32_t draw)
{
    struct room *r;
    assert_int_equal(
        room_load_drawn(&r, scratch_write(*state, "scene.yaml", DRAWN), NULL, draw, NULL),
        0);
    return r;
}

static void the_first_draw_goes_as_its_file_says(void **state)
{
    struct room *r = load_draw(state, 0);
    struct room_truth at;
    assert_int_equal(room_truth(r, 3, &at, 1), 1);
    assert_near(at.position_m[0], 4.6, 1e-9);
    assert_near(at.position_m[1], 0.2, 1e-9);
    assert_near(at.velocity_m_s[1], 1.5, 1e-9);
    assert_near(room_survey(r)->wall_distance_m, 2, 0);
    room_destroy(r);
}

static void each_other_draw_goes_a_way_of_its_own(void **state)
{
    double slowest = 9, fastest = 0, nearest = 9, farthest = 0;
    int n_left = 0;
    for (uint32_t draw = 1; draw <= 24; draw++) {
        struct room *r = load_draw(state, draw);
        struct room_truth start, going, same, end;
        double normal[3], distance_m;
        room_truth(r, 0.5, &start, 1);
        room_truth(r, 1.1, &going, 1);
        if (draw == 1) { /* the same each time */
            struct room *again = load_draw(state, draw);
            room_truth(again, 1.1, &same, 1);
            room_destroy(again);
            assert_memory_equal(going.position_m, same.position_m,
                                sizeof same.position_m);
        }
        double side = start.position_m[1] - 0.2 > 0 ? 1 : -1;
        double speed_m_s = -side * going.velocity_m_s[1];
        assert_near(start.position_m[1], 0.2 + 3 * side, 0.2);
        assert_near(start.position_m[0], 4.6, 0.1);
        assert_true(speed_m_s >= 0.5 && speed_m_s <= 2);
        /* There, a rest of 2 s, and back: a millisecond before the end of it. */
        room_truth(r, 1 + 2 * 6 / speed_m_s + 2 - 0.001, &end, 1);
        assert_near(end.position_m[1], start.position_m[1], 0.0021);
        assert_near(end.velocity_m_s[1], side * speed_m_s, 1e-6);
        room_vehicle_wall(r, 0, normal, &distance_m);
        assert_near(atan2(normal[1], normal[0]), 0, 5 * M_PI / 180);
        assert_near(room_survey(r)->wall_distance_m, 2, 0.3);
        slowest = fmin(slowest, speed_m_s);
        fastest = fmax(fastest, speed_m_s);
        nearest = fmin(nearest, room_survey(r)->wall_distance_m);
        farthest = fmax(farthest, room_survey(r)->wall_distance_m);
        n_left += side > 0;
        room_destroy(r);
    }
    /* Of 24 even draws none in an outer fifth, or one side 20 times: once in 200. */
    assert_true(slowest < 0.8 && fastest > 1.7 && nearest < 1.88 && farthest > 2.12);
    assert_true(n_left >= 4 && n_left <= 20);
}

static void wrong_drives_are_named_with_line_and_key(void **state)
{
#define OBJECT(rest)                                                                     \
    BASE "drive: {period_s: 5}\nobjects:\n  - name: p\n    kind: person\n" rest
    static const struct {
        const char *text, *place, *part;
    } cases[] = {
        {BASE "drive: {period_s: 0}\n", "drive.period_s: ", "0 is outside 0.1..600"},
        {BASE "drive:\n  period_s: 5\n  ego:\n    - {t_s: 1, speed_m_s: 1}\n"
              "    - {t_s: 1, speed_m_s: 2}\n",
         "drive.ego[1].t_s: ", "1 s does not come after the 1 s before it"},
        {BASE "drive: {period_s: 5, ego: [{t_s: 6, speed_m_s: 1}]}\n",
         "drive.ego[0].t_s: ", "6 is outside 0..5"},
        {BASE "drive: {period_s: 5, ego: [{t_s: 0, speed_m_s: 99}]}\n",
         "drive.ego[0].speed_m_s: ", "99 is outside -30..30"},
        {BASE "drive: {period_s: 5}\nnoise: {snr_db: 3}\n",
         "noise.snr_db: ", "this needs at_m"},
        {BASE "noise: {rms: 0.1, at_m: 3}\n", "noise.at_m: ", "expected snr_db with it"},
        {BASE "drive: {period_s: 5}\nstage: {axis: [1, 0, 0], positions_m: [0, 1]}\n",
         "drive: ", "has no stage"},
        {BASE "objects:\n  - {name: p, kind: person, position_m: [0, 0, 1], "
              "present_s: [1, 2]}\n",
         "objects[0].present_s: ", "only a drive has this"},
        {OBJECT(""), "objects[0]", "the key \"position_m\" is missing, or a path"},
        {OBJECT("    position_m: [0, 0, 1]\n    present_s: [3, 6]\n"),
         "objects[0].present_s: ", "3 to 6 is not a span within 0..5"},
        {OBJECT("    path: [{t_s: 1, position_m: [0, 0, 1]}, "
                "{t_s: 2, position_m: [1, 0, 1]}]\n"),
         "objects[0].path: ", "does not end where it begins"},
        {OBJECT("    present_s: [1, 2]\n    path:\n"
                "      - {t_s: 1, position_m: [0, 0, 1]}\n"
                "      - {t_s: 2, position_m: [1, 0, 3]}\n"),
         "objects[0].path[1].position_m: ", "p is 1.000 m behind the wall"},
        {BASE "noise: {rms: 0.1, rises: [{during_s: [1, 2], by_db: 3}]}\n",
         "noise.rises: ", "only a drive has this"},
        {BASE "drive: {period_s: 5}\n"
              "noise: {rms: 0.1, rises: [{during_s: [1, 2], by_db: 3}, "
              "{during_s: [4, 6], by_db: 3}]}\n",
         "noise.rises[1].during_s: ", "4 to 6 is not a span within 0..5"},
        {BASE "drive: {period_s: 5}\n"
              "noise: {rms: 0.1, rises: [{during_s: [2, 2], by_db: 3}]}\n",
         "noise.rises[0].during_s: ", "2 to 2 is not a span within 0..5"},
        {BASE "drive: {period_s: 5}\n"
              "noise: {rms: 0.1, rises: [{during_s: [1, 2], by_db: 101}]}\n",
         "noise.rises[0].by_db: ", "101 is outside -100..100"},
        {BASE "noise: {slams: [{during_s: [1, 1], peak: 1, decay_s: 0.02}]}\n",
         "noise.slams: ", "only a drive has this"},
        {BASE "drive: {period_s: 5}\n"
              "noise: {slams: [{during_s: [3, 6], peak: 1, decay_s: 0.02}]}\n",
         "noise.slams[0].during_s: ", "6 is outside 3..5"},
        {BASE "objects:\n  - {name: p, kind: person, position_m: [0, 0, 1], "
              "opaque: yes}\n",
         "objects[0].opaque: ", "only a drive has this"},
        {OBJECT("    position_m: [0, 0, 1]\n    drawn: {turn_deg: 3}\n"),
         "objects[0].drawn: ", "there is no path to change"},
        {OBJECT("    drawn: {speed_m_s: [0.5, 2]}\n    present_s: [0, 5]\n"
                "    path: [{t_s: 1, position_m: [0, 0, 1]}, "
                "{t_s: 2, position_m: [3, 0, 1]}]\n"),
         "objects[0].drawn.speed_m_s: ",
         "at 0.5 m/s the path ends after 7.0 s, and the drive after 5"},
        {BASE "drawn: {wall_m: 2.5}\n", "drawn.wall_m: ", "2.5 is outside 0..2"},
        {BASE "faults: {speakers: [{channel: 0, moved_m: [0, 0, 0.1]}]}\n",
         "faults.speakers[0].moved_m: ", "only a drive has this"},
        {BASE "drive: {period_s: 5}\n"
              "faults: {speakers: [{channel: 0, moved_m: [0, 0, 0.6]}]}\n",
         "faults.speakers[0].moved_m: ", "0.6 is outside -0.5..0.5"},
        {BASE "drift: {rate_c_min: 1}\n", "drift.rate_c_min: ", "only a drive has this"},
        {BASE "drive: {period_s: 5, rock: {frequency_hz: 11}}\n",
         "drive.rock.frequency_hz: ", "11 is outside 0..10"},
        {BASE "wall_sound: {reflectivity: 1, spans_m: [[1, 2], [4, 3]]}\n",
         "wall_sound.spans_m: ", "4 to 3 is no piece of a wall"},
        {BASE "faults: {speakers: [{channel: 0, gain_db: -20, during_s: [1, 2]}]}\n",
         "faults.speakers[0].during_s: ", "only a drive has this"},
        {BASE "drive: {period_s: 5}\n"
              "faults: {microphones: [{channel: 0, gain_db: -20, during_s: [-1, 2]}]}\n",
         "faults.microphones[0].during_s: ", "-1 to 2 is not a span within 0..5"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why = {.text = ""};
        struct room *r;
        assert_int_equal(
            room_load(&r, scratch_write(*state, "scene.yaml", cases[i].text), &why),
            -EINVAL);
        assert_null(r);
        assert_contains(why.text, "scene.yaml:");
        assert_contains(why.text, cases[i].place);
        assert_contains(why.text, cases[i].part);
    }
}

/* Each of them stands or moves as its name says, and what it is named after passes by,
 * hidden at first. */
static void the_drives_that_come_with_it_show_what_they_say(void **state)
{
    static const char *const kinds[] = {"person", "cyclist", "car", "nothing", "clutter"};
    (void)state;
    for (size_t i = 0; i < 10; i++) {
        struct error why = {.text = ""};
        struct room *r;
        char path[512];
        bool moves = i >= 5, hidden = false, in_image = false;
        double fastest = 0;
        snprintf(path, sizeof path, SOURCE_DIR "/launch/scenes/drive-%s%s.yaml",
                 kinds[i % 5], moves ? "-moving" : "");
        if (room_load(&r, path, &why))
            fail_msg("%s", why.text);
        const struct survey *s = room_survey(r);
        for (double t = 0; t < room_period_s(r); t += 0.02) {
            struct room_truth o;
            struct room_ego e;
            room_ego(r, t, &e);
            fastest = fmax(fastest, fabs(e.speed_m_s));
            if (!room_truth(r, t, &o, 1))
                continue;
            assert_string_equal(o.kind, kinds[i % 5]);
            bool inside = o.virtual_m[0] > s->volume_m[0][0] &&
                          o.virtual_m[0] < s->volume_m[0][1] &&
                          o.virtual_m[2] > s->volume_m[2][0] &&
                          o.virtual_m[2] < s->volume_m[2][1];
            hidden |= !o.line_of_sight && o.until_sight_s > 0;
            in_image |= inside && !o.line_of_sight;
        }
        assert_true(hidden == (i % 5 < 3) && in_image == (i % 5 < 3));
        assert_near(fastest, moves ? 2 : 0, 1e-9);
        assert_true(s->n_speakers == 16 && s->n_microphones == 16 && s->n_positions == 1);
        room_destroy(r);
    }
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_constant_turn_is_a_circle),
        TEST(speed_goes_straight_from_knot_to_knot),
        TEST(the_wall_moves_as_the_vehicle_does),
        TEST(objects_are_told_in_the_vehicles_frame_of_now),
        TEST(the_image_is_behind_the_wall_of_now),
        TEST(lines_of_sight_pass_corners_when_geometry_says),
        TEST(what_never_comes_into_view_says_so),
        TEST(a_person_adds_up_and_walks_on_his_feet),
        TEST(the_first_draw_goes_as_its_file_says),
        TEST(each_other_draw_goes_a_way_of_its_own),
        TEST(wrong_drives_are_named_with_line_and_key),
        TEST(the_drives_that_come_with_it_show_what_they_say),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
