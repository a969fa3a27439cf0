/* SPDX-License-Identifier: MIT */
/* Walls that come, go, move and are others while a person walks: what lists and CAN
 * frames tell of him. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "msgs/convert.h"
#include "nodes/can/sender.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/track/tracking.h"
#include "recon/walls/wall.h"
#include "tests/nodes/near.h"
#include "tests/nodes/scene.h"

enum { NX = 101, NZ = 61, MAX_WALLS = 2 };

#define FRAME_NS INT64_C(100000000)
#define BEGIN_NS INT64_C(1000000000)
#define SLANTED  0.6981317 /* 40 degrees to the right */

/* The mount of the scene puts the array's x to the vehicle's y and its z to x.  Walls are
 * straight ahead, or slanted; what is imaged is so by a wall that is really there. */
struct told_wall {
    uint32_t id; /* 0: none */
    double distance_m, angle, gate_m[2];
};

struct rig {
    struct scene scene;
    struct tracking *tracking;
    struct sender sender;
    float intensity[NZ][1][NX];
    Anlos__Volume volume;
    Anlos__Vec3 origin, step;
    struct tensor_view view;
    Anlos__DetectionList *list;
    int64_t stamp_ns;
    struct told_wall told[MAX_WALLS]; /* as the newest message has them */
    double existence;                 /* of walls, as they are told */
    double ends_m[2];                 /* of them all; both 0: they are endless */
};

static void clear(struct rig *r)
{
    uint32_t seed = 1;

    for (size_t i = 0; i < sizeof r->intensity / sizeof(float); i++) {
        seed = seed * 1664525u + 1013904223u;
        (&r->intensity[0][0][0])[i] = 1e-4f * (float)(seed >> 8) / 16777216.0f;
    }
}

static struct wall plane_of(const struct told_wall *w)
{
    return (struct wall){.normal = {sin(w->angle), 0.0, cos(w->angle)},
                         .distance_m = w->distance_m};
}

/* Somebody at (x, z) in the array frame, out by way of a wall that is there, and back by
 * way of another or the same. */
static void show(struct rig *r, const struct told_wall *out, const struct told_wall *back,
                 double x_m, double z_m)
{
    const struct wall there = plane_of(out), home = plane_of(back);
    float power = out == back ? 1.0f : 0.5f; /* each speaker has it at another range */
    double image_m[3], out_m[3];

    wall_mirror(&there, (double[3]){x_m, 0.0, z_m}, out_m);
    wall_mirror(&home, (double[3]){x_m, 0.0, z_m}, image_m);
    double part = 0.5 + 0.5 * hypot(out_m[0], out_m[2]) / hypot(image_m[0], image_m[2]);
    for (int a = 0; a < 3; a++)
        image_m[a] *= part;
    for (int z = 0; z < NZ; z++)
        for (int x = 0; x < NX; x++) {
            double dx = (-2.0 + 0.04 * x - image_m[0]) / 0.05,
                   dz = (0.9 + 0.04 * z - image_m[2]) / 0.05;
            r->intensity[z][0][x] += power * (float)exp(-0.5 * (dx * dx + dz * dz));
        }
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    const struct sender_config can = {.base_id = 0x400, .bus = {.fd = true}};
    struct pipeline_config cfg;

    if (!r || scene_open(&r->scene, SOURCE_DIR "/tests/nodes/point.yaml"))
        return -1;
    launchfile_pipeline(&cfg, NULL);
    if (tracking_create(&r->tracking, NULL, &cfg.tracker) ||
        tracking_survey(r->tracking, r->scene.survey, NULL))
        return -1;
    sender_init(&r->sender, &can);
    anlos__volume__init(&r->volume);
    anlos__vec3__init(&r->origin);
    anlos__vec3__init(&r->step);
    r->origin.x = -2.0;
    r->origin.z = 0.9;
    r->step.x = r->step.y = r->step.z = 0.04;
    r->volume.survey_id = r->scene.survey->id;
    r->volume.scan = 1;
    r->volume.pings_used = 4;
    r->volume.origin_m = &r->origin;
    r->volume.step_m = &r->step;
    r->volume.intensity = tensor_borrow_f32(&r->view, &r->intensity[0][0][0], 3,
                                            (size_t)NZ, (size_t)1, (size_t)NX);
    r->stamp_ns = BEGIN_NS;
    r->existence = 0.999;
    clear(r);
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    detections_free(r->list);
    tracking_destroy(r->tracking);
    scene_close(&r->scene);
    free(r);
    return 0;
}

static void tell(struct rig *r, const struct told_wall walls[MAX_WALLS])
{
    Anlos__WallList m = ANLOS__WALL_LIST__INIT;
    Anlos__Wall each[MAX_WALLS], *list[MAX_WALLS];
    Anlos__Vec3 normals[MAX_WALLS];
    double covariances[MAX_WALLS][6];

    memcpy(r->told, walls, sizeof r->told);
    m.walls = list;
    for (int i = 0; i < MAX_WALLS; i++) {
        const struct wall plane = plane_of(&walls[i]);
        if (!walls[i].id)
            continue;
        anlos__wall__init(&each[m.n_walls]);
        anlos__vec3__init(&normals[m.n_walls]);
        normals[m.n_walls].x = plane.normal[0];
        normals[m.n_walls].z = plane.normal[2];
        each[m.n_walls].normal = &normals[m.n_walls];
        each[m.n_walls].id = walls[i].id;
        each[m.n_walls].distance_m = walls[i].distance_m;
        each[m.n_walls].gate_near_m = walls[i].gate_m[0];
        each[m.n_walls].gate_far_m = walls[i].gate_m[1];
        each[m.n_walls].existence = r->existence;
        each[m.n_walls].ends_m = r->ends_m;
        each[m.n_walls].n_ends_m = r->ends_m[0] < r->ends_m[1] ? 2 : 0;
        memcpy(covariances[m.n_walls], (double[6]){1e-6, 0, 0, 1e-4, 0, 1e-5},
               sizeof covariances[0]);
        each[m.n_walls].covariance = covariances[m.n_walls];
        each[m.n_walls].n_covariance = 6;
        list[m.n_walls] = &each[m.n_walls];
        m.n_walls++;
    }
    assert_int_equal(tracking_walls(r->tracking, &m, r->stamp_ns, NULL), 0);
}

/* -- what never may be told -------------------------------------------------------------
 */

static const struct told_wall *find(const struct rig *r, uint32_t id)
{
    for (int i = 0; id && i < MAX_WALLS; i++)
        if (r->told[i].id == id)
            return &r->told[i];
    return NULL;
}

static bool is_before(const struct told_wall *w, double x_m, double y_m, double slack_m)
{
    const struct wall plane = plane_of(w);

    return plane.normal[0] * y_m + plane.normal[2] * x_m < plane.distance_m + slack_m;
}

static void check_list(const struct rig *r)
{
    assert_true(r->list->tracked);
    for (size_t i = 0; i < r->list->n_detections; i++) {
        const Anlos__Detection *d = r->list->detections[i];
        const struct told_wall *w = find(r, d->wall);
        assert_non_null(d->virtual_m);
        if (!d->position_m)
            assert_int_equal(d->n_covariance_m2, 0);
        if (!d->position_m)
            continue;
        assert_true(r->list->mirrored);
        assert_non_null(w); /* one that is known now */
        assert_true(is_before(w, d->position_m->x, d->position_m->y, 0.0));
    }
}

/* A frame rounds to 2 cm. */
static void check_can(struct rig *r)
{
    struct sender_list out;

    sender_list(&r->sender, r->list, r->stamp_ns, &out);
    sender_finalize(&r->sender, &out, r->stamp_ns + FRAME_NS / 2, r->stamp_ns - FRAME_NS);
    sender_sent(&r->sender, &out);
    for (size_t i = 0; i < out.n_objects; i++) {
        const struct can_object *o = &out.objects[i];
        if (isnan(o->position_m[0])) {
            assert_true(isnan(o->sigma_m[0]) && isnan(o->velocity_m_s[0]));
            continue;
        }
        const struct told_wall *w = find(r, o->wall);
        assert_non_null(w);
        assert_true(is_before(w, o->position_m[0], o->position_m[1], 0.0));
    }
}

static size_t count_tracks(const struct rig *r)
{
    size_t n = 0;

    for (size_t i = 0; i < r->list->n_detections; i++)
        n += r->list->detections[i]->measurement != ANLOS__MEASUREMENT__DELETED;
    return n;
}

static void image(struct rig *r)
{
    detections_free(r->list);
    r->list = NULL;
    r->volume.frame++;
    assert_int_equal(
        tracking_volume(r->tracking, &r->volume, r->stamp_ns, &r->list, NULL), 0);
    check_list(r);
    check_can(r);
    clear(r);
    r->stamp_ns += FRAME_NS;
}

/* -- sequences of walls -----------------------------------------------------------------
 */

#define AHEAD(id, distance_m)                                                            \
    {                                                                                    \
        id, distance_m, 0.0,                                                             \
        {                                                                                \
            0.0, 10.0                                                                    \
        }                                                                                \
    }

static const struct told_wall nowhere[MAX_WALLS];
static const struct told_wall ahead[MAX_WALLS] = {AHEAD(7, 0.8)};
static const struct told_wall nearer[MAX_WALLS] = {AHEAD(7, 0.65)};
static const struct told_wall farther[MAX_WALLS] = {AHEAD(7, 1.1)};
static const struct told_wall renamed[MAX_WALLS] = {AHEAD(8, 0.8)};
static const struct told_wall other[MAX_WALLS] = {AHEAD(9, 1.1)};
static const struct told_wall both[MAX_WALLS] = {AHEAD(7, 0.8),
                                                 {5, 0.9, SLANTED, {0.0, 10.0}}};
static const struct told_wall slanted[MAX_WALLS] = {{5, 0.9, SLANTED, {0.0, 10.0}}};
/* Aside he is imaged past the image's end; across, as it is heard here only, 0.6 m and
 * more behind himself. */
static const struct told_wall corner[MAX_WALLS] = {AHEAD(7, 0.8),
                                                   {5, 1.5, 1.0471976, {0.0, 10.0}}};
/* One of them mirrors what is near, the other what is far. */
static const struct told_wall apart[MAX_WALLS] = {{7, 0.8, 0.0, {0.0, 2.6}},
                                                  {6, 0.6, 0.0, {2.6, 10.0}}};
static const struct told_wall far_one[MAX_WALLS] = {{6, 0.6, 0.0, {2.6, 10.0}}};

/* The first mirrors what is farther than he ever is. */
static const struct told_wall second[MAX_WALLS] = {{4, 3.0, 0.0, {8.0, 10.0}},
                                                   AHEAD(7, 0.8)};
static const struct told_wall second_farther[MAX_WALLS] = {{4, 3.0, 0.0, {8.0, 10.0}},
                                                           AHEAD(7, 1.1)};
static const struct told_wall aside[MAX_WALLS] = {{4, 3.0, 0.0, {8.0, 10.0}}};
static const struct told_wall behind[MAX_WALLS] = {{4, 3.0, 0.0, {8.0, 10.0}},
                                                   AHEAD(9, 1.4)};
static const struct told_wall far_behind[MAX_WALLS] = {AHEAD(9, 1.4)};

#define WAY                                                                              \
    {                                                                                    \
        -1.2, 1.2                                                                        \
    }
#define SHORT_WAY                                                                        \
    {                                                                                    \
        -0.8, 0.0                                                                        \
    } /* in sight of both walls */

struct sequence {
    const char *name;
    const struct told_wall *told[3];  /* before, between, after */
    const struct told_wall *there[3]; /* what really mirrors him then */
    double between_s;
    double x_m[2]; /* he walks from there to there, and back */
    bool is_another;
};

static const struct sequence sequences[] = {
    {"the wall comes late",
     {nowhere, nowhere, ahead},
     {ahead, ahead, ahead},
     2.0,
     WAY,
     false},
    {"it goes for half a second",
     {ahead, nowhere, ahead},
     {ahead, ahead, ahead},
     0.5,
     WAY,
     false},
    {"it goes for 3 s", {ahead, nowhere, ahead}, {ahead, ahead, ahead}, 3.0, WAY, false},
    {"it goes for 10 s",
     {ahead, nowhere, ahead},
     {ahead, ahead, ahead},
     10.0,
     WAY,
     false},
    {"it comes back with another id",
     {ahead, nowhere, renamed},
     {ahead, ahead, ahead},
     3.0,
     WAY,
     false},
    {"it comes back elsewhere",
     {ahead, nowhere, nearer},
     {ahead, ahead, nearer},
     1.0,
     WAY,
     true},
    {"it gets another id",
     {ahead, ahead, renamed},
     {ahead, ahead, ahead},
     1.0,
     WAY,
     false},
    {"it was 0.3 m off",
     {farther, farther, ahead},
     {ahead, ahead, ahead},
     1.0,
     WAY,
     false},
    {"it was 15 cm off", {nearer, nearer, ahead}, {ahead, ahead, ahead}, 1.0, WAY, false},
    {"it moves by 0.3 m",
     {ahead, ahead, farther},
     {ahead, ahead, farther},
     1.0,
     WAY,
     false},
    {"it moves by 0.3 m, and is not the first",
     {second, second, second_farther},
     {ahead, ahead, farther},
     1.0,
     WAY,
     false},
    {"it goes for good, and 4 s later there is one behind it",
     {second, aside, behind},
     {ahead, nowhere, far_behind},
     4.0,
     WAY,
     true},
    {"it moves by 15 cm",
     {ahead, ahead, nearer},
     {ahead, ahead, nearer},
     1.0,
     WAY,
     false},
    {"it is said to have moved",
     {ahead, farther, ahead},
     {ahead, ahead, ahead},
     1.0,
     WAY,
     false},
    {"another one takes its place",
     {ahead, ahead, other},
     {ahead, ahead, ahead},
     1.0,
     WAY,
     false},
    {"another one after a gap",
     {ahead, nowhere, other},
     {ahead, ahead, ahead},
     1.0,
     WAY,
     false},
    {"another one mirrors him",
     {ahead, nowhere, other},
     {ahead, ahead, other},
     1.0,
     WAY,
     true},
    {"two walls mirror him",
     {both, both, both},
     {both, both, both},
     1.0,
     SHORT_WAY,
     false},
    {"two walls go and come",
     {both, nowhere, both},
     {both, both, both},
     2.0,
     SHORT_WAY,
     false},
    {"the second wall comes late",
     {ahead, ahead, both},
     {ahead, ahead, both},
     1.0,
     SHORT_WAY,
     false},
    {"his wall goes, not the other",
     {apart, far_one, apart},
     {ahead, ahead, ahead},
     2.0,
     WAY,
     true},
    {"the first of two goes for 0.5 s, and mirrors on",
     {both, slanted, both},
     {both, both, both},
     0.5,
     SHORT_WAY,
     false},
    {"the first of two goes for 2 s, and mirrors on",
     {both, slanted, both},
     {both, both, both},
     2.0,
     SHORT_WAY,
     false},
    {"the first of two goes, and mirrors no more",
     {both, slanted, both},
     {both, slanted, both},
     2.0,
     SHORT_WAY,
     false},
    {"the second of two goes for 2 s, and mirrors on",
     {both, ahead, both},
     {both, both, both},
     2.0,
     SHORT_WAY,
     false},
    {"the second of two goes, and mirrors no more",
     {both, ahead, both},
     {both, ahead, both},
     2.0,
     SHORT_WAY,
     false},
    {"the other wall goes, not his",
     {apart, ahead, apart},
     {ahead, ahead, ahead},
     2.0,
     WAY,
     false},
    {"two walls mirror him, and he is heard across",
     {corner, corner, corner},
     {corner, corner, corner},
     1.0,
     SHORT_WAY,
     false},
};

static double walk(const struct sequence *q, double t_s)
{
    double length_m = q->x_m[1] - q->x_m[0], way_m = fmod(0.5 * t_s, 2.0 * length_m);

    return way_m < length_m ? q->x_m[0] + way_m : q->x_m[1] + length_m - way_m;
}

/* Since he last turned. */
static double straight_s(const struct sequence *q, double t_s)
{
    return fmod(0.5 * t_s, q->x_m[1] - q->x_m[0]) / 0.5;
}

/* Nobody can know that two images are of one person before walls say so. */
static size_t how_many(const struct told_wall told[MAX_WALLS],
                       const struct told_wall there[MAX_WALLS])
{
    return !told[0].id && there[1].id ? 2 : 1;
}

/* At (x, -0.4), 1.2 m before the wall.  Returns the id that was listed last, 0: none. */
static uint32_t run(struct rig *r, const struct sequence *q, int part, double for_s)
{
    double from_s = 1e-9 * (double)(r->stamp_ns - BEGIN_NS), t_s = from_s;
    uint32_t id = 0;

    for (; t_s < from_s + for_s - 1e-6; t_s = 1e-9 * (double)(r->stamp_ns - BEGIN_NS)) {
        tell(r, q->told[part]);
        for (int i = 0; i < MAX_WALLS * MAX_WALLS; i++) {
            const struct told_wall *out = &q->there[part][i / MAX_WALLS],
                                   *back = &q->there[part][i % MAX_WALLS];
            if (out->id && back->id && (out == back || q->there[part] == corner))
                show(r, out, back, walk(q, t_s), -0.4);
        }
        image(r);
        assert_true(count_tracks(r) <= how_many(q->told[part], q->there[part]));
        if (count_tracks(r))
            id = r->list->detections[0]->id;
    }
    return id;
}

/* Where the wall really is where it is said to be.  Who turned within the last second may
 * be told a step on his old way. */
static void check_place(const struct rig *r, const struct sequence *q)
{
    double t_s = 1e-9 * (double)(r->stamp_ns - FRAME_NS - BEGIN_NS);
    const Anlos__Detection *d = r->list->detections[0];

    assert_non_null(d->position_m);
    assert_near(d->position_m->y, walk(q, t_s), straight_s(q, t_s) < 1.0 ? 0.25 : 0.1);
    if (q->told[2][0].distance_m == q->there[2][0].distance_m)
        assert_near(d->position_m->x, -0.4, 0.1);
}

static void whatever_becomes_of_walls_nobody_is_told_beyond_one_or_twice(void **state)
{
    for (size_t i = 0; i < sizeof sequences / sizeof *sequences; i++) {
        const struct sequence *q = &sequences[i];
        print_message("%s\n", q->name);
        assert_int_equal(setup(state), 0);
        struct rig *r = *state;
        uint32_t first = run(r, q, 0, 3.0);
        run(r, q, 1, q->between_s);
        uint32_t last = run(r, q, 2, 3.0);
        assert_true(first && last);
        assert_true(first == last || q->is_another);
        assert_int_equal(count_tracks(r), 1);
        check_place(r, q);
        teardown(state);
    }
}

/* Of one who is hidden himself just then, for half a second. */
static void an_echo_across_of_one_who_is_tracked_is_nobody(void **state)
{
    struct rig *r = *state;

    tell(r, corner);
    for (int k = 0; k < 20; k++) {
        show(r, &corner[0], &corner[0], -0.8 + 0.05 * k, -0.4);
        image(r);
    }
    assert_int_equal(count_tracks(r), 1);
    for (int k = 20; k < 25; k++) {
        show(r, &corner[1], &corner[0], -0.8 + 0.05 * k, -0.4);
        image(r);
        assert_int_equal(count_tracks(r), 1);
    }
}

/* In images with what stands in them, as of a vehicle that moves: without a wall nothing
 * is heard there that hides. */
static void nor_where_what_stands_is_left_in_the_image(void **state)
{
    size_t placed = 0;

    for (size_t i = 0; i < sizeof sequences / sizeof *sequences; i++) {
        const struct sequence *q = &sequences[i];
        print_message("%s\n", q->name);
        assert_int_equal(setup(state), 0);
        struct rig *r = *state;
        r->volume.standing_left = true;
        run(r, q, 0, 2.0);
        run(r, q, 1, q->between_s);
        run(r, q, 2, 2.0);
        placed += r->list->n_detections && r->list->detections[0]->position_m;
        teardown(state);
    }
    /* Nobody beyond a wall would be true of nobody at all. */
    assert_true(placed > sizeof sequences / sizeof *sequences / 2);
}

/* 1.2 m/s straight to the wall, and from 0.5 m before it on nothing is heard of him: he
 * would be there 0.42 s later. */
static void who_is_heard_no_more_ends_at_the_wall(void **state)
{
    struct rig *r = *state;
    size_t predicted = 0, ended = 0;

    for (int k = 0; k < 16; k++) {
        double z_m = -0.8 + 0.12 * k;
        tell(r, ahead);
        if (z_m < 0.3)
            show(r, &ahead[0], &ahead[0], 0.2, z_m);
        image(r);
        if (!r->list->n_detections)
            continue;
        predicted += r->list->detections[0]->measurement == ANLOS__MEASUREMENT__PREDICTED;
        ended += r->list->detections[0]->measurement == ANLOS__MEASUREMENT__DELETED;
    }
    assert_in_range(predicted, 2, 4);
    assert_int_equal(ended, 1);
}

/* What mirrors him is there with so and so much probability: so is he where he is told to
 * be.  A wall whose sender does not say it is sure. */
static void nobody_is_surer_than_the_wall_that_shows_him(void **state)
{
    static const double said[] = {0.999, 0.6, 0.0};
    struct rig *r = *state;

    for (int w = 0; w < 3; w++) {
        for (int k = 0; k < 12; k++) {
            r->existence = said[w];
            tell(r, ahead);
            show(r, &ahead[0], &ahead[0], 0.2, -0.4);
            image(r);
        }
        double existence = r->list->detections[0]->existence;
        if (said[w] == 0.6)
            assert_in_range(1000.0 * existence, 580, 600);
        else
            assert_true(existence > 0.98);
    }
}

/* Node wall tells ten times a second.  One that tells nothing for longer than a wall is
 * kept unseen (3 s) knows none any more. */
static void a_wall_that_nobody_tells_of_is_not_known(void **state)
{
    struct rig *r = *state;

    tell(r, ahead);
    for (int k = 0; k < 40; k++) {
        if (k == 31)
            memset(r->told, 0, sizeof r->told);
        show(r, &ahead[0], &ahead[0], 0.2, -0.4);
        image(r);
        if (k > 8)
            assert_int_equal(r->list->detections[0]->position_m != NULL, k <= 30);
    }
    assert_false(tracking_has_wall(r->tracking));
}

static double area_m2(const Anlos__ViewArea *a)
{
    double sum = 0.0;

    for (size_t i = 0; i < a->n_corners_m; i += 2) {
        const double *p = a->corners_m + i, *q = a->corners_m + (i + 2) % a->n_corners_m;
        sum += p[0] * q[1] - p[1] * q[0];
    }
    return 0.5 * sum;
}

/* The image is 4 m wide, from z = 0.9 to 3.3 m.  A wall that ends half a metre to either
 * side at 0.8 m shows |x| < 5/8 z of it, all from 3.2 m on.  Of what is seen directly,
 * past the ends, there are no tracks. */
static void what_lists_can_tell_of_is_in_them(void **state)
{
    struct rig *r = *state;
    const struct told_wall *const told[] = {ahead, ahead, nowhere};
    const double m2[] = {4.0 * 2.4, 0.625 * (3.2 * 3.2 - 0.81) + 4.0 * 0.1, 0.0};

    for (int k = 0; k < 3; k++) {
        r->ends_m[0] = k ? -0.5 : 0.0;
        r->ends_m[1] = k ? 0.5 : 0.0;
        tell(r, told[k]);
        image(r);
        assert_int_equal(r->list->n_views, k < 2);
        if (k == 2)
            continue;
        assert_int_equal(r->list->views[0]->wall, 7);
        assert_near(area_m2(r->list->views[0]), m2[k], 1e-9);
    }
}

/* He walks past the end, and no sound of him comes any more: that says nothing of him,
 * but where the wall goes on it says that he is hidden or gone. */
static void who_leaves_the_end_of_a_wall_is_out_of_view_not_missed(void **state)
{
    struct rig *r = *state;
    double existence[2];

    for (int w = 0; w < 2; w++) {
        r->ends_m[0] = -0.5 * w;
        r->ends_m[1] = 0.5 * w;
        for (int k = 0; k < 27; k++) {
            double x_m = -0.8 + 0.1 * k;
            tell(r, ahead);
            if (x_m < 1.25) /* sound by way of (x, -0.4) comes from 0.4 x of the wall */
                show(r, &ahead[0], &ahead[0], x_m, -0.4);
            image(r);
        }
        assert_int_equal(r->list->n_detections, 1);
        assert_int_equal(r->list->detections[0]->measurement,
                         ANLOS__MEASUREMENT__PREDICTED);
        existence[w] = r->list->detections[0]->existence;
        for (int k = 0; k < 60; k++) {
            tell(r, nowhere);
            image(r);
        }
    }
    assert_true(existence[0] < 0.95 * existence[1]); /* after six images without him */
    assert_true(existence[1] > 0.9); /* at the edge he may have been missed once */
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(whatever_becomes_of_walls_nobody_is_told_beyond_one_or_twice),
        cmocka_unit_test(nor_where_what_stands_is_left_in_the_image),
        TEST(an_echo_across_of_one_who_is_tracked_is_nobody),
        TEST(who_is_heard_no_more_ends_at_the_wall),
        TEST(nobody_is_surer_than_the_wall_that_shows_him),
        TEST(a_wall_that_nobody_tells_of_is_not_known),
        TEST(what_lists_can_tell_of_is_in_them),
        TEST(who_leaves_the_end_of_a_wall_is_out_of_view_not_missed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
