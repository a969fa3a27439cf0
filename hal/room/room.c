/* SPDX-License-Identifier: MIT */
/* hal/room/room.c -- the sound of a room: a shot of a scene that stands, and one emission
 * from where everything is at its time. */
#include "hal/room/room.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "hal/room/room_state.h"
#include "hal/room/vector.h"
#include "hal/survey/calibration_file.h"
#include "recon/tail.h"

double room_temperature_c(const struct room *r, enum pass pass, size_t position)
{
    const struct scene_drift *d = r->scene->drift;
    double along = r->survey.n_positions > 1
                       ? (double)position / (double)(r->survey.n_positions - 1)
                       : 0;
    return r->temperature_c + d->scan_c * along +
           (pass == PASS_BACKGROUND ? d->background_c : 0);
}

/* The base temperature's speed, changed as the air's temperature has changed. */
static double sound_speed_m_s(const struct room *r, enum pass pass, size_t position)
{
    double now = survey_sound_speed_m_s(room_temperature_c(r, pass, position));
    return r->sound_speed_m_s * now / survey_sound_speed_m_s(r->temperature_c);
}

/* From where the pose is, with the array moving at this velocity. */
static int prepare(struct room *r, bool down, enum pass pass, size_t position,
                   bool objects, bool surroundings, const double velocity_m_s[3])
{
    const struct scene_wall *wall = r->scene->wall_sound;
    struct propagate_scene scene = {
        .sound_speed_m_s = sound_speed_m_s(r, pass, position),
        .latency_samples = r->latency_samples,
        .speakers_m = (const double(*)[3])r->pose.speakers_m,
        .microphones_m = (const double(*)[3])r->pose.microphones_m,
        .speaker_images_m = (const double(*)[3])r->pose.speaker_images_m,
        .microphone_images_m = (const double(*)[3])r->pose.microphone_images_m,
        .points = objects ? &r->world.points : NULL,
        .facets = objects ? &r->world.facets : NULL,
        .mirror_gain = wall->reflectivity * wall->reflectivity,
        .clutter = surroundings ? &r->world.clutter : NULL,
        .mirrored = surroundings ? &r->world.mirrored : NULL,
        .mirror = &r->world.mirror,
        .direct_gain = surroundings ? *r->scene->direct_level : 0,
        .wall_echo_gain = surroundings ? wall->echo : 0};
    memcpy(scene.velocity_m_s, velocity_m_s, sizeof scene.velocity_m_s);
    vector_mirror(r->survey.wall_normal, 0, velocity_m_s, scene.image_velocity_m_s);
    return propagate_prepare(r->propagate[down], &scene);
}

int room_prepare(struct room *r, bool down, enum pass pass, size_t position, bool objects,
                 bool surroundings)
{
    static const double still[3] = {0};
    pose_move(&r->pose, position);
    return prepare(r, down, pass, position, objects, surroundings, still);
}

const struct survey *room_survey(const struct room *r)
{
    return &r->survey;
}

int room_calibrate(struct room *r, const char *path, struct calibration **out,
                   struct error *why)
{
    return calibration_take(out, path, &r->survey, why);
}

float room_limit(const struct room *r, size_t microphone)
{
    return r->faults.microphones[microphone].limit;
}

size_t room_objects(const struct room *r, const struct room_object **out)
{
    *out = r->world.objects;
    return r->world.n_objects;
}

size_t room_tail(const struct room *r)
{
    return tail_samples(&r->survey);
}

size_t room_frames(const struct room *r, size_t n_speakers)
{
    return survey_slots(&r->survey, n_speakers) * r->survey.slot_samples + room_tail(r);
}

/* A chirp's sound from its slot on, as far as the recording goes. */
static void add_heard(const struct room *r, const float *heard, size_t start,
                      size_t n_frames, float *samples)
{
    size_t n = n_frames - start < r->n_heard ? n_frames - start : r->n_heard;
    for (size_t i = 0; i < n; i++)
        samples[start + i] += heard[i];
}

/* The shot's sound by the emissions of one direction, which are all of them or every
 * second. */
static int add_direction(struct room *r, bool down, enum pass pass, size_t position,
                         const uint32_t *speakers, size_t n_speakers, float *samples)
{
    const struct survey *s = &r->survey;
    size_t n_frames = room_frames(r, n_speakers);
    int err = room_prepare(r, down, pass, position, pass == PASS_SCENE, true);
    for (size_t j = 0; j < n_speakers && !err; j++)
        for (size_t m = 0; m < s->n_microphones && survey_is_down(s, j) == down; m++)
            add_heard(r,
                      propagate_pair(r->propagate[down],
                                     r->faults.speakers[speakers[j]].wired_to,
                                     r->faults.microphones[m].wired_to),
                      survey_slot_of(s, j) * s->slot_samples, n_frames,
                      samples + m * n_frames);
    return err;
}

int room_record(struct room *r, enum pass pass, size_t position, const uint32_t *speakers,
                size_t n_speakers, uint32_t take, float *samples)
{
    const struct survey *s = &r->survey;
    size_t n_frames = room_frames(r, n_speakers);
    if (r->scene->drive || s->continuous)
        return -ENOTSUP;
    if (position >= s->n_positions)
        return -EINVAL;
    for (size_t j = 0; j < n_speakers; j++)
        if (speakers[j] >= s->n_speakers)
            return -EINVAL;
    memset(samples, 0, s->n_microphones * n_frames * sizeof *samples);
    int err = 0;
    for (int down = 0; down < 2 && r->propagate[down] && !err; down++)
        err = add_direction(r, down, pass, position, speakers, n_speakers, samples);
    if (err)
        return err;
    noise_add(
        &r->noise, &r->drive, 0,
        (uint64_t[]){r->scene->seed, ROOM_NOISE_SHOT, (uint64_t)pass, position, take}, 5,
        samples, n_frames, n_frames);
    struct fault_slots slots = {.n_frames = n_frames,
                                .slot_samples = s->slot_samples,
                                .together = s->together,
                                .speakers = speakers,
                                .n_speakers = n_speakers};
    uint64_t words[] = {r->scene->seed, (uint64_t)pass, position, take};
    faults_record(&r->faults, &slots, words, samples);
    return 0;
}

/* An element of the array over ground, in motion from one frame to another. */
static void move_element(const double p[3], const struct drive_frame *now,
                         const struct drive_frame *from, const struct drive_frame *to,
                         struct doppler_point *out)
{
    double a[3], b[3];
    drive_to_ground(now, p, out->at_m);
    drive_to_ground(from, p, a);
    drive_to_ground(to, p, b);
    for (int k = 0; k < 3; k++)
        out->velocity_m_s[k] = (b[k] - a[k]) / TRAFFIC_SPAN_S;
}

/* The array's elements and their images, where the emission comes from, and the frame
 * that they stand in; *stands: none of it moves. */
static void move_array(struct room *r, size_t speaker, double t_s,
                       struct emitter_scene *out, struct drive_frame *now, bool *stands)
{
    const struct survey *s = &r->survey;
    struct drive_frame from, to;
    double at_m[3];
    double from_s = fmin(t_s, r->scene->drive->period_s - TRAFFIC_SPAN_S);
    drive_frame(&r->drive, t_s, now);
    drive_frame(&r->drive, from_s, &from);
    drive_frame(&r->drive, from_s + TRAFFIC_SPAN_S, &to);
    *stands = !memcmp(&from, &to, sizeof from) && !memcmp(&from, now, sizeof from);
    pose_move(&r->pose, 0);
    faults_move(&r->faults.speakers[speaker], t_s, r->pose.speakers_m[speaker], at_m);
    move_element(at_m, now, &from, &to, &out->source);
    doppler_mirror(s->wall_normal, s->wall_distance_m, &out->source, &out->source_image);
    for (size_t m = 0; m < s->n_microphones; m++) {
        faults_move(&r->faults.microphones[m], t_s, r->pose.microphones_m[m], at_m);
        move_element(at_m, now, &from, &to, &r->microphones[m]);
        doppler_mirror(s->wall_normal, s->wall_distance_m, &r->microphones[m],
                       &r->microphone_images[m]);
    }
}

/* Forgets what was heard from another place, by elements at others, or in other air. */
static void keep_still(struct room *r, enum pass pass, double sound_speed_m_s,
                       const struct drive_frame *frame, size_t moves)
{
    struct room_still *still = &r->still;
    if (still->pass == pass && still->sound_speed_m_s == sound_speed_m_s &&
        still->moves == moves && !memcmp(&still->frame, frame, sizeof *frame))
        return;
    for (size_t i = 0; i < 2 * r->survey.n_speakers; i++) {
        free(still->heard[i]);
        still->heard[i] = NULL;
    }
    still->pass = pass;
    still->sound_speed_m_s = sound_speed_m_s;
    still->frame = *frame;
    still->moves = moves;
}

/* What is heard without the hidden objects, from here; NULL: no memory. */
static const float *hear_still(struct room *r, const struct emitter_scene *scene)
{
    float **kept = &r->still.heard[scene->down * r->survey.n_speakers + scene->speaker];
    struct emitter_scene part = *scene;
    if (*kept)
        return *kept;
    *kept = malloc(r->survey.n_microphones * r->n_heard * sizeof **kept);
    part.n_hidden = 0;
    if (*kept)
        emitter_execute(r->emitter, &part, *kept);
    return *kept;
}

/* r->heard: what was rendered, and still (NULL: nothing), by the microphones' cables;
 * covered: the speaker's part of it. */
static void wire(struct room *r, const float *still, float covered, double t_s)
{
    for (size_t m = 0; m < r->survey.n_microphones; m++) {
        float gain = covered * faults_cover(&r->faults.microphones[m], t_s);
        size_t from = r->faults.microphones[m].wired_to * r->n_heard;
        float *heard = r->heard + m * r->n_heard;
        memcpy(heard, r->rendered + from, r->n_heard * sizeof *heard);
        for (size_t i = 0; still && i < r->n_heard; i++)
            heard[i] += still[from + i];
        for (size_t i = 0; gain != 1 && i < r->n_heard; i++)
            heard[i] *= gain;
    }
}

/* It warms for half of the period, and cools for the other. */
static double drive_sound_speed_m_s(const struct room *r, enum pass pass, double t_s)
{
    double since_s = fmin(t_s, r->scene->drive->period_s - t_s);
    double base_c = room_temperature_c(r, pass, 0);
    double speed_m_s = sound_speed_m_s(r, pass, 0);
    if (r->scene->drift->rate_c_min == 0)
        return speed_m_s;
    return speed_m_s *
           survey_sound_speed_m_s(base_c + r->scene->drift->rate_c_min * since_s / 60) /
           survey_sound_speed_m_s(base_c);
}

void room_hear_interferer(struct room *r, size_t interferer, size_t speaker, double t_s,
                          double latency_samples)
{
    struct interferers *all = &r->interferers;
    const struct interferer *i = &all->list[interferer];
    const struct survey *s = &r->survey;
    double at_s = drive_time_s(&r->drive, t_s);
    struct drive_frame frame;
    bool stands;
    struct emitter_scene scene = {
        .sound_speed_m_s = drive_sound_speed_m_s(r, PASS_SCENE, at_s),
        .latency_samples = latency_samples,
        .microphones = r->microphones,
        .microphone_images = r->microphone_images,
        .clutter = r->traffic.clutter,
        .n_clutter = r->world.clutter.n,
        .mirror = &r->world.mirror,
        .direct_gain = i->direct,
        .wall_echo_gain = i->wall_echo};
    move_array(r, 0, at_s, &scene, &frame, &stands);
    scene.source = (struct doppler_point){.velocity_m_s = {0, 0, 0}};
    memcpy(scene.source.at_m, i->speakers_m[speaker], sizeof scene.source.at_m);
    doppler_mirror(s->wall_normal, s->wall_distance_m, &scene.source,
                   &scene.source_image);
    emitter_execute(i->emitter, &scene, all->heard);
}

static int hear_drive(struct room *r, const struct room_emission *e)
{
    const struct scene_wall *wall = r->scene->wall_sound;
    double delay_s = r->latency_samples / r->survey.sample_rate_hz;
    double t_s = drive_time_s(&r->drive, e->t_s + delay_s);
    size_t speaker = r->faults.speakers[e->speaker].wired_to;
    bool objects = e->pass == PASS_SCENE, stands;
    struct drive_frame frame;
    if (objects)
        traffic_set(&r->traffic, t_s);
    struct emitter_scene scene = {
        .sound_speed_m_s = drive_sound_speed_m_s(r, e->pass, t_s),
        .latency_samples = r->latency_samples,
        .speaker = speaker,
        .down = e->down,
        .microphones = r->microphones,
        .microphone_images = r->microphone_images,
        .hidden = r->traffic.pieces,
        .n_hidden = objects ? r->traffic.n : 0,
        .clutter = r->traffic.clutter,
        .n_clutter = r->world.clutter.n,
        .mirrored = r->traffic.mirrored,
        .n_mirrored = r->world.mirrored.n,
        .mirror = &r->world.mirror,
        .mirror_gain = wall->reflectivity * wall->reflectivity,
        .direct_gain = *r->scene->direct_level,
        .wall_echo_gain = wall->echo};
    move_array(r, speaker, t_s, &scene, &frame, &stands);
    const float *still = NULL;
    if (stands) {
        keep_still(r, e->pass, scene.sound_speed_m_s, &frame,
                   faults_moves(&r->faults, t_s));
        still = hear_still(r, &scene);
        if (!still)
            return -ENOMEM;
        scene.n_clutter = scene.n_mirrored = 0;
        scene.direct_gain = scene.wall_echo_gain = 0;
    }
    if (stands && !scene.n_hidden) /* all of it is known */
        memset(r->rendered, 0, r->survey.n_microphones * r->n_heard * sizeof(float));
    else
        emitter_execute(r->emitter, &scene, r->rendered);
    wire(r, still, faults_cover(&r->faults.speakers[e->speaker], t_s), t_s);
    return 0;
}

/* For an emission of a stage that goes on: in the middle of its chirp. */
static int prepare_on(struct room *r, const struct room_emission *e)
{
    double delay_s = r->latency_samples / r->survey.sample_rate_hz, velocity_m_s[3];
    double half_s = 0.5 * (double)r->n_chirp / r->survey.sample_rate_hz;
    for (int a = 0; a < 3; a++)
        velocity_m_s[a] = e->stage_m_s * r->survey.stage_axis[a];
    pose_go(&r->pose, e->stage_m + e->stage_m_s * (delay_s + half_s));
    return prepare(r, e->down, e->pass, e->position, e->pass == PASS_SCENE, true,
                   velocity_m_s);
}

/* Of an array that stands, or whose stage goes on. */
static int hear_scan(struct room *r, const struct room_emission *e)
{
    int err = r->survey.continuous
                  ? prepare_on(r, e)
                  : room_prepare(r, e->down, e->pass, 0, e->pass == PASS_SCENE, true);
    for (size_t m = 0; m < r->survey.n_microphones && !err; m++)
        memcpy(r->heard + m * r->n_heard,
               propagate_pair(r->propagate[e->down],
                              r->faults.speakers[e->speaker].wired_to,
                              r->faults.microphones[m].wired_to),
               r->n_heard * sizeof *r->heard);
    return err;
}

int room_hear(struct room *r, const struct room_emission *e)
{
    if (e->speaker >= r->survey.n_speakers || (e->down && !r->survey.chirp_alternates))
        return -EINVAL;
    return r->scene->drive ? hear_drive(r, e) : hear_scan(r, e);
}

int room_emit(struct room *r, const struct room_emission *e, float *samples)
{
    const struct survey *s = &r->survey;
    size_t n = room_frames(r, 1), n_heard = n < r->n_heard ? n : r->n_heard;
    int err = room_hear(r, e);
    if (err)
        return err;
    memset(samples, 0, s->n_microphones * n * sizeof *samples);
    for (size_t m = 0; m < s->n_microphones; m++)
        memcpy(samples + m * n, r->heard + m * r->n_heard, n_heard * sizeof *samples);
    noise_add(
        &r->noise, &r->drive, e->t_s,
        (uint64_t[]){r->scene->seed, ROOM_NOISE_EMISSION, (uint64_t)e->pass, e->take}, 4,
        samples, n, n);
    struct fault_slots slots = {.n_frames = n,
                                .slot_samples = s->slot_samples,
                                .speakers = &e->speaker,
                                .n_speakers = 1};
    uint64_t words[] = {r->scene->seed, (uint64_t)e->pass, ROOM_NOISE_EMISSION, e->take};
    faults_record(&r->faults, &slots, words, samples);
    return 0;
}
