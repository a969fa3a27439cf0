/* SPDX-License-Identifier: MIT */
/* tests/nodes/foxglove_samples.h -- messages for the tests of Foxglove's protocol: a
 * small array that looks at a wall 1 m away, an image of one bright voxel, what was found
 * in it.
 *
 * The mount turns the array's x to the vehicle's left, its y up and so its z forward:
 * array (x, y, z) is vehicle (3.6 + z, 0.5 + x, 0.4 + y). */
#ifndef ANLOS_TESTS_NODES_FOXGLOVE_SAMPLES_H
#define ANLOS_TESTS_NODES_FOXGLOVE_SAMPLES_H

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "msgs/detections.pb-c.h"
#include "msgs/log.pb-c.h"
#include "msgs/stage.pb-c.h"
#include "msgs/tensor.h"
#include "msgs/volume.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "nodes/foxglove/message.h"
#include "recon/survey.h"

enum { SAMPLE_NX = 5, SAMPLE_NY = 4, SAMPLE_NZ = 6 };

#define SAMPLE_STEP_M     0.1
#define SAMPLE_CAPTURE_NS 1700000000250000000LL
#define SAMPLE_PUBLISH_NS 1700000001500000000LL

struct samples {
    struct survey survey;
    double speakers_m[2][3], microphones_m[2][3], positions_m[3];
    Anlos__Survey *survey_message;
    float intensity[SAMPLE_NZ][SAMPLE_NY][SAMPLE_NX];
    struct tensor_view view;
    Anlos__Vec3 origin, step;
    Anlos__Volume volume;
    Anlos__StageState stage;
    Anlos__Log log;
    Anlos__Detection detection;
    Anlos__Detection *detection_list[1];
    Anlos__Vec3 position, virtual, extent;
    double covariance[6];
    Anlos__DetectionList detections;
    Anlos__Vec3 wall_normal;
    Anlos__Wall wall;
    Anlos__Wall *wall_list[1];
    Anlos__WallList walls;
};

/* The survey's message anew, after it was changed.  false: it is none. */
static inline bool samples_pack_survey(struct samples *s)
{
    uint8_t *bytes;
    size_t size;

    if (s->survey_message)
        anlos__survey__free_unpacked(s->survey_message, NULL);
    s->survey_message = NULL;
    if (survey_pack(&s->survey, &bytes, &size))
        return false;
    s->survey_message = anlos__survey__unpack(NULL, size, bytes);
    free(bytes);
    if (s->survey_message)
        s->volume.survey_id = s->survey_message->id;
    return s->survey_message;
}

static inline void samples_make_survey(struct samples *s)
{
    static const double speakers[2][3] = {{0, 0, 0}, {0, 0.3, 0}},
                        microphones[2][3] = {{0.1, 0, 0}, {0.1, 0.3, 0}},
                        positions[3] = {0.0, 0.2, 0.4};

    memcpy(s->speakers_m, speakers, sizeof speakers);
    memcpy(s->microphones_m, microphones, sizeof microphones);
    memcpy(s->positions_m, positions, sizeof positions);
    s->survey = (struct survey){.source = SURVEY_SIMULATION,
                                .sound_speed_m_s = 343.0,
                                .temperature_c = 20.0,
                                .sample_rate_hz = 48000.0,
                                .chirp_start_hz = 2000.0,
                                .chirp_stop_hz = 20000.0,
                                .chirp_duration_s = 0.03125,
                                .slot_samples = 3000,
                                .n_speakers = 2,
                                .n_microphones = 2,
                                .n_positions = 3,
                                .speakers_m = s->speakers_m,
                                .microphones_m = s->microphones_m,
                                .stage_axis = {1.0, 0.0, 0.0},
                                .stage_positions_m = s->positions_m,
                                .has_wall = true,
                                .wall_normal = {0.0, 0.0, 1.0},
                                .wall_distance_m = 1.0,
                                .has_mount = true,
                                .mount_origin_m = {3.6, 0.5, 0.4},
                                .mount_x_axis = {0.0, 1.0, 0.0},
                                .mount_y_axis = {0.0, 0.0, 1.0}};
}

/* Voxel (3, 1, 4) is the brightest; one that is 10 dB below stands at (0, 0, 0); the rest
 * is 40 dB below. */
static inline void samples_make_volume(struct samples *s)
{
    for (size_t i = 0; i < sizeof s->intensity / sizeof(float); i++)
        (&s->intensity[0][0][0])[i] = 4e-4f;
    s->intensity[4][1][3] = 4.0f;
    s->intensity[0][0][0] = 0.4f;
    anlos__volume__init(&s->volume);
    anlos__vec3__init(&s->origin);
    anlos__vec3__init(&s->step);
    s->origin.x = -0.2;
    s->origin.y = -0.1;
    s->origin.z = 1.5;
    s->step.x = s->step.y = s->step.z = SAMPLE_STEP_M;
    s->volume.origin_m = &s->origin;
    s->volume.step_m = &s->step;
    s->volume.scan = 1;
    s->volume.intensity = tensor_borrow_f32(&s->view, &s->intensity[0][0][0], 3,
                                            (size_t)SAMPLE_NZ, (size_t)SAMPLE_NY,
                                            (size_t)SAMPLE_NX);
}

static inline void samples_make_detections(struct samples *s)
{
    /* Standard deviations of 3 and 1 cm along x and y, turned by 30 degrees, and 2 cm. */
    static const double covariance[6] = {7e-4, 3.4641016151377546e-4, 0, 3e-4, 0, 4e-4};

    anlos__detection_list__init(&s->detections);
    anlos__detection__init(&s->detection);
    anlos__vec3__init(&s->position);
    anlos__vec3__init(&s->virtual);
    anlos__vec3__init(&s->extent);
    memcpy(s->covariance, covariance, sizeof covariance);
    s->position.x = 3.7;
    s->position.y = 0.6;
    s->position.z = 0.5;
    s->extent.x = 0.2;
    s->detection.id = 1;
    s->detection.position_m = &s->position;
    s->detection.virtual_m = &s->virtual;
    s->detection.extent_m = &s->extent;
    s->detection.covariance_m2 = s->covariance;
    s->detection.n_covariance_m2 = 6;
    s->detection.existence = 0.5;
    s->detection.level_db = 31.4;
    s->detection_list[0] = &s->detection;
    s->detections.detections = s->detection_list;
    s->detections.n_detections = 1;
    s->detections.mirrored = true;
    s->detections.in_vehicle_frame = true;
    s->detections.source = ANLOS__SOURCE__SIMULATION;
    s->detections.scan = 1;
}

/* That of the survey, heard. */
static inline void samples_make_walls(struct samples *s)
{
    anlos__vec3__init(&s->wall_normal);
    anlos__wall__init(&s->wall);
    anlos__wall_list__init(&s->walls);
    s->wall_normal.z = 1.0;
    s->wall.id = 3;
    s->wall.origin = ANLOS__WALL__ORIGIN__ESTIMATED;
    s->wall.normal = &s->wall_normal;
    s->wall.distance_m = 1.0;
    s->wall.gate_far_m = 5.0;
    s->wall.existence = 0.9;
    s->wall_list[0] = &s->wall;
    s->walls.walls = s->wall_list;
    s->walls.n_walls = 1;
}

/* Close with samples_close.  false: no memory. */
static inline bool samples_open(struct samples *s)
{
    memset(s, 0, sizeof *s);
    samples_make_survey(s);
    samples_make_volume(s);
    samples_make_detections(s);
    samples_make_walls(s);
    anlos__stage_state__init(&s->stage);
    s->stage.position_m = 0.2;
    anlos__log__init(&s->log);
    s->log.stamp_ns = 1700000002000000001LL;
    s->log.level = ANLOS__LOG__LEVEL__WARNING;
    s->log.node = (char *)"dsp";
    s->log.text = (char *)"microphone 3 is dead";
    return samples_pack_survey(s);
}

static inline void samples_close(struct samples *s)
{
    anlos__survey__free_unpacked(s->survey_message, NULL);
}

static inline struct foxglove_message
samples_message(const struct topic *t, const char *node, const ProtobufCMessage *content)
{
    return (struct foxglove_message){.topic = t,
                                     .node = node,
                                     .content = content,
                                     .capture_ns = SAMPLE_CAPTURE_NS,
                                     .publish_ns = SAMPLE_PUBLISH_NS};
}

static inline struct foxglove_message samples_volume(const struct samples *s)
{
    return samples_message(topic_volume(), "recon", &s->volume.base);
}

static inline struct foxglove_message samples_survey(const struct samples *s)
{
    return samples_message(topic_survey(), "array", &s->survey_message->base);
}

static inline struct foxglove_message samples_detections(const struct samples *s)
{
    return samples_message(topic_detections(), "track", &s->detections.base);
}

static inline struct foxglove_message samples_walls(const struct samples *s)
{
    return samples_message(topic_wall(), "wall", &s->walls.base);
}

static inline struct foxglove_message samples_stage(const struct samples *s)
{
    return samples_message(topic_stage_state(), "stage", &s->stage.base);
}

static inline struct foxglove_message samples_log(const struct samples *s)
{
    return samples_message(topic_log(), "dsp", &s->log.base);
}

#endif
