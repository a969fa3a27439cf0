/* SPDX-License-Identifier: MIT */
/* `anlos score`: the tracks of a bag against a scene, and against a file. */
#include "tests/nodes/played_bag.h"

#include <jansson.h>
#include <unistd.h>

#include "msgs/detections.pb-c.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/doctor/drive_pipe.h"
#include "nodes/anlos/score/drive_bag.h"
#include "tests/nodes/command.h"
#include "tests/nodes/near.h"

/* A person walks 1.2 m/s behind a corner, into sight and on. */
#define SCENE SOURCE_DIR "/tests/nodes/walker.yaml"
#define OFF_M 0.05

/* The scene's time is the clock's, modulo its period. */
#define PERIODS   INT64_C(200000000)
#define FROM_S    3.0
#define UNTIL_S   6.0
#define STEP_S    0.1
#define LATENCY_S 0.03

struct bag {
    struct scratch *scratch;
    struct drive_world world;
    int64_t zero_ns;
    char *path, *truth, *out;
};

static void put(struct played_bag *b, const struct topic *t, int64_t capture_ns,
                double latency_s, const ProtobufCMessage *m)
{
    b->at_ns = capture_ns + llround(1e9 * latency_s);
    played_bag_put(b, topic_publisher(t, 0), t, capture_ns, m);
}

/* What hides, beside where it is, with the right velocity. */
static void put_list(struct played_bag *b, const struct bag *f, double t_s)
{
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    Anlos__Detection d = ANLOS__DETECTION__INIT, *all[1] = {&d};
    Anlos__Vec3 at = ANLOS__VEC3__INIT;
    struct room_truth truth;

    assert_int_equal(room_truth(f->world.room, t_s, &truth, 1), 1);
    list.tracked = list.in_vehicle_frame = list.mirrored = true;
    list.detections = all;
    list.n_detections = 1;
    at.x = truth.position_m[0] + OFF_M;
    at.y = truth.position_m[1];
    d.id = 1;
    d.position_m = &at;
    d.measurement = ANLOS__MEASUREMENT__MEASURED;
    d.velocity_m_s = truth.velocity_m_s;
    d.n_velocity_m_s = 2;
    put(b, topic_detections(), f->zero_ns + llround(1e9 * t_s), LATENCY_S, &list.base);
}

static void write_bag(const struct bag *f)
{
    struct played_bag b;

    played_bag_open(&b, f->path);
    put(&b, topic_survey(), f->zero_ns, 0.0, &f->world.survey->base);
    for (double t_s = FROM_S; t_s < UNTIL_S; t_s += STEP_S)
        put_list(&b, f, t_s);
    played_bag_close(&b);
}

static void write_truth(const struct bag *f)
{
    FILE *file = fopen(f->truth, "w");

    assert_non_null(file);
    fputs("time_s,id,kind,x_m,y_m\n", file);
    for (double t_s = FROM_S - STEP_S; t_s < UNTIL_S + STEP_S; t_s += STEP_S) {
        struct room_truth truth;
        assert_int_equal(room_truth(f->world.room, t_s, &truth, 1), 1);
        fprintf(file, "%.4f,%s,%s,%.6f,%.6f\n", 1e-9 * (double)f->zero_ns + t_s,
                truth.name, truth.kind, truth.position_m[0], truth.position_m[1]);
    }
    assert_int_equal(fclose(file), 0);
}

static int setup(void **state)
{
    struct bag *f = calloc(1, sizeof *f);
    struct error why = {""};
    void *scratch = NULL;

    if (!f || scratch_open(&scratch) ||
        drive_world_create(&f->world, &(struct drive_world_config){.scene = SCENE}, &why))
        return -1;
    f->scratch = scratch;
    f->zero_ns = PERIODS * llround(1e9 * room_period_s(f->world.room));
    f->path = strdup(scratch_path(f->scratch, "drive.mcap"));
    f->truth = strdup(scratch_path(f->scratch, "truth.csv"));
    f->out = strdup(scratch_path(f->scratch, "out"));
    *state = f;
    return 0;
}

static int teardown(void **state)
{
    struct bag *f = *state;
    void *scratch = f->scratch;

    drive_world_clear(&f->world);
    free(f->path);
    free(f->truth);
    free(f->out);
    free(f);
    return scratch_close(&scratch);
}

static double figure(const json_t *o, const char *name)
{
    const json_t *x = json_object_get(o, name);

    if (!json_is_number(x))
        fail_msg("%s is not a number", name);
    return json_number_value(x);
}

static json_t *judge(const struct bag *f, char *option, char *file)
{
    char *argv[] = {"score", "--bag", f->path, option, file, "--out", f->out, NULL};
    struct command_result r;

    command_run(&r, command_score, argv);
    if (r.code)
        fail_msg("%s", r.err);
    return json_load_file(scratch_path(f->scratch, "out/drive.json"), 0, NULL);
}

static void check_figures(const json_t *o)
{
    assert_non_null(o);
    assert_near(figure(o, "gospa_m"), OFF_M, 1e-4);
    assert_near(figure(o, "position_rms_m"), OFF_M, 1e-4);
    assert_near(figure(o, "velocity_rms_m_s"), 0.0, 1e-4);
    assert_near(figure(o, "detection_probability"), 1.0, 0.0);
    assert_near(figure(o, "objects_entered"), 1.0, 0.0);
    assert_near(figure(o, "echo_to_track_s"), LATENCY_S, 0.011); /* as it went out */
    assert_near(figure(o, "false_tracks"), 0.0, 0.0);
}

static void a_recorded_simulation_is_judged_by_its_scene(void **state)
{
    struct bag *f = *state;
    char scene[] = SCENE, option[] = "--scenes";

    write_bag(f);
    json_t *all = judge(f, option, scene);
    check_figures(json_object_get(all, "drive"));
    assert_int_equal(access(scratch_path(f->scratch, "out/drive.svg"), R_OK), 0);
    assert_int_equal(access(scratch_path(f->scratch, "out/drives.csv"), R_OK), 0);
    json_decref(all);
}

static void a_file_says_who_was_there(void **state)
{
    struct bag *f = *state;
    char option[] = "--truth";

    write_bag(f);
    write_truth(f);
    json_t *all = judge(f, option, f->truth);
    check_figures(json_object_get(all, "drive"));
    json_decref(all);
}

/* The second bag's truth is somebody far away: nobody was told, and all that was is
 * false. */
static void each_bag_has_its_own_truth(void **state)
{
    struct bag *f = *state;
    char bags[512], truths[512], option[] = "--truth";
    struct command_result r;

    write_bag(f);
    write_truth(f);
    char *far = strdup(scratch_path(f->scratch, "far.csv"));
    FILE *file = fopen(far, "w");
    assert_non_null(file);
    fprintf(file, "time_s,id,kind,x_m,y_m\n1,1,person,90,90\n");
    assert_int_equal(fclose(file), 0);
    snprintf(bags, sizeof bags, "%s,%s", f->path, f->path);
    snprintf(truths, sizeof truths, "%s,%s", f->truth, far);
    char *argv[] = {"score", "--bag", bags, option, truths, "--out", f->out, NULL};
    command_run(&r, command_score, argv);
    if (r.code)
        fail_msg("%s", r.err);
    json_t *all = json_load_file(scratch_path(f->scratch, "out/drive.json"), 0, NULL);
    const json_t *both = json_object_get(all, "all");
    assert_near(figure(both, "drives"), 2.0, 0.0);
    assert_near(figure(both, "false_tracks"), 1.0, 0.0);
    check_figures(json_object_get(all, "drive")); /* each under a name of its own */
    assert_near(figure(json_object_get(all, "drive-2"), "false_tracks"), 1.0, 0.0);
    assert_int_equal(access(scratch_path(f->scratch, "out/drive-2.csv"), R_OK), 0);
    json_decref(all);
    snprintf(bags, sizeof bags, "%s,%s,%s", f->path, f->path, f->path);
    command_run(&r, command_score, argv);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "one for each of 3 bags"));
    free(far);
}

static void a_bag_without_tracks_or_truth_is_refused(void **state)
{
    struct bag *f = *state;
    struct played_bag b;
    struct command_result r;

    played_bag_open(&b, f->path);
    put(&b, topic_survey(), f->zero_ns, 0.0, &f->world.survey->base);
    played_bag_close(&b);
    char *tracks[] = {"bench", "drive", "--bag", f->path, "--scenes",
                      SCENE,   "--out", f->out,  NULL};
    command_run(&r, command_bench, tracks); /* by its old name */
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "this is `anlos score` now"));
    assert_non_null(strstr(r.err, "no lists of tracks"));
    assert_string_equal(r.out, ""); /* nor a table of none, on paper or as files */
    assert_int_equal(access(scratch_path(f->scratch, "out/drives.csv"), F_OK), -1);
    assert_int_equal(access(scratch_path(f->scratch, "out/drive.json"), F_OK), -1);
    char *truth[] = {"score", "--bag", f->path, "--out", f->out, NULL};
    command_run(&r, command_score, truth);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "--truth FILE"));
}

/* A thing that stands at 3 m, 4 m of the ground, seen from a vehicle that has driven and
 * turned. */
static void seen_from_a_vehicle_a_thing_stands_over_ground(void **state)
{
    static const struct ego_motion motions[] = {{2.0, 0.0}, {0.0, 0.3}, {-1.0, 0.0}};
    struct bag *f = *state;

    for (size_t i = 0; i < sizeof motions / sizeof *motions; i++) {
        const struct ego_motion *m = &motions[i];
        struct drive_bag_world w = {.begin_ns = f->zero_ns};
        FILE *file = fopen(f->truth, "w");
        fputs("time_s,id,kind,x_m,y_m\n", file);
        for (int k = 0; k < 3; k++) {
            double t_s = 0.05 * k, turn = m->yaw_rate_rad_s * t_s;
            double x = 3.0 - m->speed_m_s * t_s, y = 4.0;
            fprintf(file, "%.4f,post,point,%.9f,%.9f\n", 1e-9 * (double)f->zero_ns + t_s,
                    x * cos(turn) + y * sin(turn), y * cos(turn) - x * sin(turn));
        }
        fclose(file);
        struct truth_file *truth = NULL;
        struct room_truth told;
        Anlos__EgoMotion ego = ANLOS__EGO_MOTION__INIT;
        ego.speed_m_s = m->speed_m_s;
        ego.yaw_rate_rad_s = m->yaw_rate_rad_s;
        ego.valid = true;
        assert_int_equal(truth_file_load(&truth, f->truth, NULL), 0);
        w.truth = truth;
        assert_int_equal(drive_bag_world_survey(&w, f->world.survey, NULL), 0);
        assert_int_equal(drive_bag_world_ego(&w, &ego, f->zero_ns, NULL), 0);
        struct drive_truth at = drive_bag_world_truth(&w);
        assert_int_equal(at.at(at.context, 0.06, &told, 1), 1);
        assert_near(told.velocity_m_s[0], 0.0, 0.02); /* secants of a turn */
        assert_near(told.velocity_m_s[1], 0.0, 0.02);
        drive_bag_world_clear(&w);
        truth_file_destroy(truth);
    }
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_recorded_simulation_is_judged_by_its_scene),
        TEST(a_file_says_who_was_there),
        TEST(each_bag_has_its_own_truth),
        TEST(a_bag_without_tracks_or_truth_is_refused),
        TEST(seen_from_a_vehicle_a_thing_stands_over_ground),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
