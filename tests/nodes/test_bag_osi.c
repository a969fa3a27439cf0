/* SPDX-License-Identifier: MIT */
/* `anlos bag export --format osi`: what is in the trace is what OSI means by it. */
#include "tests/hal/folder.h"
#include "tests/hal/scratch.h"

#include <math.h>
#include <unistd.h>

#include "msgs/bag/topic_message.h"
#include "msgs/detections.pb-c.h"
#include "msgs/osi/osi_groundtruth.pb-c.h"
#include "msgs/osi/osi_sensordata.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "nodes/anlos/bag/stream.h"
#include "nodes/anlos/commands.h"
#include "tests/nodes/command.h"
#include "tests/nodes/near.h"

#define BEGIN_NS  INT64_C(1700000000000000000)
#define MS        INT64_C(1000000)
#define LISTS     40
#define PERIOD_MS 100

/* The vehicle drives a curve; two stand, of one name. */
static const char scene[] =
    "array: bumper\n"
    "temperature_c: 20\n"
    "wall: {normal: [0, 0, 1], distance_m: 3.8}\n"
    "mount: {origin_m: [3.6, 0, 0.4], x_axis: [0, 1, 0], y_axis: [0, 0, 1]}\n"
    "gate_m: [1.5, 4]\n"
    "volume: {x_m: [-3.2, 3.2, 0.04], y_m: [0, 0, 0.1], z_m: [2.3, 4.6, 0.02]}\n"
    "drive:\n"
    "  period_s: 600\n"
    "  ego: [{t_s: 0, speed_m_s: 1.5, yaw_rate_deg_s: 10}]\n"
    "objects:\n"
    "  - {name: post, kind: person,\n"
    "     path: [{t_s: 0, position_m: [-2, 0.47, 2.9]},\n"
    "            {t_s: 600, position_m: [-2, 0.47, 2.9]}]}\n"
    "  - {name: post, kind: cyclist,\n"
    "     path: [{t_s: 0, position_m: [2, 0.47, 3.5]},\n"
    "            {t_s: 600, position_m: [2, 0.47, 3.5]}]}\n"
    "seed: 1\n"
    "level: 0.03\n"
    "noise: {snr_db: 0, at_m: 4}\n";

static struct command_result result;

struct rig {
    struct scratch *scratch;
    char in[600], out[600], scene[600];
    struct bag_writer *writer;
    struct bag_topics *topics;
    uint64_t n;
};

static void put(struct rig *r, const struct topic *t, const ProtobufCMessage *m,
                int64_t capture_ns, int64_t publish_ns)
{
    uint8_t data[4096];
    struct envelope e = {.epoch_ns = 1,
                         .sequence = r->n++,
                         .capture_ns = capture_ns,
                         .publish_ns = publish_ns};
    struct error why;
    assert_true(protobuf_c_message_get_packed_size(m) <= sizeof data);
    e.payload_size = (uint32_t)protobuf_c_message_pack(m, data);
    snprintf(e.topic, sizeof e.topic, "%s", t->name);
    snprintf(e.node, sizeof e.node, "track");
    assert_int_equal(bag_topics_put(r->topics, &e, data, NULL, &why), 0);
}

static void put_ego(struct rig *r, double speed_m_s, double yaw_rate_rad_s, int64_t at_ns)
{
    Anlos__EgoMotion m = ANLOS__EGO_MOTION__INIT;
    m.speed_m_s = speed_m_s;
    m.yaw_rate_rad_s = yaw_rate_rad_s;
    m.valid = true;
    put(r, topic_ego(), &m.base, at_ns, at_ns);
}

struct sample { /* a list of one track at (4, -1.5), 1 m/s to the left over ground */
    Anlos__DetectionList list;
    Anlos__Detection track, *tracks[1];
    Anlos__Vec3 position, extent;
    double covariance[6], velocity[2], velocity_covariance[3];
};

static void fill(struct sample *s)
{
    *s = (struct sample){.list = ANLOS__DETECTION_LIST__INIT,
                         .track = ANLOS__DETECTION__INIT,
                         .position = ANLOS__VEC3__INIT,
                         .extent = ANLOS__VEC3__INIT,
                         .covariance = {0.04, 0.01, 0.0, 0.09, 0.0, 0.25},
                         .velocity = {0.0, 1.0},
                         .velocity_covariance = {0.16, 0.0, 0.36}};
    s->position.x = 4.0;
    s->position.y = -1.5;
    s->position.z = 0.9;
    s->extent.x = 0.5;
    s->extent.y = 0.3;
    s->extent.z = 1.7;
    s->track.id = 7;
    s->track.existence = 0.875;
    s->track.age_s = 1.25;
    s->track.measurement = ANLOS__MEASUREMENT__PREDICTED;
    s->track.motion = ANLOS__MOTION__MOVING;
    s->track.position_m = &s->position;
    s->track.extent_m = &s->extent;
    s->track.n_covariance_m2 = 6;
    s->track.covariance_m2 = s->covariance;
    s->track.n_velocity_m_s = 2;
    s->track.velocity_m_s = s->velocity;
    s->track.n_velocity_covariance_m2_s2 = 3;
    s->track.velocity_covariance_m2_s2 = s->velocity_covariance;
    s->tracks[0] = &s->track;
    s->list.n_detections = 1;
    s->list.detections = s->tracks;
    s->list.counter = 3;
    s->list.tracked = s->list.mirrored = s->list.in_vehicle_frame = true;
}

static void begin(struct rig *r)
{
    const struct bag_writer_config cfg = {.profile = "anlos", .library = "test"};
    struct error why;
    assert_int_equal(bag_writer_create(&r->writer, r->in, &cfg, &why), 0);
    assert_int_equal(bag_topics_create(&r->topics, r->writer), 0);
}

static void end(struct rig *r)
{
    struct error why;
    bag_topics_destroy(r->topics);
    assert_int_equal(bag_writer_close(r->writer, &why), 0);
}

static int export(const struct rig *r, const char *option, const char *value)
{
    char *words[] = {(char *)"bag", (char *)"export", (char *)r->in,
                     (char *)"-o",  (char *)r->out,   (char *)"--format",
                     (char *)"osi", (char *)option,   (char *)value,
                     NULL};
    command_run(&result, command_bag, words);
    return result.code;
}

/* The messages of a topic of the trace, unpacked by OSI's schema.  Freed with free. */
static size_t read_trace(const struct rig *r, const char *topic,
                         const ProtobufCMessageDescriptor *type, void **out, size_t most)
{
    struct stream *s;
    struct stream_message m;
    struct error why;
    size_t n = 0;
    assert_int_equal(stream_open(&s, r->out, &why), 0);
    stream_select(s, topic);
    while (!stream_next(s, &m, &why)) {
        assert_true(n < most);
        out[n] = protobuf_c_message_unpack(type, NULL, m.payload.size, m.payload.data);
        assert_non_null(out[n++]);
    }
    stream_close(s);
    return n;
}

static void free_all(void **messages, size_t n)
{
    for (size_t i = 0; i < n; i++)
        protobuf_c_message_free_unpacked(messages[i], NULL);
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    if (!r || scratch_open((void **)&r->scratch))
        return -1;
    snprintf(r->in, sizeof r->in, "%s/in.mcap", r->scratch->folder);
    snprintf(r->out, sizeof r->out, "%s/out.mcap", r->scratch->folder);
    snprintf(r->scene, sizeof r->scene, "%s",
             scratch_write(r->scratch, "scene.yaml", scene));
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;
    int err = scratch_close((void **)&r->scratch);
    free(r);
    return err;
}

static void a_track_is_told_in_osis_terms(void **state)
{
    struct rig *r = *state;
    struct sample s;
    void *all[2];
    fill(&s);
    begin(r);
    put_ego(r, 2.0, 0.5, BEGIN_NS);
    put_ego(r, 9.0, 0.0, BEGIN_NS + 50 * MS); /* after the sound was taken */
    put(r, topic_detections(), &s.list.base, BEGIN_NS + 20 * MS, BEGIN_NS + 60 * MS);
    end(r);
    if (export(r, NULL, NULL))
        fail_msg("%s", result.err);
    assert_string_equal(result.err, "");
    size_t n = read_trace(r, "SensorData", &osi3__sensor_data__descriptor, all, 2);
    assert_int_equal(n, 1);
    const Osi3__SensorData *d = all[0];
    assert_int_equal(d->timestamp->seconds, BEGIN_NS / 1000000000);
    assert_int_equal(d->timestamp->nanos, 60 * MS);
    assert_int_equal(d->last_measurement_time->nanos, 20 * MS);
    assert_int_equal(d->moving_object_header->cycle_counter, 3);
    assert_int_equal(d->n_moving_object, 1);
    const Osi3__DetectedMovingObject *o = d->moving_object[0];
    assert_int_equal(o->header->tracking_id->value, 7);
    assert_near(o->header->existence_probability, 0.875, 0.0);
    assert_near(o->header->age, 1.25, 0.0);
    assert_int_equal(o->header->measurement_state, 3); /* predicted */
    assert_int_equal(o->movement_state, 3);            /* moving */
    assert_near(o->base_->position->x, 4.0, 0.0);
    assert_near(o->base_->position->y, -1.5, 0.0);
    assert_near(o->base_->dimension->length, 0.5, 0.0);
    assert_near(o->base_->dimension->height, 1.7, 0.0);
    /* as seen from a frame that goes ahead with 2 m/s and turns left by 0.5 rad/s:
     * (0, 1) - (2, 0) - 0.5 z x (4, -1.5) */
    assert_near(o->base_->velocity->x, -2.0 - 0.5 * 1.5, 1e-12);
    assert_near(o->base_->velocity->y, 1.0 - 0.5 * 4.0, 1e-12);
    assert_near(o->base_rmse->position->x, 0.2, 1e-12);
    assert_near(o->base_rmse->position->y, 0.3, 1e-12);
    assert_near(o->base_rmse->position->z, 0.5, 1e-12);
    assert_near(o->base_rmse->velocity->y, 0.6, 1e-12);
    free_all(all, n);
}

static void what_osi_cannot_say_is_left_out_and_said(void **state)
{
    struct rig *r = *state;
    struct sample s;
    void *all[4];
    begin(r);
    fill(&s);
    s.track.measurement = ANLOS__MEASUREMENT__DELETED;
    put(r, topic_detections(), &s.list.base, BEGIN_NS, BEGIN_NS);
    fill(&s);
    s.track.position_m = NULL;
    put(r, topic_detections(), &s.list.base, BEGIN_NS, BEGIN_NS);
    fill(&s);
    s.list.tracked = false;
    put(r, topic_detections(), &s.list.base, BEGIN_NS, BEGIN_NS);
    fill(&s);
    s.list.in_vehicle_frame = false;
    put(r, topic_detections(), &s.list.base, BEGIN_NS, BEGIN_NS);
    fill(&s);
    s.list.ego_unknown = true; /* no velocity as seen from a vehicle that moves somehow */
    put(r, topic_detections(), &s.list.base, BEGIN_NS, BEGIN_NS);
    end(r);
    if (export(r, NULL, NULL))
        fail_msg("%s", result.err);
    assert_non_null(strstr(result.err, "1 lists stand in the array's frame: left out"));
    assert_non_null(strstr(result.err, "1 lists are of single images"));
    assert_non_null(strstr(result.err, "1 objects have no place"));
    size_t n = read_trace(r, "SensorData", &osi3__sensor_data__descriptor, all, 4);
    assert_int_equal(n, 3);
    assert_int_equal(((const Osi3__SensorData *)all[0])->n_moving_object, 0);
    assert_int_equal(((const Osi3__SensorData *)all[1])->n_moving_object, 0);
    const Osi3__SensorData *d = all[2];
    assert_null(d->moving_object[0]->base_->velocity);
    assert_int_equal(d->moving_object_header->data_qualifier, 3); /* reduced */
    free_all(all, n);
}

static void write_drive(struct rig *r)
{
    struct sample s;
    fill(&s);
    begin(r);
    for (int i = 0; i < LISTS; i++) {
        int64_t at_ns = BEGIN_NS + i * PERIOD_MS * MS;
        put(r, topic_detections(), &s.list.base, at_ns, at_ns);
    }
    end(r);
}

/* In the world's frame who stands stays where he is, and the host gets on by the velocity
 * that is told of it, however it turns. */
static void truth_stands_in_a_frame_that_does_not_move(void **state)
{
    struct rig *r = *state;
    void *all[LISTS];
    write_drive(r);
    if (export(r, "--scenes", r->scene))
        fail_msg("%s", result.err);
    size_t n = read_trace(r, "GroundTruth", &osi3__ground_truth__descriptor, all, LISTS);
    assert_int_equal(n, LISTS);
    const Osi3__GroundTruth *first = all[0];
    for (size_t i = 0; i < n; i++) {
        const Osi3__GroundTruth *g = all[i];
        assert_int_equal(g->n_moving_object, 3);
        for (int k = 0; k < 3; k++) /* in each by the same number */
            assert_int_equal(g->moving_object[k]->id->value, 1 + k);
        assert_int_equal(g->moving_object[2]->vehicle_classification->type, 11);
        assert_int_equal(g->host_vehicle_id->value, g->moving_object[0]->id->value);
        const Osi3__BaseMoving *post = g->moving_object[1]->base_;
        assert_int_equal(g->moving_object[1]->type, 3); /* pedestrian */
        assert_near(post->position->x, first->moving_object[1]->base_->position->x, 1e-6);
        assert_near(post->position->y, first->moving_object[1]->base_->position->y, 1e-6);
        assert_near(hypot(post->velocity->x, post->velocity->y), 0.0, 1e-9);
        const Osi3__BaseMoving *host = g->moving_object[0]->base_;
        assert_near(hypot(host->velocity->x, host->velocity->y), 1.5, 1e-9);
        if (!i)
            continue;
        const Osi3__BaseMoving *before =
            ((const Osi3__GroundTruth *)all[i - 1])->moving_object[0]->base_;
        double dt_s = 1e-3 * PERIOD_MS, turned = 10.0 * M_PI / 180.0 * dt_s;
        double way = 2.0 * 1.5 * dt_s / turned * sin(0.5 * turned); /* chord of the arc */
        double along = before->orientation->yaw + 0.5 * turned;
        assert_near(host->orientation->yaw - before->orientation->yaw, turned, 1e-6);
        assert_near(host->position->x - before->position->x, way * cos(along), 1e-5);
        assert_near(host->position->y - before->position->y, way * sin(along), 1e-5);
    }
    free_all(all, n);
}

static void bad_input_is_said(void **state)
{
    struct rig *r = *state;
    struct sample s;
    fill(&s);
    s.list.in_vehicle_frame = false;
    begin(r);
    put(r, topic_detections(), &s.list.base, BEGIN_NS, BEGIN_NS);
    end(r);
    assert_int_equal(export(r, NULL, NULL), 2);
    assert_non_null(strstr(result.err, "the survey has no mount"));
    assert_int_equal(access(r->out, F_OK), -1);
    assert_int_equal(export(r, "--scenes", "/nowhere.yaml"), 2);
    assert_non_null(strstr(result.err, "/nowhere.yaml"));
    assert_int_equal(export(r, "--scan", "1"), 2);
    char *words[] = {(char *)"bag", (char *)"export",
                     r->in,         (char *)"-o",
                     r->out,        (char *)"--format",
                     (char *)"csv", (char *)"--scenes",
                     r->scene,      NULL};
    command_run(&result, command_bag, words);
    assert_int_equal(result.code, 2);
    assert_non_null(strstr(result.err, "only with --format osi"));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

/* BAG SCENE: writes the drive, for whoever else reads its trace. */
static int write_for_others(const char *bag, const char *scene_path)
{
    struct rig r = {.n = 0};
    FILE *f = fopen(scene_path, "w");
    if (!f)
        return 1;
    fputs(scene, f);
    snprintf(r.in, sizeof r.in, "%s", bag);
    write_drive(&r);
    return fclose(f) != 0;
}

int main(int argc, char **argv)
{
    if (argc == 3)
        return write_for_others(argv[1], argv[2]);
    const struct CMUnitTest tests[] = {
        TEST(a_track_is_told_in_osis_terms),
        TEST(what_osi_cannot_say_is_left_out_and_said),
        TEST(truth_stands_in_a_frame_that_does_not_move),
        TEST(bad_input_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
