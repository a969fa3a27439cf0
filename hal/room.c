#include "hal/room.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hal/random.h"
#include "hal/room/microphones.h"
#include "hal/room/pose.h"
#include "hal/room/propagate.h"
#include "hal/room/scene.h"
#include "hal/room/vector.h"
#include "hal/room/world.h"
#include "hal/tail.h"

enum { STREAM_NOISE = 8, PROBED_POSITIONS = 8, RING_SAMPLES = 256 };
#define TEMPERATURE_DEFAULT_C 20.0
#define SLOWEST_SOUND         0.85 /* of the nominal speed, with 30 K of drift */

struct room {
    struct scene *scene;
    struct survey survey;
    struct world world;
    struct pose pose;
    struct propagate *propagate;
    size_t n_chirp, n_heard; /* samples of a chirp; heard of it by a microphone */
    double noise_rms;
};

static float *make_chirp(const struct survey *s, size_t *n)
{
    double rate_hz = s->sample_rate_hz;
    *n = (size_t)llround(s->chirp_duration_s * rate_hz);
    float *out = calloc(*n + 1, sizeof *out);
    double slope = (s->chirp_stop_hz - s->chirp_start_hz) / s->chirp_duration_s;
    for (size_t i = 0; out && i < *n; i++) {
        double t = (double)i / rate_hz;
        double turns = fmod((s->chirp_start_hz + 0.5 * slope * t) * t, 1);
        double phase = 2 * M_PI * turns;
        out[i] = (float)(s->chirp_sine ? sin(phase) : cos(phase));
    }
    return out;
}

static double distance_m(const double a[3], const double b[3])
{
    double way[3];
    vector_add(a, -1, b, way);
    return sqrt(vector_dot(way, way));
}

/* The farthest that any element gets from the first speaker at the first position. */
static double array_reach_m(struct room *r, double first[3])
{
    const struct survey *s = &r->survey;
    double reach = 0;
    for (size_t k = 0; k < s->n_positions; k++) {
        pose_move(&r->pose, k);
        if (k == 0)
            memcpy(first, r->pose.speakers_m[0], 3 * sizeof *first);
        for (size_t i = 0; i < s->n_speakers; i++)
            reach = fmax(reach, distance_m(r->pose.speakers_m[i], first));
        for (size_t i = 0; i < s->n_microphones; i++)
            reach = fmax(reach, distance_m(r->pose.microphones_m[i], first));
    }
    return reach;
}

static double farthest_m(const struct scatter *s, const double from[3])
{
    double farthest = 0;
    for (size_t i = 0; i < s->n; i++) {
        farthest = fmax(farthest, distance_m(s->pieces[i].in, from));
        farthest = fmax(farthest, distance_m(s->pieces[i].out, from));
    }
    return farthest;
}

/* No sound takes a longer way from speaker to microphone. */
static double longest_path_m(struct room *r)
{
    const struct survey *s = &r->survey;
    double first[3], image[3];
    double reach = array_reach_m(r, first);
    vector_mirror(s->wall_normal, s->wall_distance_m, first, image);
    double far =
        fmax(farthest_m(&r->world.points, image), farthest_m(&r->world.facets, image));
    far = fmax(far, farthest_m(&r->world.clutter, first));
    far = fmax(far, distance_m(first, image) / 2); /* the wall's echo */
    return 2 * (far + reach);
}

static int create_propagate(struct room *r, const char *path, struct complaint *why)
{
    const struct survey *s = &r->survey;
    size_t n_bins;
    int err = -ENOMEM;
    float *responses = NULL, *chirp = make_chirp(s, &r->n_chirp);
    double latest = s->latency_samples + longest_path_m(r) * s->sample_rate_hz /
                                             (SLOWEST_SOUND * s->sound_speed_m_s);
    r->n_heard = propagate_length((size_t)latest + r->n_chirp + RING_SAMPLES);
    n_bins = r->n_heard / 2 + 1;
    responses = malloc(s->n_microphones * n_bins * sizeof *responses);
    if (!chirp || !responses)
        goto out;
    microphones_respond(s, *r->scene->level, r->scene->errors->gain_db, r->scene->seed,
                        n_bins, s->sample_rate_hz / (double)r->n_heard, responses);
    struct propagate_config cfg = {.sample_rate_hz = s->sample_rate_hz,
                                   .n_samples = r->n_heard,
                                   .n_speakers = s->n_speakers,
                                   .n_microphones = s->n_microphones,
                                   .chirp = chirp,
                                   .n_chirp = r->n_chirp,
                                   .responses = responses};
    err = propagate_create(&r->propagate, &cfg);
out:
    free(responses);
    free(chirp);
    return err ? complain(why, err, "%s: %s", path, strerror(-err)) : 0;
}

static double base_temperature_c(const struct room *r)
{
    return isnan(r->survey.temperature_c) ? TEMPERATURE_DEFAULT_C
                                          : r->survey.temperature_c;
}

double room_temperature_c(const struct room *r, Anlos__Pass pass, size_t position)
{
    const struct scene_drift *d = r->scene->drift;
    double along = r->survey.n_positions > 1
                       ? (double)position / (double)(r->survey.n_positions - 1)
                       : 0;
    return base_temperature_c(r) + d->scan_c * along +
           (pass == ANLOS__PASS__BACKGROUND ? d->background_c : 0);
}

/* The survey's speed, changed as the air's temperature has changed. */
static double sound_speed_m_s(const struct room *r, Anlos__Pass pass, size_t position)
{
    double now = survey_sound_speed_m_s(room_temperature_c(r, pass, position));
    return r->survey.sound_speed_m_s * now /
           survey_sound_speed_m_s(base_temperature_c(r));
}

/* What is heard in a scene: the hidden objects, or what is there anyway, or both. */
static int prepare(struct room *r, Anlos__Pass pass, size_t position, bool objects,
                   bool surroundings)
{
    const struct scene_wall *wall = r->scene->wall_sound;
    pose_move(&r->pose, position);
    struct propagate_scene scene = {
        .sound_speed_m_s = sound_speed_m_s(r, pass, position),
        .latency_samples = r->survey.latency_samples,
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
    if (s->microphones->ripple_db > 0 &&
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
            add_heard(r, propagate_pair(r->propagate, speakers[j], m),
                      j * s->slot_samples, n_frames, samples + m * n_frames);
    add_noise(r, pass, position, take, s->n_microphones * n_frames, samples);
    return 0;
}

void room_destroy(struct room *r)
{
    if (!r)
        return;
    propagate_destroy(r->propagate);
    pose_clear(&r->pose);
    world_clear(&r->world);
    survey_clear(&r->survey);
    scene_free(r->scene);
    free(r);
}
