/* SPDX-License-Identifier: MIT */
/* libanlos as a program has it: public headers and the shared library alone. */
#include "tests/recon/library_rig.h"

#include <pthread.h>

static struct anlos_pipeline *make_pipeline(const struct anlos_survey *s)
{
    struct anlos_config cfg;
    struct anlos_pipeline *p;

    anlos_config_init(&cfg);
    ok(anlos_pipeline_create(&p, &cfg, s, &why));
    return p;
}

/* All pings but the last `missing`; returns the news of the last one. */
static int scan(struct anlos_pipeline *p, size_t missing)
{
    int news = 0;

    for (size_t k = 0; k < POSITIONS * SPEAKERS - missing; k++) {
        struct anlos_ping ping = make_ping(k / SPEAKERS, k % SPEAKERS);
        echo(samples, k / SPEAKERS, k % SPEAKERS, 0.01);
        ping.capture_ns = (int64_t)k * SECOND / 32;
        assert_false(news & (ANLOS_NEW_IMAGE | ANLOS_NEW_OBJECTS));
        news = anlos_pipeline_ping(p, &ping, &why);
        ok(news);
    }
    return news;
}

static void assert_point(const struct anlos_pipeline *p)
{
    struct anlos_object o = {.size = sizeof o};
    struct anlos_list list = {.size = sizeof list};
    const double really[3] = {point_m[0], point_m[1], 2 * WALL_M - point_m[2]};

    ok(anlos_pipeline_list(p, &list, &why));
    assert_int_equal(list.n, 1);
    assert_true(list.mirrored && !list.in_vehicle_frame && !list.tracked);
    ok(anlos_pipeline_object(p, 0, &o, &why));
    assert_true(o.placed && o.wall == 1);
    if (distance(o.position_m, really) > 0.01 || distance(o.virtual_m, point_m) > 0.01)
        fail_msg("[%g, %g, %g], imaged at [%g, %g, %g]", o.position_m[0], o.position_m[1],
                 o.position_m[2], o.virtual_m[0], o.virtual_m[1], o.virtual_m[2]);
}

static void a_point_is_found_where_it_is(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(POSITIONS);
    struct anlos_pipeline *p = make_pipeline(s);
    struct anlos_image image = {.size = sizeof image};
    struct anlos_health health = {.size = sizeof health};
    size_t brightest = 0;

    refused(anlos_pipeline_image(p, &image, &why), ANLOS_NOT_READY, "no image");
    assert_true(scan(p, 0) & ANLOS_NEW_OBJECTS);
    assert_point(p);
    ok(anlos_pipeline_image(p, &image, &why));
    for (size_t i = 0; i < image.n[0] * image.n[1] * image.n[2]; i++)
        brightest = image.intensity[i] > image.intensity[brightest] ? i : brightest;
    const double at[3] = {
        image.origin_m[0] + image.step_m[0] * (double)(brightest % image.n[0]),
        image.origin_m[1] +
            image.step_m[1] * (double)(brightest / image.n[0] % image.n[1]),
        image.origin_m[2] +
            image.step_m[2] * (double)(brightest / image.n[0] / image.n[1])};
    assert_true(distance(at, point_m) < 0.015);
    assert_string_equal(image.method, "fast");
    assert_int_equal(image.pings_used, POSITIONS * SPEAKERS);
    assert_true(image.survey == anlos_survey_id(s));
    ok(anlos_pipeline_health(p, &health, &why));
    assert_int_equal(health.pings, POSITIONS * SPEAKERS);
    assert_int_equal(health.images, 1);
    assert_int_equal(health.refused, 0);
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(s);
}

static void a_scan_that_lacks_pings_is_imaged_when_it_ends(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(POSITIONS);
    struct anlos_pipeline *p = make_pipeline(s);
    struct anlos_image image = {.size = sizeof image};

    assert_false(scan(p, 2) & ANLOS_NEW_IMAGE);
    int news = anlos_pipeline_finish(p, &why);
    ok(news);
    assert_true(news & ANLOS_NEW_OBJECTS);
    assert_point(p);
    ok(anlos_pipeline_image(p, &image, &why));
    assert_int_equal(image.pings_used, POSITIONS * SPEAKERS - 2);
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(s);
}

static void a_background_is_recorded_first(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(POSITIONS);
    struct anlos_config cfg;
    struct anlos_pipeline *p;
    struct anlos_ping ping = make_ping(0, 0);

    anlos_config_init(&cfg);
    cfg.background = ANLOS_BACKGROUND_RECORDED;
    ok(anlos_pipeline_create(&p, &cfg, s, &why));
    echo(samples, 0, 0, 0.01);
    refused(anlos_pipeline_ping(p, &ping, &why), ANLOS_NOT_READY, "background");
    for (size_t k = 0; k < POSITIONS * SPEAKERS; k++) { /* as much as the scene has: */
        ping = make_ping(k / SPEAKERS, k % SPEAKERS);
        ping.background = true;
        echo(samples, k / SPEAKERS, k % SPEAKERS, 0.01);
        ok(anlos_pipeline_ping(p, &ping, &why));
    }
    scan(p, 0);
    struct anlos_image image = {.size = sizeof image};
    ok(anlos_pipeline_image(p, &image, &why)); /* nothing is left of it */
    for (size_t i = 0; i < image.n[0] * image.n[1] * image.n[2]; i++)
        assert_true(image.intensity[i] < 1e-9f);
    anlos_pipeline_destroy(p);
    p = make_pipeline(s);
    refused(anlos_pipeline_ping(p, &ping, &why), ANLOS_INVALID, "background");
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(s);
}

static void a_static_array_gives_an_image_each_round(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(1);
    struct anlos_config cfg;
    struct anlos_pipeline *p;
    struct anlos_image image = {.size = sizeof image};
    struct anlos_list list = {.size = sizeof list};

    anlos_config_init_static(&cfg);
    cfg.background = ANLOS_BACKGROUND_NONE;
    ok(anlos_pipeline_create(&p, &cfg, s, &why));
    for (size_t k = 0; k < 3 * SPEAKERS; k++) {
        struct anlos_ping ping = make_ping(0, k % SPEAKERS);
        echo(samples, 0, k % SPEAKERS, 0.01);
        ping.capture_ns = SECOND + (int64_t)k * SECOND / 32;
        int news = anlos_pipeline_ping(p, &ping, &why);
        ok(news);
        assert_int_equal(!!(news & ANLOS_NEW_IMAGE), k % SPEAKERS == SPEAKERS - 1);
    }
    ok(anlos_pipeline_image(p, &image, &why));
    assert_int_equal(image.frame, 3);
    ok(anlos_pipeline_list(p, &list, &why));
    assert_true(list.tracked);
    assert_true(list.capture_ns == SECOND + (3 * SPEAKERS - 1) * (SECOND / 32));
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(s);
}

static void a_broken_microphone_is_left_out_and_counted(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(POSITIONS);
    struct anlos_pipeline *p = make_pipeline(s);
    struct anlos_health health = {.size = sizeof health};

    for (size_t k = 0; k < POSITIONS * SPEAKERS; k++) {
        struct anlos_ping ping = make_ping(k / SPEAKERS, k % SPEAKERS);
        echo(samples, k / SPEAKERS, k % SPEAKERS, 0.01);
        samples[PING + 700] = NAN; /* of the second microphone */
        samples[PING + 701] = INFINITY;
        for (size_t i = 0; i < 100; i++) /* of the third: 4 % at full scale */
            samples[2 * PING + 900 + i] = 1.0f;
        int news = anlos_pipeline_ping(p, &ping, &why);
        ok(news);
        assert_int_equal(!!(news & ANLOS_NEW_NOTE), k == 0); /* said once */
        if (k == 0) {
            assert_non_null(strstr(anlos_pipeline_note(p), "microphone 2"));
            assert_non_null(strstr(anlos_pipeline_note(p), "microphone 3"));
        }
    }
    ok(anlos_pipeline_health(p, &health, &why));
    assert_int_equal(health.microphones, MICS);
    assert_int_equal(health.damaged, 1);
    assert_int_equal(health.clipped, 1);
    assert_int_equal(health.not_finite_samples, 2 * POSITIONS * SPEAKERS);
    assert_int_equal(health.clipped_samples, 100 * POSITIONS * SPEAKERS);
    assert_point(p);
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(s);
}

static void walls_that_are_told_move_what_they_mirror(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(POSITIONS);
    struct anlos_pipeline *p = make_pipeline(s);
    struct anlos_wall wall = {.size = sizeof wall, .id = 7, .normal = {0, 0, 1}};
    struct anlos_object o = {.size = sizeof o};

    assert_int_equal(anlos_pipeline_n_walls(p), 1); /* the survey's */
    wall.distance_m = 0.7;
    wall.existence = 1.0;
    int news = anlos_pipeline_walls(p, &wall, 1, 0, &why);
    ok(news);
    assert_true(news & ANLOS_NEW_WALLS);
    scan(p, 0);
    ok(anlos_pipeline_object(p, 0, &o, &why));
    assert_int_equal(o.wall, 7);
    assert_true(fabs(o.position_m[2] - (2 * 0.7 - point_m[2])) < 0.01);
    wall.id = 0;
    ok(anlos_pipeline_wall(p, 0, &wall, &why));
    assert_int_equal(wall.id, 7);
    refused(anlos_pipeline_wall(p, 1, &wall, &why), ANLOS_INVALID, "wall 1 of 1");
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(s);
}

static void the_version_is_that_of_the_headers(void **state)
{
    (void)state;
    struct anlos_survey *s = NULL;
    char text[32];

    assert_string_equal(anlos_version(), ANLOS_VERSION);
    assert_true(anlos_version_number() == ANLOS_VERSION_NUMBER);
    snprintf(text, sizeof text, "%d.%d.%d", ANLOS_VERSION_MAJOR, ANLOS_VERSION_MINOR,
             ANLOS_VERSION_PATCH);
    assert_string_equal(text, ANLOS_VERSION);
    /* Headers of another interface, and newer ones of the same. */
    refused(anlos_survey_create_for(ANLOS_VERSION_NUMBER + (1u << 24), &s, &why),
            ANLOS_VERSION_MISMATCH, "interface 2");
    refused(anlos_survey_create_for(ANLOS_VERSION_NUMBER - (1u << 24), &s, &why),
            ANLOS_VERSION_MISMATCH, "compile anew");
    refused(anlos_survey_create_for(ANLOS_VERSION_NUMBER + 1, &s, &why),
            ANLOS_VERSION_MISMATCH, "install");
    assert_null(s);
}

static void sizes_that_cannot_be_are_refused(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(POSITIONS);
    struct anlos_pipeline *p = make_pipeline(s), *none = NULL;
    struct anlos_config cfg;
    struct anlos_ping ping = make_ping(0, 0);
    struct anlos_health health = {.size = sizeof health + 8};
    struct anlos_wall wall = {.size = 0};

    anlos_config_init(&cfg);
    cfg.size += 8;
    refused(anlos_pipeline_create(&none, &cfg, s, &why), ANLOS_INVALID, "its size is");
    assert_null(none);
    ping.size = 0;
    refused(anlos_pipeline_ping(p, &ping, &why), ANLOS_INVALID, "struct anlos_ping: its");
    refused(anlos_pipeline_health(p, &health, &why), ANLOS_INVALID, "its size is");
    refused(anlos_pipeline_walls(p, &wall, 1, 0, &why), ANLOS_INVALID, "its size is 0");
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(s);
}

static void null_is_refused(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(POSITIONS);
    struct anlos_pipeline *p = make_pipeline(s), *out = NULL;
    struct anlos_config cfg;
    struct anlos_ping ping = make_ping(0, 0);
    struct anlos_image image = {.size = sizeof image};
    struct anlos_object object = {.size = sizeof object};
    const double one[3] = {0, 0, 1};
    const int I = ANLOS_INVALID;

    anlos_config_init(&cfg);
    refused(anlos_survey_create(NULL, &why), I, "out is NULL");
    refused(anlos_survey_speakers(NULL, one, 1, &why), I, "survey is NULL");
    refused(anlos_survey_speakers(s, NULL, 1, &why), I, "speakers is NULL");
    refused(anlos_survey_stage(s, NULL, one, 1, &why), I, "stage axis is NULL");
    refused(anlos_survey_volume(s, one, NULL, one, &why), I, "volume y is NULL");
    refused(anlos_survey_check(NULL, &why), I, "survey is NULL");
    refused(anlos_pipeline_create(NULL, &cfg, s, &why), I, "out is NULL");
    refused(anlos_pipeline_create(&out, NULL, s, &why), I, "config is NULL");
    refused(anlos_pipeline_ping(NULL, &ping, &why), I, "pipeline is NULL");
    refused(anlos_pipeline_ping(p, NULL, &why), I, "anlos_ping is NULL");
    refused(anlos_pipeline_survey(p, NULL, &why), I, "survey is NULL");
    refused(anlos_pipeline_finish(NULL, &why), I, "pipeline is NULL");
    refused(anlos_pipeline_ego(NULL, 0, 0, 0, &why), I, "pipeline is NULL");
    refused(anlos_pipeline_air(NULL, 20, &why), I, "pipeline is NULL");
    refused(anlos_pipeline_walls(p, NULL, 1, 0, &why), I, "walls is NULL");
    refused(anlos_pipeline_image(NULL, &image, &why), I, "pipeline is NULL");
    refused(anlos_pipeline_object(NULL, 0, &object, &why), I, "pipeline is NULL");
    refused(anlos_pipeline_wall(p, 0, NULL, &why), I, "anlos_wall is NULL");
    ping.samples = NULL;
    refused(anlos_pipeline_ping(p, &ping, &why), I, "samples of a ping is NULL");
    assert_int_equal(anlos_pipeline_ping(p, &ping, NULL), I); /* without a sentence */
    assert_true(anlos_survey_id(NULL) == 0 && anlos_survey_ping_samples(NULL) == 0);
    assert_int_equal(anlos_pipeline_n_walls(NULL), 0);
    assert_string_equal(anlos_pipeline_note(NULL), "");
    anlos_pipeline_destroy(NULL);
    anlos_survey_destroy(NULL);
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(s);
}

static void numbers_that_are_none_are_refused(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(POSITIONS);
    struct anlos_pipeline *p = make_pipeline(s), *none = NULL;
    struct anlos_config cfg;
    struct anlos_ping ping = make_ping(0, 0);
    struct anlos_wall wall = {.size = sizeof wall, .id = 1, .normal = {0, NAN, 1}};
    const double bad[6] = {0, 0, NAN, 0, 0, 1};
    const int I = ANLOS_INVALID;

    refused(anlos_survey_speakers(s, bad, 1, &why), I, "speakers: number 2 is");
    refused(anlos_survey_pings(s, bad, 1, &why), I, "pings: number 2 is");
    refused(anlos_survey_stage(s, bad, stage, 1, &why), I, "stage axis: number 2");
    refused(anlos_survey_chirp(s, NAN, 2e4, 0.06, false, &why), I, "chirp");
    refused(anlos_survey_sampling(s, INFINITY, SLOT, 0, &why), I, "sampling");
    refused(anlos_survey_sound_speed(s, NAN, &why), I, "sound speed");
    refused(anlos_survey_air(s, NAN, 0, &why), I, "air of");
    refused(anlos_survey_gate(s, NAN, 2, &why), I, "gate");
    refused(anlos_survey_add_wall(s, bad, 1, 0, 0, &why), I, "wall normal");
    refused(anlos_pipeline_ego(p, NAN, 0, 0, &why), I, "a vehicle with");
    refused(anlos_pipeline_ego(p, 1, 0, -1, &why), I, "capture_ns");
    refused(anlos_pipeline_air(p, NAN, &why), I, "air of");
    refused(anlos_pipeline_walls(p, &wall, 1, 0, &why), I, "normal");
    ping.capture_ns = INT64_MAX;
    refused(anlos_pipeline_ping(p, &ping, &why), I, "capture_ns");
    ping.capture_ns = 0;
    ping.has_temperature = true;
    ping.temperature_c = NAN;
    refused(anlos_pipeline_ping(p, &ping, &why), I, "air of");
    anlos_config_init(&cfg);
    cfg.min_existence = NAN;
    refused(anlos_pipeline_create(&none, &cfg, s, &why), I, "min_existence is");
    assert_true(anlos_survey_check(s, &why) == 0); /* what was refused changed nothing */
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(s);
}

static void a_survey_that_does_not_fit_is_refused(void **state)
{
    (void)state;
    const double axis[3] = {1.0, 1.2, 0.05}, places[12] = {0, 0, 0, 0.05};
    struct anlos_survey *s = make_survey(POSITIONS);
    struct anlos_config cfg;
    struct anlos_pipeline *p = NULL;

    anlos_config_init_static(&cfg); /* this one has a stage */
    refused(anlos_pipeline_create(&p, &cfg, s, &why), ANLOS_UNSUPPORTED, "6 positions");
    anlos_config_init(&cfg);
    ok(anlos_survey_gate(s, 0.5, 50.0, &why));
    refused(anlos_survey_check(s, &why), ANLOS_INVALID, "gate beyond the slot");
    refused(anlos_pipeline_create(&p, &cfg, s, &why), ANLOS_INVALID, "gate beyond");
    anlos_survey_destroy(s);
    ok(anlos_survey_create(&s, &why));
    refused(anlos_pipeline_create(&p, &cfg, s, &why), ANLOS_INVALID, "speakers_m has 0");
    ok(anlos_survey_pings(s, places, 2, &why)); /* `fast` needs a grid of them */
    ok(anlos_survey_volume(s, axis, axis, axis, &why));
    refused(anlos_pipeline_create(&p, &cfg, s, &why), ANLOS_UNSUPPORTED, "method 'fast'");
    assert_null(p);
    anlos_survey_destroy(s);
}

static void a_configuration_that_cannot_be_is_refused(void **state)
{
    (void)state;
    static const char *const unknown[] = {"nonsense=1"}, *const misplaced[] = {"l1=0.1"};
    struct anlos_survey *s = make_survey(POSITIONS);
    struct anlos_config cfg;
    struct anlos_pipeline *p = NULL;
    const int I = ANLOS_INVALID;

#define REFUSED(change, words)                                                           \
    do {                                                                                 \
        anlos_config_init(&cfg);                                                         \
        change;                                                                          \
        refused(anlos_pipeline_create(&p, &cfg, s, &why), I, words);                     \
    } while (0)
    REFUSED(cfg.method = "slow", "expected one of fast, backprojection");
    REFUSED(cfg.method = NULL, "method '(NULL)'");
    REFUSED(cfg.window = "round", "hann, hamming or rectangular");
    REFUSED(cfg.compression = "", "matched_filter or deramp");
    REFUSED(cfg.threads = 0, "threads is 0, expected 1");
    REFUSED(cfg.array = 2, "array is 2");
    REFUSED(cfg.confirm_hits = 6, "confirm_hits is 6, expected 1 to 3");
    REFUSED(cfg.background = ANLOS_BACKGROUND_ADAPTIVE, "static array");
    REFUSED(cfg.walls = -1, "walls is -1");
    REFUSED((cfg.options = unknown, cfg.n_options = 1), "nonsense");
    REFUSED((cfg.options = misplaced, cfg.n_options = 1), "l1");
    REFUSED(cfg.n_options = 1, "options is NULL");
#undef REFUSED
    assert_null(p);
    anlos_survey_destroy(s);
}

static void a_ping_of_another_survey_or_shape_is_refused(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(POSITIONS), *other = make_survey(1);
    struct anlos_pipeline *p = make_pipeline(NULL);
    struct anlos_health health = {.size = sizeof health};
    struct anlos_ping ping = make_ping(0, 0);
    const int I = ANLOS_INVALID;

    refused(anlos_pipeline_ping(p, &ping, &why), ANLOS_NOT_READY, "a survey");
    ok(anlos_pipeline_survey(p, s, &why));
#define REFUSED(change, words)                                                           \
    do {                                                                                 \
        ping = make_ping(0, 0);                                                          \
        change;                                                                          \
        refused(anlos_pipeline_ping(p, &ping, &why), I, words);                          \
    } while (0)
    REFUSED(ping.survey = anlos_survey_id(other), "a ping of the survey");
    REFUSED(ping.n_microphones = 3, "3 microphones, but the survey has 4");
    REFUSED(ping.speaker = SPEAKERS, "speaker 4");
    REFUSED(ping.position = POSITIONS, "position 6");
    REFUSED(ping.n_samples = SLOT - 1, "1499 samples, expected a slot");
    REFUSED(ping.down = true, "alternate");
#undef REFUSED
    ok(anlos_pipeline_health(p, &health, &why));
    assert_int_equal(health.refused, 7);
    assert_int_equal(health.pings, 0);
    ping = make_ping(0, 0);
    ping.survey = anlos_survey_id(s);
    echo(samples, 0, 0, 0.01);
    ok(anlos_pipeline_ping(p, &ping, &why));
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(other);
    anlos_survey_destroy(s);
}

static void every_method_has_a_name_and_every_option_a_line(void **state)
{
    (void)state;
    const char *help = NULL;
    char methods[128];
    size_t n = 0, k = 0;
    bool has_fast = false;

    for (; anlos_method(n); n++)
        has_fast = has_fast || !strcmp(anlos_method(n), "fast");
    assert_true(has_fast && n >= 8);
    for (; anlos_option(k, &help, methods, sizeof methods); k++)
        assert_true(help && help[0] && methods[0]);
    assert_true(k > 5);
    assert_non_null(anlos_option(0, NULL, NULL, 0));
}

static void an_emission_is_the_chirp(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(1);
    size_t n = anlos_survey_emission(s, false, NULL, 0);
    float out[SLOT];

    assert_int_equal(n, llrint(CHIRP_S * RATE_HZ));
    assert_int_equal(anlos_survey_emission(s, false, out, n), n);
    for (size_t i = 0; i < n; i++) {
        double t = (double)i / RATE_HZ;
        double turns = START_HZ * t + 0.5 * (STOP_HZ - START_HZ) / CHIRP_S * t * t;
        assert_true(fabs((double)out[i] - cos(2 * PI * turns)) < 1e-6);
    }
    assert_true(anlos_survey_ping_samples(s) > SLOT);
    anlos_survey_destroy(s);
}

/* The paper's array in the paper's scan is what a new survey needs nothing more for. */
static void a_new_survey_has_the_chirp_of_the_paper(void **state)
{
    (void)state;
    struct anlos_survey *s;
    const double places[6] = {0, 0, 0, 0.08, 0, 0};

    ok(anlos_survey_create(&s, &why));
    ok(anlos_survey_speakers(s, places, 1, &why));
    ok(anlos_survey_microphones(s, places + 3, 1, &why));
    ok(anlos_survey_check(s, &why));
    assert_int_equal(anlos_survey_emission(s, false, NULL, 0), 3000);
    anlos_survey_destroy(s);
}

/* Each thread with a pipeline of its own, planned while others plan and destroy. */
static void *work_alone(void *result)
{
    struct anlos_error own_why = {0, ""};
    struct anlos_config cfg;
    struct anlos_survey *s = NULL;
    struct anlos_pipeline *p = NULL;
    const double places[4][3] = {{0, 0, 0}, {0, 0.08, 0}, {0.04, 0, 0}, {0.04, 0.08, 0}};
    float *silence = calloc((size_t)2 * 6000, sizeof *silence);
    int news = -1;

    anlos_config_init(&cfg);
    cfg.threads = 2;
    if (silence && !anlos_survey_create(&s, &own_why) &&
        !anlos_survey_speakers(s, places[0], 2, &own_why) &&
        !anlos_survey_microphones(s, places[2], 2, &own_why) &&
        !anlos_pipeline_create(&p, &cfg, s, &own_why)) {
        struct anlos_ping ping = {.size = sizeof ping};
        ping.n_microphones = 2;
        ping.n_samples = 6000;
        ping.samples = silence;
        for (size_t i = 0; i < 12000; i++)
            silence[i] = (float)((i * 7919) % 211) / 21100.0f;
        for (ping.speaker = 0; ping.speaker < 2; ping.speaker++)
            news = anlos_pipeline_ping(p, &ping, &own_why);
    }
    *(int *)result = news;
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(s);
    free(silence);
    return NULL;
}

static void threads_with_pipelines_of_their_own_do_not_meet(void **state)
{
    (void)state;
    pthread_t threads[4];
    int news[4];

    for (int i = 0; i < 4; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, work_alone, &news[i]), 0);
    for (int i = 0; i < 4; i++)
        assert_int_equal(pthread_join(threads[i], NULL), 0);
    for (int i = 0; i < 4; i++)
        assert_true(news[i] > 0 && (news[i] & ANLOS_NEW_OBJECTS));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_is_found_where_it_is),
        cmocka_unit_test(a_scan_that_lacks_pings_is_imaged_when_it_ends),
        cmocka_unit_test(a_background_is_recorded_first),
        cmocka_unit_test(a_static_array_gives_an_image_each_round),
        cmocka_unit_test(a_broken_microphone_is_left_out_and_counted),
        cmocka_unit_test(walls_that_are_told_move_what_they_mirror),
        cmocka_unit_test(the_version_is_that_of_the_headers),
        cmocka_unit_test(sizes_that_cannot_be_are_refused),
        cmocka_unit_test(null_is_refused),
        cmocka_unit_test(numbers_that_are_none_are_refused),
        cmocka_unit_test(a_survey_that_does_not_fit_is_refused),
        cmocka_unit_test(a_configuration_that_cannot_be_is_refused),
        cmocka_unit_test(a_ping_of_another_survey_or_shape_is_refused),
        cmocka_unit_test(every_method_has_a_name_and_every_option_a_line),
        cmocka_unit_test(an_emission_is_the_chirp),
        cmocka_unit_test(a_new_survey_has_the_chirp_of_the_paper),
        cmocka_unit_test(threads_with_pipelines_of_their_own_do_not_meet),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
