/* SPDX-License-Identifier: MIT */
/* nodes/anlos/bag/export_osi.c -- tracks as ASAM OSI's SensorData, and who was really
 * there in a simulated drive as its GroundTruth: OSI's multi-channel trace file, a bag
 * with metadata of its own.
 *
 * The sensor's frame is the vehicle's (mounted at its origin, not turned), which OSI has
 * in the middle of the rear axle and anlos on the ground below it.  The world's frame is
 * that of the vehicle when the drive begins. */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/room/room.h"
#include "hal/room/scene.h"
#include "msgs/bag/schemas.h"
#include "msgs/bag/writer.h"
#include "msgs/detections.pb-c.h"
#include "msgs/osi/osi_groundtruth.pb-c.h"
#include "msgs/osi/osi_sensordata.pb-c.h"
#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/bag/export.h"
#include "nodes/anlos/score/drive_bag.h"

#define TRACE_VERSION "3.8.0" /* of the file's layout, which OSI 3.8 says first */
#define SENSOR_ID     1
#define HOST_ID       1
#define MOST_AT_ONCE  64
#define NS_PER_S      INT64_C(1000000000)

struct trace_channel {
    const char *topic, *schema, *description;
    uint16_t id;
    uint32_t n; /* messages */
};

struct osi_export {
    struct stream *stream;
    const char *file;
    struct room *scene; /* NULL: nobody says who was there */
    struct bag_writer *writer;
    struct trace_channel told, truth;
    struct drive_bag_world world; /* how the vehicle moved */
    size_t n_elsewhere, n_placeless, n_untracked;
};

static Osi3__InterfaceVersion version(void)
{
    Osi3__InterfaceVersion v = OSI3__INTERFACE_VERSION__INIT;
    v.has_version_major = v.has_version_minor = v.has_version_patch = true;
    v.version_major = OSI_MAJOR;
    v.version_minor = OSI_MINOR;
    v.version_patch = OSI_PATCH;
    return v;
}

static Osi3__Timestamp timestamp(int64_t ns)
{
    Osi3__Timestamp t = OSI3__TIMESTAMP__INIT;
    t.has_seconds = t.has_nanos = true;
    t.seconds = ns / NS_PER_S;
    t.nanos = (uint32_t)(ns % NS_PER_S);
    return t;
}

static Osi3__Identifier identifier(uint64_t id)
{
    Osi3__Identifier i = OSI3__IDENTIFIER__INIT;
    i.has_value = true;
    i.value = id;
    return i;
}

static Osi3__Vector3d vector(double x, double y, double z)
{
    Osi3__Vector3d v = OSI3__VECTOR3D__INIT;
    v.has_x = v.has_y = v.has_z = true;
    v.x = x;
    v.y = y;
    v.z = z;
    return v;
}

static Osi3__Dimension3d dimension(double length, double width, double height)
{
    Osi3__Dimension3d d = OSI3__DIMENSION3D__INIT;
    d.has_length = d.has_width = d.has_height = true;
    d.length = length;
    d.width = width;
    d.height = height;
    return d;
}

static Osi3__Orientation3d orientation(double yaw)
{
    Osi3__Orientation3d o = OSI3__ORIENTATION3D__INIT;
    o.has_roll = o.has_pitch = o.has_yaw = true;
    o.yaw = yaw;
    return o;
}

/* Times of the bag: OSI's own stand in the message. */
static int put(struct osi_export *x, struct trace_channel *c, const ProtobufCMessage *m,
               const struct bag_message *raw, struct error *why)
{
    size_t size = protobuf_c_message_get_packed_size(m);
    uint8_t *data = malloc(size ? size : 1);
    if (!data)
        return error_say(why, -ENOMEM, "out of memory");
    protobuf_c_message_pack(m, data);
    const struct bag_message out = {.channel_id = c->id,
                                    .sequence = c->n,
                                    .log_time = raw->log_time,
                                    .publish_time = raw->publish_time,
                                    .data = {data, size}};
    int err = bag_writer_message(x->writer, &out, why);
    c->n += !err;
    free(data);
    return err;
}

struct told { /* one object, and all that it is made of */
    Osi3__DetectedMovingObject object;
    Osi3__DetectedItemHeader header;
    Osi3__Identifier id, sensor, *sensors[1];
    Osi3__BaseMoving base, rmse;
    Osi3__Vector3d position, velocity, position_rmse, velocity_rmse;
    Osi3__Dimension3d size;
};

static void tell_header(struct told *t, const Anlos__Detection *d)
{
    bool measured = d->measurement != ANLOS__MEASUREMENT__PREDICTED;
    osi3__detected_item_header__init(&t->header);
    t->id = identifier(d->id);
    t->sensor = identifier(SENSOR_ID);
    t->sensors[0] = &t->sensor;
    t->header.tracking_id = &t->id;
    t->header.n_sensor_id = 1;
    t->header.sensor_id = t->sensors;
    t->header.has_existence_probability = t->header.has_age = true;
    t->header.existence_probability = d->existence;
    t->header.age = d->age_s;
    t->header.has_measurement_state = true;
    t->header.measurement_state =
        measured
            ? OSI3__DETECTED_ITEM_HEADER__MEASUREMENT_STATE__MEASUREMENT_STATE_MEASURED
            : OSI3__DETECTED_ITEM_HEADER__MEASUREMENT_STATE__MEASUREMENT_STATE_PREDICTED;
    t->object.header = &t->header;
}

/* OSI's velocity is seen from the parent frame, which moves with the vehicle: ours is
 * over ground. */
static void tell_velocity(struct told *t, const Anlos__Detection *d,
                          const struct ego_motion *ego)
{
    const double *v = d->velocity_m_s, *c = d->velocity_covariance_m2_s2;
    t->velocity = vector(v[0] - ego->speed_m_s + ego->yaw_rate_rad_s * d->position_m->y,
                         v[1] - ego->yaw_rate_rad_s * d->position_m->x, 0.0);
    t->base.velocity = &t->velocity;
    if (d->n_velocity_covariance_m2_s2 != 3)
        return;
    t->velocity_rmse = vector(sqrt(c[0]), sqrt(c[2]), 0.0);
    t->rmse.velocity = &t->velocity_rmse;
}

static void tell_place(struct told *t, const Anlos__Detection *d)
{
    const double *c = d->covariance_m2;
    osi3__base_moving__init(&t->base);
    osi3__base_moving__init(&t->rmse);
    t->position = vector(d->position_m->x, d->position_m->y, d->position_m->z);
    t->base.position = &t->position;
    t->object.base_ = &t->base;
    t->object.base_rmse = &t->rmse;
    if (d->n_covariance_m2 == 6) {
        t->position_rmse = vector(sqrt(c[0]), sqrt(c[3]), sqrt(c[5]));
        t->rmse.position = &t->position_rmse;
    }
    if (d->extent_m) {
        t->size = dimension(d->extent_m->x, d->extent_m->y, d->extent_m->z);
        t->base.dimension = &t->size;
    }
}

static Osi3__DetectedMovingObject__MovementState movement(Anlos__Motion m)
{
    switch (m) {
    case ANLOS__MOTION__STANDING:
        return OSI3__DETECTED_MOVING_OBJECT__MOVEMENT_STATE__MOVEMENT_STATE_STATIONARY;
    case ANLOS__MOTION__MOVING:
        return OSI3__DETECTED_MOVING_OBJECT__MOVEMENT_STATE__MOVEMENT_STATE_MOVING;
    default:
        return OSI3__DETECTED_MOVING_OBJECT__MOVEMENT_STATE__MOVEMENT_STATE_UNKNOWN;
    }
}

static void tell(struct told *t, const Anlos__Detection *d, const struct ego_motion *ego)
{
    osi3__detected_moving_object__init(&t->object);
    tell_header(t, d);
    tell_place(t, d);
    if (ego && d->n_velocity_m_s == 2)
        tell_velocity(t, d, ego);
    t->object.has_reference_point = t->object.has_movement_state = true;
    t->object.reference_point =
        OSI3__DETECTED_MOVING_OBJECT__REFERENCE_POINT__REFERENCE_POINT_CENTER;
    t->object.movement_state = movement(d->motion);
}

/* Echoes by two bounces are told with the low existence that they have.  What is deleted
 * is not there any more. */
static size_t tell_all(struct osi_export *x, const Anlos__DetectionList *list,
                       const struct ego_motion *ego, struct told *items,
                       Osi3__DetectedMovingObject **objects)
{
    size_t n = 0;
    for (size_t i = 0; i < list->n_detections; i++) {
        const Anlos__Detection *d = list->detections[i];
        if (d->measurement == ANLOS__MEASUREMENT__DELETED)
            continue;
        if (!d->position_m) {
            x->n_placeless++;
            continue;
        }
        tell(&items[n], d, ego);
        objects[n] = &items[n].object;
        n++;
    }
    return n;
}

static int write_told(struct osi_export *x, const Anlos__DetectionList *list,
                      const struct stream_message *m, struct error *why)
{
    Osi3__SensorData data = OSI3__SENSOR_DATA__INIT;
    Osi3__DetectedEntityHeader header = OSI3__DETECTED_ENTITY_HEADER__INIT;
    Osi3__MountingPosition mounting = OSI3__MOUNTING_POSITION__INIT;
    Osi3__InterfaceVersion v = version();
    Osi3__Timestamp sent = timestamp(m->envelope.publish_ns);
    Osi3__Timestamp heard = timestamp(m->envelope.capture_ns);
    Osi3__Identifier sensor = identifier(SENSOR_ID);
    Osi3__Vector3d origin = vector(0.0, 0.0, 0.0);
    Osi3__Orientation3d ahead = orientation(0.0);
    const struct ego_motion ego =
        drive_bag_world_motion(&x->world, m->envelope.capture_ns);
    struct told *items = calloc(list->n_detections + 1, sizeof *items);
    Osi3__DetectedMovingObject **objects =
        calloc(list->n_detections + 1, sizeof(Osi3__DetectedMovingObject *));
    int err = items && objects ? 0 : error_say(why, -ENOMEM, "out of memory");
    if (!err) {
        mounting.position = &origin;
        mounting.orientation = &ahead;
        header.measurement_time = &heard;
        header.has_cycle_counter = header.has_data_qualifier = true;
        header.cycle_counter = list->counter;
        header.data_qualifier =
            list->preview || list->ego_unknown
                ? OSI3__DETECTED_ENTITY_HEADER__DATA_QUALIFIER__DATA_QUALIFIER_AVAILABLE_REDUCED
                : OSI3__DETECTED_ENTITY_HEADER__DATA_QUALIFIER__DATA_QUALIFIER_AVAILABLE;
        data.version = &v;
        data.timestamp = &sent;
        data.last_measurement_time = &heard;
        data.sensor_id = &sensor;
        data.mounting_position = &mounting;
        data.moving_object_header = &header;
        data.n_moving_object =
            tell_all(x, list, list->ego_unknown ? NULL : &ego, items, objects);
        data.moving_object = objects;
        err = put(x, &x->told, &data.base, &m->raw, why);
    }
    free(objects);
    free(items);
    return err;
}

struct present { /* one who was there, and all that it is made of */
    Osi3__MovingObject object;
    Osi3__Identifier id;
    Osi3__BaseMoving base;
    Osi3__Vector3d position, velocity, to_rear;
    Osi3__Dimension3d size;
    Osi3__Orientation3d heading, turning;
    Osi3__MovingObject__VehicleAttributes attributes;
    Osi3__MovingObject__VehicleClassification class;
};

static void present(struct present *p, uint64_t id, double yaw)
{
    osi3__moving_object__init(&p->object);
    osi3__base_moving__init(&p->base);
    p->id = identifier(id);
    p->heading = orientation(yaw);
    p->base.position = &p->position;
    p->base.velocity = &p->velocity;
    p->base.orientation = &p->heading;
    p->object.id = &p->id;
    p->object.base_ = &p->base;
    p->object.has_type = true;
}

static void classify(struct present *p,
                     Osi3__MovingObject__VehicleClassification__Type type)
{
    osi3__moving_object__vehicle_classification__init(&p->class);
    p->class.has_type = true;
    p->class.type = type;
    p->object.type = OSI3__MOVING_OBJECT__TYPE__TYPE_VEHICLE;
    p->object.vehicle_classification = &p->class;
}

/* How large the host is, nobody says: its place is the vehicle's origin. */
static void present_host(struct present *p, const struct room_ego *ego)
{
    present(p, HOST_ID, ego->yaw_rad);
    p->position = vector(ego->x_m, ego->y_m, 0.0);
    p->velocity = vector(ego->speed_m_s * cos(ego->yaw_rad),
                         ego->speed_m_s * sin(ego->yaw_rad), 0.0);
    p->turning = orientation(ego->yaw_rate_rad_s);
    p->base.orientation_rate = &p->turning;
    p->to_rear = vector(0.0, 0.0, 0.0);
    osi3__moving_object__vehicle_attributes__init(&p->attributes);
    p->attributes.bbcenter_to_rear = &p->to_rear;
    p->object.vehicle_attributes = &p->attributes;
    classify(p, OSI3__MOVING_OBJECT__VEHICLE_CLASSIFICATION__TYPE__TYPE_OTHER);
}

/* Places, sizes and velocities of a room's truth lie along the vehicle's axes. */
static void present_body(struct present *p, const struct room_truth *t,
                         const struct room_ego *ego)
{
    double c = cos(ego->yaw_rad), s = sin(ego->yaw_rad);
    const double *r = t->position_m, *v = t->velocity_m_s;
    present(p, HOST_ID + 1 + t->object, ego->yaw_rad);
    p->position =
        vector(ego->x_m + c * r[0] - s * r[1], ego->y_m + s * r[0] + c * r[1], r[2]);
    p->velocity = vector(c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]);
    p->size = dimension(t->extent_m[0], t->extent_m[1], t->extent_m[2]);
    p->base.dimension = &p->size;
    p->object.type = OSI3__MOVING_OBJECT__TYPE__TYPE_OTHER;
    if (!strcmp(t->kind, scene_kind_name(SCENE_PERSON)))
        p->object.type = OSI3__MOVING_OBJECT__TYPE__TYPE_PEDESTRIAN;
    if (!strcmp(t->kind, scene_kind_name(SCENE_CAR)))
        classify(p, OSI3__MOVING_OBJECT__VEHICLE_CLASSIFICATION__TYPE__TYPE_MEDIUM_CAR);
    if (!strcmp(t->kind, scene_kind_name(SCENE_CYCLIST)))
        classify(p, OSI3__MOVING_OBJECT__VEHICLE_CLASSIFICATION__TYPE__TYPE_BICYCLE);
}

static int write_truth(struct osi_export *x, const struct stream_message *m,
                       struct error *why)
{
    Osi3__GroundTruth truth = OSI3__GROUND_TRUTH__INIT;
    Osi3__InterfaceVersion v = version();
    Osi3__Timestamp at = timestamp(m->envelope.capture_ns);
    Osi3__Identifier host = identifier(HOST_ID);
    Osi3__MovingObject *objects[1 + MOST_AT_ONCE];
    struct present all[1 + MOST_AT_ONCE];
    struct room_truth there[MOST_AT_ONCE];
    struct room_ego ego;
    double t_s = room_time_s(x->scene, m->envelope.capture_ns);
    size_t n = room_truth(x->scene, t_s, there, MOST_AT_ONCE);
    n = n < MOST_AT_ONCE ? n : MOST_AT_ONCE;
    memset(all, 0, sizeof all);
    room_ego(x->scene, t_s, &ego);
    present_host(&all[0], &ego);
    for (size_t i = 0; i < n; i++)
        present_body(&all[1 + i], &there[i], &ego);
    for (size_t i = 0; i < 1 + n; i++)
        objects[i] = &all[i].object;
    truth.version = &v;
    truth.timestamp = &at;
    truth.host_vehicle_id = &host;
    truth.n_moving_object = 1 + n;
    truth.moving_object = objects;
    return put(x, &x->truth, &truth.base, &m->raw, why);
}

static int write_list(struct osi_export *x, const Anlos__DetectionList *list,
                      const struct stream_message *m, struct error *why)
{
    if (!list->tracked) {
        x->n_untracked++;
        return 0;
    }
    if (!list->in_vehicle_frame) {
        x->n_elsewhere++;
        return 0;
    }
    int err = write_told(x, list, m, why);
    if (!err && x->scene)
        err = write_truth(x, m, why);
    return err;
}

static int write_lists(struct osi_export *x, struct error *why)
{
    struct stream_message m;
    int err;
    while (!(err = stream_next(x->stream, &m, why))) {
        ProtobufCMessage *content;
        err = stream_unpack(&content, x->stream, &m, why);
        if (err)
            return err;
        if (m.topic == topic_detections())
            err = write_list(x, (const Anlos__DetectionList *)content, &m, why);
        else
            err = drive_bag_world_ego(&x->world, (const Anlos__EgoMotion *)content,
                                      m.envelope.capture_ns, why);
        protobuf_c_message_free_unpacked(content, NULL);
        if (err)
            return err;
    }
    return err == -ENODATA ? 0 : err;
}

static int put_metadata(struct bag_writer *w, struct error *why)
{
    static const char *const pairs[][2] = {
        {"version", TRACE_VERSION},
        {"min_osi_version", OSI_VERSION},
        {"max_osi_version", OSI_VERSION},
        {"min_protobuf_version", PROTOBUF_C_VERSION},
        {"max_protobuf_version", PROTOBUF_C_VERSION},
        {"description", "what anlos told of hidden objects"},
    };
    struct bytes_buffer map = {.data = NULL};
    for (size_t i = 0; i < sizeof pairs / sizeof *pairs; i++)
        bag_map_put(&map, bytes_of(pairs[i][0]), bytes_of(pairs[i][1]));
    const struct bag_metadata m = {.name = bytes_of("net.asam.osi.trace"),
                                   .metadata = bytes_in(&map)};
    int err = map.failed ? error_say(why, -ENOMEM, "out of memory")
                         : bag_writer_metadata(w, &m, why);
    bytes_free(&map);
    return err;
}

static int define(struct bag_writer *w, struct trace_channel *c, struct error *why)
{
    const struct bag_schema schema = bag_schema_find(osi_schema_table, c->schema);
    struct bytes_buffer map = {.data = NULL};
    bag_map_put(&map, bytes_of("net.asam.osi.trace.channel.osi_version"),
                bytes_of(OSI_VERSION));
    bag_map_put(&map, bytes_of("net.asam.osi.trace.channel.protobuf_version"),
                bytes_of(PROTOBUF_C_VERSION));
    bag_map_put(&map, bytes_of("net.asam.osi.trace.channel.description"),
                bytes_of(c->description));
    struct bag_channel channel = {.topic = bytes_of(c->topic),
                                  .message_encoding = bytes_of(BAG_PROTOBUF),
                                  .metadata = bytes_in(&map)};
    int err = map.failed ? error_say(why, -ENOMEM, "out of memory")
                         : bag_writer_schema(w, &schema, &channel.schema_id, why);
    if (!err)
        err = bag_writer_channel(w, &channel, &c->id, why);
    bytes_free(&map);
    return err;
}

static int write_trace(struct osi_export *x, const char *out, struct error *why)
{
    struct verb_output output;
    int err = verb_output_begin(&output, out, why);
    if (err)
        return err;
    err = verb_writer_create(&x->writer, &output, "", BAG_ZSTD, why);
    if (err)
        return verb_output_end(&output, err, why);
    err = put_metadata(x->writer, why);
    if (!err)
        err = define(x->writer, &x->told, why);
    if (!err && x->scene)
        err = define(x->writer, &x->truth, why);
    if (!err)
        err = write_lists(x, why);
    if (!err && !x->told.n)
        err = error_say(why, -ENODATA, "%s: no list of tracks in the vehicle frame%s",
                        x->file,
                        x->n_elsewhere   ? ": the survey has no mount"
                        : x->n_untracked ? ", only of single images"
                                         : "");
    int closed = bag_writer_close(x->writer, err ? NULL : why);
    return verb_output_end(&output, err ? err : closed, why);
}

static int load_scene(struct osi_export *x, const char *path, struct error *why)
{
    if (!path)
        return 0;
    int err = room_load(&x->scene, path, why);
    if (!err && !room_is_drive(x->scene))
        err = error_say(why, -EINVAL, "%s: not a drive: the key \"drive\" is missing",
                        path);
    return err;
}

static void say_what_is_left_out(const struct osi_export *x)
{
    if (x->n_elsewhere)
        fprintf(stderr,
                "anlos bag export: %s: %zu lists stand in the array's frame: left out\n",
                x->file, x->n_elsewhere);
    if (x->n_untracked)
        fprintf(stderr,
                "anlos bag export: %s: %zu lists are of single images, not tracked: left "
                "out\n",
                x->file, x->n_untracked);
    if (x->n_placeless)
        fprintf(
            stderr,
            "anlos bag export: %s: %zu objects have no place, as no wall is known: left "
            "out\n",
            x->file, x->n_placeless);
}

int export_osi(struct stream *s, const struct export_options *o, struct error *why)
{
    struct osi_export x = {
        .stream = s,
        .file = o->file,
        .told = {"SensorData", "osi3.SensorData", "tracks as the vehicle was told them",
                 0, 0},
        .truth = {"GroundTruth", "osi3.GroundTruth", "who was there", 0, 0}};
    int err = load_scene(&x, o->scene, why);
    if (!err)
        err = write_trace(&x, o->out, why);
    if (!err) {
        printf("%s: %" PRIu32 " SensorData", o->out, x.told.n);
        if (x.scene)
            printf(", %" PRIu32 " GroundTruth", x.truth.n);
        putchar('\n');
        say_what_is_left_out(&x);
    }
    room_destroy(x.scene);
    drive_bag_world_clear(&x.world);
    return err;
}
