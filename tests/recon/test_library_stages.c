/* SPDX-License-Identifier: MIT */
/* The stages of libanlos by themselves: one after the other they give what the pipeline
 * gives, and refuse what is not theirs. */
#include "tests/recon/library_rig.h"

static void assert_same_object(const struct anlos_object *a, const struct anlos_object *b)
{
    assert_int_equal(a->id, b->id);
    assert_int_equal(a->state, b->state);
    assert_memory_equal(a->position_m, b->position_m, sizeof a->position_m);
    assert_memory_equal(a->covariance_m2, b->covariance_m2, sizeof a->covariance_m2);
    assert_memory_equal(a->velocity_m_s, b->velocity_m_s, sizeof a->velocity_m_s);
    assert_true(a->existence == b->existence && a->wall == b->wall);
}

/* -- a scan -----------------------------------------------------------------------------
 */

/* The brightest coarse voxel of a scan of so many positions, the last of which is so much
 * louder. */
static float coarse_of(struct anlos_pipeline *p, uint32_t scan, size_t positions,
                       double gain, double last_gain)
{
    struct anlos_image image = {.size = sizeof image};
    float most = 0.0f;

    for (size_t k = 0; k < positions * SPEAKERS; k++) {
        struct anlos_ping ping = make_ping(k / SPEAKERS, k % SPEAKERS);
        bool last = k / SPEAKERS == positions - 1;
        ping.scan = scan;
        echo(samples, k / SPEAKERS, k % SPEAKERS, last ? last_gain : gain);
        ok(anlos_pipeline_ping(p, &ping, &why));
    }
    ok(anlos_pipeline_finish(p, &why));
    ok(anlos_pipeline_image(p, &image, &why));
    assert_non_null(image.coarse);
    for (size_t v = 0; v < image.coarse_n[0] * image.coarse_n[1] * image.coarse_n[2]; v++)
        most = fmaxf(most, image.coarse[v]);
    return most;
}

/* Of many positions it is imaged before the last one comes, of few and of a scan that
 * ends early with the image. */
static void what_lies_around_is_of_the_same_scan_without_its_last_position(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(MOST_POSITIONS);
    struct anlos_config cfg;
    struct anlos_pipeline *p;

    anlos_config_init(&cfg);
    ok(anlos_pipeline_create(&p, &cfg, s, &why));
    float first = coarse_of(p, 1, MOST_POSITIONS, 0.01, 0.01);
    assert_true(first > 0.0f);
    assert_true(coarse_of(p, 2, MOST_POSITIONS, 0.01, 0.1) == first);
    assert_true(coarse_of(p, 3, POSITIONS, 0.02, 0.02) >
                2.0f * first); /* 4 but for two */
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(s);
}

static void a_scan_by_stages_is_that_of_the_pipeline(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(POSITIONS);
    struct anlos_config cfg;
    struct anlos_pipeline *p;
    struct anlos_compressor *c;
    struct anlos_imager *m;
    struct anlos_detector *d;
    struct anlos_traces traces = {.size = sizeof traces};
    struct anlos_image image = {.size = sizeof image}, whole = {.size = sizeof whole};
    struct anlos_object a = {.size = sizeof a}, b = {.size = sizeof b};
    struct anlos_list list = {.size = sizeof list};

    anlos_config_init(&cfg);
    ok(anlos_pipeline_create(&p, &cfg, s, &why));
    ok(anlos_compressor_create(&c, &cfg, s, &why));
    ok(anlos_imager_create(&m, &cfg, s, &why));
    ok(anlos_detector_create(&d, &cfg, s, &why));
    refused(anlos_imager_image(m, &image, &why), ANLOS_NOT_READY, "before");
    refused(anlos_detector_object(d, 0, &a, &why), ANLOS_NOT_READY, "no list");
    for (size_t k = 0; k < POSITIONS * SPEAKERS; k++) {
        struct anlos_ping ping = make_ping(k / SPEAKERS, k % SPEAKERS);
        echo(samples, k / SPEAKERS, k % SPEAKERS, 0.01);
        ok(anlos_pipeline_ping(p, &ping, &why));
        assert_int_equal(anlos_compressor_ping(c, &ping, &traces, &why), 1);
        assert_true(traces.n_microphones == MICS && traces.n_samples > 10);
        int complete = anlos_imager_add(m, &traces, &why);
        ok(complete);
        assert_int_equal(complete, k == POSITIONS * SPEAKERS - 1);
        if (k == 5) {
            ok(anlos_imager_image(m, &image, &why));
            assert_true(image.preview && image.pings_used == 6);
        }
    }
    ok(anlos_imager_image(m, &image, &why));
    ok(anlos_pipeline_image(p, &whole, &why));
    assert_false(image.preview);
    assert_memory_equal(image.intensity, whole.intensity,
                        image.n[0] * image.n[1] * image.n[2] * sizeof(float));
    ok(anlos_detector_image(d, &image, NULL, 0, &why));
    ok(anlos_detector_list(d, &list, &why));
    assert_int_equal(list.n, 1);
    ok(anlos_detector_object(d, 0, &a, &why));
    ok(anlos_pipeline_object(p, 0, &b, &why));
    assert_same_object(&a, &b);
    ok(anlos_detector_image(d, &image, NULL, 0, &why)); /* of no wall: */
    struct anlos_wall wall = {.size = sizeof wall, .id = 3, .normal = {0, 0, 1}};
    wall.distance_m = 0.75;
    wall.existence = 1;
    ok(anlos_detector_image(d, &image, &wall, 1, &why));
    ok(anlos_detector_object(d, 0, &a, &why));
    assert_true(fabs(a.position_m[2] - (1.5 - point_m[2])) < 0.01 && a.wall == 3);
    anlos_detector_destroy(d);
    anlos_imager_destroy(m);
    anlos_compressor_destroy(c);
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(s);
}

/* A trace's peak lies at the echo's delay: t0 + n / rate. */
static void a_trace_peaks_at_the_delay_of_its_echo(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(POSITIONS);
    struct anlos_config cfg;
    struct anlos_compressor *c;
    struct anlos_traces t = {.size = sizeof t};
    struct anlos_ping ping = make_ping(2, 1);
    const double from[3] = {stage[2], element(1), 0};

    anlos_config_init(&cfg);
    ok(anlos_compressor_create(&c, &cfg, s, &why));
    echo(samples, 2, 1, 0.25);
    ok(anlos_compressor_ping(c, &ping, &t, &why));
    for (size_t m = 0; m < MICS; m++) {
        const double to[3] = {stage[2] + 0.04, element(m), 0};
        double delay = (distance(from, point_m) + distance(point_m, to)) / SPEED;
        size_t best = 0;
        double most = 0;
        for (size_t n = 0; n < t.n_samples; n++) {
            const float *y = t.samples + 2 * (m * t.n_samples + n);
            if (hypot((double)y[0], (double)y[1]) > most) {
                most = hypot((double)y[0], (double)y[1]);
                best = n;
            }
        }
        assert_true(fabs(t.t0_s + (double)best / t.rate_hz - delay) < 0.6 / t.rate_hz);
        assert_true(fabs(most - 0.25) < 0.03); /* between two samples it is lower */
    }
    anlos_compressor_destroy(c);
    anlos_survey_destroy(s);
}

/* -- a static array ---------------------------------------------------------------------
 */

enum { ROW = 4 };

static double along(size_t i) /* a row of elements, level */
{
    return 0.12 * (double)i;
}

static void microphone(size_t i, double at_m[3])
{
    at_m[0] = along(i) + 0.06;
    at_m[1] = 0.03;
    at_m[2] = 0;
}

/* By way of a point; NULL: of an image source behind the wall at z = wall_m. */
static void hear(size_t speaker, const double *point, double wall_m)
{
    const double at[3] = {along(speaker), 0, 0}, image[3] = {at[0], 0, 2 * wall_m};
    double to[3];

    memset(samples, 0, sizeof samples);
    for (size_t m = 0; m < ROW; m++) {
        microphone(m, to);
        double way = point ? distance(at, point) + distance(point, to)
                           : distance(image, to);
        add_chirp(samples + m * PING, way / SPEED, 0.05);
    }
}

/* It looks ahead, from half a metre above the ground. */
static struct anlos_survey *make_row(void)
{
    static const double x[] = {-0.4, 1, 0.02}, y[] = {0, 0, 1}, z[] = {0.9, 1.6, 0.01};
    static const double at[] = {0, 0, 0.5}, left[] = {0, 1, 0}, up[] = {0, 0, 1};
    struct anlos_survey *s;
    double speakers[ROW][3] = {{0}}, mics[ROW][3];

    for (size_t i = 0; i < ROW; i++) {
        speakers[i][0] = along(i);
        microphone(i, mics[i]);
    }
    ok(anlos_survey_create(&s, &why));
    ok(anlos_survey_speakers(s, speakers[0], ROW, &why));
    ok(anlos_survey_microphones(s, mics[0], ROW, &why));
    ok(anlos_survey_chirp(s, START_HZ, STOP_HZ, CHIRP_S, false, &why));
    ok(anlos_survey_sampling(s, RATE_HZ, SLOT, 0, &why));
    ok(anlos_survey_sound_speed(s, SPEED, &why));
    ok(anlos_survey_volume(s, x, y, z, &why));
    ok(anlos_survey_mount(s, at, left, up, &why));
    return s;
}

static void a_static_array_by_stages_is_that_of_the_pipeline(void **state)
{
    (void)state;
    struct anlos_survey *s = make_row();
    struct anlos_config cfg;
    struct anlos_pipeline *p;
    struct anlos_compressor *c;
    struct anlos_static_array *a;
    struct anlos_tracker *t;
    struct anlos_wall wall = {.size = sizeof wall, .id = 1, .normal = {0, 0, 1}};
    struct anlos_traces traces = {.size = sizeof traces};
    struct anlos_image image = {.size = sizeof image};
    struct anlos_list x = {.size = sizeof x}, y = {.size = sizeof y};
    size_t objects = 0;

    wall.distance_m = WALL_M;
    wall.existence = 1;
    anlos_config_init_static(&cfg);
    cfg.background = ANLOS_BACKGROUND_NONE;
    cfg.false_alarm_rate = 0;
    cfg.lost_s = 100;
    ok(anlos_pipeline_create(&p, &cfg, s, &why));
    ok(anlos_compressor_create(&c, &cfg, s, &why));
    ok(anlos_static_array_create(&a, &cfg, s, &why));
    ok(anlos_tracker_create(&t, &cfg, s, &why));
    refused(anlos_static_array_image(a, &image, &why), ANLOS_NOT_READY, "before");
    ok(anlos_pipeline_walls(p, &wall, 1, SECOND, &why));
    ok(anlos_static_array_walls(a, &wall, 1, SECOND, &why));
    ok(anlos_tracker_walls(t, &wall, 1, SECOND, &why));
    ok(anlos_pipeline_ego(p, 0, 0, SECOND, &why));
    ok(anlos_compressor_ego(c, 0, 0, SECOND, &why));
    ok(anlos_static_array_ego(a, 0, 0, SECOND, &why));
    ok(anlos_tracker_ego(t, 0, 0, SECOND, &why));
    for (size_t k = 0; k < 12 * SPEAKERS; k++) {
        struct anlos_ping ping = make_ping(0, k % SPEAKERS);
        const double at[3] = {0.2, 0, 1.5 - 0.3 * (double)k / 32}; /* comes nearer */
        hear(k % SPEAKERS, at, 0);
        ping.capture_ns = SECOND + (int64_t)k * SECOND / 32;
        int news = anlos_pipeline_ping(p, &ping, &why);
        ok(news);
        assert_int_equal(anlos_compressor_ping(c, &ping, &traces, &why), 1);
        int due = anlos_static_array_add(a, &traces, &why);
        ok(due);
        assert_int_equal(!!(news & ANLOS_NEW_IMAGE), due);
        if (!due)
            continue;
        ok(anlos_static_array_image(a, &image, &why));
        ok(anlos_tracker_image(t, &image, &why));
        ok(anlos_tracker_list(t, &x, &why));
        ok(anlos_pipeline_list(p, &y, &why));
        assert_true(x.n == y.n && x.capture_ns == y.capture_ns && x.tracked);
        for (size_t i = 0; i < x.n; i++, objects++) {
            struct anlos_object one = {.size = sizeof one}, other = one;
            ok(anlos_tracker_object(t, i, &one, &why));
            ok(anlos_pipeline_object(p, i, &other, &why));
            assert_same_object(&one, &other);
        }
    }
    assert_true(objects > 0 && y.n == 1);
    image.capture_ns -= SECOND / 2;
    refused(anlos_tracker_image(t, &image, &why), ANLOS_STALE, "");
    anlos_tracker_destroy(t);
    anlos_static_array_destroy(a);
    anlos_compressor_destroy(c);
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(s);
}

/* -- walls ------------------------------------------------------------------------------
 */

static void a_wall_is_found_where_it_is(void **state)
{
    (void)state;
    struct anlos_survey *s = make_row();
    struct anlos_config cfg;
    struct anlos_wall_finder *f;
    struct anlos_wall w = {.size = sizeof w};
    int64_t at_ns = 0;
    int lists = 0;

    anlos_config_init_static(&cfg);
    cfg.walls = ANLOS_WALLS_HEARD;
    cfg.background = ANLOS_BACKGROUND_NONE;
    ok(anlos_wall_finder_create(&f, &cfg, s, &why));
    for (size_t k = 0; k < 100; k++) { /* 3 s */
        struct anlos_ping ping = make_ping(0, k % ROW);
        hear(k % ROW, NULL, 1.1);
        ping.capture_ns = SECOND + (int64_t)k * SECOND / 32;
        int news = anlos_wall_finder_ping(f, &ping, &why);
        ok(news);
        lists += news;
    }
    assert_true(lists > 1);
    assert_int_equal(anlos_wall_finder_n_walls(f, &at_ns), 1);
    assert_true(at_ns > 3 * SECOND);
    ok(anlos_wall_finder_wall(f, 0, &w, &why));
    assert_true(fabs(w.distance_m - 1.1) < 0.005 && w.normal[2] > 0.9998);
    assert_int_equal(w.origin, ANLOS_WALL_ESTIMATED);
    assert_true(w.existence > 0.5);
    refused(anlos_wall_finder_wall(f, 1, &w, &why), ANLOS_INVALID, "wall 1 of 1");
    refused(anlos_wall_finder_given(f, &w, 1, SECOND, &why), ANLOS_INVALID, "GIVEN");
    anlos_wall_finder_destroy(f);
    cfg.walls = ANLOS_WALLS_GIVEN; /* what is given is told */
    w = (struct anlos_wall){.size = sizeof w, .id = 9, .normal = {1, 0, 0}};
    w.distance_m = 2.0;
    w.existence = 1.0;
    w.origin = ANLOS_WALL_GIVEN;
    ok(anlos_wall_finder_create(&f, &cfg, s, &why));
    assert_int_equal(anlos_wall_finder_given(f, &w, 1, SECOND, &why), 1);
    assert_int_equal(anlos_wall_finder_n_walls(f, NULL), 1);
    w.id = 0;
    ok(anlos_wall_finder_wall(f, 0, &w, &why));
    assert_int_equal(w.id, 9);
    assert_true(fabs(w.distance_m - 2.0) < 1e-9 && fabs(w.normal[2] - 1) < 1e-9);
    anlos_wall_finder_destroy(f);
    anlos_survey_destroy(s);
}

/* -- ego motion -------------------------------------------------------------------------
 */

static void a_point_stays_while_the_vehicle_turns(void **state)
{
    (void)state;
    struct anlos_ego *e;
    const double v = 8.0, w = 0.7, t = 0.09, radius = v / w;
    const double dx = radius * sin(w * t), dy = radius * (1 - cos(w * t));
    const double from[3] = {10, 3, 1};
    double to[3], speed = 0, yaw = 0;

    ok(anlos_ego_create(&e, &why));
    refused(anlos_ego_at(e, 0, &speed, &yaw, &why), ANLOS_NOT_READY, "not known");
    ok(anlos_ego_add(e, v, w, SECOND, &why));
    refused(anlos_ego_add(e, v, w, SECOND, &why), ANLOS_STALE, "not later");
    ok(anlos_ego_at(e, SECOND + SECOND / 20, &speed, &yaw, &why));
    assert_true(speed == v && yaw == w);
    ok(anlos_ego_point(e, SECOND, SECOND + 9 * (SECOND / 100), from, to, &why));
    /* The earlier point less the way, turned back by the turn. */
    double x = from[0] - dx, y = from[1] - dy;
    assert_true(fabs(to[0] - (cos(w * t) * x + sin(w * t) * y)) < 1e-9);
    assert_true(fabs(to[1] - (-sin(w * t) * x + cos(w * t) * y)) < 1e-9);
    assert_true(to[2] == from[2]);
    refused(anlos_ego_point(e, SECOND, 3 * SECOND, from, to, &why), ANLOS_NOT_READY,
            "all the way");
    anlos_ego_destroy(e);
}

/* -- what is not theirs -----------------------------------------------------------------
 */

static void traces_and_images_of_others_are_refused(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(POSITIONS), *other = make_survey(1);
    struct anlos_config cfg;
    struct anlos_imager *m;
    struct anlos_detector *d;
    struct anlos_compressor *c;
    struct anlos_ping ping = make_ping(0, 0);
    struct anlos_traces t = {.size = sizeof t}, changed;
    static const float pixels[8];
    struct anlos_image image = {.size = sizeof image, .n = {2, 2, 2}}, wrong;
    const int I = ANLOS_INVALID;

    anlos_config_init(&cfg);
    ok(anlos_imager_create(&m, &cfg, s, &why));
    ok(anlos_detector_create(&d, &cfg, s, &why));
    ok(anlos_compressor_create(&c, &cfg, s, &why));
    echo(samples, 0, 0, 0.01);
    ok(anlos_compressor_ping(c, &ping, &t, &why));
#define TRACES(change, words)                                                            \
    do {                                                                                 \
        changed = t;                                                                     \
        change;                                                                          \
        refused(anlos_imager_add(m, &changed, &why), I, words);                          \
    } while (0)
    TRACES(changed.survey = anlos_survey_id(other), "another survey");
    TRACES(changed.n_samples--, "do not fit");
    TRACES(changed.rate_hz *= 2, "do not fit");
    TRACES(changed.n_microphones = 1, "1 microphones");
    TRACES(changed.speaker = SPEAKERS, "speaker 4");
    TRACES(changed.samples = NULL, "samples of traces is NULL");
    TRACES(changed.size--, "its size is");
    TRACES(changed.capture_ns = -1, "capture_ns");
#undef TRACES
    ok(anlos_imager_add(m, &t, &why));
    image.intensity = pixels;
    for (int a = 0; a < 3; a++)
        image.step_m[a] = 0.1;
#define IMAGE(change, words)                                                             \
    do {                                                                                 \
        wrong = image;                                                                   \
        change;                                                                          \
        refused(anlos_detector_image(d, &wrong, NULL, 0, &why), I, words);               \
    } while (0)
    IMAGE(wrong.survey = anlos_survey_id(other), "another survey");
    IMAGE(wrong.intensity = NULL, "is NULL");
    IMAGE(wrong.n[1] = 0, "along y");
    IMAGE(wrong.step_m[2] = NAN, "along z");
    IMAGE(wrong.origin_m[0] = NAN, "origin");
    static const float beyond[2][4] = {{0.0f, 0.0f, 1.0f, 1.0f}, {0.0f, NAN, 1.0f, 1.0f}};
    static const float below[4] = {0.0f, 0.0f, 1.0f, -1.0f};
    IMAGE(wrong.coarse = wrong.intensity, "coarse voxels");
    IMAGE(wrong.n_beyond = 1, "beyond of an image is NULL");
    IMAGE((wrong.beyond = beyond[0], wrong.n_beyond = 257), "256 at most");
    IMAGE((wrong.beyond = beyond[0], wrong.n_beyond = 2), "place 1 is none");
    IMAGE((wrong.beyond = below, wrong.n_beyond = 1), "place 0 is none");
    static const float movers[2][7] = {{0.0f, 0.0f, 1.0f, 0.5f, 0.0f, 0.0f, 9.0f},
                                       {0.0f, 0.0f, 1.0f, 0.5f, 0.0f, 0.0f, -1.0f}};
    IMAGE(wrong.n_movers = 1, "movers of an image is NULL");
    IMAGE((wrong.movers = movers[0], wrong.n_movers = 9), "8 at most");
    IMAGE((wrong.movers = movers[0], wrong.n_movers = 2),
          "movers of an image: 1 is none");
    IMAGE(wrong.n_ambiguous = 1, "ambiguous of an image is NULL");
    IMAGE((wrong.ambiguous = movers[0], wrong.n_ambiguous = 2),
          "ambiguous of an image: 1 is none");
    static const float courses[2][8] = {{0.0f, 0.0f, 1.0f, 0.5f, 0.0f, 0.0f, 9.0f, 0.5f},
                                        {0.0f, 0.0f, 1.0f, 0.5f, 0.0f, 0.0f, 9.0f, 1.5f}};
    IMAGE(wrong.n_courses = 1, "courses of an image is NULL");
    IMAGE((wrong.courses = courses[0], wrong.n_courses = 9), "8 at most");
    IMAGE((wrong.courses = courses[0], wrong.n_courses = 2),
          "courses of an image: 1 is none");
#undef IMAGE
    ok(anlos_detector_image(d, &image, NULL, 0, &why)); /* empty: no objects */
    anlos_compressor_destroy(c);
    anlos_detector_destroy(d);
    anlos_imager_destroy(m);
    anlos_survey_destroy(other);
    anlos_survey_destroy(s);
}

/* A program that calls the library has no launch file. */
static void what_does_not_fit_names_the_field_of_the_configuration(void **state)
{
    (void)state;
    struct anlos_survey *stepped = make_survey(POSITIONS), *s = make_survey(1);
    static const float pixels[1];
    struct anlos_image image = {
        .size = sizeof image, .n = {1, 1, 1}, .intensity = pixels};
    struct anlos_config cfg;
    struct anlos_static_array *a;
    struct anlos_detector *d;

    anlos_config_init_static(&cfg);
    refused(anlos_static_array_create(&a, &cfg, stepped, &why), ANLOS_UNSUPPORTED,
            "array: a static array stands, and this survey has");
    ok(anlos_detector_create(&d, &cfg, s, &why));
    for (int i = 0; i < 3; i++)
        image.step_m[i] = 0.1;
    refused(anlos_detector_image(d, &image, NULL, 0, &why), ANLOS_INVALID,
            "false_alarm_rate: a volume that is too small");
    anlos_detector_destroy(d);
    anlos_survey_destroy(s);
    anlos_survey_destroy(stepped);
}

static void null_is_refused_by_each_stage(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(1);
    struct anlos_config cfg;
    struct anlos_traces traces = {.size = sizeof traces};
    struct anlos_image image = {.size = sizeof image};
    struct anlos_object object = {.size = sizeof object};
    struct anlos_list list = {.size = sizeof list};
    struct anlos_wall wall = {.size = sizeof wall};
    struct anlos_ping ping = make_ping(0, 0);
    struct anlos_imager *m = NULL;
    struct anlos_ego *e = NULL;
    double x[3] = {0};
    const int I = ANLOS_INVALID;

    anlos_config_init(&cfg);
    refused(anlos_imager_create(NULL, &cfg, s, &why), I, "out is NULL");
    refused(anlos_imager_create(&m, NULL, s, &why), I, "config is NULL");
    refused(anlos_imager_create(&m, &cfg, NULL, &why), I, "survey is NULL");
    refused(anlos_compressor_create(NULL, &cfg, s, &why), I, "out is NULL");
    refused(anlos_static_array_create(NULL, &cfg, s, &why), I, "out is NULL");
    refused(anlos_wall_finder_create(NULL, &cfg, s, &why), I, "out is NULL");
    refused(anlos_detector_create(NULL, &cfg, s, &why), I, "out is NULL");
    refused(anlos_tracker_create(NULL, &cfg, s, &why), I, "out is NULL");
    refused(anlos_ego_create(NULL, &why), I, "out is NULL");
    refused(anlos_imager_add(NULL, &traces, &why), I, "imager is NULL");
    refused(anlos_imager_image(NULL, &image, &why), I, "imager is NULL");
    refused(anlos_compressor_ping(NULL, &ping, &traces, &why), I, "compressor is NULL");
    refused(anlos_static_array_add(NULL, &traces, &why), I, "array is NULL");
    refused(anlos_static_array_image(NULL, &image, &why), I, "array is NULL");
    refused(anlos_static_array_ego(NULL, 0, 0, 0, &why), I, "array is NULL");
    refused(anlos_static_array_walls(NULL, &wall, 1, 0, &why), I, "array is NULL");
    refused(anlos_wall_finder_ping(NULL, &ping, &why), I, "finder is NULL");
    refused(anlos_wall_finder_wall(NULL, 0, &wall, &why), I, "finder is NULL");
    refused(anlos_detector_image(NULL, &image, NULL, 0, &why), I, "detector is NULL");
    refused(anlos_detector_list(NULL, &list, &why), I, "detector is NULL");
    refused(anlos_detector_object(NULL, 0, &object, &why), I, "detector is NULL");
    refused(anlos_tracker_image(NULL, &image, &why), I, "tracker is NULL");
    refused(anlos_tracker_walls(NULL, &wall, 1, 0, &why), I, "tracker is NULL");
    refused(anlos_tracker_list(NULL, &list, &why), I, "tracker is NULL");
    refused(anlos_tracker_object(NULL, 0, &object, &why), I, "tracker is NULL");
    refused(anlos_ego_add(NULL, 0, 0, 0, &why), I, "motion is NULL");
    ok(anlos_ego_create(&e, &why));
    refused(anlos_ego_add(e, NAN, 0, 0, &why), I, "a vehicle with");
    refused(anlos_ego_at(e, 0, NULL, x, &why), I, "speed_m_s is NULL");
    refused(anlos_ego_point(e, 0, 1, NULL, x, &why), I, "from_m is NULL");
    assert_null(m);
    assert_int_equal(anlos_wall_finder_n_walls(NULL, NULL), 0);
    anlos_ego_destroy(e);
    anlos_ego_destroy(NULL);
    anlos_imager_destroy(NULL);
    anlos_compressor_destroy(NULL);
    anlos_static_array_destroy(NULL);
    anlos_wall_finder_destroy(NULL);
    anlos_detector_destroy(NULL);
    anlos_tracker_destroy(NULL);
    anlos_survey_destroy(s);
}

static bool says(void *ctx)
{
    return *(bool *)ctx;
}

static void assert_same_image(const struct anlos_image *a, const struct anlos_image *b)
{
    assert_memory_equal(a->n, b->n, sizeof a->n);
    assert_memory_equal(a->intensity, b->intensity,
                        a->n[0] * a->n[1] * a->n[2] * sizeof(float));
}

static void an_image_that_is_stopped_can_be_asked_for_again(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(POSITIONS);
    struct anlos_config cfg;
    struct anlos_pipeline *p;
    struct anlos_compressor *c;
    struct anlos_imager *m;
    struct anlos_traces traces = {.size = sizeof traces};
    struct anlos_image image = {.size = sizeof image}, whole = {.size = sizeof whole};
    struct anlos_list list = {.size = sizeof list};
    bool stops = true;

    anlos_config_init(&cfg);
    assert_null(cfg.stop);
    cfg.method = "backprojection";
    cfg.stop = says;
    cfg.stop_ctx = &stops;
    refused(anlos_imager_create(&m, &cfg, s, &why), ANLOS_CANCELED, "stopped");
    refused(anlos_pipeline_create(&p, &cfg, s, &why), ANLOS_CANCELED, "stopped");
    assert_null(p);
    stops = false;
    ok(anlos_imager_create(&m, &cfg, s, &why));
    ok(anlos_pipeline_create(&p, &cfg, s, &why));
    ok(anlos_compressor_create(&c, &cfg, s, &why));
    for (size_t k = 0; k < POSITIONS * SPEAKERS; k++) {
        struct anlos_ping ping = make_ping(k / SPEAKERS, k % SPEAKERS);
        echo(samples, k / SPEAKERS, k % SPEAKERS, 0.01);
        assert_int_equal(anlos_compressor_ping(c, &ping, &traces, &why), 1);
        stops = k == POSITIONS * SPEAKERS - 1;
        ok(anlos_imager_add(m, &traces, &why));
        if (stops)
            refused(anlos_pipeline_ping(p, &ping, &why), ANLOS_CANCELED, "stopped");
        else
            ok(anlos_pipeline_ping(p, &ping, &why));
    }
    refused(anlos_imager_image(m, &image, &why), ANLOS_CANCELED, "stopped");
    refused(anlos_pipeline_image(p, &whole, &why), ANLOS_NOT_READY, "no image");
    refused(anlos_pipeline_finish(p, &why), ANLOS_CANCELED, "stopped");
    stops = false;
    ok(anlos_imager_image(m, &image, &why));
    assert_int_equal(anlos_pipeline_finish(p, &why), ANLOS_NEW_IMAGE | ANLOS_NEW_OBJECTS);
    ok(anlos_pipeline_image(p, &whole, &why));
    assert_int_equal(whole.pings_used, POSITIONS * SPEAKERS);
    assert_same_image(&image, &whole);
    ok(anlos_pipeline_list(p, &list, &why));
    assert_int_equal(list.n, 1);
    anlos_imager_destroy(m);
    anlos_pipeline_destroy(p);
    anlos_compressor_destroy(c);
    anlos_survey_destroy(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_lies_around_is_of_the_same_scan_without_its_last_position),
        cmocka_unit_test(a_scan_by_stages_is_that_of_the_pipeline),
        cmocka_unit_test(an_image_that_is_stopped_can_be_asked_for_again),
        cmocka_unit_test(a_trace_peaks_at_the_delay_of_its_echo),
        cmocka_unit_test(a_static_array_by_stages_is_that_of_the_pipeline),
        cmocka_unit_test(a_wall_is_found_where_it_is),
        cmocka_unit_test(a_point_stays_while_the_vehicle_turns),
        cmocka_unit_test(traces_and_images_of_others_are_refused),
        cmocka_unit_test(what_does_not_fit_names_the_field_of_the_configuration),
        cmocka_unit_test(null_is_refused_by_each_stage),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
