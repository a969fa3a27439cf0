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
#include "hal/room/room_state.h"
#include "hal/room/vector.h"

enum { PROBED_POSITIONS = 8, RING_SAMPLES = 256, STREAM_DRAWS = 12 };
#define TEMPERATURE_DEFAULT_C 20.0
#define SLOWEST_SOUND         0.85 /* of the nominal speed, with 30 K of drift */

/* -- how far sound gets -----------------------------------------------------------------
 */

#define STEP_S      0.02
#define STEPS       5000
#define EGO_MAX_M_S 30.0 /* as scene_check.c has it */

static double distance_m(const double a[3], const double b[3])
{
    double way[3];
    vector_add(a, -1, b, way);
    return sqrt(vector_dot(way, way));
}

/* The farthest that any element gets from the first speaker at the first position. */
static double array_reach_m(struct pose *pose, double first[3])
{
    const struct survey *s = pose->survey;
    double reach = 0;
    for (size_t k = 0; k < s->n_positions; k++) {
        pose_move(pose, k);
        if (k == 0)
            memcpy(first, pose->speakers_m[0], 3 * sizeof *first);
        for (size_t i = 0; i < s->n_speakers; i++)
            reach = fmax(reach, distance_m(pose->speakers_m[i], first));
        for (size_t i = 0; i < s->n_microphones; i++)
            reach = fmax(reach, distance_m(pose->microphones_m[i], first));
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

/* No sound takes a longer way from speaker to microphone, at any position.  Leaves the
 * pose at the last one. */
static double reach_longest_path_m(struct pose *pose, const struct world *world)
{
    const struct survey *s = pose->survey;
    double first[3], image[3];
    double reach = array_reach_m(pose, first);
    reach += fabs(survey_speed_m_s(s)) * survey_duration_s(s) / (double)s->n_positions;
    vector_mirror(s->wall_normal, s->wall_distance_m, first, image);
    double far =
        fmax(farthest_m(&world->points, image), farthest_m(&world->facets, image));
    far = fmax(far, farthest_m(&world->mirrored, image));
    far = fmax(far, farthest_m(&world->clutter, first));
    far = fmax(far, distance_m(first, image) / 2); /* the wall's echo */
    return 2 * (far + reach);
}

/* Of a moment of a drive: from the first speaker or its image to anything. */
static double reach_now_m(const struct survey *s, const double first[3],
                          const struct traffic *traffic)
{
    double image[3], far;
    vector_mirror(s->wall_normal, s->wall_distance_m, first, image);
    far = distance_m(first, image) / 2; /* the wall's echo */
    for (size_t i = 0; i < traffic->n; i++) {
        far = fmax(far, distance_m(traffic->pieces[i].in.at_m, image));
        far = fmax(far, distance_m(traffic->pieces[i].out.at_m, image));
    }
    far = fmax(far, farthest_m(&traffic->world->mirrored, image));
    return fmax(far, farthest_m(&traffic->world->clutter, first));
}

/* The same at any time of a drive, by steps of it. */
static double reach_longest_drive_m(struct pose *pose, const struct drive *drive,
                                    struct traffic *traffic)
{
    double first[3], at[3], reach = array_reach_m(pose, first), far = 0;
    double step_s = fmax(STEP_S, drive->scene->period_s / STEPS), speed_m_s = 0;
    for (double t_s = 0; t_s < drive->scene->period_s; t_s += step_s) {
        struct drive_frame frame;
        traffic_set(traffic, t_s);
        drive_frame(drive, t_s, &frame);
        drive_to_ground(&frame, first, at);
        far = fmax(far, reach_now_m(pose->survey, at, traffic));
        for (size_t i = 0; i < traffic->n; i++) {
            const double *v = traffic->pieces[i].in.velocity_m_s;
            speed_m_s = fmax(speed_m_s, sqrt(vector_dot(v, v)));
        }
    }
    return 2 * (far + reach + (speed_m_s + EGO_MAX_M_S) * step_s);
}

/* -- what renders it --------------------------------------------------------------------
 */

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

/* -- the level of its noise, and the whole ----------------------------------------------
 */

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
    r->noise.rms = noise->rms ? *noise->rms : 0;
    if (!noise->snr_db)
        return 0;
    if (noise->at_m)
        power = person_power(r, *noise->at_m);
    else if (measure_echoes(r, &power) < 0)
        return -ENOMEM;
    r->noise.rms = sqrt(power * pow(10, -*noise->snr_db / 10));
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
        err = noise_create(&r->noise, s, &r->survey, r->sound_speed_m_s);
    if (!err)
        err = create_renderer(r);
    if (!err)
        err = create_interferers(r);
    if (!err)
        err = set_noise(r);
    return err ? err : room_set_sights(r);
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
    if (err)
        goto fail;
    r->scene->seed = draw_seed(r->scene->seed, draw);
    if (draw)
        scene_draw(r->scene, &r->survey);
    static const struct firing as_it_is = {.stagger = FIRING_STAGGER_AS_IT_IS};
    r->slots = firing_slots(&r->survey, firing ? firing : &as_it_is,
                            r->scene->n_interferers > 0, r->scene->seed);
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
        free(r->sights[i].spans);
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
    noise_clear(&r->noise);
    interferers_clear(&r->interferers);
    pose_clear(&r->pose);
    world_clear(&r->world);
    survey_clear(&r->survey);
    scene_free(r->scene);
    free(r);
}
