/* SPDX-License-Identifier: MIT */
/* What allocates, when memory gives out at each place where it may: -ENOMEM, nothing left
 * behind, nothing half made. */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "recon/detection/beyond.h"
#include "recon/imaging/imager_options.h"
#include "recon/inverse/psf.h"
#include "recon/pipeline.h"
#include "recon/planning/coherence.h"
#include "recon/planning/probe.h"
#include "recon/static_array/frames.h"
#include "recon/tracking/track.h"
#include "recon/walls/wall_crosstalk.h"
#include "tests/failing.h"
#include "tests/recon/array_traces.h"
#include "tests/recon/bumper.h"
#include "tests/recon/rig.h"

static void expect(const char *name, int (*run)(void *, struct error *), void *context,
                   size_t calls)
{
    const struct failing_work work = {
        .name = name, .run = run, .context = context, .wordless = true};

    assert_true(failing_each(&work) >= calls);
}

/* -- every method, on arrays that it images in different ways
 * ----------------------------
 */

struct method {
    struct rig rig;
    struct pool *pool;
    struct imager_options options;
    const char *name;
};

static int imager_work(void *context, struct error *why)
{
    struct method *m = context;
    struct imager_config cfg = rig_config(&m->rig, m->name, m->pool);
    struct imager *im = NULL;
    const char *reason = NULL;

    (void)why;
    cfg.options = &m->options;
    int err = imager_create(&im, &cfg, &reason);
    if (err)
        assert_null(im);
    imager_destroy(im);
    return err;
}

static void method_open(struct method *m, const char *name, bool pairs)
{
    if (pairs)
        rig_pairs(&m->rig);
    else
        rig_default(&m->rig);
    rig_look_at(&m->rig, 0.0, 0.0, 1.1, 5, 0.02);
    imager_options_default(&m->options);
    m->name = name;
}

static void expect_method(struct method *m, size_t calls)
{
    assert_int_equal(pool_create(&m->pool, 1), 0);
    expect(m->name, imager_work, m, calls);
    pool_destroy(m->pool);
}

static void an_imager_is_made_whole_or_not_at_all(void **state)
{
    (void)state;
    static struct method m;
    static const char *const names[] = {"fast",       "backprojection", "paper",
                                        "incoherent", "iterative",      "sparse"};

    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        method_open(&m, names[i], false);
        expect_method(&m, 10);
    }
    for (int k = 0; k < 2; k++) {
        method_open(&m, k ? "confocal" : "lct", true);
        expect_method(&m, 5);
    }
}

static void what_options_ask_for_is_made_whole_or_not_at_all(void **state)
{
    (void)state;
    static struct method m;
    static const char *const bases[] = {"lct", "fast", "backprojection", "paper"};

    for (int dmo = 0; dmo < 2; dmo++) {
        method_open(&m, "fast", false);
        m.options.dmo = dmo;
        expect_method(&m, 10);
        method_open(&m, "paper", false);
        m.options.lightcone = dmo;
        expect_method(&m, 10);
    }
    method_open(&m, "backprojection", false);
    m.options.coherence = 1.0;
    expect_method(&m, 10);
    for (size_t i = 0; i < sizeof bases / sizeof *bases; i++) {
        method_open(&m, "iterative", i == 0);
        m.options.base = bases[i];
        expect_method(&m, 10);
    }
    for (int i = 0; i < 2; i++) { /* stage steps that are whole voxels */
        method_open(&m, i ? "incoherent" : "backprojection", false);
        rig_look_at(&m.rig, 0.0, 0.0, 1.1, 5, 0.01);
        expect_method(&m, 10);
    }
}

/* A geometry of pings with places of their own. */
static void elements_that_stand_anywhere_need_memory_too(void **state)
{
    (void)state;
    static struct method m;

    for (int i = 0; i < 2; i++) {
        method_open(&m, i ? "incoherent" : "backprojection", false);
        m.rig.speakers_m[1][1] += 0.0123;
        m.rig.microphones_m[2][0] += 0.031;
        m.rig.microphones_m[2][2] += 0.017;
        m.rig.positions_m[3] += 0.0031;
        expect_method(&m, 5);
    }
}

/* -- a static array
 * ----------------------------------------------------------------------
 */

static int frames_work(void *context, struct error *why)
{
    struct bumper *b = context;
    struct frames *f = NULL;

    (void)why;
    int err = frames_create(&f, &b->cfg);
    if (err)
        assert_null(f);
    frames_destroy(f);
    return err;
}

static void frames_are_made_whole_or_not_at_all(void **state)
{
    (void)state;
    static struct bumper b;

    for (int sum = FRAMES_COHERENT; sum <= FRAMES_POWER; sum++) {
        bumper_default(&b);
        bumper_start(&b);
        b.cfg.sum = (enum frames_sum)sum;
        expect("frames", frames_work, &b, 10);
        bumper_stop(&b);
    }
}

static int tracker_work(void *context, struct error *why)
{
    struct track_config cfg;
    struct tracker *t = NULL;

    (void)context;
    (void)why;
    track_config_default(&cfg);
    int err = tracker_create(&t, &cfg);
    tracker_destroy(t);
    return err;
}

struct pair {
    struct pulse_compress *filters[2];
    struct wall_crosstalk_config cfg;
};

static int crosstalk_work(void *context, struct error *why)
{
    const struct pair *p = context;
    struct wall_crosstalk *x = NULL;

    (void)why;
    int err = wall_crosstalk_create(&x, &p->cfg);
    if (err)
        assert_null(x);
    wall_crosstalk_destroy(x);
    return err;
}

static void trackers_and_walls_need_memory(void **state)
{
    (void)state;
    const struct chirp up = {2000.0, 20000.0, 0.02, false},
                       down = {20000.0, 2000.0, 0.02, false};
    const double slot_s = 0.024, direct_s = 0.003;
    struct pulse_compress_config cfg = {.sample_rate_hz = 48000.0,
                                        .n_samples = 2304,
                                        .chirp = up,
                                        .window = WINDOW_HANN,
                                        .gate_s = {0.0, slot_s + direct_s + 1e-4},
                                        .oversampling = 2.0,
                                        .n_channels = 1};
    struct pair p;

    expect("tracker", tracker_work, NULL, 1);
    assert_int_equal(pulse_compress_create(&p.filters[0], &cfg), 0);
    cfg.chirp = down;
    assert_int_equal(pulse_compress_create(&p.filters[1], &cfg), 0);
    p.cfg = (struct wall_crosstalk_config){.filters = {p.filters[0], p.filters[1]},
                                           .chirps = {up, down},
                                           .sample_rate_hz = 48000.0,
                                           .n_samples = 2304,
                                           .direct_s = direct_s,
                                           .slot_s = slot_s};
    expect("crosstalk", crosstalk_work, &p, 5);
    pulse_compress_destroy(p.filters[0]);
    pulse_compress_destroy(p.filters[1]);
}

/* -- what looks at traces and images
 * -----------------------------------------------------
 */

struct look {
    struct array_traces a;
    struct grid grid;
    struct pool *pool;
};

static int coherence_work(void *context, struct error *why)
{
    struct look *l = context;
    struct coherence c;

    (void)why;
    return coherence_measure(&c, &l->a.set, l->pool);
}

static int probe_work(void *context, struct error *why)
{
    struct look *l = context;
    struct probe p;

    (void)why;
    return probe_run(&p, &l->a.set, &l->grid, NULL, l->pool);
}

static int beyond_work(void *context, struct error *why)
{
    struct look *l = context;
    struct detection d = {.position_m = {0.0, 0.0, 1.0}, .existence = 1.0};

    (void)why;
    return beyond_judge_traces(&l->a.set, &l->grid, 15.0, false, l->pool, &d, 1);
}

static int psf_work(void *context, struct error *why)
{
    struct look *l = context;
    const struct psf_config cfg = {.geometry = &l->a.rig.geometry,
                                   .band_hz = {2000.0, 20000.0},
                                   .at_m = {0.5, 0.5, 2.0}};
    struct grid grid;
    struct psf p;
    float *intensity = NULL;

    (void)why;
    int err = psf_compute(&p, &cfg, &grid, &intensity);
    if (!err)
        free(intensity);
    return err;
}

static void what_looks_at_traces_says_that_memory_is_missing(void **state)
{
    (void)state;
    static const struct scatterer point = {{0.5, 0.5, 2.0}, 1.0};
    const double around[3][3] = {{0.3, 0.7, 0.05}, {0.3, 0.7, 0.05}, {1.8, 2.2, 0.05}};
    static struct look l;

    array_traces_create(&l.a, 4);
    array_traces_fill(&l.a, &point, 1, 0.0);
    assert_int_equal(grid_from_limits(&l.grid, around), 0);
    assert_int_equal(pool_create(&l.pool, 1), 0);
    expect("coherence", coherence_work, &l, 3);
    expect("probe", probe_work, &l, 10);
    expect("beyond", beyond_work, &l, 10);
    expect("psf", psf_work, &l, 2);
    pool_destroy(l.pool);
    array_traces_clear(&l.a);
}

/* -- all of it
 * ---------------------------------------------------------------------------
 */

struct whole {
    struct pipeline_config cfg;
    struct survey survey;
};

static int pipeline_work(void *context, struct error *why)
{
    const struct whole *w = context;
    struct pipeline *p = NULL;
    int err = pipeline_create(&p, &w->cfg);

    if (err) {
        assert_null(p);
        return error_say(why, err, "a pipeline: %s", strerror(-err));
    }
    err = pipeline_survey(p, &w->survey, why);
    assert_true(pipeline_survey_id(p) == (err ? 0 : survey_id(&w->survey)));
    pipeline_destroy(p);
    return err;
}

/* Of a scan with a recorded background, and of a static array that learns its own and
 * hears walls with two chirps at a time. */
static void a_pipeline_is_planned_whole_or_says_what_it_lacks(void **state)
{
    (void)state;
    static double speakers[2][3] = {{-0.2, 0, 0}, {0.2, 0, 0}},
                  microphones[2][3] = {{-0.1, 0, 0}, {0.1, 0, 0}},
                  positions[2] = {0.0, 0.05};

    for (int is_static = 0; is_static < 2; is_static++) {
        struct whole w = {
            .survey = {.source = SURVEY_SIMULATION,
                       .sound_speed_m_s = 343.0,
                       .temperature_c = 20.0,
                       .sample_rate_hz = 48000,
                       .chirp_start_hz = 2000.0,
                       .chirp_stop_hz = 20000.0,
                       .chirp_duration_s = 0.005,
                       .chirp_alternates = is_static,
                       .together = is_static ? 2 : 1,
                       .slot_samples = 1152,
                       .n_speakers = 2,
                       .n_microphones = 2,
                       .n_positions = is_static ? 1 : 2,
                       .speakers_m = speakers,
                       .microphones_m = microphones,
                       .stage_axis = {0, 1, 0},
                       .stage_positions_m = positions,
                       .has_gate = true,
                       .gate_m = {0.5, 2.0},
                       .has_volume = true,
                       .volume_m = {{-0.4, 0.4, 0.1}, {0.0, 0.0, 0.1}, {0.8, 1.4, 0.1}}}};
        pipeline_config_default(&w.cfg, is_static);
        w.cfg.frontend.background = is_static ? BACKGROUND_ADAPTIVE : BACKGROUND_RECORDED;
        w.cfg.finds_walls = is_static;
        w.cfg.walls.map.from = WALL_FROM_ECHOES;
        const struct failing_work work = {.name = is_static ? "static array" : "scan",
                                          .run = pipeline_work,
                                          .context = &w};
        assert_true(failing_each(&work) >= 50);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_imager_is_made_whole_or_not_at_all),
        cmocka_unit_test(what_options_ask_for_is_made_whole_or_not_at_all),
        cmocka_unit_test(elements_that_stand_anywhere_need_memory_too),
        cmocka_unit_test(frames_are_made_whole_or_not_at_all),
        cmocka_unit_test(a_pipeline_is_planned_whole_or_says_what_it_lacks),
        cmocka_unit_test(trackers_and_walls_need_memory),
        cmocka_unit_test(what_looks_at_traces_says_that_memory_is_missing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
