/* SPDX-License-Identifier: MIT */
/* What Foxglove draws: numbers from the samples' geometry. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "foxglove/figures.pb-c.h"
#include "foxglove/image.pb-c.h"
#include "foxglove/log.pb-c.h"
#include "foxglove/transforms.pb-c.h"
#include "nodes/foxglove/channels.h"
#include "nodes/foxglove/image.h"
#include "nodes/foxglove/parts.h"
#include "tests/nodes/foxglove_samples.h"
#include "tests/nodes/near.h"

struct rig {
    struct samples samples;
    struct setting setting;
    struct arena arena;
};

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    struct foxglove_message m;

    *state = r;
    if (!r || !samples_open(&r->samples))
        return -1;
    m = samples_survey(&r->samples);
    return setting_take(&r->setting, &m) ? 0 : -1;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    arena_clear(&r->arena);
    setting_clear(&r->setting);
    samples_close(&r->samples);
    free(r);
    return 0;
}

/* The survey was changed. */
static void resurvey(struct rig *r)
{
    assert_true(samples_pack_survey(&r->samples));
    const struct foxglove_message m = samples_survey(&r->samples);
    assert_true(setting_take(&r->setting, &m));
}

/* How the channel view/NAME makes its messages. */
static foxglove_convert conversion(const char *name)
{
    struct channel c = {.name = NULL};

    for (size_t i = 0; i < channels_count(); i++) {
        channel_get(i, &c);
        if (!strncmp(c.name, CHANNEL_VIEW, strlen(CHANNEL_VIEW)) &&
            !strcmp(c.name + strlen(CHANNEL_VIEW), name))
            return c.convert;
    }
    fail_msg("no channel %s%s", CHANNEL_VIEW, name);
    return NULL;
}

static void *converted(struct rig *r, const char *name, const struct foxglove_message *m)
{
    ProtobufCMessage *out = NULL;

    assert_int_equal(conversion(name)(&r->arena, &r->setting, m, &out), 0);
    assert_true(protobuf_c_message_check(out));
    return out;
}

static void assert_vector(const Foxglove__Vector3 *v, double x, double y, double z)
{
    assert_near(v->x, x, 1e-9);
    assert_near(v->y, y, 1e-9);
    assert_near(v->z, z, 1e-9);
}

/* v, turned by q: v + 2 u x (u x v + w v), Hamilton. */
static void turned(const Foxglove__Quaternion *q, const double v[3], double out[3])
{
    const double u[3] = {q->x, q->y, q->z};
    double t[3];

    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        t[i] = u[j] * v[k] - u[k] * v[j] + q->w * v[i];
    }
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        out[i] = v[i] + 2.0 * (u[j] * t[k] - u[k] * t[j]);
    }
}

static void assert_turned(const Foxglove__Quaternion *q, double x, double y, double z,
                          double to_x, double to_y, double to_z)
{
    double out[3];

    turned(q, (const double[3]){x, y, z}, out);
    assert_near(out[0], to_x, 1e-9);
    assert_near(out[1], to_y, 1e-9);
    assert_near(out[2], to_z, 1e-9);
}

static void a_quaternion_turns_the_axes_where_they_point(void **state)
{
    struct rig *r = *state;
    /* About x, y, z by half a turn, about (1, 1, 1) by thirds of one, and none. */
    static const double axes[6][3][3] = {
        {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}, {{-1, 0, 0}, {0, 1, 0}, {0, 0, -1}},
        {{-1, 0, 0}, {0, -1, 0}, {0, 0, 1}}, {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}},
        {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}},   {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
    };

    for (int n = 0; n < 6; n++) {
        const Foxglove__Quaternion *q = part_quaternion(&r->arena, axes[n]);
        for (int i = 0; i < 3; i++)
            assert_turned(q, i == 0, i == 1, i == 2, axes[n][i][0], axes[n][i][1],
                          axes[n][i][2]);
    }
}

static void times_before_1970_keep_positive_nanoseconds(void **state)
{
    struct rig *r = *state;
    const Google__Protobuf__Timestamp *t = part_time(&r->arena, -1);

    assert_int_equal(t->seconds, -1);
    assert_int_equal(t->nanos, 999999999);
}

static const float *points_of(const Foxglove__PointCloud *c, size_t *n)
{
    assert_int_equal(c->point_stride, 16);
    assert_int_equal(c->data.len % 16, 0);
    *n = c->data.len / 16;
    return (const float *)(const void *)c->data.data;
}

/* Voxels (0, 0, 0) and (3, 1, 4) are at (-0.2, -0.1, 1.5) and (0.1, 0, 1.9), imaged
 * behind the wall z = 1: they are really at z = 0.5 and 0.1. */
static void the_cloud_has_the_bright_voxels_where_they_really_are(void **state)
{
    static const float expected[2][4] = {{-0.2f, -0.1f, 0.5f, -10.0f},
                                         {0.1f, 0.0f, 0.1f, 0.0f}};
    struct rig *r = *state;
    const struct foxglove_message m = samples_volume(&r->samples);
    const Foxglove__PointCloud *c = converted(r, "cloud", &m);
    size_t n;
    const float *points = points_of(c, &n);

    assert_string_equal(c->frame_id, "array");
    assert_int_equal(c->timestamp->seconds * 1000000000 + c->timestamp->nanos,
                     SAMPLE_CAPTURE_NS);
    assert_int_equal(n, 2);
    for (int i = 0; i < 8; i++)
        assert_near(points[i], expected[i / 4][i % 4], 1e-5);
}

static void without_a_wall_the_cloud_stays_as_imaged(void **state)
{
    struct rig *r = *state;
    size_t n;

    r->samples.survey.has_wall = false;
    resurvey(r);
    const struct foxglove_message m = samples_volume(&r->samples);
    const float *points = points_of(converted(r, "cloud", &m), &n);
    assert_int_equal(n, 2);
    assert_near(points[2], 1.5, 1e-6);
    assert_near(points[6], 1.9, 1e-6);
}

static void an_image_waits_for_its_survey(void **state)
{
    struct rig *r = *state;
    const struct foxglove_message m = samples_volume(&r->samples);
    ProtobufCMessage *out;

    r->samples.volume.survey_id++;
    assert_int_equal(conversion("cloud")(&r->arena, &r->setting, &m, &out), -EAGAIN);
    assert_int_equal(conversion("voxels")(&r->arena, &r->setting, &m, &out), -EAGAIN);
}

static void a_volume_that_does_not_hold_is_refused(void **state)
{
    static const char *const all[] = {"cloud", "voxels", "front", "top", "side"};
    struct rig *r = *state;
    const struct foxglove_message m = samples_volume(&r->samples);
    ProtobufCMessage *out;

    r->samples.view.message.data.len -= 4;
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        assert_int_equal(conversion(all[i])(&r->arena, &r->setting, &m, &out), -EINVAL);
}

/* Drawing axes there would never end. */
static void a_grid_beyond_all_measure_is_refused(void **state)
{
    static const double places[][2] = {{1e20, 0.1}, {0.0, 1e20}, {0.0, 1e-300}, {0, 0}};
    struct rig *r = *state;
    const struct foxglove_message m = samples_volume(&r->samples);
    ProtobufCMessage *out;

    for (size_t i = 0; i < 4; i++) {
        r->samples.origin.x = places[i][0];
        r->samples.step.x = places[i][1];
        assert_int_equal(conversion("front")(&r->arena, &r->setting, &m, &out), -EINVAL);
        assert_int_equal(conversion("voxels")(&r->arena, &r->setting, &m, &out), -EINVAL);
    }
}

static void an_empty_or_broken_image_makes_an_empty_cloud(void **state)
{
    static const float values[] = {0.0f, NAN, -1.0f, INFINITY};
    struct rig *r = *state;
    const struct foxglove_message m = samples_volume(&r->samples);
    size_t n;

    for (size_t k = 0; k < 4; k++) {
        for (size_t i = 0; i < sizeof r->samples.intensity / sizeof(float); i++)
            (&r->samples.intensity[0][0][0])[i] = values[k];
        points_of(converted(r, "cloud", &m), &n);
        assert_int_equal(n, 0);
        converted(r, "voxels", &m);
    }
}

/* 1000 voxels of 1, 100 of 1000, 10 of 10000 (all 30 dB and more above the median). */
static void no_more_voxels_stand_out_than_are_asked_for(void **state)
{
    float v[1110];
    struct levels l;

    (void)state;
    for (size_t i = 0; i < 1110; i++)
        v[i] = i < 1000 ? 1.0f : i < 1100 ? 1000.0f : 10000.0f;
    levels_measure(&l, v, 1110, 200);
    assert_int_equal(l.n, 110);
    assert_true(l.threshold <= 1000.0f && l.threshold > 1.0f);
    levels_measure(&l, v, 1110, 50);
    assert_int_equal(l.n, 10);
    assert_true(l.threshold <= 10000.0f && l.threshold > 1000.0f);
    assert_near(level_db(&l, 100.0f, -40.0f), -20.0, 1e-5);
    assert_near(level_db(&l, 0.0f, -40.0f), -40.0, 1e-5);
}

/* Nothing in noise alone is 14 dB above the median: -ln(u) < 25 ln 2 for any u here. */
static void noise_does_not_stand_out(void **state)
{
    enum { N = 100000 };
    float *v = malloc(N * sizeof *v);
    struct levels l;
    uint32_t seed = 7;

    (void)state;
    assert_non_null(v);
    for (size_t i = 0; i < N; i++) {
        seed = seed * 1664525u + 1013904223u;
        v[i] = -logf(((float)(seed >> 8) + 0.5f) / 16777216.0f);
    }
    levels_measure(&l, v, N, N);
    assert_int_equal(l.n, 0);
    free(v);
}

static float cell(const Foxglove__VoxelGrid *v, size_t x, size_t y, size_t z)
{
    const uint8_t *at = v->data.data + z * v->slice_stride + y * v->row_stride +
                        x * v->cell_stride;
    float value;

    assert_true((size_t)(at - v->data.data) + sizeof value <= v->data.len);
    memcpy(&value, at, sizeof value);
    return value;
}

/* Where the middle of a cell is. */
static void middle_of(const Foxglove__VoxelGrid *v, const double index[3], double out[3])
{
    const double along[3] = {(index[0] + 0.5) * v->cell_size->x,
                             (index[1] + 0.5) * v->cell_size->y,
                             (index[2] + 0.5) * v->cell_size->z};

    turned(v->pose->orientation, along, out);
    out[0] += v->pose->position->x;
    out[1] += v->pose->position->y;
    out[2] += v->pose->position->z;
}

/* The brightest voxel, wherever it is in the grid, is at the place of the cloud's. */
static void assert_brightest_at(const Foxglove__VoxelGrid *v, double x, double y,
                                double z)
{
    size_t n_z = v->data.len / v->slice_stride;
    bool found = false;
    double at[3];

    for (size_t k = 0; k < n_z; k++) {
        for (size_t j = 0; j < v->row_count; j++) {
            for (size_t i = 0; i < v->column_count; i++) {
                if (cell(v, i, j, k) < -1e-3f)
                    continue;
                assert_false(found);
                found = true;
                middle_of(v, (const double[3]){(double)i, (double)j, (double)k}, at);
                assert_near(at[0], x, 1e-9);
                assert_near(at[1], y, 1e-9);
                assert_near(at[2], z, 1e-9);
            }
        }
    }
    assert_true(found);
}

static void the_voxels_are_where_the_cloud_is(void **state)
{
    struct rig *r = *state;
    const struct foxglove_message m = samples_volume(&r->samples);
    const Foxglove__VoxelGrid *v = converted(r, "voxels", &m);

    assert_string_equal(v->frame_id, "array");
    assert_int_equal(v->column_count, SAMPLE_NX);
    assert_int_equal(v->row_count, SAMPLE_NY);
    assert_int_equal(v->data.len, sizeof r->samples.intensity);
    assert_brightest_at(v, 0.1, 0.0, 0.1);
}

/* Against wall_mirror's own formula p - 2 (n.p - d) n, for a wall that is tilted. */
static void a_tilted_wall_turns_the_grid(void **state)
{
    struct rig *r = *state;
    const double n[3] = {0.36, 0.48, 0.8}, p[3] = {0.1, 0.0, 1.9};
    double beyond = n[0] * p[0] + n[1] * p[1] + n[2] * p[2] - 1.0;

    memcpy(r->samples.survey.wall_normal, n, sizeof n);
    resurvey(r);
    const struct foxglove_message m = samples_volume(&r->samples);
    assert_brightest_at(converted(r, "voxels", &m), p[0] - 2.0 * beyond * n[0],
                        p[1] - 2.0 * beyond * n[1], p[2] - 2.0 * beyond * n[2]);
}

static void without_a_wall_the_grid_is_as_imaged(void **state)
{
    struct rig *r = *state;

    r->samples.survey.has_wall = false;
    resurvey(r);
    const struct foxglove_message m = samples_volume(&r->samples);
    const Foxglove__VoxelGrid *v = converted(r, "voxels", &m);
    assert_vector(v->pose->position, -0.25, -0.15, 1.45);
    assert_brightest_at(v, 0.1, 0.0, 1.9);
}

/* 160 x 160 x 160 voxels of 1 cm, the brightest of which must be in a cell around it. */
static void a_large_image_is_folded_to_maxima(void **state)
{
    enum { N = 160 };
    struct rig *r = *state;
    float *v = calloc((size_t)N * N * N, sizeof *v);

    assert_non_null(v);
    v[(100 * N + 31) * N + 77] = 1.0f;
    r->samples.step.x = r->samples.step.y = r->samples.step.z = 0.01;
    r->samples.volume.intensity =
        tensor_borrow_f32(&r->samples.view, v, 3, (size_t)N, (size_t)N, (size_t)N);
    r->samples.survey.has_wall = false;
    resurvey(r);
    const struct foxglove_message m = samples_volume(&r->samples);
    const Foxglove__VoxelGrid *g = converted(r, "voxels", &m);
    size_t n_cells = g->data.len / sizeof(float);

    assert_true(n_cells <= 1 << 18 && n_cells > 1 << 16);
    assert_true(g->column_count * g->cell_size->x >= 1.6 - 1e-9);
    size_t i = (size_t)(0.775 / g->cell_size->x), j = (size_t)(0.315 / g->cell_size->y),
           k = (size_t)(1.005 / g->cell_size->z);
    assert_near(cell(g, i, j, k), 0.0, 1e-6);
    assert_near(cell(g, 0, 0, 0), -40.0, 1e-6);
    free(v);
}

static void pictures_are_png_of_three_sides(void **state)
{
    static const char *const all[] = {"front", "top", "side"};
    static const uint8_t head[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
    struct rig *r = *state;
    const struct foxglove_message m = samples_volume(&r->samples);

    for (size_t i = 0; i < 3; i++) {
        const Foxglove__CompressedImage *c = converted(r, all[i], &m);
        assert_string_equal(c->format, "png");
        assert_true(c->data.len > 1000);
        assert_memory_equal(c->data.data, head, sizeof head);
    }
}

static void an_object_is_a_dot_an_ellipsoid_a_box_and_a_label(void **state)
{
    struct rig *r = *state;
    const struct foxglove_message m = samples_detections(&r->samples);
    const Foxglove__SceneUpdate *u = converted(r, "objects", &m);

    assert_int_equal(u->n_deletions, 1);
    assert_int_equal(u->deletions[0]->type, FOXGLOVE__SCENE_ENTITY_DELETION__TYPE__ALL);
    assert_int_equal(u->n_entities, 1);
    const Foxglove__SceneEntity *e = u->entities[0];
    assert_string_equal(e->frame_id, "vehicle");
    assert_string_equal(e->id, "object 1");
    assert_int_equal(e->n_spheres, 2);
    assert_vector(e->spheres[0]->pose->position, 3.7, 0.6, 0.5);
    assert_vector(e->spheres[1]->pose->position, 3.7, 0.6, 0.5);
    const Foxglove__Vector3 *size =
        e->spheres[1]->size; /* 4 deviations from end to end */
    assert_near(fmax(size->x, fmax(size->y, size->z)), 0.12, 1e-9);
    assert_near(fmin(size->x, fmin(size->y, size->z)), 0.04, 1e-9);
    assert_int_equal(e->n_cubes, 1);
    assert_vector(e->cubes[0]->size, 0.2, 0.0, 0.0);
    assert_int_equal(e->n_texts, 1);
    assert_string_equal(e->texts[0]->text, "1  50%  31 dB");
}

/* 3 m/s to (0.6, 0.8) of the vehicle, and a turn of the arrow's x axis there. */
static void a_track_has_an_arrow_of_what_it_goes_in_a_second(void **state)
{
    double velocity[2] = {1.8, 2.4};
    struct rig *r = *state;
    const struct foxglove_message m = samples_detections(&r->samples);
    Anlos__Detection *d = &r->samples.detection;

    r->samples.detections.tracked = true;
    d->velocity_m_s = velocity;
    d->n_velocity_m_s = 2;
    d->shape = ANLOS__SHAPE__EXTENDED;
    d->measurement = ANLOS__MEASUREMENT__PREDICTED;
    d->unseen_s = 0.42;
    const Foxglove__SceneUpdate *u = converted(r, "objects", &m);
    const Foxglove__SceneEntity *e = u->entities[0];
    assert_int_equal(e->n_arrows, 1);
    const Foxglove__ArrowPrimitive *arrow = e->arrows[0];
    assert_vector(arrow->pose->position, 3.7, 0.6, 0.5);
    assert_near(arrow->shaft_length + arrow->head_length, 3.0, 1e-9);
    assert_turned(arrow->pose->orientation, 1, 0, 0, 0.6, 0.8, 0);
    assert_string_equal(e->texts[0]->text, "1  extended  50%  3.0 m/s  unseen 0.4 s");
    velocity[0] = velocity[1] = 0.01; /* it stands */
    u = converted(r, "objects", &m);
    assert_int_equal(u->entities[0]->n_arrows, 0);
    d->measurement = ANLOS__MEASUREMENT__DELETED;
    u = converted(r, "objects", &m);
    assert_int_equal(u->n_entities, 0);
}

static void an_arrow_points_anywhere(void **state)
{
    static const double ways[4][3] = {{0, 0, 2}, {0, 0, -2}, {-2, 0, 0}, {1, -2, 2}};
    static const struct part_room room = {.arrows = 1};
    static const double from[3] = {0, 0, 0};
    struct rig *r = *state;

    for (int i = 0; i < 4; i++) {
        const double *w = ways[i];
        double n = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
        Foxglove__SceneEntity *e = part_entity(&r->arena, "e", "array", 1, &room);
        part_add_arrow(&r->arena, e, from, w, 0.01, NULL);
        assert_turned(e->arrows[0]->pose->orientation, 1, 0, 0, w[0] / n, w[1] / n,
                      w[2] / n);
    }
}

static void an_object_without_a_place_is_left_out(void **state)
{
    struct rig *r = *state;
    const struct foxglove_message m = samples_detections(&r->samples);

    r->samples.position.y = NAN;
    const Foxglove__SceneUpdate *u = converted(r, "objects", &m);
    assert_int_equal(u->n_entities, 0);
    assert_int_equal(u->n_deletions, 1);
}

static void what_is_not_mirrored_back_says_so(void **state)
{
    struct rig *r = *state;
    const struct foxglove_message m = samples_detections(&r->samples);

    r->samples.detections.mirrored = false;
    r->samples.detections.in_vehicle_frame = false;
    r->samples.detection.n_covariance_m2 = 5; /* not one */
    const Foxglove__SceneUpdate *u = converted(r, "objects", &m);
    assert_string_equal(u->entities[0]->frame_id, "array");
    assert_string_equal(u->entities[0]->texts[0]->text, "1  50%  31 dB  mirrored");
    assert_int_equal(u->entities[0]->n_spheres, 1);
}

/* The elements' middle, half way along the stage, is (0.25, 0.15, 0): the wall is drawn
 * in front of it, its normal the third axis of the box. */
static void the_scene_has_wall_vehicle_and_array_in_their_places(void **state)
{
    struct rig *r = *state;
    const struct foxglove_message m = samples_survey(&r->samples);
    const Foxglove__SceneUpdate *u = converted(r, "scene", &m);

    assert_int_equal(u->n_entities, 3);
    assert_int_equal(u->n_deletions, 0);
    const Foxglove__SceneEntity *wall = u->entities[0], *car = u->entities[1],
                                *array = u->entities[2];
    assert_string_equal(wall->frame_id, "array");
    assert_vector(wall->cubes[0]->pose->position, 0.25, 0.15, 1.0);
    assert_turned(wall->cubes[0]->pose->orientation, 0, 0, 1, 0, 0, 1);
    assert_string_equal(car->frame_id, "vehicle");
    assert_string_equal(array->frame_id, "stage");
    assert_true(array->frame_locked);
    assert_int_equal(array->n_spheres, 4);
    assert_vector(array->spheres[3]->pose->position, 0.1, 0.3, 0.0);
}

static void a_tilted_wall_is_drawn_along_its_plane(void **state)
{
    static const double normals[3][3] = {{0.36, 0.48, 0.8}, {1, 0, 0}, {0, -1, 0}};
    struct rig *r = *state;

    for (int i = 0; i < 3; i++) {
        const double *n = normals[i];
        memcpy(r->samples.survey.wall_normal, n, sizeof normals[i]);
        resurvey(r);
        const struct foxglove_message m = samples_survey(&r->samples);
        const Foxglove__SceneUpdate *u = converted(r, "scene", &m);
        const Foxglove__Pose *p = u->entities[0]->cubes[0]->pose;
        assert_turned(p->orientation, 0, 0, 1, n[0], n[1], n[2]);
        assert_near(n[0] * p->position->x + n[1] * p->position->y + n[2] * p->position->z,
                    1.0, 1e-9);
    }
}

static void what_a_survey_does_not_have_is_taken_away(void **state)
{
    struct rig *r = *state;

    r->samples.survey.has_wall = false;
    r->samples.survey.has_mount = false;
    resurvey(r);
    const struct foxglove_message m = samples_survey(&r->samples);
    const Foxglove__SceneUpdate *u = converted(r, "scene", &m);
    assert_int_equal(u->n_entities, 1);
    assert_string_equal(u->entities[0]->id, "array");
    assert_int_equal(u->n_deletions, 2);
    assert_string_equal(u->deletions[0]->id, "wall");
    assert_string_equal(u->deletions[1]->id, "vehicle");
}

/* The one that is told moves in front of the array, 0.8 m away; the survey's goes. */
static void a_wall_that_is_told_takes_the_place_of_the_surveys(void **state)
{
    struct rig *r = *state;
    const struct foxglove_message m = samples_walls(&r->samples),
                                  survey = samples_survey(&r->samples);

    r->samples.wall.distance_m = 0.8;
    setting_take(&r->setting, &m);
    const Foxglove__SceneUpdate *u = converted(r, "walls", &m);
    assert_int_equal(u->n_entities, 1);
    assert_string_equal(u->entities[0]->id, "wall 3");
    assert_string_equal(u->entities[0]->texts[0]->text, "wall 3  estimated  90%");
    assert_vector(u->entities[0]->cubes[0]->pose->position, 0.25, 0.15, 0.8);
    u = converted(r, "scene", &survey);
    assert_int_equal(u->n_entities, 2);
    assert_string_equal(u->deletions[0]->id, "wall");
    /* The brightest voxel is imaged at z = 1.9. */
    const struct foxglove_message volume = samples_volume(&r->samples);
    assert_brightest_at(converted(r, "voxels", &volume), 0.1, 0.0, -0.3);
}

static void a_wall_that_does_not_hold_is_refused(void **state)
{
    struct rig *r = *state;
    const struct foxglove_message m = samples_walls(&r->samples);
    ProtobufCMessage *out;

    r->samples.wall_normal.z = 0.5;
    assert_int_equal(conversion("walls")(&r->arena, &r->setting, &m, &out), -EINVAL);
}

/* Array (x, y, z) is vehicle (3.6 + z, 0.5 + x, 0.4 + y). */
static void the_array_is_where_it_is_mounted(void **state)
{
    struct rig *r = *state;
    struct foxglove_message m = samples_stage(&r->samples);

    setting_take(&r->setting, &m);
    const Foxglove__FrameTransforms *t = converted(r, "frames", &m);
    assert_int_equal(t->n_transforms, 2);
    const Foxglove__FrameTransform *array = t->transforms[0], *stage = t->transforms[1];
    assert_string_equal(array->parent_frame_id, "vehicle");
    assert_string_equal(array->child_frame_id, "array");
    assert_vector(array->translation, 3.6, 0.5, 0.4);
    assert_turned(array->rotation, 1, 2, 3, 3, 1, 2);
    assert_string_equal(stage->parent_frame_id, "array");
    assert_string_equal(stage->child_frame_id, "stage");
    assert_vector(stage->translation, 0.2, 0.0, 0.0);
    assert_turned(stage->rotation, 1, 2, 3, 1, 2, 3);
}

static void without_a_mount_the_array_is_the_root(void **state)
{
    struct rig *r = *state;

    r->samples.survey.has_mount = false;
    resurvey(r);
    const struct foxglove_message m = samples_survey(&r->samples);
    const Foxglove__FrameTransforms *t = converted(r, "frames", &m);
    assert_int_equal(t->n_transforms, 1);
    assert_string_equal(t->transforms[0]->parent_frame_id, "array");
}

static void a_list_becomes_figures_for_plots(void **state)
{
    struct rig *r = *state;
    struct foxglove_message m = samples_detections(&r->samples);
    const Anlos__Figures *f = converted(r, "figures", &m);

    assert_int_equal(f->objects, 1);
    assert_near(f->snr_db, 31.4, 1e-9);
    assert_near(f->latency_ms, 1250.0, 1e-6);
    assert_int_equal(f->timestamp->seconds, 1700000000);
    assert_int_equal(f->timestamp->nanos, 250000000);
    r->samples.detection.measurement = ANLOS__MEASUREMENT__PREDICTED;
    r->samples.detections.source = ANLOS__SOURCE__REPLAY;
    f = converted(r, "figures", &m);
    assert_int_equal(f->objects, 1);
    assert_true(isnan(f->snr_db) && isnan(f->latency_ms));
}

static void a_log_line_keeps_level_node_and_stamp(void **state)
{
    struct rig *r = *state;
    const struct foxglove_message m = samples_log(&r->samples);
    const Foxglove__Log *l = converted(r, "log", &m);

    assert_int_equal(l->level, FOXGLOVE__LOG__LEVEL__WARNING);
    assert_string_equal(l->name, "dsp");
    assert_string_equal(l->message, "microphone 3 is dead");
    assert_int_equal(l->timestamp->seconds, 1700000002);
    assert_int_equal(l->timestamp->nanos, 1);
    r->samples.log.repeats = 37;
    r->samples.log.repeats_s = 10.0;
    r->samples.log.repeats_ago_s = 4.0;
    r->samples.log.left_out = 2;
    l = converted(r, "log", &m);
    assert_string_equal(l->message, "microphone 3 is dead (37 times more in 10 s, "
                                    "last 4 s ago) (2 lines before it are left out)");
}

static void every_channel_has_a_schema_and_a_source(void **state)
{
    struct channel c, other;

    (void)state;
    for (size_t i = 0; i < channels_count(); i++) {
        channel_get(i, &c);
        assert_non_null(c.sources[0]);
        assert_true(c.schema.data.size > 0);
        for (size_t k = 0; k < i; k++) {
            channel_get(k, &other);
            assert_string_not_equal(c.name, other.name);
        }
    }
}

/* Between blocks, at their ends, and larger than one. */
static void an_arena_gives_zeroed_parts_that_do_not_touch(void **state)
{
    static const size_t sizes[] = {1, 17, 4000, 200, 100000, 16, 0};
    struct rig *r = *state;
    unsigned char *parts[7];

    for (size_t i = 0; i < 7; i++) {
        parts[i] = arena_array(&r->arena, sizes[i], 1);
        assert_non_null(parts[i]);
        for (size_t k = 0; k < sizes[i]; k++)
            assert_int_equal(parts[i][k], 0);
        memset(parts[i], (int)i + 1, sizes[i]);
    }
    for (size_t i = 0; i < 7; i++)
        for (size_t k = 0; k < sizes[i]; k++)
            assert_int_equal(parts[i][k], i + 1);
    assert_null(arena_array(&r->arena, SIZE_MAX / 2, 3));
    assert_true(r->arena.failed);
    assert_non_null(arena_one(&r->arena, 100));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_quaternion_turns_the_axes_where_they_point),
        TEST(times_before_1970_keep_positive_nanoseconds),
        TEST(the_cloud_has_the_bright_voxels_where_they_really_are),
        TEST(without_a_wall_the_cloud_stays_as_imaged),
        TEST(an_image_waits_for_its_survey),
        TEST(a_volume_that_does_not_hold_is_refused),
        TEST(a_grid_beyond_all_measure_is_refused),
        TEST(an_empty_or_broken_image_makes_an_empty_cloud),
        TEST(no_more_voxels_stand_out_than_are_asked_for),
        TEST(noise_does_not_stand_out),
        TEST(the_voxels_are_where_the_cloud_is),
        TEST(a_tilted_wall_turns_the_grid),
        TEST(without_a_wall_the_grid_is_as_imaged),
        TEST(a_large_image_is_folded_to_maxima),
        TEST(pictures_are_png_of_three_sides),
        TEST(an_object_is_a_dot_an_ellipsoid_a_box_and_a_label),
        TEST(a_track_has_an_arrow_of_what_it_goes_in_a_second),
        TEST(an_arrow_points_anywhere),
        TEST(an_object_without_a_place_is_left_out),
        TEST(what_is_not_mirrored_back_says_so),
        TEST(the_scene_has_wall_vehicle_and_array_in_their_places),
        TEST(a_tilted_wall_is_drawn_along_its_plane),
        TEST(what_a_survey_does_not_have_is_taken_away),
        TEST(a_wall_that_is_told_takes_the_place_of_the_surveys),
        TEST(a_wall_that_does_not_hold_is_refused),
        TEST(the_array_is_where_it_is_mounted),
        TEST(without_a_mount_the_array_is_the_root),
        TEST(a_list_becomes_figures_for_plots),
        TEST(a_log_line_keeps_level_node_and_stamp),
        TEST(every_channel_has_a_schema_and_a_source),
        TEST(an_arena_gives_zeroed_parts_that_do_not_touch),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
