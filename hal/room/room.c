#include "hal/room/room.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hal/survey/calibration_file.h"
#include "hal/alsa/emission.h"
#include "hal/random.h"
#include "hal/room/faults.h"
#include "hal/room/microphones.h"
#include "hal/room/pose.h"
#include "hal/room/propagate.h"
#include "hal/room/reach.h"
#include "hal/room/scene.h"
#include "hal/room/world.h"
#include "hal/tail.h"

enum { STREAM_NOISE = 8, STREAM_FAULTS = 9, PROBED_POSITIONS = 8, RING_SAMPLES = 256 };
#define TEMPERATURE_DEFAULT_C 20.0
#define SLOWEST_SOUND         0.85 /* of the nominal speed, with 30 K of drift */

struct room {
    struct scene *scene;
    struct survey survey; /* as the processor knows it */
    double sound_speed_m_s, temperature_c, latency_samples; /* as they are */
    struct faults faults;
    struct world world;
    struct pose pose;
    struct propagate *propagate;
    size_t n_chirp, n_heard; /* samples of a chirp; heard of it by a microphone */
    double noise_rms;
};

static int create_propagate(struct room *r, const char *path, struct complaint *why)
{
    const struct survey *s = &r->survey;
    size_t n_bins;
    int err = -ENOMEM;
    float *responses = NULL, *emissions = NULL, *chirp = emission_create(s, &r->n_chirp);
    double latest = r->latency_samples + reach_longest_path_m(&r->pose, &r->world) *
                                             s->sample_rate_hz /
                                             (SLOWEST_SOUND * r->sound_speed_m_s);
    r->n_heard = propagate_length((size_t)latest + r->n_chirp + RING_SAMPLES);
    n_bins = r->n_heard / 2 + 1;
    responses = malloc(s->n_microphones * n_bins * sizeof *responses);
    if (chirp)
        emissions = faults_emit(&r->faults, chirp, r->n_chirp);
    if (!emissions || !responses)
        goto out;
    microphones_respond(s, *r->scene->level, r->scene->errors->gain_db, r->scene->seed,
                        n_bins, s->sample_rate_hz / (double)r->n_heard, responses);
    for (size_t i = 0; i < s->n_microphones * n_bins; i++)
        responses[i] *= r->faults.microphones[i / n_bins].gain;
    struct propagate_config cfg = {.sample_rate_hz = s->sample_rate_hz,
                                   .n_samples = r->n_heard,
                                   .n_speakers = s->n_speakers,
                                   .n_microphones = s->n_microphones,
                                   .emissions = emissions,
                                   .n_chirp = r->n_chirp,
                                   .responses = responses};
    err = propagate_create(&r->propagate, &cfg);
out:
    free(responses);
    free(emissions);
    free(chirp);
    return err ? complain(why, err, "%s: %s", path, strerror(-err)) : 0;
}

double room_temperature_c(const struct room *r, Anlos__Pass pass, size_t position)
{
    const struct scene_drift *d = r->scene->drift;
    double along = r->survey.n_positions > 1
                       ? (double)position / (double)(r->survey.n_positions - 1)
                       : 0;
    return r->temperature_c + d->scan_c * along +
           (pass == ANLOS__PASS__BACKGROUND ? d->background_c : 0);
}

/* The base temperature's speed, changed as the air's temperature has changed. */
static double sound_speed_m_s(const struct room *r, Anlos__Pass pass, size_t position)
{
    double now = survey_sound_speed_m_s(room_temperature_c(r, pass, position));
    return r->sound_speed_m_s * now / survey_sound_speed_m_s(r->temperature_c);
}

/* What is heard in a scene: the hidden objects, or what is there anyway, or both. */
static int prepare(struct room *r, Anlos__Pass pass, size_t position, bool objects,
                   bool surroundings)
{
    const struct scene_wall *wall = r->scene->wall_sound;
    pose_move(&r->pose, position);
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
        .direct_gain = surroundings ? *r->scene->direct_level : 0,
        .wall_echo_gain = surroundings ? wall->echo : 0};
    return propagate_prepare(r->propagate, &scene);
}

/* Mean square of the objects' echoes over a recording, from some positions of it. */
static int measure_echoes(struct room *r, double *power)
{
    const struct survey *s = &r->survey;
    size_t n = s->n_positions < PROBED_POSITIONS ? s->n_positions : PROBED_POSITIONS;
    double sum = 0;
    for (size_t i = 0; i < n; i++) {
        size_t position = n > 1 ? i * (s->n_positions - 1) / (n - 1) : 0;
        if (prepare(r, ANLOS__PASS__SCENE, position, true, false) < 0)
            return -ENOMEM;
        for (size_t pair = 0; pair < s->n_speakers * s->n_microphones; pair++) {
            const float *y = propagate_pair(r->propagate, pair / s->n_microphones,
                                            pair % s->n_microphones);
            for (size_t k = 0; k < r->n_heard; k++)
                sum += (double)y[k] * y[k];
        }
    }
    *power = sum / (double)(n * s->n_speakers * s->n_microphones * s->slot_samples);
    return 0;
}

static int set_noise(struct room *r, const char *path, struct complaint *why)
{
    const struct scene_noise *noise = r->scene->noise;
    double power;
    r->noise_rms = noise->rms ? *noise->rms : 0;
    if (!noise->snr_db)
        return 0;
    if (measure_echoes(r, &power) < 0)
        return complain(why, -ENOMEM, "%s: out of memory", path);
    r->noise_rms = sqrt(power * pow(10, -*noise->snr_db / 10));
    return 0;
}

/* The truth, of which the survey may know less than that. */
static int set_truth(struct room *r)
{
    const struct survey *s = &r->survey;
    const struct scene_faults *f = r->scene->faults;
    r->sound_speed_m_s = f->sound_speed_m_s ? *f->sound_speed_m_s : s->sound_speed_m_s;
    r->latency_samples = s->latency_samples + f->latency_samples;
    r->temperature_c = isnan(s->temperature_c) ? TEMPERATURE_DEFAULT_C : s->temperature_c;
    return faults_create(&r->faults, f, s->n_speakers, s->n_microphones);
}

int room_load(struct room **out, const char *path, struct complaint *why)
{
    *out = NULL;
    struct room *r = calloc(1, sizeof *r);
    if (!r)
        return complain(why, -ENOMEM, "%s: out of memory", path);
    int err = scene_load(&r->scene, &r->survey, path, why);
    if (err)
        goto fail;
    const struct scene *s = r->scene;
    if (set_truth(r) < 0)
        err = complain(why, -ENOMEM, "%s: out of memory", path);
    if (!err && s->microphones->ripple_db > 0 &&
        microphones_invent(&r->survey, s->microphones->ripple_db, s->seed) < 0)
        err = complain(why, -ENOMEM, "%s: out of memory", path);
    if (!err)
        err = world_create(&r->world, s, &r->survey, path, why);
    if (!err && pose_create(&r->pose, &r->survey, s->errors->element_m,
                            s->errors->stage_m, s->seed) < 0)
        err = complain(why, -ENOMEM, "%s: out of memory", path);
    if (!err)
        err = create_propagate(r, path, why);
    if (!err)
        err = set_noise(r, path, why);
    if (err)
        goto fail;
    *out = r;
    return 0;
fail:
    room_destroy(r);
    return err;
}

const struct survey *room_survey(const struct room *r)
{
    return &r->survey;
}

int room_calibrate(struct room *r, const char *path, struct calibration **out,
                   struct complaint *why)
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
    return n_speakers * r->survey.slot_samples + room_tail(r);
}

/* A chirp's sound from its slot on, as far as the recording goes. */
static void add_heard(const struct room *r, const float *heard, size_t start,
                      size_t n_frames, float *samples)
{
    size_t n = n_frames - start < r->n_heard ? n_frames - start : r->n_heard;
    for (size_t i = 0; i < n; i++)
        samples[start + i] += heard[i];
}

static void add_noise(const struct room *r, Anlos__Pass pass, size_t position,
                      uint32_t take, size_t n, float *samples)
{
    struct random random;
    if (!(r->noise_rms > 0))
        return;
    random_seed(
        &random,
        (uint64_t[]){r->scene->seed, STREAM_NOISE, (uint64_t)pass, position, take}, 5);
    random_add_noise(&random, samples, n, (float)r->noise_rms);
}

int room_record(struct room *r, Anlos__Pass pass, size_t position,
                const uint32_t *speakers, size_t n_speakers, uint32_t take,
                float *samples)
{
    const struct survey *s = &r->survey;
    size_t n_frames = room_frames(r, n_speakers);
    if (position >= s->n_positions)
        return -EINVAL;
    for (size_t j = 0; j < n_speakers; j++)
        if (speakers[j] >= s->n_speakers)
            return -EINVAL;
    int err = prepare(r, pass, position, pass == ANLOS__PASS__SCENE, true);
    if (err)
        return err;
    memset(samples, 0, s->n_microphones * n_frames * sizeof *samples);
    for (size_t j = 0; j < n_speakers; j++)
        for (size_t m = 0; m < s->n_microphones; m++)
            add_heard(r,
                      propagate_pair(r->propagate,
                                     r->faults.speakers[speakers[j]].wired_to,
                                     r->faults.microphones[m].wired_to),
                      j * s->slot_samples, n_frames, samples + m * n_frames);
    add_noise(r, pass, position, take, s->n_microphones * n_frames, samples);
    struct fault_slots slots = {.n_frames = n_frames,
                                .slot_samples = s->slot_samples,
                                .speakers = speakers,
                                .n_speakers = n_speakers};
    uint64_t words[] = {r->scene->seed, (uint64_t)pass, position, take};
    faults_record(&r->faults, &slots, words, samples);
    return 0;
}

void room_destroy(struct room *r)
{
    if (!r)
        return;
    propagate_destroy(r->propagate);
    faults_clear(&r->faults);
    pose_clear(&r->pose);
    world_clear(&r->world);
    survey_clear(&r->survey);
    scene_free(r->scene);
    free(r);
}
