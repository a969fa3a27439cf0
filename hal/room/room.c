/* SPDX-License-Identifier: MIT */
#include "hal/room/room.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "hal/random.h"
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

double room_sound_speed_m_s(const struct room *r, enum pass pass, size_t position)
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
        .sound_speed_m_s = room_sound_speed_m_s(r, pass, position),
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

int room_prepare_on(struct room *r, const struct room_emission *e)
{
    double delay_s = r->latency_samples / r->survey.sample_rate_hz, velocity_m_s[3];
    double half_s = 0.5 * (double)r->n_chirp / r->survey.sample_rate_hz;
    for (int a = 0; a < 3; a++)
        velocity_m_s[a] = e->stage_m_s * r->survey.stage_axis[a];
    pose_go(&r->pose, e->stage_m + e->stage_m_s * (delay_s + half_s));
    return prepare(r, e->down, e->pass, e->position, e->pass == PASS_SCENE, true,
                   velocity_m_s);
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

static double noise_rms(const struct room *r, double t_s)
{
    const struct scene_noise *noise = r->scene->noise;
    double rms = r->noise_rms, at_s = noise->n_rises ? drive_time_s(&r->drive, t_s) : 0;
    for (unsigned i = 0; i < noise->n_rises; i++)
        if (at_s >= noise->rises[i].during_s[0] && at_s < noise->rises[i].during_s[1])
            rms *= pow(10, noise->rises[i].by_db / 20);
    return rms;
}

void room_add_noise(const struct room *r, double t_s, const uint64_t *words,
                    size_t n_words, float *samples, size_t stride, size_t n)
{
    float rms = (float)noise_rms(r, t_s);
    struct random random;
    slams_add(&r->slams, t_s, samples, stride, n);
    for (unsigned i = 0; i < r->scene->noise->n_tones; i++)
        tone_add(&r->scene->noise->tones[i], &r->drive, t_s, r->survey.sample_rate_hz,
                 r->survey.n_microphones, samples, stride, n);
    if (!(rms > 0))
        return;
    random_seed(&random, words, n_words);
    if (stride == n)
        random_add_noise(&random, samples, r->survey.n_microphones * n, rms);
    for (size_t m = 0; m < r->survey.n_microphones && stride != n; m++)
        random_add_noise(&random, samples + m * stride, n, rms);
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
    room_add_noise(
        r, 0,
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
