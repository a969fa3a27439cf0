/* SPDX-License-Identifier: MIT */
/* Each key of a launch file that says how the stages work is in the one configuration
 * that the nodes and whoever holds all stages take. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/rt/launchfile_pipeline.h"
#include "tests/nodes/near.h"

enum kind { REAL, SIZE, SWITCH, WORD };

struct key {
    const char *text; /* a section of the launch file */
    double value;     /* what it says, */
    size_t offset;    /* of whom */
    enum kind kind;
};

#define OF(field) (((struct pipeline_config *)NULL)->field)
#define KEY(text, value, field)                                                          \
    {                                                                                    \
        text, value, offsetof(struct pipeline_config, field),                            \
            _Generic(OF(field), double                                                   \
                     : REAL, size_t                                                      \
                     : SIZE, bool                                                        \
                     : SWITCH, default                                                   \
                     : WORD)                                                             \
    }
#define DEGREE (M_PI / 180.0)

static const struct key of_both[] = {
    KEY("dsp: {window: hamming}", WINDOW_HAMMING, frontend.window),
    KEY("dsp: {compression: deramp}", COMPRESSION_DERAMP, frontend.compression),
    KEY("dsp: {compression: deramp}", COMPRESSION_DERAMP, array.compression),
    KEY("dsp: {compression: deramp}", COMPRESSION_DERAMP, scan.compression),
    KEY("recon: {threads: 31}", 31, array.threads),
    KEY("recon: {threads: 31}", 31, scan.threads),
    KEY("track: {mode: lists}", OBJECT_TRACKER_LISTS, tracker.mode),
    KEY("track: {cfar: averaging}", CFAR_AVERAGING, tracker.detector.cfar),
    KEY("track: {false_alarm_rate: 0.001}", 0.001, tracker.detector.false_alarm_rate),
    KEY("track: {threshold_db: 14.5}", 14.5, tracker.detector.threshold_db),
    KEY("track: {min_existence: 0.35}", 0.35, tracker.detector.min_existence),
    KEY("track: {clutter: 2.5}", 2.5, tracker.clutter),
    KEY("track: {sidelobe_db: 11.5}", 11.5, tracker.sidelobe_db),
    KEY("track: {look_s: 0.15}", 0.15, tracker.look_s),
    KEY("track: {confirm_hits: 1}", 1, tracker.track.life.confirm_hits),
    KEY("track: {confirm_of: 6}", 6, tracker.track.life.confirm_of),
    KEY("track: {confirm_existence: 0.55}", 0.55, tracker.track.life.confirm_existence),
    KEY("track: {detection_probability: 0.65}", 0.65,
        tracker.track.detection_probability),
    KEY("track: {acceleration_psd: 1.75}", 1.75, tracker.track.acceleration_psd_m2_s3),
    KEY("track: {join_m: 1.15}", 1.15, tracker.track.join_m),
    KEY("track: {coast_s: 2.25}", 2.25, tracker.track.coast_s),
    KEY("wall: {from: topic}", WALL_FROM_TOPIC, walls.map.from),
    KEY("wall: {from: echoes}", WALL_FROM_ECHOES, walls.map.from),
    KEY("wall: {lost_s: 4.5}", 4.5, walls.map.lost_s),
    KEY("wall: {lost_s: 4.5}", 4.5, tracker.walls_s),
    KEY("wall: {vertical_deg: 3}", 3 * DEGREE, walls.map.vertical_rad),
    KEY("wall: {vertical_deg: 3}", 3 * DEGREE, walls.listener.vertical_rad),
    KEY("wall: {prior: none}", false, walls.listener.vertical),
    KEY("wall: {reach_m: 7.5}", 7.5, walls.listener.reach_m),
    KEY("wall: {every_s: 0.25}", 0.25, walls.listener.every_s),
    KEY("wall: {free_view_m: [[0, 0], [1, 0], [0, 2]]}", 3, walls.map.n_corners),
    KEY("wall: {free_view_m: [[0, 0], [1, 0], [0, 2]]}", 2.0,
        walls.map.free_view_m[2][1]),
};

static const struct key of_a_scan[] = {
    KEY("scan: {background: true}", BACKGROUND_RECORDED, frontend.background),
    KEY("scan: {mode: fixed}", true, is_static),
};

static const struct key of_a_static_array[] = {
    KEY("dsp: {background: adaptive}", BACKGROUND_ADAPTIVE, frontend.background),
    KEY("dsp: {background: adaptive}", true, array.moving_only),
    KEY("dsp: {background: adaptive, background_s: 25}", 25, frontend.background_s),
    KEY("recon: {frames: {pings: 7}}", 7, array.pings),
    KEY("recon: {frames: {sum: coherent}}", FRAMES_COHERENT, array.sum),
    KEY("recon: {frames: {every: ping}}", true, array.every_ping),
    KEY("scan: {mode: fixed, speakers: [0, 5, 10]}", 3, array.frame_pings),
    KEY("nodes: [array, scan, dsp, recon, wall, track]", true, finds_walls),
};

static struct launchfile *load(const char *base, const char *text)
{
    static const char *const heads[] = {"nodes:", "scan:"};
    static const char nodes[] = "nodes: [array, scan, dsp, recon, track]\n";
    struct launchfile *l = NULL;
    struct error why = {""};
    char file[600];
    bool has[2];

    for (int k = 0; k < 2; k++) /* what the key says itself is not there twice */
        has[k] = !strncmp(text, heads[k], strlen(heads[k]));
    snprintf(file, sizeof file, "%sarray: {uri: 'sim:scene.yaml'}\n%s%s\n",
             has[0] ? "" : nodes, has[1] ? "" : base, text);
    if (launchfile_parse(&l, "launch.yaml", file, strlen(file), &why))
        fail_msg("%s: %s", text, why.text);
    return l;
}

static double value_of(const struct pipeline_config *cfg, const struct key *key)
{
    const char *at = (const char *)cfg + key->offset;
    int word;

    if (key->kind == REAL)
        return *(const double *)(const void *)at;
    if (key->kind == SIZE)
        return (double)*(const size_t *)(const void *)at;
    if (key->kind == SWITCH)
        return *(const bool *)(const void *)at;
    memcpy(&word, at, sizeof word);
    return word;
}

static void check(const char *base, const struct key *keys, size_t n)
{
    struct pipeline_config without, with;
    struct launchfile *l = load(base, "");

    launchfile_pipeline(&without, l);
    for (size_t i = 0; i < n; i++) {
        struct launchfile *said = load(base, keys[i].text);
        launchfile_pipeline(&with, said);
        if (fabs(value_of(&with, &keys[i]) - keys[i].value) > 1e-12)
            fail_msg("%s: it is %g", keys[i].text, value_of(&with, &keys[i]));
        if (value_of(&without, &keys[i]) == keys[i].value)
            fail_msg("%s: it is so without the key", keys[i].text);
        launchfile_destroy(said);
    }
    launchfile_destroy(l);
}

#define CHECK(base, keys) check(base, keys, sizeof keys / sizeof *keys)

static void each_key_is_what_the_stages_run_with(void **state)
{
    (void)state;
    CHECK("", of_both);
    CHECK("scan: {mode: fixed}\n", of_both);
    CHECK("", of_a_scan);
    CHECK("scan: {mode: fixed}\n", of_a_static_array);
}

static void a_method_and_its_options_are_those_of_the_file(void **state)
{
    (void)state;
    struct pipeline_config cfg;
    struct launchfile *l =
        load("", "recon: {method: backprojection, options: {coherence: 1.5}}");

    launchfile_pipeline(&cfg, l);
    assert_string_equal(cfg.scan.method, "backprojection");
    assert_near(cfg.scan.options->coherence, 1.5, 0.0);
    launchfile_destroy(l);
}

/* A bag without a launch file is processed as by one that says nothing. */
static void without_a_file_it_is_what_an_empty_one_says(void **state)
{
    (void)state;
    struct pipeline_config none, empty;
    struct launchfile *l = load("", "");

    launchfile_pipeline(&none, NULL);
    launchfile_pipeline(&empty, l);
    for (size_t i = 0; i < sizeof of_both / sizeof *of_both; i++)
        if (strncmp(of_both[i].text, "wall", 4))
            assert_near(value_of(&none, &of_both[i]), value_of(&empty, &of_both[i]), 0.0);
    assert_false(none.is_static || empty.is_static);
    assert_false(none.finds_walls || empty.finds_walls);
    assert_near(none.tracker.walls_s, empty.tracker.walls_s, 0.0);
    assert_int_equal(none.frontend.background, empty.frontend.background);
    launchfile_destroy(l);
}

/* What the stages say of a field of anlos/config.h. */
static void an_error_names_the_key_of_the_launch_file(void **state)
{
    static const struct {
        const char *said, *read;
    } texts[] = {
        {"array: a static array stands", "scan.mode: a static array stands"},
        {"false_alarm_rate: too small", "track.cfar: too small"},
        {"image_pings: 300: too many", "recon.frames.pings: 300: too many"},
        {"method 'magic': no such method", "recon.method 'magic': no such method"},
        {"walls: none is heard", "wall.from: none is heard"},
        {"walls gate_m is [3, 2]", "walls gate_m is [3, 2]"}, /* of the survey */
        {"gate_m: far is 4 m", "gate_m: far is 4 m"},
        {"walls", "walls"},
        {"", ""},
    };
    struct error why;

    (void)state;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        snprintf(why.text, sizeof why.text, "%s", texts[i].said);
        assert_int_equal(launchfile_name_key(&why, -EINVAL), -EINVAL);
        assert_string_equal(why.text, texts[i].read);
    }
    snprintf(why.text, sizeof why.text, "array: ");
    assert_int_equal(launchfile_name_key(&why, 0), 0);
    assert_string_equal(why.text, "array: ");
    assert_int_equal(launchfile_name_key(NULL, -EINVAL), -EINVAL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_key_is_what_the_stages_run_with),
        cmocka_unit_test(a_method_and_its_options_are_those_of_the_file),
        cmocka_unit_test(an_error_names_the_key_of_the_launch_file),
        cmocka_unit_test(without_a_file_it_is_what_an_empty_one_says),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
