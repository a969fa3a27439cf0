/* SPDX-License-Identifier: MIT */
/* hal/room/room_create.c -- a room from its scene file: the truth, what renders its
 * sound, and the level of its noise. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hal/alsa/emission.h"
#include "hal/random.h"
#include "hal/room/figure.h"
#include "hal/room/microphones.h"
#include "hal/room/motion.h"
#include "hal/room/reach.h"
#include "hal/room/room_state.h"

enum { PROBED_POSITIONS = 8, RING_SAMPLES = 256, SIGHT_STEPS = 20000, STREAM_DRAWS = 12 };
#define TEMPERATURE_DEFAULT_C 20.0
#define SLOWEST_SOUND         0.85 /* of the nominal speed, with 30 K of drift */
#define SIGHT_STEP_S          0.005

/* What the speakers make of the chirp in one direction, and the microphones of what they
 * hear; free() both. */
struct room_sound {
    float *emissions[2]; /* [n_speakers][n_chirp] */
    float *responses;    /* [n_microphones][n_heard / 2 + 1] */
};

static float *emissions_of(struct room *r, bool down)
{
    float *chirp = emission_create(&r->survey, down, &r->n_chirp);
    float *out = chirp ? faults_emit(&r->faults, chirp, r->n_chirp) : NULL;
    free(chirp);
    return out;
}

static int create_sound(struct room *r, struct room_sound *out)
{
    const struct survey *s = &r->survey;
    size_t n_bins;
    out->emissions[0] = emissions_of(r, false);
    out->emissions[1] = s->chirp_alternates ? emissions_of(r, true) : NULL;
    if (!out->emissions[0] || (s->chirp_alternates && !out->emissions[1]))
        return -ENOMEM;
    double path_m = r->scene->drive
                        ? reach_longest_drive_m(&r->pose, &r->drive, &r->traffic)
                        : reach_longest_path_m(&r->pose, &r->world);
    double latest = r->latency_samples +
                    path_m * s->sample_rate_hz / (SLOWEST_SOUND * r->sound_speed_m_s);
    r->n_heard = propagate_length((size_t)latest + r->n_chirp + RING_SAMPLES);
    n_bins = r->n_heard / 2 + 1;
    out->responses = malloc(s->n_microphones * n_bins * sizeof *out->responses);
    if (!out->responses)
        return -ENOMEM;
    microphones_respond(s, *r->scene->level, r->scene->errors->gain_db, r->scene->seed,
                        n_bins, s->sample_rate_hz / (double)r->n_heard, out->responses);
    for (size_t i = 0; i < s->n_microphones * n_bins; i++)
        out->responses[i] *= r->faults.microphones[i / n_bins].gain;
    return 0;
}

static int create_emitter(struct room *r, const struct room_sound *sound)
{
    const struct survey *s = &r->survey;
    struct emitter_config cfg = {.sample_rate_hz = s->sample_rate_hz,
                                 .n_samples = r->n_heard,
                                 .n_speakers = s->n_speakers,
                                 .n_microphones = s->n_microphones,
                                 .emissions = {sound->emissions[0], sound->emissions[1]},
                                 .n_chirp = r->n_chirp,
                                 .responses = sound->responses,
                                 .facets = r->world.facets.n > 0};
    return emitter_create(&r->emitter, &cfg);
}

static int create_propagate(struct room *r, const struct room_sound *sound)
{
    const struct survey *s = &r->survey;
    struct propagate_config cfg = {
        .sample_rate_hz = s->sample_rate_hz,
        .n_samples = r->n_heard,
        .n_speakers = s->n_speakers,
        .n_microphones = s->n_microphones,
        .n_chirp = r->n_chirp,
        .n_terms = propagate_terms(survey_speed_m_s(s), r->sound_speed_m_s, r->n_chirp),
        .responses = sound->responses};
    int err = 0;
    for (int down = 0; down < 2 && sound->emissions[down] && !err; down++) {
        cfg.emissions = sound->emissions[down];
        err = propagate_create(&r->propagate[down], &cfg);
    }
    return err;
}

static int create_renderer(struct room *r)
{
    struct room_sound sound = {.responses = NULL};
    int err = create_sound(r, &sound);
    size_t n = r->survey.n_microphones;
    if (!err)
        err = r->scene->drive ? create_emitter(r, &sound) : create_propagate(r, &sound);
    r->heard = calloc(n * r->n_heard + 1, sizeof *r->heard);
    r->rendered = calloc(n * r->n_heard + 1, sizeof *r->rendered);
    r->microphones = calloc(n, sizeof *r->microphones);
    r->microphone_images = calloc(n, sizeof *r->microphone_images);
    r->still.heard = calloc(2 * r->survey.n_speakers, sizeof(float *));
    if (!r->heard || !r->rendered || !r->microphones || !r->microphone_images ||
        !r->still.heard)
        err = -ENOMEM;
    free(sound.emissions[0]);
    free(sound.emissions[1]);
    free(sound.responses);
    return err;
}

static int create_interferers(struct room *r)
{
    const struct survey *s = &r->survey;
    double heard_s = (double)(r->n_heard - r->n_chirp) / s->sample_rate_hz;
    const struct interferers_config cfg = {.scene = r->scene,
                                           .survey = s,
                                           .mirror = &r->world.mirror,
                                           .faults = &r->faults,
                                           .sound_speed_m_s = r->sound_speed_m_s,
                                           .longest_m = heard_s * r->sound_speed_m_s};
    return interferers_create(&r->interferers, &cfg);
}

/* Mean square of the objects' echoes over a recording, from some positions of it. */
static int measure_echoes(struct room *r, double *power)
{
    const struct survey *s = &r->survey;
    size_t n = s->n_positions < PROBED_POSITIONS ? s->n_positions : PROBED_POSITIONS;
    double sum = 0;
    for (size_t i = 0; i < n; i++) {
        size_t position = n > 1 ? i * (s->n_positions - 1) / (n - 1) : 0;
        if (room_prepare(r, false, PASS_SCENE, position, true, false) < 0)
            return -ENOMEM;
        for (size_t pair = 0; pair < s->n_speakers * s->n_microphones; pair++) {
            const float *y = propagate_pair(r->propagate[0], pair / s->n_microphones,
                                            pair % s->n_microphones);
            for (size_t k = 0; k < r->n_heard; k++)
                sum += (double)y[k] * y[k];
        }
    }
    *power = sum / (double)(n * s->n_speakers * s->n_microphones * s->slot_samples);
    return 0;
}

/* The same of a person at a range from the array, by way of the wall. */
static double person_power(const struct room *r, double range_m)
{
    double wall = r->scene->wall_sound->reflectivity;
    double amplitude = *r->scene->level * wall * wall * FIGURE_PERSON_M /
                       (range_m * range_m);
    return amplitude * amplitude / 2 * (double)r->n_chirp /
           (double)r->survey.slot_samples;
}

static int set_noise(struct room *r)
{
    const struct scene_noise *noise = r->scene->noise;
    double power;
    r->noise_rms = noise->rms ? *noise->rms : 0;
    if (!noise->snr_db)
        return 0;
    if (noise->at_m)
        power = person_power(r, *noise->at_m);
    else if (measure_echoes(r, &power) < 0)
        return -ENOMEM;
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

struct watch { /* an object, from the array */
    const struct room *room;
    size_t object;
};

static bool is_in_view(void *ctx, double t_s)
{
    const struct watch *w = ctx;
    return room_sees(w->room, w->object, t_s);
}

static int set_sights(struct room *r)
{
    const struct scene_drive *drive = r->scene->drive;
    int err = 0;
    r->sights = calloc(r->world.n_objects + 1, sizeof *r->sights);
    if (!r->sights)
        return -ENOMEM;
    for (size_t i = 0; i < r->world.n_objects && drive && !err; i++) {
        const double *present_s = r->scene->objects[i].present_s;
        struct watch w = {r, i};
        err = sight_scan(&r->sights[i], is_in_view, &w, present_s ? present_s[0] : 0,
                         present_s ? present_s[1] : drive->period_s,
                         fmax(SIGHT_STEP_S, drive->period_s / SIGHT_STEPS));
    }
    return err;
}

/* All that is not the file's: 0, -ENOMEM. */
static int complete(struct room *r)
{
    const struct scene *s = r->scene;
    int err = pose_create(&r->pose, &r->survey, s->errors->element_m, s->errors->stage_m,
                          s->seed);
    if (!err)
        err = drive_create(&r->drive, s->drive, &r->survey);
    if (!err)
        err = traffic_create(&r->traffic, s, &r->world);
    if (!err)
        err = slams_create(&r->slams, s, &r->survey, r->sound_speed_m_s);
    if (!err)
        err = create_renderer(r);
    if (!err)
        err = create_interferers(r);
    if (!err)
        err = set_noise(r);
    return err ? err : set_sights(r);
}

/* Seeds of neighbouring scenes are neighbours: their draws are not each other's. */
static uint32_t draw_seed(uint32_t seed, uint32_t draw)
{
    struct random r;
    random_seed(&r, (uint64_t[]){seed, STREAM_DRAWS, draw}, 3);
    return draw ? (uint32_t)(random_even(&r) * 0x1p32) : seed;
}

int room_load_drawn(struct room **out, const char *path, const struct firing *firing,
                    uint32_t draw, struct error *why)
{
    *out = NULL;
    struct room *r = calloc(1, sizeof *r);
    if (!r)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    int err = scene_load(&r->scene, &r->survey, path, why);
    if (!err && firing)
        err = firing_apply(&r->survey, firing, why);
    if (!err && firing)
        r->jitter_samples = (size_t)firing->jitter_samples;
    if (err)
        goto fail;
    r->scene->seed = draw_seed(r->scene->seed, draw);
    if (draw)
        scene_draw(r->scene, &r->survey);
    const struct scene *s = r->scene;
    if (set_truth(r) < 0)
        err = error_say(why, -ENOMEM, "%s: out of memory", path);
    if (!err && s->microphones->ripple_db > 0 &&
        microphones_invent(&r->survey, s->microphones->ripple_db, s->seed) < 0)
        err = error_say(why, -ENOMEM, "%s: out of memory", path);
    if (!err)
        err = world_create(&r->world, s, &r->survey, path, why);
    if (err)
        goto fail;
    err = complete(r);
    if (err)
        error_say(why, err, "%s: %s", path, strerror(-err));
    if (err)
        goto fail;
    *out = r;
    return 0;
fail:
    room_destroy(r);
    return err;
}

int room_load(struct room **out, const char *path, struct error *why)
{
    return room_load_drawn(out, path, NULL, 0, why);
}

void room_destroy(struct room *r)
{
    if (!r)
        return;
    for (size_t i = 0; r->sights && i < r->world.n_objects; i++)
        sight_clear_spans(&r->sights[i]);
    free(r->sights);
    propagate_destroy(r->propagate[0]);
    propagate_destroy(r->propagate[1]);
    emitter_destroy(r->emitter);
    for (size_t i = 0; r->still.heard && i < 2 * r->survey.n_speakers; i++)
        free(r->still.heard[i]);
    free(r->still.heard);
    free(r->heard);
    free(r->rendered);
    free(r->microphones);
    free(r->microphone_images);
    traffic_clear(&r->traffic);
    drive_clear(&r->drive);
    faults_clear(&r->faults);
    slams_clear(&r->slams);
    interferers_clear(&r->interferers);
    pose_clear(&r->pose);
    world_clear(&r->world);
    survey_clear(&r->survey);
    scene_free(r->scene);
    free(r);
}
