/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/can/sender.h"
#include "tests/nodes/near.h"

#define MS 1000000LL

static void init(struct sender *s, uint32_t base)
{
    struct sender_config cfg;

    sender_config_set(&cfg, NULL);
    cfg.base_id = base;
    sender_init(s, &cfg);
}

struct list {
    Anlos__DetectionList message;
    Anlos__Detection detections[40], *pointers[40];
    Anlos__Vec3 position, extent;
    double covariance[6];
};

static void fill(struct list *l, size_t n)
{
    anlos__detection_list__init(&l->message);
    anlos__vec3__init(&l->position);
    anlos__vec3__init(&l->extent);
    l->position.x = 4.0;
    l->position.y = -1.5;
    l->position.z = 0.5;
    l->extent.x = 0.2;
    l->extent.y = 0.3;
    l->extent.z = 1.1;
    memcpy(l->covariance, (const double[]){4e-4, 1e-4, 0, 1e-4, 0, 1e-4},
           sizeof l->covariance);
    for (size_t i = 0; i < n; i++) {
        Anlos__Detection *d = l->pointers[i] = &l->detections[i];
        anlos__detection__init(d);
        d->id = (uint32_t)i + 1;
        d->position_m = &l->position;
        d->extent_m = &l->extent;
        d->covariance_m2 = l->covariance;
        d->n_covariance_m2 = 6;
        d->existence = 0.75;
    }
    l->message.detections = l->pointers;
    l->message.n_detections = n;
    l->message.counter = 5;
    l->message.mirrored = true;
    l->message.in_vehicle_frame = true;
}

static void assert_frame(const struct can_frame_data *is,
                         const struct can_frame_data *expected)
{
    assert_int_equal(is->id, expected->id);
    assert_int_equal(is->size, expected->size);
    assert_memory_equal(is->data, expected->data, expected->size);
}

static void a_list_is_header_time_and_three_frames_an_object(void **state)
{
    struct sender s;
    struct list l;
    struct can_frame_data expected;
    struct sender_list sent;
    const struct can_frame_data *f = sent.frames;
    static const uint32_t ids[] = {0x502, 0x503, 0x504, 0x505,
                                   0x506, 0x504, 0x505, 0x506};

    (void)state;
    init(&s, 0x500);
    fill(&l, 2);
    sender_list(&s, &l.message, 1000 * MS, &sent);
    sender_finalize(&s, &sent, 1030 * MS, 0);
    assert_int_equal(sent.n_frames, 8);
    for (size_t i = 0; i < 8; i++)
        assert_int_equal(f[i].id, ids[i]);
    can_pack_list_header(&expected, 0x500,
                         &(struct can_list_header){.number = 2,
                                                   .counter = 5,
                                                   .latency_ms = 30.0,
                                                   .cycle_ms = NAN,
                                                   .time_sync = CAN_SYNC_UNKNOWN});
    assert_frame(&f[0], &expected);
    can_pack_time(&expected, 0x500, 1000 * MS);
    assert_frame(&f[1], &expected);
}

static void an_object_carries_what_the_detection_says(void **state)
{
    struct sender s;
    struct list l;
    struct can_frame_data expected;
    struct sender_list sent;
    const struct can_frame_data *f = sent.frames;
    const struct can_object object = {.id = 1,
                                      .counter = 5,
                                      .position_m = {4.0, -1.5, 0.5},
                                      .measurement = CAN_NEW,
                                      .existence = 0.75,
                                      .velocity_m_s = {NAN, NAN},
                                      .sigma_m = {0.02, 0.01},
                                      .sigma_v_m_s = NAN,
                                      .correlation = 0.5,
                                      .length_m = 0.2,
                                      .width_m = 0.3};

    (void)state;
    init(&s, 0x400);
    fill(&l, 1);
    sender_list(&s, &l.message, 1, &sent);
    sender_finalize(&s, &sent, 1, 0);
    assert_int_equal(sent.n_frames, 5);
    can_pack_object_state(&expected, 0x400, &object);
    assert_frame(&f[2], &expected);
    can_pack_object_dynamics(&expected, 0x400, &object);
    assert_frame(&f[3], &expected);
    can_pack_object_quality(&expected, 0x400, &object);
    assert_frame(&f[4], &expected);
}

/* Its shape is nobody's then. */
static void an_echo_of_other_objects_is_a_class_of_its_own(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;
    struct can_object o;

    (void)state;
    init(&s, 0x400);
    fill(&l, 1);
    l.message.detections[0]->shape = ANLOS__SHAPE__POINT;
    l.message.detections[0]->multipath = ANLOS__MULTIPATH__OF_A_PAIR;
    sender_list(&s, &l.message, 1, &sent);
    sender_finalize(&s, &sent, 1, 0);
    assert_int_equal(can_unpack_object_dynamics(&sent.frames[3], &o), 0);
    assert_int_equal(o.class, CAN_MULTIPATH);
}

/* Not when it was made: it may have waited for the bus. */
static void age_and_cycle_are_those_of_when_it_goes_out(void **state)
{
    struct sender s;
    struct list l;
    struct can_frame_data expected;
    struct sender_list sent;
    const struct can_frame_data *f = sent.frames;

    (void)state;
    init(&s, 0x400);
    fill(&l, 0);
    sender_list(&s, &l.message, 1100 * MS, &sent);
    sender_finalize(&s, &sent, 1105 * MS, 1010 * MS);
    sender_finalize(&s, &sent, 1120 * MS, 1010 * MS);
    can_pack_list_header(&expected, 0x400,
                         &(struct can_list_header){.counter = 5,
                                                   .latency_ms = 20.0,
                                                   .cycle_ms = 110.0,
                                                   .time_sync = CAN_SYNC_UNKNOWN});
    assert_frame(&f[0], &expected);
}

static void more_objects_than_fit_are_cut_off_and_said(void **state)
{
    struct sender s;
    struct list l;
    struct can_frame_data expected;
    struct sender_list sent;
    const struct can_frame_data *f = sent.frames;

    (void)state;
    init(&s, 0x400);
    fill(&l, 40);
    sender_list(&s, &l.message, 0, &sent);
    sender_finalize(&s, &sent, 7 * MS, 0);
    assert_int_equal(sent.n_frames, 2 + 3 * CAN_MAX_OBJECTS);
    can_pack_list_header(&expected, 0x400,
                         &(struct can_list_header){.number = CAN_MAX_OBJECTS,
                                                   .counter = 5,
                                                   .latency_ms = NAN,
                                                   .cycle_ms = NAN,
                                                   .time_sync = CAN_SYNC_UNKNOWN,
                                                   .truncated = true});
    assert_frame(&f[0], &expected);
}

/* Of the one object of the list, only that it is there is known. */
static void assert_nowhere(const struct list *l)
{
    struct sender s;
    struct can_frame_data expected;
    struct sender_list sent;
    const struct can_frame_data *f = sent.frames;
    const struct can_object object = {.id = 1,
                                      .counter = 5,
                                      .position_m = {NAN, NAN, NAN},
                                      .existence = 0.75,
                                      .velocity_m_s = {NAN, NAN},
                                      .sigma_m = {NAN, NAN},
                                      .sigma_v_m_s = NAN,
                                      .correlation = NAN,
                                      .length_m = NAN,
                                      .width_m = NAN};

    init(&s, 0x400);
    sender_list(&s, &l->message, 1, &sent);
    sender_finalize(&s, &sent, 1, 0);
    assert_int_equal(sent.n_frames, 5);
    can_pack_object_state(&expected, 0x400, &object);
    assert_frame(&f[2], &expected);
    can_pack_object_dynamics(&expected, 0x400, &object);
    assert_frame(&f[3], &expected);
    can_pack_object_quality(&expected, 0x400, &object);
    assert_frame(&f[4], &expected);
}

static void what_a_detection_does_not_say_is_not_available(void **state)
{
    struct list l;

    (void)state;
    fill(&l, 1);
    l.detections[0].position_m = NULL;
    l.detections[0].extent_m = NULL;
    l.detections[0].n_covariance_m2 = 0;
    assert_nowhere(&l);
}

/* Where the wall or the array stands is not known: neither is where the object is. */
static void a_place_outside_of_the_vehicle_frame_is_not_sent(void **state)
{
    struct list l;

    (void)state;
    fill(&l, 1);
    l.message.mirrored = false;
    assert_nowhere(&l);
    fill(&l, 1);
    l.message.in_vehicle_frame = false;
    assert_nowhere(&l);
}

static void assert_status(const struct sender *s, enum can_state state,
                          enum can_source source)
{
    struct can_frame_data f, expected;
    const struct can_status status = {.state = state,
                                      .source = source,
                                      .temperature_c = 20.0,
                                      .sound_speed_m_s = 343.2,
                                      .range_m = NAN};

    sender_status(s, &f);
    can_pack_status(&expected, 0x400, &status);
    assert_frame(&f, &expected);
}

static void the_status_follows_the_survey(void **state)
{
    struct sender s;
    Anlos__Survey survey = ANLOS__SURVEY__INIT;

    (void)state;
    survey.source = ANLOS__SOURCE__LIVE;
    survey.temperature_c = 20.0;
    survey.sound_speed_m_s = 343.2;
    init(&s, 0x400);
    sender_survey(&s, &survey);
    assert_status(&s, CAN_INIT, CAN_LIVE);
}

static void what_is_not_known_to_be_live_never_looks_live(void **state)
{
    struct sender s;
    Anlos__Survey survey = ANLOS__SURVEY__INIT;

    (void)state;
    init(&s, 0x400);
    assert_int_equal(s.status.source, CAN_SOURCE_UNKNOWN); /* until a survey says it */
    survey.temperature_c = 20.0;
    survey.sound_speed_m_s = 343.2;
    survey.source = (Anlos__Source)9;
    sender_survey(&s, &survey);
    assert_status(&s, CAN_INIT, CAN_SIMULATION);
    survey.source = ANLOS__SOURCE__REPLAY;
    sender_survey(&s, &survey);
    assert_status(&s, CAN_INIT, CAN_REPLAY);
}

/* A list of tracks: each says what it knows of itself. */
/* The vehicle has heard of them before. */
static void know_tracks(struct sender *s)
{
    for (size_t id = 0; id < 256; id++)
        s->told[id] = true;
}

static void fill_tracks(struct list *l, size_t n)
{
    static double velocity[] = {-1.5, 0.25}, velocity_covariance[] = {0.04, 0.0, 0.09};

    fill(l, n);
    l->message.tracked = true;
    for (size_t i = 0; i < n; i++) {
        Anlos__Detection *d = &l->detections[i];
        d->measurement = ANLOS__MEASUREMENT__MEASURED;
        d->velocity_m_s = velocity;
        d->n_velocity_m_s = 2;
        d->velocity_covariance_m2_s2 = velocity_covariance;
        d->n_velocity_covariance_m2_s2 = 3;
        d->shape = ANLOS__SHAPE__EXTENDED;
        d->shape_probability = 0.8;
        d->motion = ANLOS__MOTION__MOVING;
        d->age_s = 3.5;
        d->unseen_s = 0.25;
        d->wall = 2;
        d->in_free_view = true;
    }
}

static void send(struct sender *s, const struct list *l, int64_t age_ms,
                 struct sender_list *sent)
{
    sender_list(s, &l->message, 100000 * MS, sent);
    sender_finalize(s, sent, (100000 + age_ms) * MS, 0);
}

/* The array sits at (3.6, 0, 0.4), the wall is at x = 5.8: of what is at 4.87, -1.06 the
 * image is at 6.73, and the other way round. */
static void no_place_beyond_its_wall_leaves(void **state)
{
    static const struct {
        double at_m, image_m;
        uint32_t wall;
        bool leaves;
    } cases[] = {{4.87, 6.73, 1, true}, {6.73, 4.87, 1, false}, {6.73, 6.73, 0, true},
                 {5.75, 5.85, 1, true}, {6.73, 6.73, 1, true},  {6.5, 5.1, 1, false}};
    Anlos__Survey survey = ANLOS__SURVEY__INIT;
    Anlos__Vec3 mount = ANLOS__VEC3__INIT, image = ANLOS__VEC3__INIT;
    struct sender s;
    struct list l;
    struct sender_list sent;
    uint64_t withheld = 0;

    (void)state;
    init(&s, 0x400);
    mount.x = 3.6;
    mount.z = 0.4;
    survey.has_mount = true;
    survey.mount_origin_m = &mount;
    sender_survey(&s, &survey);
    know_tracks(&s);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        fill_tracks(&l, 1);
        l.position.x = cases[i].at_m;
        l.position.y = -1.06;
        l.position.z = 0.4;
        l.extent.x = l.extent.y = l.extent.z = 0.0;
        image.x = -1.06;
        image.z = cases[i].image_m - 3.6;
        l.detections[0].virtual_m = &image;
        l.detections[0].wall = cases[i].wall;
        sender_list(&s, &l.message, 0, &sent);
        assert_int_equal(!isnan(sent.objects[0].position_m[0]), cases[i].leaves);
        assert_int_equal(!isnan(sent.objects[0].sigma_m[0]), cases[i].leaves);
        withheld += !cases[i].leaves;
        assert_int_equal(s.beyond, withheld);
        assert_int_equal(sent.n_objects, 1);
    }
}

static void a_track_says_how_it_moves(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;
    struct can_object o;

    (void)state;
    init(&s, 0x400);
    know_tracks(&s);
    fill_tracks(&l, 1);
    send(&s, &l, 50, &sent);
    assert_int_equal(can_unpack_object_state(&sent.frames[2], &o), 0);
    assert_int_equal(can_unpack_object_dynamics(&sent.frames[3], &o), 0);
    assert_int_equal(can_unpack_object_quality(&sent.frames[4], &o), 0);
    assert_int_equal(o.measurement, CAN_MEASURED);
    assert_near(o.velocity_m_s[0], -1.5, 1e-9);
    assert_near(o.velocity_m_s[1], 0.25, 1e-9);
    assert_near(o.sigma_v_m_s, 0.3, 1e-9); /* of the worse axis */
    assert_int_equal(o.class, CAN_EXTENDED);
    assert_int_equal(o.motion, CAN_MOVING);
}

/* Course and sigmas of one that moves so. */
static struct can_object motion_of(const double velocity_m_s[2],
                                   const double covariance[3], Anlos__Motion motion)
{
    double v[2] = {velocity_m_s[0], velocity_m_s[1]};
    double c[3] = {covariance[0], covariance[1], covariance[2]};
    struct sender s;
    struct list l;
    struct sender_list out;

    init(&s, 0x400);
    s.cfg.bus.motion = true;
    fill_tracks(&l, 1);
    l.detections[0].velocity_m_s = v;
    l.detections[0].velocity_covariance_m2_s2 = c;
    l.detections[0].motion = motion;
    sender_list(&s, &l.message, 100000 * MS, &out);
    return out.objects[0];
}

static void a_motion_goes_before_the_other_frames_of_its_object(void **state)
{
    static const uint32_t classic[] = {0x407, 0x404, 0x405, 0x406, 0x407, 0x404},
                          flexible[] = {0x407, 0x408, 0x407, 0x408};
    const double degree = acos(-1) / 180;
    struct sender s;
    struct list l;
    struct sender_list sent;
    struct can_object o;

    (void)state;
    for (int fd = 0; fd < 2; fd++) {
        init(&s, 0x400);
        know_tracks(&s);
        s.cfg.bus.fd = fd;
        s.cfg.bus.motion = true;
        fill_tracks(&l, 2);
        send(&s, &l, 50, &sent);
        assert_int_equal(sent.n_frames, fd ? 6 : 10);
        for (size_t i = 0; i < (fd ? 4 : 6); i++)
            assert_int_equal(sent.frames[2 + i].id, fd ? flexible[i] : classic[i]);
        assert_int_equal(can_unpack_object_motion(&sent.frames[fd ? 4 : 6], &o), 0);
        assert_int_equal(o.id, 2);
        assert_near(o.course_rad, atan2(0.25, -1.5), 0.51 * degree);
        assert_near(o.sigma_velocity_m_s[0], 0.2, 1e-9);
        assert_near(o.sigma_velocity_m_s[1], 0.3, 1e-9);
        assert_near(o.velocity_correlation, 0.0, 1e-9);
    }
}

/* The directions of 20000 velocities with that error: a square grid of its quantiles. */
static double share_within_sigma(const struct can_object *o, const double c[3])
{
    const double xx = sqrt(c[0]), xy = c[1] / xx, yy = sqrt(c[2] - xy * xy);
    size_t within = 0, n = 0;

    for (double u = 0.005; u < 1.0; u += 0.01)
        for (double a = 0.0025; a < 1.0; a += 0.005, n++) {
            double r = sqrt(-2.0 * log(u)), p = r * cos(2 * acos(-1) * a),
                   q = r * sin(2 * acos(-1) * a);
            double x = o->velocity_m_s[0] + xx * p,
                   y = o->velocity_m_s[1] + xy * p + yy * q;
            double off = remainder(atan2(y, x) - o->course_rad, 2 * acos(-1));
            within += fabs(off) < o->sigma_course_rad;
        }
    return (double)within / (double)n;
}

static void a_course_is_as_sure_as_it_says(void **state)
{
    static const struct {
        double v[2], c[3];
    } cases[] = {
        {{1.0, 0.0}, {0.24, 0.0, 0.24}},      {{0.0, -1.4}, {0.01, 0.0, 0.4}},
        {{-1.1, 1.1}, {0.15, 0.1, 0.15}},     {{-1.1, 1.1}, {0.15, -0.1, 0.15}},
        {{3.0, 0.0}, {0.4, 0.0, 2.2}},        {{3.0, 0.0}, {2.2, 0.0, 0.3}},
        {{-5.0, -0.01}, {0.04, 0.005, 0.09}}, {{2.0, 3.0}, {0.5, 0.4, 0.6}},
    };

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct can_object o = motion_of(cases[i].v, cases[i].c, ANLOS__MOTION__MOVING);
        assert_near(o.course_rad, atan2(cases[i].v[1], cases[i].v[0]), 1e-12);
        double share = share_within_sigma(&o, cases[i].c); /* 0.683, never far less */
        assert_true(share > 0.67 && share < 0.74);
    }
}

static void what_has_no_sure_direction_has_no_course(void **state)
{
    static const double v[2] = {-0.9, 0.0}, sure[3] = {0.2024, 0.0, 0.01},
                        unsure[3] = {0.2026, 0.0, 0.01}, across[3] = {0.01, 0.0, 0.2026},
                        none[3] = {NAN, 0.0, 0.01}, negative[3] = {0.01, 0.0, -1e-6},
                        impossible[3] = {0.01, 0.02, 0.01}, zero[2] = {0.0, 0.0},
                        exact[3] = {0.0, 0.0, 0.0};
    const struct {
        const double *v, *c;
        Anlos__Motion motion;
        bool course;
    } cases[] = {
        {v, sure, ANLOS__MOTION__MOVING, true},
        {v, sure, ANLOS__MOTION__STANDING, false},
        {v, sure, ANLOS__MOTION__MOTION_UNKNOWN, false},
        {v, unsure, ANLOS__MOTION__MOVING, false},
        {v, across, ANLOS__MOTION__MOVING, false},
        {v, none, ANLOS__MOTION__MOVING, false},
        {v, negative, ANLOS__MOTION__MOVING, false},
        {v, impossible, ANLOS__MOTION__MOVING, false},
        {zero, exact, ANLOS__MOTION__MOVING, false},
    };

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct can_object o = motion_of(cases[i].v, cases[i].c, cases[i].motion);
        if (isnan(o.course_rad) == cases[i].course ||
            isnan(o.sigma_course_rad) == cases[i].course)
            fail_msg("case %zu: %g +- %g", i, o.course_rad, o.sigma_course_rad);
        if (cases[i].c == impossible)
            assert_true(isnan(o.sigma_velocity_m_s[0]) && isnan(o.velocity_correlation));
    }
}

static void a_motion_takes_its_part_of_the_bus(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;
    unsigned n[2];

    (void)state;
    for (int motion = 0; motion < 2; motion++) {
        init(&s, 0x400);
        s.cfg.bus.motion = motion;
        s.cfg.bus.load = 0.25;
        fill(&l, 32);
        for (int i = 0; i < 20; i++) {
            sender_list(&s, &l.message, 0, &sent);
            sender_finalize(&s, &sent, (1000 + 100 * i) * MS, 0);
        }
        n[motion] = (unsigned)sent.n_picked;
        assert_int_equal(sent.n_frames, 2 + (3 + (size_t)motion) * n[motion]);
        double used = 10.0 * (double)sent.n_frames * 135 / 500e3;
        assert_true(used < 0.25 && used > 0.15);
    }
    assert_in_range(4 * n[1], 3 * n[0] - 4, 3 * n[0] + 4); /* four frames for three */
}

static double corners[2][16] = {{3, 1, 5, 1, 5, 3.5}, {-1, -2, 4, -2, 4, 0, -1, 0}};

/* Two areas: a triangle by way of wall 3 and a square by way of the 21st. */
static void fill_view_of(struct list *l, Anlos__ViewArea areas[2],
                         Anlos__ViewArea *each[2])
{
    for (int k = 0; k < 2; k++) {
        anlos__view_area__init(&areas[k]);
        areas[k].wall = k ? 21 : 3;
        areas[k].corners_m = corners[k];
        areas[k].n_corners_m = k ? 8 : 6;
        each[k] = &areas[k];
    }
    l->message.n_views = 2;
    l->message.views = each;
}

static void a_field_of_view_goes_between_header_and_time(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;
    struct can_view_corner c;
    Anlos__ViewArea areas[2], *each[2];

    (void)state;
    for (int n = 0; n < 2; n++) {
        init(&s, 0x400);
        know_tracks(&s);
        s.cfg.bus.view = true;
        fill_tracks(&l, (size_t)n);
        fill_view_of(&l, areas, each);
        send(&s, &l, 50, &sent);
        assert_int_equal(sent.n_frames, 1 + 7 + 1 + 3 * n);
        assert_int_equal(sent.frames[0].id, 0x402);
        assert_int_equal(sent.frames[8].id, 0x403);
        for (int i = 0; i < 7; i++) {
            int area = i >= 3, corner = i - 3 * area;
            assert_int_equal(sent.frames[1 + i].id, 0x409);
            assert_int_equal(can_unpack_field_of_view(&sent.frames[1 + i], &c), 0);
            assert_int_equal(c.counter, sent.header.counter & 15);
            assert_int_equal(c.wall, area ? 15 : 3);
            assert_int_equal(c.area, area);
            assert_int_equal(c.corner, corner);
            assert_int_equal(c.corners, 3 + area);
            assert_near(c.at_m[0], corners[area][2 * corner], 0.0101);
            assert_near(c.at_m[1], corners[area][2 * corner + 1], 0.0101);
        }
        assert_true(sender_holds(&s, &sent, 50 * MS));
        sender_let_objects(&s, false); /* nor may it claim to see anything */
        assert_false(sender_holds(&s, &sent, 50 * MS));
    }
}

/* Nothing is seen: by nobody, by a sensor that may tell of nothing, where no place is
 * known; and an area with a corner that the frame has no room for is left out. */
static void what_is_not_seen_is_said_by_one_frame(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;
    struct can_view_corner c;
    Anlos__ViewArea areas[2], *each[2];
    double far[6] = {0, 0, 164, 0, 0, 1};

    (void)state;
    for (int k = 0; k < 6; k++) {
        init(&s, 0x400);
        know_tracks(&s);
        s.cfg.bus.view = k < 5;
        fill_tracks(&l, 0);
        fill_view_of(&l, areas, each);
        if (k == 0)
            l.message.n_views = 0;
        sender_let_objects(&s, k != 1);
        l.message.mirrored = k != 2;
        l.message.in_vehicle_frame = k != 3;
        if (k == 4) {
            areas[0].corners_m = far;
            areas[1].n_corners_m = 4;
        }
        send(&s, &l, 50, &sent);
        assert_int_equal(sent.n_frames, k < 5 ? 3 : 2);
        if (k == 5) /* it is not wanted */
            continue;
        assert_int_equal(can_unpack_field_of_view(&sent.frames[1], &c), 0);
        assert_int_equal(c.corners, 0);
        assert_true(isnan(c.at_m[0]) && isnan(c.at_m[1]));
    }
}

static void a_field_of_view_takes_its_part_of_the_bus(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;
    unsigned n[2];
    Anlos__ViewArea areas[2], *each[2];

    (void)state;
    for (int view = 0; view < 2; view++) {
        init(&s, 0x400);
        s.cfg.bus.view = view;
        s.cfg.bus.load = 0.25;
        fill(&l, 32);
        fill_view_of(&l, areas, each);
        for (int i = 0; i < 20; i++) {
            sender_list(&s, &l.message, 0, &sent);
            sender_finalize(&s, &sent, (1000 + 100 * i) * MS, 0);
        }
        n[view] = (unsigned)sent.n_picked;
        assert_int_equal(sent.n_frames, 2 + 7 * (size_t)view + 3 * n[view]);
        assert_true(10.0 * (double)sent.n_frames * 135 / 500e3 < 0.25);
    }
    assert_in_range(n[0] - n[1], 2, 3); /* 7 frames are those of 2 1/3 objects */
}

static void a_variance_that_is_none_never_looks_like_certainty(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;
    struct can_object o;
    double velocity_covariance[] = {0.04, 0.0, NAN};

    (void)state;
    init(&s, 0x400);
    fill_tracks(&l, 1);
    l.covariance[0] = NAN;
    l.covariance[3] = -1e-6;
    l.detections[0].velocity_covariance_m2_s2 = velocity_covariance;
    send(&s, &l, 50, &sent);
    assert_int_equal(can_unpack_object_quality(&sent.frames[4], &o), 0);
    assert_true(isnan(o.sigma_m[0]));
    assert_true(isnan(o.sigma_m[1]));
    assert_true(isnan(o.correlation));
    assert_true(isnan(o.sigma_v_m_s));
}

/* As of one who is heard along a line: in the frame 0.99 would be 1, and singular. */
static void a_correlation_that_is_nearly_one_is_none_that_is(void **state)
{
    static const double said[][2] = {
        {0.99, 0.96}, {-0.995, -0.96}, {0.92, 0.92}, {1, 0.96}};

    (void)state;
    for (size_t i = 0; i < sizeof said / sizeof *said; i++) {
        struct sender s;
        struct list l;
        struct sender_list sent;
        struct can_object o;
        init(&s, 0x400);
        s.cfg.bus.motion = true;
        fill_tracks(&l, 1);
        l.covariance[0] = l.covariance[3] = 0.04;
        l.covariance[1] = 0.04 * said[i][0];
        double velocity_covariance[] = {0.09, 0.09 * said[i][0], 0.09};
        l.detections[0].velocity_covariance_m2_s2 = velocity_covariance;
        send(&s, &l, 50, &sent);
        assert_int_equal(can_unpack_object_motion(&sent.frames[2], &o), 0);
        assert_int_equal(can_unpack_object_quality(&sent.frames[5], &o), 0);
        assert_near(o.correlation, said[i][1], 1e-9);
        assert_near(o.velocity_correlation, said[i][1], 1e-9);
    }
}

/* As the frames say it. */
static struct can_object said_of_first(const struct sender *s,
                                       const struct sender_list *sent)
{
    struct can_object o = {0};

    if (s->cfg.bus.fd) {
        assert_int_equal(can_unpack_object_fd(&sent->frames[2], &o), 0);
        return o;
    }
    assert_int_equal(can_unpack_object_state(&sent->frames[2], &o), 0);
    assert_int_equal(can_unpack_object_dynamics(&sent->frames[3], &o), 0);
    assert_int_equal(can_unpack_object_quality(&sent->frames[4], &o), 0);
    return o;
}

/* The ranges are those of anlos.dbc. */
static void a_place_out_of_the_range_of_its_frame_is_not_sent(void **state)
{
    static const struct {
        double at_m[3];
        bool fd, leaves;
    } cases[] = {
        {{81.9, -40.94, 12.75}, false, true}, {{-81.9, 40.94, -12.75}, false, true},
        {{81.904, 0, 0}, false, true}, /* rounded to 81.9 */
        {{81.92, 0, 0}, false, false},        {{-81.92, 0, 0}, false, false},
        {{0, 40.96, 0}, false, false},        {{0, -40.96, 0}, false, false},
        {{0, 0, 12.8}, false, false},         {{0, 0, -12.8}, false, false},
        {{INFINITY, 0, 0}, false, false},     {{1e300, 0, 0}, false, false},
        {{1000, -1000, 1000}, true, true},    {{1001, 0, 0}, true, false},
        {{0, -1001, 0}, true, false},         {{0, 0, -INFINITY}, true, false},
    };
    struct sender s;
    struct list l;
    struct sender_list sent;
    uint64_t beyond = 0;

    (void)state;
    init(&s, 0x400);
    know_tracks(&s);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const double *p = cases[i].at_m;
        fill_tracks(&l, 1);
        s.cfg.bus.fd = cases[i].fd;
        l.position.x = p[0];
        l.position.y = p[1];
        l.position.z = p[2];
        send(&s, &l, 50, &sent);
        struct can_object o = said_of_first(&s, &sent);
        for (size_t k = 0; k < 3; k++)
            if (cases[i].leaves)
                assert_near(o.position_m[k], p[k], 0.025);
            else
                assert_true(isnan(o.position_m[k]));
        assert_int_equal(isnan(o.velocity_m_s[0]), !cases[i].leaves);
        assert_int_equal(isnan(o.length_m), !cases[i].leaves);
        assert_int_equal(isnan(o.sigma_m[0]), !cases[i].leaves && !cases[i].fd);
        assert_near(o.existence, 0.75, 0.005);
        beyond += !cases[i].leaves;
        assert_int_equal(s.out_of_range, beyond);
        assert_int_equal(!sent.note, cases[i].leaves);
    }
    assert_int_equal(s.beyond, 0);
}

static void so_is_a_speed_and_the_place_stays(void **state)
{
    static const struct {
        double speed_m_s[2];
        bool fd, leaves;
    } cases[] = {
        {{51.15, -51.15}, false, true}, {{51.2, 0}, false, false},
        {{0, -51.2}, false, false},     {{-INFINITY, 0}, false, false},
        {{51.2, -1000}, true, true},    {{0, 1001}, true, false},
    };
    struct sender s;
    struct list l;
    struct sender_list sent;
    uint64_t beyond = 0;

    (void)state;
    init(&s, 0x400);
    know_tracks(&s);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        double speed_m_s[2] = {cases[i].speed_m_s[0], cases[i].speed_m_s[1]};
        fill_tracks(&l, 1);
        s.cfg.bus.fd = cases[i].fd;
        l.detections[0].velocity_m_s = speed_m_s;
        send(&s, &l, 50, &sent);
        struct can_object o = said_of_first(&s, &sent);
        for (size_t k = 0; k < 2; k++)
            if (cases[i].leaves)
                assert_near(o.velocity_m_s[k], speed_m_s[k], 0.025);
            else
                assert_true(isnan(o.velocity_m_s[k]));
        assert_int_equal(isnan(o.sigma_v_m_s), !cases[i].leaves);
        assert_near(o.position_m[0], 4.0, 0.01);
        beyond += !cases[i].leaves;
        assert_int_equal(s.out_of_range, beyond);
    }
}

static void nor_is_what_is_no_probability_age_size_or_covariance(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;
    struct can_object o;
    uint64_t beyond = 0;

    (void)state;
    init(&s, 0x400);
    know_tracks(&s);
    static const double none[] = {-0.01, 1.01, INFINITY, -INFINITY};
    for (size_t fd = 0; fd < 2; fd++)
        for (size_t i = 0; i < sizeof none / sizeof *none; i++) {
            fill_tracks(&l, 1);
            s.cfg.bus.fd = fd;
            l.detections[0].existence = none[i];
            send(&s, &l, 50, &sent);
            o = said_of_first(&s, &sent);
            assert_true(isnan(o.existence));
            assert_near(o.position_m[0], 4.0, 0.01);
            assert_int_equal(s.out_of_range, ++beyond);
        }
    fill_tracks(&l, 1);
    l.detections[0].shape_probability = 1.5;
    l.detections[0].age_s = l.detections[0].unseen_s = -1.0;
    l.extent.x = -0.2;
    l.covariance[0] = -1.0; /* would be 0: quite certain */
    send(&s, &l, 50, &sent);
    o = said_of_first(&s, &sent);
    assert_true(isnan(o.class_probability));
    assert_true(isnan(o.age_s));
    assert_true(isnan(o.unseen_s));
    assert_true(isnan(o.length_m));
    assert_near(o.width_m, 0.3, 0.01);
    for (size_t k = 0; k < 6; k++)
        assert_true(isnan(o.covariance_m2[k]));
    assert_int_equal(s.out_of_range, ++beyond);
}

/* The DBC says so of each of them. */
static void the_largest_size_age_and_sigma_mean_that_or_more(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;
    struct can_object o;

    (void)state;
    init(&s, 0x400);
    know_tracks(&s);
    fill_tracks(&l, 1);
    l.extent.x = l.extent.y = 50.0;
    l.covariance[0] = l.covariance[3] = 100.0;
    send(&s, &l, 50, &sent);
    o = said_of_first(&s, &sent);
    assert_near(o.length_m, 6.2, 1e-9);
    assert_near(o.width_m, 3.0, 1e-9);
    assert_near(o.sigma_m[0], 2.52, 1e-9);
    assert_near(o.sigma_m[1], 2.52, 1e-9);
    s.cfg.bus.fd = true;
    l.detections[0].age_s = 1e5;
    send(&s, &l, 50, &sent);
    assert_near(said_of_first(&s, &sent).age_s, 6553.4, 0.1);
    assert_int_equal(s.out_of_range, 0);
    assert_null(sent.note);
}

static void every_measurement_of_a_track_has_its_word(void **state)
{
    static const struct {
        Anlos__Measurement in;
        enum can_measurement out;
    } pairs[] = {{ANLOS__MEASUREMENT__NEW, CAN_NEW},
                 {ANLOS__MEASUREMENT__MEASURED, CAN_MEASURED},
                 {ANLOS__MEASUREMENT__PREDICTED, CAN_PREDICTED},
                 {ANLOS__MEASUREMENT__DELETED, CAN_DELETED},
                 {(Anlos__Measurement)7, CAN_PREDICTED}};
    struct sender s;
    struct list l;
    struct sender_list sent;
    struct can_object o;

    (void)state;
    init(&s, 0x400);
    know_tracks(&s);
    fill_tracks(&l, 1);
    for (size_t i = 0; i < 5; i++) {
        l.detections[0].measurement = pairs[i].in;
        send(&s, &l, 50, &sent);
        assert_int_equal(can_unpack_object_state(&sent.frames[2], &o), 0);
        assert_int_equal(o.measurement, pairs[i].out);
    }
}

/* Nor as new; one that is deleted stays so. */
static void what_was_heard_too_long_ago_is_never_sent_as_measured(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;
    struct can_object o;

    (void)state;
    init(&s, 0x400);
    know_tracks(&s);
    s.cfg.stale_ns = 500 * MS;
    fill_tracks(&l, 3);
    l.detections[1].measurement = ANLOS__MEASUREMENT__NEW;
    l.detections[2].measurement = ANLOS__MEASUREMENT__DELETED;
    send(&s, &l, 500, &sent);
    can_unpack_object_state(&sent.frames[2], &o);
    assert_int_equal(o.measurement, CAN_MEASURED);
    /* It waited for the bus, and goes out now. */
    sender_finalize(&s, &sent, 100501 * MS, 0);
    can_unpack_object_state(&sent.frames[2], &o);
    assert_int_equal(o.measurement, CAN_PREDICTED);
    can_unpack_object_state(&sent.frames[5], &o);
    assert_int_equal(o.measurement, CAN_PREDICTED);
    can_unpack_object_state(&sent.frames[8], &o);
    assert_int_equal(o.measurement, CAN_DELETED);
}

static struct can_list_header header_of(const struct sender_list *sent)
{
    struct can_list_header h;

    assert_int_equal(can_unpack_list_header(&sent->frames[0], &h), 0);
    return h;
}

static enum can_measurement measurement_of(const struct sender_list *sent, size_t i)
{
    struct can_object o;

    assert_int_equal(can_unpack_object_state(&sent->frames[2 + 3 * i], &o), 0);
    return o.measurement;
}

/* Tracked already when the sensor became ready: heard, and not known to the vehicle. */
static void an_object_is_new_in_the_first_list_that_tells_of_it(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;

    (void)state;
    init(&s, 0x400);
    fill_tracks(&l, 2);
    sender_let_objects(&s, false);
    send(&s, &l, 50, &sent);
    sender_sent(&s, &sent);
    sender_let_objects(&s, true);
    for (int i = 0; i < 2; i++) { /* sent, but not all of it came on the bus */
        send(&s, &l, 50, &sent);
        assert_int_equal(measurement_of(&sent, 0), CAN_NEW);
        assert_int_equal(measurement_of(&sent, 1), CAN_NEW);
    }
    sender_sent(&s, &sent);
    send(&s, &l, 50, &sent);
    assert_int_equal(measurement_of(&sent, 0), CAN_MEASURED);
    assert_int_equal(measurement_of(&sent, 1), CAN_MEASURED);
}

/* Neither where it should be nor that it ended is said of what was never told. */
static void a_track_is_not_sent_before_it_is_new(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;

    (void)state;
    init(&s, 0x400);
    fill_tracks(&l, 2);
    l.detections[0].measurement = ANLOS__MEASUREMENT__PREDICTED;
    l.detections[1].measurement = ANLOS__MEASUREMENT__DELETED;
    send(&s, &l, 50, &sent);
    assert_int_equal(sent.n_frames, 2);
    assert_int_equal(header_of(&sent).number, 0);
    assert_false(header_of(&sent).truncated);
    sender_sent(&s, &sent);
    l.detections[0].measurement = l.detections[1].measurement =
        ANLOS__MEASUREMENT__MEASURED;
    send(&s, &l, 50, &sent);
    assert_int_equal(measurement_of(&sent, 0), CAN_NEW);
    assert_int_equal(measurement_of(&sent, 1), CAN_NEW);
}

/* It waited for the bus until it could only be predicted. */
static void nor_is_one_that_grew_old_before_it_was_sent(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;

    (void)state;
    init(&s, 0x400);
    s.cfg.stale_ns = 500 * MS;
    fill_tracks(&l, 1);
    l.detections[0].measurement = ANLOS__MEASUREMENT__NEW;
    send(&s, &l, 501, &sent);
    assert_int_equal(header_of(&sent).number, 0);
    sender_sent(&s, &sent);
    l.detections[0].measurement = ANLOS__MEASUREMENT__MEASURED;
    send(&s, &l, 50, &sent);
    assert_int_equal(measurement_of(&sent, 0), CAN_NEW);
}

/* Its detections number themselves in each list: none begins with New. */
static void what_is_not_tracked_is_sent_also_when_it_is_old(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;

    (void)state;
    init(&s, 0x400);
    s.cfg.stale_ns = 500 * MS;
    fill(&l, 1);
    send(&s, &l, 501, &sent);
    assert_int_equal(measurement_of(&sent, 0), CAN_PREDICTED);
}

static void after_a_time_without_objects_each_is_new_again(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;

    (void)state;
    init(&s, 0x400);
    know_tracks(&s);
    fill_tracks(&l, 3);
    sender_let_objects(&s, false);
    sender_let_objects(&s, true);
    l.detections[1].measurement = ANLOS__MEASUREMENT__PREDICTED;
    l.detections[2].measurement = ANLOS__MEASUREMENT__DELETED;
    send(&s, &l, 50, &sent);
    assert_int_equal(header_of(&sent).number, 1);
    assert_int_equal(measurement_of(&sent, 0), CAN_NEW);
}

/* All of it was on the bus when the sensor became faulty. */
static void a_list_that_was_confirmed_too_late_told_nothing(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;

    (void)state;
    init(&s, 0x400);
    fill_tracks(&l, 1);
    send(&s, &l, 50, &sent);
    sender_let_objects(&s, false);
    sender_sent(&s, &sent);
    sender_let_objects(&s, true);
    send(&s, &l, 50, &sent);
    assert_int_equal(measurement_of(&sent, 0), CAN_NEW);
}

static void a_track_that_is_deleted_is_so_once_and_its_id_is_new_again(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;

    (void)state;
    init(&s, 0x400);
    know_tracks(&s);
    fill_tracks(&l, 1);
    l.detections[0].measurement = ANLOS__MEASUREMENT__DELETED;
    send(&s, &l, 50, &sent);
    assert_int_equal(measurement_of(&sent, 0), CAN_DELETED);
    sender_sent(&s, &sent);
    send(&s, &l, 50, &sent);
    assert_int_equal(header_of(&sent).number, 0);
    l.detections[0].measurement = ANLOS__MEASUREMENT__MEASURED;
    send(&s, &l, 50, &sent);
    assert_int_equal(measurement_of(&sent, 0), CAN_NEW);
}

static void an_fd_frame_carries_all_of_an_object(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;
    struct can_object o;

    (void)state;
    init(&s, 0x400);
    know_tracks(&s);
    s.cfg.bus.fd = true;
    fill_tracks(&l, 2);
    send(&s, &l, 50, &sent);
    assert_int_equal(sent.n_frames, 4);
    assert_int_equal(sent.frames[3].id, 0x408);
    assert_true(sent.frames[3].fd);
    assert_int_equal(can_unpack_object_fd(&sent.frames[3], &o), 0);
    assert_int_equal(o.id, 2);
    assert_int_equal(o.measurement, CAN_MEASURED);
    assert_near(o.position_m[1], -1.5, 1e-6);
    assert_near(o.covariance_m2[1], 1e-4, 1e-9);
    assert_near(o.height_m, 1.1, 1e-6);
    assert_near(o.class_probability, 0.8, 0.01);
    assert_near(o.age_s, 3.5, 0.1);
    assert_near(o.unseen_s, 0.25, 0.1);
    assert_int_equal(o.wall, 2);
    assert_true(o.in_free_view);
    assert_false(o.behind_no_wall);
}

/* 32 objects 10 times a second take a quarter of 500 kbit/s (test_load has the sums):
 * what half of it carries they may take, what a twentieth does they may not. */
static void a_list_is_cut_to_what_the_bus_may_carry(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;

    (void)state;
    init(&s, 0x400);
    fill(&l, 32);
    for (int i = 0; i < 20; i++) {
        sender_list(&s, &l.message, 0, &sent);
        sender_finalize(&s, &sent, (1000 + 100 * i) * MS, 0);
    }
    assert_int_equal(header_of(&sent).number, 32);
    assert_false(header_of(&sent).truncated);
    s.cfg.bus.load = 0.05;
    for (int i = 20; i < 40; i++) {
        sender_list(&s, &l.message, 0, &sent);
        sender_finalize(&s, &sent, (1000 + 100 * i) * MS, 0);
    }
    struct can_list_header h = header_of(&sent);
    assert_true(h.number > 0 && h.number < 10);
    assert_true(h.truncated);
    assert_int_equal(sent.n_frames, 2 + 3 * h.number);
    /* By the bits of its frames, 135 at most each. */
    double used = 10.0 * (double)sent.n_frames * 135 / 500e3;
    assert_true(used < 0.05);
}

/* A bus with room for the likeliest six. */
static void send_six(struct sender *s, struct list *l, struct sender_list *sent)
{
    s->cfg.bus.load = 0.05;
    s->budget.n = 0;
    send(s, l, 50, sent);
}

static void what_the_vehicle_does_not_know_yet_takes_no_room_of_others(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;

    (void)state;
    init(&s, 0x400);
    fill_tracks(&l, 32);
    for (size_t i = 0; i < 31; i++) {
        l.detections[i].measurement = ANLOS__MEASUREMENT__PREDICTED;
        l.detections[i].existence = 0.95;
    }
    send_six(&s, &l, &sent);
    assert_int_equal(header_of(&sent).number, 1);
    assert_false(header_of(&sent).truncated);
    assert_int_equal(measurement_of(&sent, 0), CAN_NEW);
}

/* There was no room for it while others were likelier; the second one also ended. */
static void what_was_left_out_is_known_as_long_as_it_lives(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;

    (void)state;
    init(&s, 0x400);
    know_tracks(&s);
    fill_tracks(&l, 32);
    l.detections[0].existence = l.detections[1].existence = 0.1;
    l.detections[1].measurement = ANLOS__MEASUREMENT__DELETED;
    send_six(&s, &l, &sent);
    assert_true(header_of(&sent).truncated);
    sender_sent(&s, &sent);
    l.message.n_detections = 2;
    l.detections[1].measurement = ANLOS__MEASUREMENT__MEASURED;
    send_six(&s, &l, &sent);
    assert_int_equal(measurement_of(&sent, 0), CAN_MEASURED);
    assert_int_equal(measurement_of(&sent, 1), CAN_NEW);
}

/* The same of more objects than a list has. */
static void so_is_what_is_beyond_the_longest_list(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;

    (void)state;
    init(&s, 0x400);
    know_tracks(&s);
    fill_tracks(&l, 34);
    l.detections[32].existence = l.detections[33].existence = 0.1;
    l.detections[33].measurement = ANLOS__MEASUREMENT__DELETED;
    send(&s, &l, 50, &sent);
    assert_int_equal(header_of(&sent).number, 32);
    sender_sent(&s, &sent);
    l.message.detections = &l.pointers[32];
    l.message.n_detections = 2;
    l.detections[33].measurement = ANLOS__MEASUREMENT__MEASURED;
    send(&s, &l, 50, &sent);
    assert_int_equal(measurement_of(&sent, 0), CAN_MEASURED);
    assert_int_equal(measurement_of(&sent, 1), CAN_NEW);
}

static void a_sensor_that_is_not_to_be_trusted_sends_no_objects(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;

    (void)state;
    init(&s, 0x400);
    fill(&l, 3);
    sender_let_objects(&s, false);
    send(&s, &l, 50, &sent);
    assert_int_equal(sent.n_frames, 2);
    assert_int_equal(header_of(&sent).number, 0);
    assert_false(header_of(&sent).truncated);
}

/* The counter rises with every list, whoever made it. */
static void an_empty_list_of_our_own_counts_between_the_others(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;

    (void)state;
    init(&s, 0x400);
    fill(&l, 1);
    send(&s, &l, 50, &sent);
    assert_int_equal(header_of(&sent).counter, 5);
    sender_empty_list(&s, 100000 * MS, &sent);
    sender_finalize(&s, &sent, 100400 * MS, 0);
    assert_int_equal(header_of(&sent).counter, 6);
    assert_int_equal(header_of(&sent).number, 0);
    assert_near(header_of(&sent).latency_ms, 400.0, 1e-9);
    l.message.counter = 6;
    send(&s, &l, 50, &sent);
    assert_int_equal(header_of(&sent).counter, 7);
}

static unsigned counter_of_message(struct sender *s, uint32_t counter)
{
    struct list l;
    struct sender_list sent;

    fill(&l, 0);
    l.message.counter = counter;
    send(s, &l, 50, &sent);
    return header_of(&sent).counter;
}

static unsigned counter_of_our_own(struct sender *s)
{
    struct sender_list sent;

    sender_empty_list(s, 100000 * MS, &sent);
    sender_finalize(s, &sent, 100400 * MS, 0);
    return header_of(&sent).counter;
}

/* Until the tracker tells its first, which it counts from 0. */
static void lists_of_our_own_before_all_others_have_counters_of_their_own(void **state)
{
    struct sender s;

    (void)state;
    init(&s, 0x400);
    assert_int_equal(counter_of_our_own(&s), 0);
    assert_int_equal(counter_of_our_own(&s), 1);
    assert_int_equal(counter_of_message(&s, 0), 2);
    assert_int_equal(counter_of_message(&s, 1), 3);
    assert_int_equal(counter_of_our_own(&s), 4);
}

static void a_message_that_got_lost_is_missed_by_the_counter(void **state)
{
    struct sender s;

    (void)state;
    init(&s, 0x400);
    assert_int_equal(counter_of_message(&s, 200), 200);
    assert_int_equal(counter_of_message(&s, 203), 203);
    assert_int_equal(counter_of_our_own(&s), 204);
    assert_int_equal(counter_of_message(&s, 206), 207);
}

static void the_counter_goes_on_when_that_of_the_messages_begins_again(void **state)
{
    struct sender s;

    (void)state;
    init(&s, 0x400);
    assert_int_equal(counter_of_message(&s, 1000), 1000);
    assert_int_equal(counter_of_message(&s, 0), 1001);
    assert_int_equal(counter_of_message(&s, 1), 1002);
    assert_int_equal(counter_of_message(&s, 1 + 4096), 1003); /* nor back, nor the same */
}

/* In 12 bits. */
static void the_counter_wraps_around(void **state)
{
    struct sender s;

    (void)state;
    init(&s, 0x400);
    for (uint32_t i = 0; i < 4095; i++)
        assert_int_equal(counter_of_message(&s, i), i);
    assert_int_equal(counter_of_our_own(&s), 4095);
    assert_int_equal(counter_of_message(&s, 4095), 0);
    assert_int_equal(counter_of_message(&s, 4096), 1);
}

/* Half a millisecond is how exactly clocks agree, two are not. */
static void the_age_of_sound_that_is_still_to_come_is_not_available(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;

    (void)state;
    init(&s, 0x400);
    fill(&l, 0);
    sender_list(&s, &l.message, 100000 * MS, &sent);
    sender_finalize(&s, &sent, 100000 * MS - MS / 2, 0);
    assert_near(header_of(&sent).latency_ms, 0.0, 1e-9);
    sender_finalize(&s, &sent, 100000 * MS - 2 * MS, 0);
    assert_true(isnan(header_of(&sent).latency_ms));
    sender_finalize(&s, &sent, 99500 * MS, 0);
    assert_true(isnan(header_of(&sent).latency_ms));
}

/* Stamps go on as before, the vehicle's clock was set. */
static void the_time_of_a_list_is_that_of_the_vehicle(void **state)
{
    struct sender s;
    struct list l;
    struct sender_list sent;
    int64_t stamp_ns;

    (void)state;
    init(&s, 0x400);
    fill(&l, 0);
    s.wall_ahead_ns = -3000 * MS;
    send(&s, &l, 40, &sent);
    assert_int_equal(can_unpack_time(&sent.frames[1], &stamp_ns), 0);
    assert_int_equal(stamp_ns, 97000 * MS);
    assert_near(header_of(&sent).latency_ms, 40.0, 1e-9);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_list_is_header_time_and_three_frames_an_object),
        cmocka_unit_test(an_object_carries_what_the_detection_says),
        cmocka_unit_test(an_echo_of_other_objects_is_a_class_of_its_own),
        cmocka_unit_test(age_and_cycle_are_those_of_when_it_goes_out),
        cmocka_unit_test(more_objects_than_fit_are_cut_off_and_said),
        cmocka_unit_test(what_a_detection_does_not_say_is_not_available),
        cmocka_unit_test(a_place_outside_of_the_vehicle_frame_is_not_sent),
        cmocka_unit_test(the_status_follows_the_survey),
        cmocka_unit_test(what_is_not_known_to_be_live_never_looks_live),
        cmocka_unit_test(no_place_beyond_its_wall_leaves),
        cmocka_unit_test(a_track_says_how_it_moves),
        cmocka_unit_test(a_motion_goes_before_the_other_frames_of_its_object),
        cmocka_unit_test(a_course_is_as_sure_as_it_says),
        cmocka_unit_test(what_has_no_sure_direction_has_no_course),
        cmocka_unit_test(a_motion_takes_its_part_of_the_bus),
        cmocka_unit_test(a_field_of_view_goes_between_header_and_time),
        cmocka_unit_test(what_is_not_seen_is_said_by_one_frame),
        cmocka_unit_test(a_field_of_view_takes_its_part_of_the_bus),
        cmocka_unit_test(a_variance_that_is_none_never_looks_like_certainty),
        cmocka_unit_test(a_correlation_that_is_nearly_one_is_none_that_is),
        cmocka_unit_test(a_place_out_of_the_range_of_its_frame_is_not_sent),
        cmocka_unit_test(so_is_a_speed_and_the_place_stays),
        cmocka_unit_test(nor_is_what_is_no_probability_age_size_or_covariance),
        cmocka_unit_test(the_largest_size_age_and_sigma_mean_that_or_more),
        cmocka_unit_test(every_measurement_of_a_track_has_its_word),
        cmocka_unit_test(what_was_heard_too_long_ago_is_never_sent_as_measured),
        cmocka_unit_test(an_object_is_new_in_the_first_list_that_tells_of_it),
        cmocka_unit_test(a_track_is_not_sent_before_it_is_new),
        cmocka_unit_test(nor_is_one_that_grew_old_before_it_was_sent),
        cmocka_unit_test(what_is_not_tracked_is_sent_also_when_it_is_old),
        cmocka_unit_test(after_a_time_without_objects_each_is_new_again),
        cmocka_unit_test(a_list_that_was_confirmed_too_late_told_nothing),
        cmocka_unit_test(a_track_that_is_deleted_is_so_once_and_its_id_is_new_again),
        cmocka_unit_test(an_fd_frame_carries_all_of_an_object),
        cmocka_unit_test(a_list_is_cut_to_what_the_bus_may_carry),
        cmocka_unit_test(what_the_vehicle_does_not_know_yet_takes_no_room_of_others),
        cmocka_unit_test(what_was_left_out_is_known_as_long_as_it_lives),
        cmocka_unit_test(so_is_what_is_beyond_the_longest_list),
        cmocka_unit_test(a_sensor_that_is_not_to_be_trusted_sends_no_objects),
        cmocka_unit_test(an_empty_list_of_our_own_counts_between_the_others),
        cmocka_unit_test(lists_of_our_own_before_all_others_have_counters_of_their_own),
        cmocka_unit_test(a_message_that_got_lost_is_missed_by_the_counter),
        cmocka_unit_test(the_counter_goes_on_when_that_of_the_messages_begins_again),
        cmocka_unit_test(the_counter_wraps_around),
        cmocka_unit_test(the_age_of_sound_that_is_still_to_come_is_not_available),
        cmocka_unit_test(the_time_of_a_list_is_that_of_the_vehicle),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
