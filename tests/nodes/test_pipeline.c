/* SPDX-License-Identifier: MIT */
/* All stages in one, on plain types, and the steps of the nodes with packed messages
 * between them: images, walls, objects and tracks are the same bytes. */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <math.h>

#include "msgs/convert.h"
#include "nodes/anlos/doctor/drive_pipe.h"
#include "nodes/dsp/dsp.h"
#include "nodes/recon/recon.h"
#include "nodes/recon/steady.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/track/tracking.h"
#include "nodes/wall/finding.h"
#include "tests/nodes/scene.h"

#define SECOND INT64_C(1000000000)

struct both {
    struct launchfile *launch;
    struct pipeline_config cfg;
    struct pipeline *pipeline;
    struct pipeline_output out;
    uint64_t walls_told;

    struct dsp *dsp;
    struct steady *steady;
    struct recon *recon;
    struct tracking *tracking;
    struct finding *finding;

    size_t images, lists, objects, wall_lists, walls;
};

/* As it comes over the bus. */
static void *sent(const ProtobufCMessage *m)
{
    size_t size = protobuf_c_message_get_packed_size(m);
    uint8_t *bytes = malloc(size + 1);

    assert_non_null(bytes);
    protobuf_c_message_pack(m, bytes);
    ProtobufCMessage *back = protobuf_c_message_unpack(m->descriptor, NULL, size, bytes);
    assert_non_null(back);
    free(bytes);
    return back;
}

static void done(void *m)
{
    protobuf_c_message_free_unpacked(m, NULL);
}

static void assert_same(const ProtobufCMessage *a, const ProtobufCMessage *b)
{
    size_t size = protobuf_c_message_get_packed_size(a);
    uint8_t *x = malloc(size + 1), *y = malloc(size + 1);

    assert_true(x && y);
    assert_int_equal(protobuf_c_message_get_packed_size(b), size);
    protobuf_c_message_pack(a, x);
    protobuf_c_message_pack(b, y);
    if (memcmp(x, y, size))
        fail_msg("two of %s differ", a->descriptor->name);
    free(x);
    free(y);
}

/* -- what the nodes do ------------------------------------------------------------------
 */

static void start(struct both *b, const char *settings, const Anlos__Survey *message)
{
    struct survey survey;
    struct error why = {""};

    *b = (struct both){.launch = NULL};
    if (launchfile_parse(&b->launch, "settings", settings, strlen(settings), &why))
        fail_msg("%s", why.text);
    launchfile_pipeline(&b->cfg, b->launch);
    b->cfg.array.threads = b->cfg.scan.threads = 1;
    int err = pipeline_create(&b->pipeline, &b->cfg) ||
              dsp_create(&b->dsp, NULL, &b->cfg.frontend) ||
              tracking_create(&b->tracking, NULL, &b->cfg.tracker) ||
              (b->cfg.is_static ? steady_create(&b->steady, NULL, &b->cfg.array)
                                : recon_create(&b->recon, NULL, &b->cfg.scan)) ||
              (b->cfg.finds_walls && finding_create(&b->finding, NULL, &b->cfg.walls));
    assert_false(err);
    Anlos__Survey *m = sent(&message->base);
    err = survey_from_message(&survey, m, &why) ||
          pipeline_survey(b->pipeline, &survey, &why) || dsp_survey(b->dsp, m, &why) ||
          tracking_survey(b->tracking, m, &why) ||
          (b->steady ? steady_survey(b->steady, m, &why)
                     : recon_survey(b->recon, m, &why)) ||
          (b->finding && finding_survey(b->finding, m, &why));
    if (err)
        fail_msg("%s", why.text);
    survey_clear(&survey);
    done(m);
}

static void stop(struct both *b)
{
    pipeline_destroy(b->pipeline);
    dsp_destroy(b->dsp);
    steady_destroy(b->steady);
    recon_destroy(b->recon);
    tracking_destroy(b->tracking);
    finding_destroy(b->finding);
    launchfile_destroy(b->launch);
}

/* Here and there a list of the walls is due at the same time, and is the same. */
static void compare_walls(struct both *b, int64_t now_ns)
{
    struct error why = {""};
    struct walls_view view;
    Anlos__WallList m;
    int64_t stamp_ns, own_ns;
    uint64_t told;
    const Anlos__WallList *list = b->finding ? finding_list(b->finding, now_ns, &stamp_ns)
                                             : NULL;
    const struct walls *own = pipeline_known_walls(b->pipeline, &own_ns, &told);

    assert_int_equal(told - b->walls_told, list != NULL);
    b->walls_told = told;
    if (!list)
        return;
    walls_to_message(own, wall_finder_map(pipeline_finder(b->pipeline))->text, &view, &m);
    assert_same(&m.base, &list->base);
    assert_true(own_ns == stamp_ns);
    b->wall_lists++;
    b->walls += own->n;
    Anlos__WallList *came = sent(&list->base);
    if (tracking_walls(b->tracking, came, stamp_ns, &why) ||
        (b->steady && steady_walls(b->steady, came, stamp_ns, &why)))
        fail_msg("%s", why.text);
    done(came);
}

static void compare_image(struct both *b, const Anlos__Volume *volume, int64_t stamp_ns)
{
    struct error why = {""};
    struct volume_view view;
    Anlos__DetectionList *list, *own;
    Anlos__Volume m;

    assert_non_null(b->out.image);
    volume_to_message(b->out.image, &view, &m);
    assert_same(&m.base, &volume->base);
    assert_true(b->out.image->capture_ns == stamp_ns);
    Anlos__Volume *came = sent(&volume->base);
    if (tracking_volume(b->tracking, came, stamp_ns, &list, &why))
        fail_msg("%s", why.text);
    done(came);
    assert_non_null(b->out.objects);
    assert_int_equal(detections_from_objects(&own, b->out.objects), 0);
    assert_same(&own->base, &list->base);
    b->images++;
    b->lists += list->n_detections > 0;
    b->objects += list->n_detections;
    detections_free(own);
    detections_free(list);
}

static void image_traces(struct both *b, const Anlos__Traces *traces, int64_t capture_ns)
{
    char note[128];
    Anlos__Receipt receipt;
    Anlos__Volume volume;
    Anlos__Traces *came = sent(&traces->base);

    if (b->steady) {
        bool due = steady_traces(b->steady, came, capture_ns, note, sizeof note);
        assert_int_equal(b->out.image != NULL, due);
        if (due)
            steady_image(b->steady, &volume);
        if (due)
            compare_image(b, &volume, steady_capture_ns(b->steady));
    } else {
        recon_traces(b->recon, came, capture_ns, capture_ns, &receipt, note, sizeof note);
        assert_int_equal(!b->out.unfit, receipt.usable);
        assert_int_equal(b->out.image != NULL, recon_is_complete(b->recon));
        if (b->out.image)
            recon_image(b->recon, false, &volume);
        if (b->out.image)
            compare_image(b, &volume, recon_capture_ns(b->recon));
    }
    assert_string_equal(b->out.note, note);
    done(came);
}

static void take_ping(struct both *b, const Anlos__Ping *message, int64_t capture_ns,
                      int64_t now_ns)
{
    struct error why = {""};
    struct dsp_output dsp;
    struct ping ping;

    ping_from_message(&ping, message, capture_ns);
    if (pipeline_ping(b->pipeline, &ping, now_ns, &b->out, &why))
        fail_msg("%s", why.text);
    Anlos__Ping *came = sent(&message->base);
    dsp_ping(b->dsp, came, capture_ns, &dsp);
    assert_int_equal(b->out.front->outcome == FRONTEND_TRACES, dsp.has_traces);
    assert_string_equal(b->out.front->note, dsp.note);
    if (dsp.has_traces)
        image_traces(b, &dsp.traces, capture_ns);
    if (b->finding) {
        Anlos__Echoes *echoes = dsp.has_echoes ? sent(&dsp.echoes.base) : NULL;
        if (echoes)
            finding_echoes(b->finding, echoes, capture_ns, now_ns);
        if (echoes)
            done(echoes);
    }
    compare_walls(b, now_ns);
    done(came);
}

static void take_ego(struct both *b, const Anlos__EgoMotion *message, int64_t stamp_ns)
{
    struct error why = {""};
    struct ego_motion motion;

    assert_int_equal(pipeline_ego(b->pipeline, ego_from_message(&motion, message),
                                  stamp_ns, stamp_ns, &why),
                     0);
    dsp_ego(b->dsp, message, stamp_ns);
    steady_ego(b->steady, message, stamp_ns);
    tracking_ego(b->tracking, message, stamp_ns);
    if (b->finding)
        finding_ego(b->finding, message, stamp_ns);
    compare_walls(b, stamp_ns);
}

static void take_given(struct both *b, const Anlos__WallList *message, int64_t stamp_ns)
{
    struct error why = {""};
    struct walls walls;

    if (b->launch->wall.from != WALL_FROM_TOPIC)
        return;
    assert_int_equal(walls_from_message(&walls, message, &why), 0);
    assert_int_equal(pipeline_given(b->pipeline, &walls, stamp_ns, stamp_ns, &why), 0);
    assert_int_equal(finding_given(b->finding, message, stamp_ns, &why), 0);
    compare_walls(b, stamp_ns);
}

/* -- a drive ----------------------------------------------------------------------------
 */

/* Somebody walks behind the corner while the vehicle starts off. */
static const char street[] =
    "array: bumper\n"
    "temperature_c: 20\n"
    "wall: {normal: [0.1, 0, 0.995], distance_m: 2.2}\n"
    "mount: {origin_m: [3.6, 0, 0.4], x_axis: [0, 1, 0], y_axis: [0, 0, 1]}\n"
    "gate_m: [1.5, 4.1]\n"
    "volume: {x_m: [-2.4, 2.4, 0.08], y_m: [0, 0, 0.1], z_m: [2.4, 4.1, 0.08]}\n"
    "drive:\n"
    "  period_s: 8\n"
    "  ego: [{t_s: 1.2, speed_m_s: 0}, {t_s: 1.5, speed_m_s: 0.6},\n"
    "        {t_s: 1.8, speed_m_s: 0.6}, {t_s: 2.1, speed_m_s: 0},\n"
    "        {t_s: 5.3, speed_m_s: 0}, {t_s: 5.6, speed_m_s: -0.6},\n"
    "        {t_s: 5.9, speed_m_s: -0.6}, {t_s: 6.2, speed_m_s: 0}]\n"
    "objects:\n"
    "  - name: person\n"
    "    kind: person\n"
    "    path:\n"
    "      - {t_s: 0, position_m: [-2.4, 0, 1.3]}\n"
    "      - {t_s: 4, position_m: [2.4, 0, 1.3]}\n"
    "      - {t_s: 8, position_m: [-2.4, 0, 1.3]}\n"
    "seed: 3\n"
    "level: 0.03\n"
    "wall_sound: {reflectivity: 0.95, echo: 0.5}\n"
    "noise: {snr_db: 10, at_m: 4}\n";

static void drive(struct scratch *s, const char *walls, struct both *b)
{
    struct drive_world *w = calloc(1, sizeof *w);
    struct error why = {""};
    struct drive_walls given;
    Anlos__EgoMotion ego;
    Anlos__Ping ping;
    int64_t stamp_ns;
    char settings[400];
    const struct drive_world_config world = {
        .scene = scratch_write(s, "drive.yaml", street)};

    snprintf(settings, sizeof settings,
             "nodes: [array, scan, dsp, recon, wall, track]\n"
             "array: {uri: 'sim:drive.yaml'}\n"
             "scan: {mode: fixed, speakers: [0, 5, 10, 15]}\n"
             "dsp: {background: adaptive, background_s: 10}\n"
             "recon: {frames: {pings: 4, sum: power, every: ping}}\n"
             "track: {confirm_hits: 1, confirm_of: 2, look_s: 0.05}\n"
             "wall: {%s}\n",
             walls);
    assert_non_null(w);
    if (drive_world_create(w, &world, &why) || drive_world_shoot(w, PASS_SCENE, &why))
        fail_msg("%s", why.text);
    start(b, settings, w->survey);
    int64_t ego_ns = w->begin_ns, given_ns = w->begin_ns;
    for (int k = 0; k < 60; k++) {
        assert_int_equal(drive_world_ping(w, PASS_SCENE, &ping, &stamp_ns), 0);
        int64_t now_ns = stamp_ns + SECOND / 25;
        for (; ego_ns <= now_ns; ego_ns += DRIVE_EGO_NS) {
            drive_world_ego(w, ego_ns, &ego);
            take_ego(b, &ego, ego_ns);
        }
        for (; given_ns <= now_ns; given_ns += DRIVE_WALL_NS) {
            drive_world_wall(w, given_ns, &given);
            take_given(b, &given.list, given_ns);
        }
        take_ping(b, &ping, stamp_ns, now_ns);
    }
    drive_world_clear(w);
    free(w);
    stop(b);
    assert_true(b->images >= 40);
}

static void a_drive_with_a_wall_that_is_heard_is_the_same(void **state)
{
    struct both b;

    drive(*state, "from: echoes, every_s: 0.05", &b);
    assert_true(b.walls > 2 && b.wall_lists > b.walls); /* from its second look on */
    assert_true(b.lists > 0 && b.objects > 0);
}

static void so_is_one_with_walls_that_the_vehicle_gives(void **state)
{
    struct both b;

    drive(*state, "from: topic", &b);
    assert_true(b.walls > 5);
    assert_true(b.lists > 0 && b.objects > 0);
}

static void so_is_one_with_the_wall_of_the_survey(void **state)
{
    struct both b;

    drive(*state, "from: survey", &b);
    assert_true(b.walls > 5 && b.walls == b.wall_lists);
    assert_true(b.lists > 0 && b.objects > 0);
}

/* -- a scan -----------------------------------------------------------------------------
 */

static void fire(struct both *b, struct scene *scene, Anlos__Pass pass, size_t but_last)
{
    size_t n = scene->survey->n_speakers_m, all = n * scene->survey->n_stage_positions_m;
    Anlos__Ping ping;

    for (size_t k = 0; k < all - but_last; k++) {
        scene_ping(scene, pass, (uint32_t)(k / n), (uint32_t)(k % n), &ping);
        take_ping(b, &ping, SECOND + (int64_t)k * SECOND / 20,
                  SECOND + (int64_t)k * SECOND / 20 + SECOND / 30);
    }
}

static void scan(const char *method, size_t but_last)
{
    struct error why = {""};
    struct scene scene;
    struct both b;
    char settings[200];
    Anlos__Volume volume;

    snprintf(settings, sizeof settings,
             "nodes: [stage, array, scan, dsp, recon, track]\n"
             "array: {uri: 'sim:point.yaml'}\n"
             "scan: {background: true}\n"
             "recon: {method: %s}\n",
             method);
    assert_int_equal(scene_open(&scene, SOURCE_DIR "/tests/nodes/point.yaml"), 0);
    start(&b, settings, scene.survey);
    fire(&b, &scene, ANLOS__PASS__BACKGROUND, 0);
    assert_int_equal(b.images, 0);
    fire(&b, &scene, ANLOS__PASS__SCENE, but_last);
    assert_int_equal(b.images, !but_last);
    assert_int_equal(pipeline_finish(b.pipeline, &b.out, &why), 0);
    if (but_last) {
        recon_image(b.recon, false, &volume);
        compare_image(&b, &volume, recon_capture_ns(b.recon));
    } else {
        assert_null(b.out.image); /* it has its image */
    }
    assert_int_equal(b.images, 1);
    assert_true(b.objects > 0);
    stop(&b);
    scene_close(&scene);
}

static void a_scan_is_the_same_with_all_of_its_pings_and_without_the_last(void **state)
{
    (void)state;
    scan("fast", 0);
    scan("fast", 3);
    scan("backprojection", 0);
}

/* -- walls ------------------------------------------------------------------------------
 */

/* Who finds walls himself asks nobody, and the vehicle is heard where it is to say. */
static void check_whose_walls(const char *nodes, const char *from, bool takes_told,
                              bool takes_given)
{
    const struct walls said = {
        .n = 1,
        .list = {{.id = 5,
                  .plane = {.normal = {1, 0, 0}, .distance_m = 2.0},
                  .gate_m = {0.0, WALLS_FAR_M}}},
        .existence = {1.0}};
    struct walls none_such = said;
    struct error why = {""};
    struct scene point;
    struct both b;
    char settings[200];
    uint64_t told, given;
    int64_t stamp_ns;

    none_such.list[0].plane.distance_m = NAN;
    snprintf(settings, sizeof settings,
             "nodes: [stage, array, scan, dsp, recon, %strack]\n"
             "array: {uri: 'sim:point.yaml'}\nwall: {from: %s}\n",
             nodes, from);
    assert_int_equal(scene_open(&point, SOURCE_DIR "/tests/nodes/point.yaml"), 0);
    start(&b, settings, point.survey);
    assert_int_equal(pipeline_walls(b.pipeline, &none_such, SECOND, &why),
                     takes_told ? -EINVAL : 0);
    assert_int_equal(pipeline_given(b.pipeline, &none_such, SECOND, SECOND, &why),
                     takes_given ? -EINVAL : 0);
    pipeline_known_walls(b.pipeline, &stamp_ns, &given); /* one that is empty is due */
    assert_int_equal(given, takes_given);
    assert_int_equal(pipeline_walls(b.pipeline, &said, 2 * SECOND, &why), 0);
    pipeline_known_walls(b.pipeline, &stamp_ns, &told);
    assert_int_equal(told - given, takes_told);
    assert_int_equal(pipeline_given(b.pipeline, &said, 3 * SECOND, 3 * SECOND, &why), 0);
    const struct walls *known = pipeline_known_walls(b.pipeline, &stamp_ns, &given);
    assert_int_equal(given - told, takes_given);
    if (takes_told || takes_given)
        assert_int_equal(known->list[0].id, 5);
    else
        assert_null(known);
    stop(&b);
    scene_close(&point);
}

static void walls_are_taken_from_whom_they_are_to_come(void **state)
{
    (void)state;
    check_whose_walls("", "echoes", true, false);
    check_whose_walls("", "topic", true, false);
    check_whose_walls("wall, ", "echoes", false, false);
    check_whose_walls("wall, ", "topic", false, true);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_drive_with_a_wall_that_is_heard_is_the_same),
        TEST(so_is_one_with_walls_that_the_vehicle_gives),
        TEST(so_is_one_with_the_wall_of_the_survey),
        TEST(a_scan_is_the_same_with_all_of_its_pings_and_without_the_last),
        TEST(walls_are_taken_from_whom_they_are_to_come),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
