/* SPDX-License-Identifier: MIT */
/* Plain types through packed messages and back: each field has a value of its own. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "msgs/convert.h"
#include "tests/recon/survey_example.h"

enum { MICS = 3, SAMPLES = 4 };

/* As it comes over the bus. */
static ProtobufCMessage *sent(const ProtobufCMessage *m)
{
    size_t size = protobuf_c_message_get_packed_size(m);
    uint8_t *bytes = malloc(size + 1);

    assert_non_null(bytes);
    assert_int_equal(protobuf_c_message_pack(m, bytes), size);
    ProtobufCMessage *back = protobuf_c_message_unpack(m->descriptor, NULL, size, bytes);
    assert_non_null(back);
    free(bytes);
    return back;
}

static void traces_come_back(void **state)
{
    (void)state;
    static const bool masked[MICS] = {false, true, false};
    float complex samples[MICS][SAMPLES];
    const struct traces t = {.survey_id = 11,
                             .capture_ns = 12,
                             .scan = 13,
                             .frame = 14,
                             .position = 15,
                             .speaker = 16,
                             .stage_m = 0.17,
                             .temperature_c = 18.5,
                             .down = true,
                             .background_subtracted = true,
                             .blanked = true,
                             .clipped_samples = 19,
                             .n_microphones = MICS,
                             .format = {.t0_s = 0.02,
                                        .rate_hz = 21e3,
                                        .carrier_hz = 2.2e3,
                                        .n_samples = SAMPLES},
                             .samples = samples[0],
                             .masked = masked};
    protobuf_c_boolean storage[MICS];
    struct traces_room *room = calloc(1, sizeof *room);
    struct tensor_view view;
    struct traces back;
    Anlos__Traces m;

    assert_non_null(room);
    for (int i = 0; i < MICS * SAMPLES; i++)
        samples[i / SAMPLES][i % SAMPLES] = (float)i - 2.5f * I;
    traces_to_message(&t, storage, &view, &m);
    Anlos__Traces *came = (Anlos__Traces *)sent(&m.base);
    traces_from_message(&back, room, came, t.capture_ns);
    assert_int_equal(back.survey_id, 11);
    assert_int_equal(back.capture_ns, 12);
    assert_int_equal(back.scan, 13);
    assert_int_equal(back.frame, 14);
    assert_int_equal(back.position, 15);
    assert_int_equal(back.speaker, 16);
    assert_true(back.stage_m == 0.17 && back.temperature_c == 18.5);
    assert_true(back.down && back.background_subtracted && back.blanked);
    assert_int_equal(back.clipped_samples, 19);
    assert_int_equal(back.n_microphones, MICS);
    assert_memory_equal(&back.format, &t.format, sizeof t.format);
    assert_memory_equal(back.samples, samples, sizeof samples);
    assert_memory_equal(back.masked, masked, sizeof masked);
    came->n_masked = MICS - 1; /* not one for each */
    traces_from_message(&back, room, came, 0);
    assert_null(back.samples);
    assert_int_equal(back.n_microphones, 0);
    came->n_masked = MICS;
    anlos__traces__free_unpacked(came, NULL);
    free(room);
}

static void a_volume_comes_back(void **state)
{
    (void)state;
    float intensity[2][3][4];
    float newest[3][1][2], around[2][1][3];
    const float spots[2][4] = {{1.0f, -2.0f, 3.0f, 9.0f}, {0.5f, 0.0f, 1.0f, 0.0f}};
    const struct volume_mover movers[2] = {
        {{1.0f, 0.0f, 2.0f}, {-0.5f, 0.0f, 1.5f}, 20.0f},
        {{-1.0f, 0.0f, 3.0f}, {0.5f, 0.0f, -1.5f}, 30.0f}};
    const struct volume_course courses[2] = {{movers[0], 0.25f}, {movers[1], 1.0f}};
    const struct volume v = {.survey_id = 11,
                             .capture_ns = 12,
                             .scan = 13,
                             .frame = 14,
                             .grid = {.origin_m = {-0.1, 0.2, 1.5},
                                      .step_m = {0.01, 0.02, 0.03},
                                      .n = {4, 3, 2}},
                             .intensity = &intensity[0][0][0],
                             .blocks = {.origin_m = {-0.05, 0.3, 1.6},
                                        .step_m = {0.08, 0.09, 0.1},
                                        .n = {2, 1, 3}},
                             .newest = &newest[0][0][0],
                             .around = {.grid = {.origin_m = {-1.0, -0.5, 0.4},
                                                 .step_m = {0.1, 0.2, 0.3},
                                                 .n = {3, 1, 2}},
                                        .intensity = &around[0][0][0],
                                        .n_spots = 2,
                                        .spots = spots},
                             .method = "frames",
                             .source = SURVEY_SIMULATION,
                             .sound_speed_m_s = 340.5,
                             .preview = true,
                             .pings_used = 15,
                             .age_s = 0.21,
                             .pings_expected = 16,
                             .pings_blanked = 17,
                             .microphones_masked = 18,
                             .clipped_samples = 19,
                             .standing_left = true,
                             .standing_taken = true,
                             .movers = movers,
                             .n_movers = 2,
                             .ambiguous = movers + 1,
                             .n_ambiguous = 1,
                             .courses = courses,
                             .n_courses = 2};
    struct volume_view view;
    struct volume back;
    Anlos__Volume m;

    for (int i = 0; i < 24; i++)
        (&intensity[0][0][0])[i] = (float)i;
    for (int i = 0; i < 6; i++)
        (&newest[0][0][0])[i] = (float)(2 * i);
    for (int i = 0; i < 6; i++)
        (&around[0][0][0])[i] = (float)(3 * i);
    volume_to_message(&v, &view, &m);
    Anlos__Volume *came = (Anlos__Volume *)sent(&m.base);
    volume_from_message(&back, came, v.capture_ns);
    assert_int_equal(back.survey_id, 11);
    assert_int_equal(back.capture_ns, 12);
    assert_int_equal(back.scan, 13);
    assert_int_equal(back.frame, 14);
    assert_memory_equal(&back.grid, &v.grid, sizeof v.grid);
    assert_memory_equal(back.intensity, intensity, sizeof intensity);
    assert_memory_equal(&back.blocks, &v.blocks, sizeof v.blocks);
    assert_memory_equal(back.newest, newest, sizeof newest);
    assert_memory_equal(&back.around.grid, &v.around.grid, sizeof v.around.grid);
    assert_memory_equal(back.around.intensity, around, sizeof around);
    assert_int_equal(back.around.n_spots, 2);
    assert_memory_equal(back.around.spots, spots, sizeof spots);
    assert_string_equal(back.method, "frames");
    assert_int_equal(back.source, SURVEY_SIMULATION);
    assert_true(back.sound_speed_m_s == 340.5 && back.preview);
    assert_int_equal(back.pings_used, 15);
    assert_true(back.age_s == 0.21);
    assert_int_equal(back.pings_expected, 16);
    assert_int_equal(back.pings_blanked, 17);
    assert_int_equal(back.microphones_masked, 18);
    assert_int_equal(back.clipped_samples, 19);
    assert_true(back.standing_left && back.standing_taken);
    assert_int_equal(back.n_movers, 2);
    assert_memory_equal(back.movers, movers, sizeof movers);
    assert_int_equal(back.n_ambiguous, 1);
    assert_memory_equal(back.ambiguous, movers + 1, sizeof *movers);
    assert_int_equal(back.n_courses, 2);
    assert_memory_equal(back.courses, courses, sizeof courses);
    came->step_m->y = 0.0; /* no grid */
    volume_from_message(&back, came, 0);
    assert_null(back.intensity);
    anlos__volume__free_unpacked(came, NULL);
}

/* From whoever sends: all of them, or none. */
static void movers_that_none_could_be_are_none(void **state)
{
    (void)state;
    struct volume_mover movers[VOLUME_MOVERS + 1];
    struct volume v = {.movers = movers, .ambiguous = movers, .method = "frames"};

    for (int wrong = 0; wrong < 5; wrong++) {
        struct volume_view view;
        struct volume back;
        Anlos__Volume m;
        for (int i = 0; i <= VOLUME_MOVERS; i++)
            movers[i] = (struct volume_mover){.at_m = {0, 0, 1}, .power = 1.0f};
        v.n_movers = v.n_ambiguous = wrong == 1 ? VOLUME_MOVERS + 1 : VOLUME_MOVERS;
        movers[3].at_m[2] = wrong == 2 ? NAN : 1.0f;
        movers[3].velocity_m_s[0] = wrong == 3 ? 341.0f : 1.0f;
        movers[3].power = wrong == 4 ? 0.0f : 1.0f;
        volume_to_message(&v, &view, &m);
        Anlos__Volume *came = (Anlos__Volume *)sent(&m.base);
        volume_from_message(&back, came, 0);
        assert_int_equal(back.n_movers, wrong ? 0 : VOLUME_MOVERS);
        assert_int_equal(back.n_ambiguous, wrong ? 0 : VOLUME_MOVERS);
        anlos__volume__free_unpacked(came, NULL);
    }
}

static void courses_that_none_could_be_are_none(void **state)
{
    (void)state;
    struct volume_course courses[VOLUME_MOVERS + 1];
    struct volume v = {.courses = courses, .method = "frames"};

    for (int wrong = 0; wrong < 6; wrong++) {
        struct volume_view view;
        struct volume back;
        Anlos__Volume m;
        for (int i = 0; i <= VOLUME_MOVERS; i++)
            courses[i] = (struct volume_course){
                .mover = {.at_m = {0, 0, 1}, .power = 1.0f}, .sure = 0.5f};
        v.n_courses = wrong == 1 ? VOLUME_MOVERS + 1 : VOLUME_MOVERS;
        courses[3].mover.power = wrong == 2 ? 0.0f : 1.0f;
        courses[4].sure = wrong == 3 ? -0.1f : wrong == 4 ? 1.1f : 0.0f;
        courses[5].sure = wrong == 5 ? NAN : 1.0f;
        volume_to_message(&v, &view, &m);
        Anlos__Volume *came = (Anlos__Volume *)sent(&m.base);
        volume_from_message(&back, came, 0);
        assert_int_equal(back.n_courses, wrong ? 0 : VOLUME_MOVERS);
        anlos__volume__free_unpacked(came, NULL);
    }
}

/* From whoever sends: not more of them than there are voxels. */
static void more_blocks_than_voxels_are_none(void **state)
{
    (void)state;
    float intensity[2] = {1.0f, 2.0f}, newest[3] = {1.0f, 2.0f, 3.0f};
    struct volume v = {.grid = {{0, 0, 1}, {0.1, 0.1, 0.1}, {2, 1, 1}},
                       .intensity = intensity,
                       .blocks = {{0, 0, 1}, {0.1, 0.1, 0.1}, {2, 1, 1}},
                       .newest = newest,
                       .method = "frames"};

    for (size_t n = 2; n <= 3; n++) {
        struct volume_view view;
        struct volume back;
        Anlos__Volume m;
        v.blocks.n[0] = n;
        volume_to_message(&v, &view, &m);
        Anlos__Volume *came = (Anlos__Volume *)sent(&m.base);
        volume_from_message(&back, came, 0);
        assert_true((back.newest != NULL) == (n == 2));
        anlos__volume__free_unpacked(came, NULL);
    }
}

/* What lies around is left out whole where it does not hold, and the image stays. */
static void surroundings_that_do_not_hold_are_none(void **state)
{
    (void)state;
    float intensity[2] = {1.0f, 2.0f}, around[2] = {3.0f, 4.0f};
    float spots[SURROUNDINGS_SPOTS + 1][4] = {{1.0f, 2.0f, 3.0f, 4.0f}};
    const struct {
        size_t n_spots;
        float x, z, level;
        double step_m;
        bool holds;
    } cases[] = {
        {1, 1.0f, 3.0f, 4.0f, 0.1, true},
        {0, NAN, NAN, NAN, 0.1, true},
        {1, NAN, 3.0f, 4.0f, 0.1, false},
        {1, 1.0f, 3e4f, 4.0f, 0.1, false},
        {1, 1.0f, 3.0f, NAN, 0.1, false},
        {1, 1.0f, 3.0f, -1.0f, 0.1, false},
        {1, 1.0f, 3.0f, INFINITY, 0.1, false},
        {1, 1.0f, 3.0f, 4.0f, 0.0, false},
        {SURROUNDINGS_SPOTS, 1.0f, 3.0f, 4.0f, 0.1, true},
        {SURROUNDINGS_SPOTS + 1, 1.0f, 3.0f, 4.0f, 0.1, false},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct volume v = {.grid = {{0, 0, 1}, {0.1, 0.1, 0.1}, {2, 1, 1}},
                           .intensity = intensity,
                           .around = {.grid = {{0, 0, 1}, {0.1, 0.1, 0.1}, {2, 1, 1}},
                                      .intensity = around,
                                      .n_spots = cases[i].n_spots,
                                      .spots = (const float(*)[4])spots},
                           .method = "fast"};
        struct volume_view view;
        struct volume back;
        Anlos__Volume m;
        spots[0][0] = cases[i].x;
        spots[0][2] = cases[i].z;
        spots[0][3] = cases[i].level;
        v.around.grid.step_m[1] = cases[i].step_m;
        volume_to_message(&v, &view, &m);
        Anlos__Volume *came = (Anlos__Volume *)sent(&m.base);
        volume_from_message(&back, came, 0);
        assert_non_null(back.intensity);
        assert_true((back.around.intensity != NULL) == cases[i].holds);
        anlos__volume__free_unpacked(came, NULL);
    }
}

static void a_ping_is_read_as_it_was_sent(void **state)
{
    (void)state;
    uint32_t clipped[MICS] = {1, 2, 3}, not_finite[MICS] = {4, 5, 6};
    float samples[MICS][SAMPLES] = {{0.5f}};
    Anlos__Ping m = ANLOS__PING__INIT;
    struct tensor_view view;
    struct ping p;

    m.survey_id = 11;
    m.scan = 13;
    m.frame = 14;
    m.pass = ANLOS__PASS__BACKGROUND;
    m.position = 15;
    m.speaker = 16;
    m.stage_m = 0.17;
    m.temperature_c = 18.5;
    m.down = m.valid = true;
    m.samples = tensor_borrow_f32(&view, samples[0], 2, (size_t)MICS, (size_t)SAMPLES);
    m.clipped = clipped;
    m.not_finite = not_finite;
    m.n_clipped = m.n_not_finite = MICS;
    ping_from_message(&p, &m, 12);
    assert_int_equal(p.survey_id, 11);
    assert_int_equal(p.capture_ns, 12);
    assert_int_equal(p.scan, 13);
    assert_int_equal(p.frame, 14);
    assert_int_equal(p.pass, PASS_BACKGROUND);
    assert_int_equal(p.position, 15);
    assert_int_equal(p.speaker, 16);
    assert_true(p.stage_m == 0.17 && p.temperature_c == 18.5 && p.down && p.valid);
    assert_int_equal(p.n_microphones, MICS);
    assert_int_equal(p.n_samples, SAMPLES);
    assert_ptr_equal(p.samples, samples);
    assert_ptr_equal(p.clipped, clipped);
    assert_ptr_equal(p.not_finite, not_finite);
    m.n_not_finite = MICS - 1;
    ping_from_message(&p, &m, 12);
    assert_null(p.samples);
    m.n_not_finite = MICS;
    m.samples = NULL;
    ping_from_message(&p, &m, 12);
    assert_null(p.samples);
}

static struct object seen(void)
{
    return (struct object){.id = 7,
                           .placed = true,
                           .place = {.position_m = {1, 2, 3},
                                     .covariance_m2 = {4, 5, 6, 7, 8, 9},
                                     .extent_m = {0.1, 0.2, 0.3},
                                     .wall = 10,
                                     .height_assumed = true,
                                     .behind_no_wall = true,
                                     .in_free_view = true},
                           .virtual_m = {11, 12, 13},
                           .existence = 0.14,
                           .level_db = 15,
                           .shape = {SHAPE_EXTENDED, 0.16},
                           .at_border = 5,
                           .multipath = MULTIPATH_FACE,
                           .of = {17, 18}};
}

static void assert_seen(const Anlos__Detection *d)
{
    assert_int_equal(d->id, 7);
    assert_true(d->virtual_m->x == 11 && d->virtual_m->y == 12 && d->virtual_m->z == 13);
    assert_true(d->existence == 0.14 && d->level_db == 15);
    assert_int_equal(d->shape, ANLOS__SHAPE__EXTENDED);
    assert_true(d->shape_probability == 0.16);
    assert_int_equal(d->wall, 10);
    assert_true(d->height_assumed && d->behind_no_wall && d->in_free_view);
    assert_int_equal(d->at_border, 5);
    assert_int_equal(d->multipath, ANLOS__MULTIPATH__BY_A_FACE);
    assert_int_equal(d->n_multipath_of, 2);
    assert_int_equal(d->multipath_of[0], 17);
    assert_int_equal(d->multipath_of[1], 18);
}

static void objects_are_listed_as_they_are(void **state)
{
    (void)state;
    struct object_list list = {.scan = 1,
                               .frame = 2,
                               .counter = 3,
                               .preview = true,
                               .mirrored = true,
                               .in_vehicle_frame = true,
                               .tracked = true,
                               .ego_unknown = true,
                               .source = SURVEY_REPLAY,
                               .temperature_c = 4.5,
                               .sound_speed_m_s = 340,
                               .view = {2,
                                        {{7, 3, {{1, 2}, {3, 4}, {5, 7}}},
                                         {0, 4, {{1, 1}, {2, 1}, {2, 2}, {1, 2}}}}},
                               .n = 3};
    Anlos__DetectionList *m;

    list.objects[0] = seen();
    list.objects[1] = seen();
    list.objects[1].tracked = true;
    list.objects[1].state = TRACK_PREDICTED;
    list.objects[1].motion = TRACK_MOVING;
    list.objects[1].age_s = 19;
    list.objects[1].unseen_s = 20;
    memcpy(list.objects[1].velocity_m_s, (double[]){21, 22}, 2 * sizeof(double));
    memcpy(list.objects[1].velocity_m2_s2, (double[]){23, 24, 25}, 3 * sizeof(double));
    list.objects[1].of[1] = 17; /* of one alone */
    list.objects[2] = list.objects[1];
    list.objects[2].placed = false;
    assert_int_equal(detections_from_objects(&m, &list), 0);
    assert_int_equal(m->scan, 1);
    assert_int_equal(m->frame, 2);
    assert_int_equal(m->counter, 3);
    assert_true(m->preview && m->mirrored && m->in_vehicle_frame && m->tracked &&
                m->ego_unknown);
    assert_int_equal(m->source, ANLOS__SOURCE__REPLAY);
    assert_true(m->temperature_c == 4.5 && m->sound_speed_m_s == 340);
    assert_int_equal(m->n_detections, 3);
    const Anlos__Detection *d = m->detections[0];
    assert_seen(d);
    assert_true(d->position_m->x == 1 && d->position_m->y == 2 && d->position_m->z == 3);
    assert_true(d->extent_m->x == 0.1 && d->extent_m->y == 0.2 && d->extent_m->z == 0.3);
    assert_int_equal(d->n_covariance_m2, 6);
    for (int i = 0; i < 6; i++)
        assert_true(d->covariance_m2[i] == 4 + i);
    assert_int_equal(d->n_velocity_m_s + d->n_velocity_covariance_m2_s2, 0);
    d = m->detections[1];
    assert_int_equal(d->measurement, ANLOS__MEASUREMENT__PREDICTED);
    assert_int_equal(d->motion, ANLOS__MOTION__MOVING);
    assert_true(d->age_s == 19 && d->unseen_s == 20);
    assert_int_equal(d->n_velocity_m_s, 2);
    assert_true(d->velocity_m_s[0] == 21 && d->velocity_m_s[1] == 22);
    assert_int_equal(d->n_velocity_covariance_m2_s2, 3);
    for (int i = 0; i < 3; i++)
        assert_true(d->velocity_covariance_m2_s2[i] == 23 + i);
    assert_int_equal(d->n_multipath_of, 1);
    d = m->detections[2]; /* it is there, nobody knows where */
    assert_null(d->position_m);
    assert_null(d->extent_m);
    assert_int_equal(d->n_covariance_m2 + d->n_velocity_m_s, 0);
    assert_true(d->virtual_m->z == 13);
    assert_int_equal(m->n_views, 2);
    assert_int_equal(m->views[0]->wall, 7);
    assert_int_equal(m->views[0]->n_corners_m, 6);
    for (int i = 0; i < 6; i++)
        assert_true(m->views[0]->corners_m[i] == i + 1 + (i == 5));
    assert_int_equal(m->views[1]->wall, 0);
    assert_int_equal(m->views[1]->n_corners_m, 8);
    detections_free(m);
}

/* To the last bit: whoever takes walls from the bus has what one process has. */
static void walls_come_back(void **state)
{
    (void)state;
    const struct walls w = {
        .n = 2,
        .list = {{.id = 21,
                  .plane = {.normal = {0.6, 0.0, 0.8},
                            .distance_m = 2.2,
                            .covariance = {1e-4, 2e-5, 3e-5, 4e-4, 5e-5, 6e-4},
                            .ends_m = {-1.5, 1.0 / 3.0}},
                  .gate_m = {0.7, 8.0}},
                 {.id = 22,
                  .plane = {.normal = {1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0},
                            .distance_m = 0.9},
                  .gate_m = {0.0, WALLS_FAR_M}}},
        .existence = {0.75, 1.0},
        .unseen_s = {0.3, 0.0},
        .origin = {WALL_GIVEN, WALL_CONFIGURED},
        .n_corners = 3,
        .free_view_m = {{0.1, 0.2}, {1.3, 0.4}, {0.5, 2.6}}};
    struct walls_view view;
    struct walls back;
    Anlos__WallList m;

    walls_to_message(&w, "all is well", &view, &m);
    Anlos__WallList *came = (Anlos__WallList *)sent(&m.base);
    assert_string_equal(came->text, "all is well");
    assert_int_equal(came->walls[0]->n_covariance, 6);
    assert_int_equal(came->walls[1]->n_covariance, 0);
    assert_int_equal(came->walls[0]->n_ends_m, 2);
    assert_int_equal(came->walls[1]->n_ends_m, 0);
    assert_int_equal(walls_from_message(&back, came, NULL), 0);
    assert_int_equal(back.n, 2);
    for (size_t i = 0; i < 2; i++) {
        const struct wall_gate *a = &w.list[i], *b = &back.list[i];
        assert_int_equal(b->id, a->id);
        assert_memory_equal(&b->plane, &a->plane, sizeof a->plane);
        assert_memory_equal(b->gate_m, a->gate_m, sizeof a->gate_m);
        assert_true(back.existence[i] == w.existence[i]);
        assert_true(back.unseen_s[i] == w.unseen_s[i]);
        assert_int_equal(back.origin[i], w.origin[i]);
    }
    assert_int_equal(back.n_corners, 3);
    assert_memory_equal(back.free_view_m, w.free_view_m, 3 * sizeof *w.free_view_m);
    protobuf_c_message_free_unpacked(&came->base, NULL);
}

static void arrivals_come_back(void **state)
{
    (void)state;
    const struct wall_arrivals at[3] = {
        {.heard = true, .n = 2, .peaks = {{1.0 / 3.0, 0.25}, {2.5, 1e-3}}},
        {.heard = false},
        {.heard = true, .n = 1, .peaks = {{0.7, 1.0 / 7.0}}}};
    const struct wall_returns r = {.ping = {.survey_id = 7,
                                            .capture_ns = 11,
                                            .scan = 2,
                                            .frame = 3,
                                            .pass = PASS_BACKGROUND,
                                            .position = 4,
                                            .speaker = 5,
                                            .down = true,
                                            .valid = true},
                                   .usable = true,
                                   .n_microphones = 3,
                                   .at = at};
    struct returns_room out = {.n = 0}, in = {.n = 0};
    struct wall_returns back;
    Anlos__Echoes m;

    assert_int_equal(returns_to_message(&r, &out, &m), 0);
    Anlos__Echoes *came = (Anlos__Echoes *)sent(&m.base);
    assert_int_equal(returns_from_message(&back, &in, came, 11), 0);
    assert_true(back.usable && back.ping.down && back.ping.valid);
    assert_int_equal(back.ping.survey_id, 7);
    assert_int_equal(back.ping.capture_ns, 11);
    assert_int_equal(back.ping.scan, 2);
    assert_int_equal(back.ping.frame, 3);
    assert_int_equal(back.ping.pass, PASS_BACKGROUND);
    assert_int_equal(back.ping.position, 4);
    assert_int_equal(back.ping.speaker, 5);
    assert_int_equal(back.n_microphones, 3);
    for (size_t i = 0; i < 3; i++) {
        assert_int_equal(back.at[i].heard, at[i].heard);
        assert_int_equal(back.at[i].n, at[i].n);
        assert_memory_equal(back.at[i].peaks, at[i].peaks, at[i].n * sizeof *at[i].peaks);
    }
    came->arrivals[2] = 2; /* more than there are */
    assert_int_equal(returns_from_message(&back, &in, came, 11), -EINVAL);
    came->arrivals[2] = 1;
    came->amplitude[1] = 0.0;
    assert_int_equal(returns_from_message(&back, &in, came, 11), -EINVAL);
    protobuf_c_message_free_unpacked(&came->base, NULL);
    returns_room_clear(&out);
    returns_room_clear(&in);
}

static void motion_is_none_where_it_is_not_valid_or_the_vehicle_stands(void **state)
{
    (void)state;
    Anlos__EgoMotion m = ANLOS__EGO_MOTION__INIT;
    struct ego_motion out;

    m.speed_m_s = 2.0;
    m.yaw_rate_rad_s = 0.5;
    assert_null(ego_from_message(&out, &m));
    m.valid = true;
    assert_ptr_equal(ego_from_message(&out, &m), &out);
    assert_true(out.speed_m_s == 2.0 && out.yaw_rate_rad_s == 0.5);
    m.standstill = true;
    assert_non_null(ego_from_message(&out, &m));
    assert_true(out.speed_m_s == 0.0 && out.yaw_rate_rad_s == 0.0);
}

/* -- surveys, and messages that are none -----------------------------------------------
 */

static Anlos__Survey *message_of(const struct survey *s)
{
    uint8_t *bytes = NULL;
    size_t size = 0;
    assert_int_equal(survey_pack(s, &bytes, &size), 0);
    Anlos__Survey *m = anlos__survey__unpack(NULL, size, bytes);
    free(bytes);
    assert_non_null(m);
    return m;
}

static void a_survey_comes_back_from_its_message(void **state)
{
    (void)state;
    struct survey s = example(), back;
    struct error why = {""};
    Anlos__Survey *m = message_of(&s);
    assert_int_equal(survey_from_message(&back, m, &why), 0);
    anlos__survey__free_unpacked(m, NULL); /* the copy owns its arrays */
    assert_surveys_equal(&s, &back);
    assert_true(survey_id(&s) == survey_id(&back));
    survey_clear(&back);
}

static void places_and_replica_come_back_too(void **state)
{
    (void)state;
    struct survey s = foreign_example(), back, copy;
    struct error why = {""};
    Anlos__Survey *m = message_of(&s);
    if (survey_from_message(&back, m, &why))
        fail_msg("%s", why.text);
    assert_int_equal(survey_copy(&copy, &back), 0);
    survey_clear(&back);
    assert_int_equal(copy.n_positions, 5000);
    assert_memory_equal(copy.pings_m, s.pings_m, 5000 * sizeof *s.pings_m);
    assert_int_equal(copy.n_replica, 100);
    assert_memory_equal(copy.replica, s.replica, 100 * sizeof *s.replica);
    assert_true(survey_id(&copy) == survey_id(&s));
    copy.pings_m[4999][1][2] += 1e-9;
    assert_false(survey_id(&copy) == survey_id(&s));
    copy.pings_m[4999][1][2] = s.pings_m[4999][1][2];
    copy.replica[7] += 1e-6f;
    assert_false(survey_id(&copy) == survey_id(&s));
    survey_clear(&copy);
    m->n_pings_m -= 6; /* one place short */
    assert_int_equal(survey_from_message(&back, m, &why), -EINVAL);
    assert_non_null(strstr(why.text, "pings_m"));
    anlos__survey__free_unpacked(m, NULL);
}

static void a_survey_of_the_least_comes_back_too(void **state)
{
    (void)state;
    struct survey s = example(), back;
    s.has_gate = s.has_volume = s.has_wall = s.has_mount = false;
    memset(s.gate_m, 0, sizeof s.gate_m);
    memset(s.volume_m, 0, sizeof s.volume_m);
    memset(s.wall_normal, 0, sizeof s.wall_normal);
    s.wall_distance_m = 0;
    memset(s.mount_origin_m, 0, sizeof s.mount_origin_m);
    memset(s.mount_x_axis, 0, sizeof s.mount_x_axis);
    memset(s.mount_y_axis, 0, sizeof s.mount_y_axis);
    s.n_responses = 0;
    s.responses = NULL;
    s.n_speakers = s.n_microphones = s.n_positions = 1;
    s.temperature_c = NAN;
    Anlos__Survey *m = message_of(&s);
    assert_int_equal(survey_from_message(&back, m, NULL), 0);
    anlos__survey__free_unpacked(m, NULL);
    assert_surveys_equal(&s, &back);
    survey_clear(&back);
}

static void alternating_chirps_and_shared_slots_come_back_from_a_message(void **state)
{
    (void)state;
    struct survey s = example(), back;
    uint8_t *bytes;
    size_t size;
    s.chirp_alternates = true;
    s.together = 2;
    s.continuous = true;
    assert_int_equal(survey_pack(&s, &bytes, &size), 0);
    Anlos__Survey *m = anlos__survey__unpack(NULL, size, bytes);
    free(bytes);
    assert_non_null(m);
    assert_int_equal(survey_from_message(&back, m, NULL), 0);
    anlos__survey__free_unpacked(m, NULL);
    assert_true(back.chirp_alternates);
    assert_int_equal(back.together, 2);
    assert_true(back.continuous);
    survey_clear(&back);
}

static void several_walls_come_back_from_a_message(void **state)
{
    (void)state;
    struct survey s = example(), back;
    uint8_t *bytes;
    size_t size;
    s.n_walls = 2;
    memcpy(s.walls[0].normal, s.wall_normal, sizeof s.wall_normal);
    s.walls[0].distance_m = s.wall_distance_m;
    s.walls[0].gate_m[1] = 4;
    s.walls[1] = (struct survey_wall){{1, 0, 0}, 2.5, {2, 3}};
    s.wall_ends_m[1][0] = -1.5;
    s.wall_ends_m[1][1] = 2.25;
    assert_int_equal(survey_pack(&s, &bytes, &size), 0);
    Anlos__Survey *m = anlos__survey__unpack(NULL, size, bytes);
    free(bytes);
    assert_non_null(m);
    assert_int_equal(survey_from_message(&back, m, NULL), 0);
    assert_int_equal(back.n_walls, 2);
    assert_same(back.walls[1].normal, s.walls[1].normal, 3);
    assert_true(back.walls[1].distance_m == 2.5 && back.walls[1].gate_m[1] == 3);
    assert_same(back.wall_ends_m[1], s.wall_ends_m[1], 2);
    assert_true(back.wall_ends_m[0][0] == 0 && back.wall_ends_m[0][1] == 0);
    survey_clear(&back);
    m->n_wall_ends = 3;
    assert_int_equal(survey_from_message(&back, m, NULL), -EINVAL);
    m->n_wall_ends = 4;
    m->wall_ends[2] = 3.0; /* from behind to */
    assert_int_equal(survey_from_message(&back, m, NULL), -EINVAL);
    m->wall_ends[2] = -1.5;
    m->n_walls = 7;
    assert_int_equal(survey_from_message(&back, m, NULL), -EINVAL);
    m->n_walls = 12;
    anlos__survey__free_unpacked(m, NULL);
    s.walls[0].distance_m += 0.1; /* then it is not the wall */
    assert_int_equal(survey_check(&s, NULL), -EINVAL);
}

static void a_bad_survey_is_not_packed(void **state)
{
    (void)state;
    struct survey s = example();
    uint8_t *bytes = NULL;
    size_t size = 0;
    s.sample_rate_hz = 0;
    assert_int_equal(survey_pack(&s, &bytes, &size), -EINVAL);
    assert_null(bytes);
}

typedef void damage(Anlos__Survey *m);

static void lose_axis(Anlos__Survey *m)
{
    anlos__vec3__free_unpacked(m->stage_axis, NULL);
    m->stage_axis = NULL;
}

static void lose_normal(Anlos__Survey *m)
{
    anlos__vec3__free_unpacked(m->wall_normal, NULL);
    m->wall_normal = NULL;
}

static void lose_mount(Anlos__Survey *m)
{
    anlos__vec3__free_unpacked(m->mount_y_axis, NULL);
    m->mount_y_axis = NULL;
}

static void lose_volume(Anlos__Survey *m)
{
    m->n_volume = 8;
}

static void lose_gain(Anlos__Survey *m)
{
    m->responses[1]->n_gain_db--;
}

static void lengthen_serial(Anlos__Survey *m)
{
    free(m->responses[0]->serial);
    m->responses[0]->serial = strdup("a serial of thirty-two characters");
}

static void change_id(Anlos__Survey *m)
{
    m->id++;
}

static void change_number(Anlos__Survey *m)
{
    m->speakers_m[1]->x += 0.001;
}

static void lose_half_of_the_gate(Anlos__Survey *m)
{
    m->gate_far_m = NAN;
}

static void a_damaged_message_is_refused_and_leaves_nothing(void **state)
{
    (void)state;
    static const struct {
        damage *apply;
        const char *says;
    } cases[] = {
        {lose_axis, "stage_axis is missing"},
        {lose_normal, "wall_normal is missing"},
        {lose_mount, "mount_y_axis"},
        {lose_volume, "expected 9"},
        {lose_gain, "mic-1"},
        {lengthen_serial, "serial"},
        {change_id, "is not that of its"},
        {change_number, "is not that of its"},
        {lose_half_of_the_gate, "gate_m"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct survey s = example(), back;
        struct error why = {""};
        Anlos__Survey *m = message_of(&s);
        cases[i].apply(m);
        assert_int_equal(survey_from_message(&back, m, &why), -EINVAL);
        if (!strstr(why.text, cases[i].says))
            fail_msg("\"%s\" does not say \"%s\"", why.text, cases[i].says);
        assert_null(back.speakers_m);
        assert_null(back.responses);
        anlos__survey__free_unpacked(m, NULL);
    }
}

static void a_message_with_too_many_elements_is_refused(void **state)
{
    (void)state;
    static double positions[SURVEY_MAX_ELEMENTS + 1];
    struct survey s = example(), back;
    struct error why = {""};
    Anlos__Survey *m = message_of(&s);
    size_t n = m->n_stage_positions_m;
    double *own = m->stage_positions_m;
    m->stage_positions_m = positions;
    m->n_stage_positions_m = SURVEY_MAX_ELEMENTS + 1;
    assert_int_equal(survey_from_message(&back, m, &why), -EINVAL);
    assert_non_null(strstr(why.text, "stage_positions_m has 4097"));
    m->stage_positions_m = own;
    m->n_stage_positions_m = n;
    anlos__survey__free_unpacked(m, NULL);
}

/* Where protobuf lets a cut message pass, the content no longer has the id. */
static void a_message_cut_at_any_length_is_refused(void **state)
{
    (void)state;
    struct survey s = example(), back;
    uint8_t *bytes;
    size_t size, refused_by_content = 0;
    assert_int_equal(survey_pack(&s, &bytes, &size), 0);
    for (size_t n = 0; n < size; n++) {
        Anlos__Survey *m = anlos__survey__unpack(NULL, n, bytes);
        if (!m)
            continue;
        assert_int_equal(survey_from_message(&back, m, NULL), -EINVAL);
        refused_by_content++;
        anlos__survey__free_unpacked(m, NULL);
    }
    assert_true(refused_by_content > 10);
    free(bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(traces_come_back),
        cmocka_unit_test(a_volume_comes_back),
        cmocka_unit_test(more_blocks_than_voxels_are_none),
        cmocka_unit_test(movers_that_none_could_be_are_none),
        cmocka_unit_test(courses_that_none_could_be_are_none),
        cmocka_unit_test(surroundings_that_do_not_hold_are_none),
        cmocka_unit_test(a_ping_is_read_as_it_was_sent),
        cmocka_unit_test(objects_are_listed_as_they_are),
        cmocka_unit_test(walls_come_back),
        cmocka_unit_test(arrivals_come_back),
        cmocka_unit_test(motion_is_none_where_it_is_not_valid_or_the_vehicle_stands),
        cmocka_unit_test(a_survey_comes_back_from_its_message),
        cmocka_unit_test(places_and_replica_come_back_too),
        cmocka_unit_test(a_survey_of_the_least_comes_back_too),
        cmocka_unit_test(alternating_chirps_and_shared_slots_come_back_from_a_message),
        cmocka_unit_test(several_walls_come_back_from_a_message),
        cmocka_unit_test(a_bad_survey_is_not_packed),
        cmocka_unit_test(a_damaged_message_is_refused_and_leaves_nothing),
        cmocka_unit_test(a_message_with_too_many_elements_is_refused),
        cmocka_unit_test(a_message_cut_at_any_length_is_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
