/* SPDX-License-Identifier: MIT */
/* The steps of `anlos recon --bag` in this process, on what a bumper hears. */
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

#include "msgs/convert.h"
#include "nodes/anlos/replay/chain.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "tests/nodes/near.h"
#include "tests/nodes/scene.h"

#define SECOND   1000000000LL
#define WALL_M   1.3
#define SURVEY_M 0.8 /* where the survey has it */
#define ROUNDS   8

static const char hall[] = "array: bumper\ntemperature_c: 20\nseed: 3\nlevel: 0.03\n"
                           "objects: [{name: p, kind: point, position_m: [0, 0.3, 0.2], "
                           "scattering_length_m: 0.05}]\n"
                           "noise: {rms: 0.0001}\n"
                           "wall: {normal: [0, 0, 1], distance_m: 1.3}\n"
                           "wall_sound: {reflectivity: 0.9, echo: 0.7, patches: 50, "
                           "scattering_length_m: 0.01, roughness_m: 0.02}\n";

static const char launch_text[] =
    "nodes: [array, scan, dsp, recon, wall, track, can]\n"
    "array: {uri: \"sim:none.yaml\"}\n"
    "scan: {mode: fixed}\n"
    "recon: {frames: {pings: 16, sum: power, every: frame}}\n"
    "wall: {from: echoes}\n";

struct rig {
    struct scene scene;
    struct launchfile *launch;
    struct canbus *can;
    struct stopwatch stages[RECON_STAGES];
    struct chain chain;
};

/* The id of a survey is of its content. */
static int misplace_wall(struct scene *scene)
{
    struct survey wrong;
    struct error why = {""};

    if (survey_from_message(&wrong, scene->survey, &why))
        return -1;
    wrong.wall_distance_m = SURVEY_M;
    anlos__survey__free_unpacked(scene->survey, NULL);
    scene->survey = scene_message(&wrong);
    survey_clear(&wrong);
    return scene->survey ? 0 : -1;
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    struct error why = {""};
    char path[] = "/tmp/anlos-chain-XXXXXX";
    int fd = mkstemp(path);

    if (!r || fd < 0 || write(fd, hall, strlen(hall)) != (ssize_t)strlen(hall))
        return -1;
    close(fd);
    int err = scene_open(&r->scene, path);
    unlink(path);
    if (err ||
        launchfile_parse(&r->launch, "launch.yaml", launch_text, strlen(launch_text),
                         &why) ||
        canbus_open(&r->can, "log:/dev/null", &why))
        return -1;
    *state = r;
    return misplace_wall(&r->scene);
}

static int teardown(void **state)
{
    struct rig *r = *state;

    chain_clear(&r->chain);
    canbus_close(r->can);
    launchfile_destroy(r->launch);
    scene_close(&r->scene);
    free(r);
    return 0;
}

static void start(struct rig *r, bool finds_walls)
{
    struct chain_config cfg = {.can = r->can};
    struct error why = {""};

    launchfile_pipeline(&cfg.pipeline, r->launch);
    cfg.pipeline.finds_walls = finds_walls;
    assert_int_equal(chain_create(&r->chain, &cfg, r->stages), 0);
    if (chain_survey(&r->chain, r->scene.survey, &why))
        fail_msg("%s", why.text);
}

static void hear(struct rig *r)
{
    struct error why = {""};
    Anlos__Ping ping;
    int64_t now_ns = SECOND;

    for (uint32_t k = 0; k < ROUNDS * r->scene.survey->n_speakers_m; k++) {
        uint32_t speaker = k % (uint32_t)r->scene.survey->n_speakers_m;
        scene_ping(&r->scene, ANLOS__PASS__SCENE, 0, speaker, &ping);
        ping.frame = 1 + k / (uint32_t)r->scene.survey->n_speakers_m;
        if (chain_ping(&r->chain, &ping, now_ns - SECOND / 50, now_ns, &why))
            fail_msg("%s", why.text);
        now_ns += SECOND / 40;
    }
}

/* Half a metre from where the survey has it. */
static void a_wall_that_the_launch_file_has_heard_is_where_its_echoes_say(void **state)
{
    struct rig *r = *state;

    start(r, true);
    hear(r);
    int64_t stamp_ns;
    uint64_t lists;
    const struct walls *walls =
        pipeline_known_walls(r->chain.pipeline, &stamp_ns, &lists);
    assert_non_null(walls);
    assert_int_equal(walls->n, 1);
    assert_near(walls->list[0].plane.distance_m, WALL_M, 0.01);
    assert_near(fabs(walls->list[0].plane.normal[2]), 1.0, 0.001);
    assert_int_equal(walls->origin[0], WALL_ESTIMATED);
}

static bool has_wall(const struct rig *r)
{
    return object_tracker_has_wall(pipeline_tracker(r->chain.pipeline));
}

/* What was recorded of walls then is another's opinion, and is not taken. */
static void a_recorded_wall_does_not_go_before_one_that_is_heard(void **state)
{
    struct rig *r = *state;
    Anlos__WallList none = ANLOS__WALL_LIST__INIT;

    start(r, true);
    hear(r);
    assert_true(has_wall(r));
    chain_walls(&r->chain, &none, 3 * SECOND);
    assert_true(has_wall(r));
    chain_clear(&r->chain);
    start(r, false);
    chain_walls(&r->chain, &none, 3 * SECOND);
    assert_false(has_wall(r));
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_wall_that_the_launch_file_has_heard_is_where_its_echoes_say),
        TEST(a_recorded_wall_does_not_go_before_one_that_is_heard),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
