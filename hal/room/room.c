/* SPDX-License-Identifier: MIT */
#include "hal/room/room.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/list.h"
#include "hal/random.h"
#include "hal/room/drive.h"
#include "hal/room/elements.h"
#include "hal/room/emitter.h"
#include "hal/room/figure.h"
#include "hal/room/noise.h"
#include "hal/room/propagate.h"
#include "hal/room/scene.h"
#include "hal/room/vector.h"
#include "hal/room/world.h"
#include "hal/survey/calibration.h"
#include "hal/survey/firing.h"
#include "recon/tail.h"

enum { NOISE_SHOT = 8, NOISE_EMISSION = 10, NOISE_STREAM = 11 };

/* What is heard besides the hidden objects while the vehicle stands: the same from round
 * to round, and most of the work. */
struct room_still {
    enum pass pass;
    double sound_speed_m_s;
    struct drive_frame frame; /* where it stands */
    size_t moves;             /* of its elements, so far */
    float **heard; /* [up, down][n_speakers]: [n_microphones][n_heard], or NULL: not
                      rendered yet */
};

/* When an object is in view. */
struct sight_spans {
    size_t n, room;
    struct sight_span {
        double from_s, to_s;
    } * spans; /* [n], in their order */
};

struct room {
    struct scene *scene;
    struct survey survey; /* as the processor knows it */
    double sound_speed_m_s, temperature_c, latency_samples; /* as they are */
    struct faults faults;
    struct noise noise;
    struct interferers interferers;
    struct firing_slots slots; /* of our endless shots */
    struct world world;
    struct pose pose;
    struct drive drive;
    struct traffic traffic;
    struct sight_spans *sights;     /* [world.n_objects] of a drive */
    struct propagate *propagate[2]; /* standing: upward and, where chirps alternate,
                                       downward */
    struct emitter *emitter;        /* of a drive */
    struct room_still still;
    struct doppler_point *microphones, *microphone_images; /* [n_microphones] */
    float *heard;            /* [n_microphones][n_heard] of one emission */
    float *rendered;         /* the same before the cables of a drive's microphones */
    size_t n_chirp, n_heard; /* samples of a chirp; heard of it by a microphone */
};

/* -- the sound of a shot, and of one emission from where everything is at its time -----
 */

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
static int prepare_moving(struct room *r, bool down, enum pass pass, size_t position,
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

/* What is heard in a standing scene: the hidden objects, or what is there anyway, or
 * both; by the propagation of one direction.  0, -ENOMEM. */
static int prepare_standing(struct room *r, bool down, enum pass pass, size_t position,
                            bool objects, bool surroundings)
{
    static const double still[3] = {0};
    pose_move(&r->pose, position);
    return prepare_moving(r, down, pass, position, objects, surroundings, still);
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
static void add_to_shot(const struct room *r, const float *heard, size_t start,
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
    int err = prepare_standing(r, down, pass, position, pass == PASS_SCENE, true);
    for (size_t j = 0; j < n_speakers && !err; j++)
        for (size_t m = 0; m < s->n_microphones && survey_is_down(s, j) == down; m++)
            add_to_shot(r,
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
    noise_add(&r->noise, &r->drive, 0,
              (uint64_t[]){r->scene->seed, NOISE_SHOT, (uint64_t)pass, position, take}, 5,
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

/* An interferer's emission, from where everything is at its time; latency_samples: when
 * it begins, after sample 0 of what is heard then, r->interferers.heard. */
static void hear_interferer(struct room *r, size_t interferer, size_t speaker, double t_s,
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
    return prepare_moving(r, e->down, e->pass, e->position, e->pass == PASS_SCENE, true,
                          velocity_m_s);
}

/* Of an array that stands, or whose stage goes on. */
static int hear_scan(struct room *r, const struct room_emission *e)
{
    int err = r->survey.continuous
                  ? prepare_on(r, e)
                  : prepare_standing(r, e->down, e->pass, 0, e->pass == PASS_SCENE, true);
    for (size_t m = 0; m < r->survey.n_microphones && !err; m++)
        memcpy(r->heard + m * r->n_heard,
               propagate_pair(r->propagate[e->down],
                              r->faults.speakers[e->speaker].wired_to,
                              r->faults.microphones[m].wired_to),
               r->n_heard * sizeof *r->heard);
    return err;
}

/* An emission into r->heard, without noise.  0, -EINVAL, -ENOMEM. */
static int hear(struct room *r, const struct room_emission *e)
{
    if (e->speaker >= r->survey.n_speakers || (e->down && !r->survey.chirp_alternates))
        return -EINVAL;
    return r->scene->drive ? hear_drive(r, e) : hear_scan(r, e);
}

int room_emit(struct room *r, const struct room_emission *e, float *samples)
{
    const struct survey *s = &r->survey;
    size_t n = room_frames(r, 1), n_heard = n < r->n_heard ? n : r->n_heard;
    int err = hear(r, e);
    if (err)
        return err;
    memset(samples, 0, s->n_microphones * n * sizeof *samples);
    for (size_t m = 0; m < s->n_microphones; m++)
        memcpy(samples + m * n, r->heard + m * r->n_heard, n_heard * sizeof *samples);
    noise_add(&r->noise, &r->drive, e->t_s,
              (uint64_t[]){r->scene->seed, NOISE_EMISSION, (uint64_t)e->pass, e->take}, 4,
              samples, n, n);
    struct fault_slots slots = {.n_frames = n,
                                .slot_samples = s->slot_samples,
                                .speakers = &e->speaker,
                                .n_speakers = 1};
    uint64_t words[] = {r->scene->seed, (uint64_t)e->pass, NOISE_EMISSION, e->take};
    faults_record(&r->faults, &slots, words, samples);
    return 0;
}

/* -- the sound of emissions that ring into each other ----------------------------------
 */

struct room_stream {
    struct room *room;
    struct room_stream_config cfg;
    uint64_t pass;      /* word of its noise */
    uint32_t *speakers; /* [n_speakers] */
    size_t n_speakers;
    size_t n_ping, n_line; /* samples */
    uint64_t base;         /* sample of the stream where the line begins */
    uint64_t next;         /* emission to render next */
    uint64_t next_slot;    /* of which to add the noise next */
    uint64_t *interferes;  /* [interferers.n]: emission of each to render next */
    uint64_t asked;        /* pings before this one may not be asked for */
    float *line;           /* [n_microphones][n_line] */
    float *ping;           /* [n_microphones][n_ping] */
};

int room_stream_create(struct room_stream **out, struct room *r,
                       const struct room_stream_config *cfg)
{
    *out = NULL;
    if (!cfg->n_speakers)
        return -EINVAL;
    for (size_t i = 0; i < cfg->n_speakers; i++)
        if (cfg->speakers[i] >= r->survey.n_speakers)
            return -EINVAL;
    struct room_stream *s = calloc(1, sizeof *s);
    if (!s)
        return -ENOMEM;
    size_t n_microphones = r->survey.n_microphones;
    s->room = r;
    s->cfg = *cfg;
    s->pass = (uint64_t)cfg->pass | (uint64_t)cfg->take << 8;
    s->n_speakers = cfg->n_speakers;
    s->n_ping = room_frames(r, 1);
    s->n_line = s->n_ping + r->n_heard + r->survey.slot_samples;
    s->speakers = malloc(cfg->n_speakers * sizeof *s->speakers);
    s->line = calloc(n_microphones * s->n_line, sizeof *s->line);
    s->ping = calloc(n_microphones * s->n_ping, sizeof *s->ping);
    s->interferes = calloc(r->interferers.n + 1, sizeof *s->interferes);
    if (!s->speakers || !s->line || !s->ping || !s->interferes) {
        room_stream_destroy(s);
        return -ENOMEM;
    }
    memcpy(s->speakers, cfg->speakers, cfg->n_speakers * sizeof *s->speakers);
    *out = s;
    return 0;
}

void room_stream_destroy(struct room_stream *s)
{
    if (!s)
        return;
    free(s->speakers);
    free(s->interferes);
    free(s->line);
    free(s->ping);
    free(s);
}

uint64_t room_stream_start(const struct room_stream *s, uint64_t n)
{
    const struct survey *survey = &s->room->survey;
    uint64_t round = n / s->n_speakers;
    uint64_t slot = round * survey_slots(survey, s->n_speakers) +
                    survey_slot_of(survey, n % s->n_speakers);
    return s->cfg.n_emissions ? slot * survey->slot_samples
                              : firing_start(&s->room->slots, slot);
}

/* Lets the line begin at a later sample. */
static void advance(struct room_stream *s, uint64_t base)
{
    uint64_t by = base - s->base;
    size_t keep = by < s->n_line ? s->n_line - (size_t)by : 0;
    for (size_t m = 0; m < s->room->survey.n_microphones; m++) {
        float *line = s->line + m * s->n_line;
        if (keep)
            memmove(line, line + by, keep * sizeof *line);
        memset(line + keep, 0, (s->n_line - keep) * sizeof *line);
    }
    s->base = base;
}

/* The noise of whole slots, up to a sample.  A slot that had begun before the line was
 * ignored. */
static void add_noise(struct room_stream *s, uint64_t until)
{
    const struct room *r = s->room;
    size_t slot_samples = r->survey.slot_samples;
    if (s->next_slot * slot_samples < s->base)
        s->next_slot = (s->base + slot_samples - 1) / slot_samples;
    for (; s->next_slot * slot_samples < until; s->next_slot++) {
        float *at = s->line + (size_t)(s->next_slot * slot_samples - s->base);
        uint64_t pass = s->pass, seed = r->scene->seed;
        double t_s = s->cfg.start_s +
                     (double)(s->next_slot * slot_samples) / r->survey.sample_rate_hz;
        noise_add(&r->noise, &r->drive, t_s,
                  (uint64_t[]){seed, NOISE_STREAM, pass, s->next_slot}, 4, at, s->n_line,
                  slot_samples);
        faults_add_noise(&r->faults, (uint64_t[]){seed, pass, NOISE_STREAM, s->next_slot},
                         FAULTS_NO_SPEAKER, at, s->n_line, slot_samples);
    }
}

/* Heard sound [n_microphones][n] onto the line from a sample of the stream on; what comes
 * before the line is over. */
static void add_to_line(struct room_stream *s, const float *heard, size_t n,
                        int64_t start)
{
    int64_t base = (int64_t)s->base;
    size_t skip = start < base ? (size_t)(base - start) : 0;
    size_t at = start < base ? 0 : (size_t)(start - base);
    if (skip >= n || at >= s->n_line)
        return;
    size_t left = n - skip, room = s->n_line - at;
    for (size_t m = 0; m < s->room->survey.n_microphones; m++) {
        const float *from = heard + m * n + skip;
        float *line = s->line + m * s->n_line + at;
        for (size_t i = 0; i < left && i < room; i++)
            line[i] += from[i];
    }
}

static int add_emission(struct room_stream *s, uint64_t n)
{
    struct room *r = s->room;
    size_t index = (size_t)(n % s->n_speakers);
    uint64_t start = room_stream_start(s, n);
    double since_s = (double)start / r->survey.sample_rate_hz;
    struct room_emission e = {.pass = s->cfg.pass,
                              .speaker = s->speakers[index],
                              .down = survey_is_down(&r->survey, index),
                              .t_s = s->cfg.start_s + since_s,
                              .position = s->cfg.position + (size_t)(n / s->n_speakers),
                              .stage_m = s->cfg.stage_m + s->cfg.stage_m_s * since_s,
                              .stage_m_s = s->cfg.stage_m_s};
    int err = hear(r, &e);
    if (err)
        return err;
    size_t at = start < s->base ? 0 : (size_t)(start - s->base);
    add_to_line(s, r->heard, r->n_heard, (int64_t)start);
    uint64_t words[] = {r->scene->seed, s->pass, NOISE_STREAM, n};
    if (start >= s->base)
        faults_add_noise(&r->faults, words, e.speaker, s->line + at, s->n_line,
                         r->survey.slot_samples);
    return 0;
}

/* Its sound, by the microphones' cables. */
static void add_interferer(struct room_stream *s, size_t interferer, uint64_t until)
{
    struct room *r = s->room;
    struct interferers *all = &r->interferers;
    const struct interferer *i = &all->list[interferer];
    double rate_hz = r->survey.sample_rate_hz;
    double since_s = s->cfg.start_s + (double)s->base / rate_hz;
    double until_s = s->cfg.start_s + (double)until / rate_hz;
    uint64_t first = interferer_next(i, since_s - (double)all->n_heard / rate_hz);
    uint64_t *next = &s->interferes[interferer];
    struct interferer_emission e;
    *next = *next > first ? *next : first;
    for (;; ++*next) {
        interferer_emission(i, r->scene->drive->period_s, *next, &e);
        if (e.t_s >= until_s)
            break;
        double at = (e.t_s - s->cfg.start_s) * rate_hz;
        if (!e.sounds || at + (double)all->n_heard <= (double)s->base)
            continue;
        hear_interferer(r, interferer, e.speaker, e.t_s, at - floor(at));
        add_to_line(s, all->heard, all->n_heard, (int64_t)floor(at));
    }
}

int room_stream_ping(struct room_stream *s, uint64_t n, const float **samples)
{
    struct room *r = s->room;
    uint64_t start = room_stream_start(s, n);
    if (n < s->asked)
        return -EINVAL;
    s->asked = n;
    bool longer = r->slots.jitter_samples || r->slots.stagger_samples;
    if (longer && start - s->base <= r->n_heard) /* between two pings, too */
        add_noise(s, start);
    advance(s, start);
    add_noise(s, start + s->n_ping);
    for (; room_stream_start(s, s->next) < start + s->n_ping; s->next++) {
        if (room_stream_start(s, s->next) + r->n_heard <= start ||
            (s->cfg.n_emissions && s->next >= s->cfg.n_emissions))
            continue;
        int err = add_emission(s, s->next);
        if (err)
            return err;
    }
    for (size_t i = 0; i < r->interferers.n && s->cfg.pass == PASS_SCENE; i++)
        add_interferer(s, i, start + s->n_ping);
    for (size_t m = 0; m < r->survey.n_microphones; m++)
        memcpy(s->ping + m * s->n_ping, s->line + m * s->n_line,
               s->n_ping * sizeof *s->ping);
    faults_limit(&r->faults, s->ping, s->n_ping, s->n_ping);
    *samples = s->ping;
    return 0;
}

int room_stream_round(struct room *r, enum pass pass, size_t round, float *samples)
{
    const struct survey *s = &r->survey;
    if (!s->continuous || round >= s->n_positions)
        return -EINVAL;
    uint32_t *speakers = malloc(s->n_speakers * sizeof *speakers);
    if (!speakers)
        return -ENOMEM;
    for (size_t j = 0; j < s->n_speakers; j++)
        speakers[j] = (uint32_t)j;
    const struct room_stream_config cfg = {.pass = pass,
                                           .speakers = speakers,
                                           .n_speakers = s->n_speakers,
                                           .stage_m = s->stage_positions_m[0],
                                           .stage_m_s = survey_speed_m_s(s),
                                           .n_emissions = s->n_positions * s->n_speakers};
    struct room_stream *stream = NULL;
    size_t n_ping = room_frames(r, 1), n = room_frames(r, s->n_speakers);
    uint64_t first = round * s->n_speakers;
    int err = room_stream_create(&stream, r, &cfg);
    for (uint64_t k = first; !err && k < first + s->n_speakers; k++) {
        const float *ping;
        err = room_stream_ping(stream, k, &ping);
        size_t at =
            (size_t)(room_stream_start(stream, k) - room_stream_start(stream, first));
        for (size_t m = 0; !err && m < s->n_microphones; m++)
            memcpy(samples + m * n + at, ping + m * n_ping, n_ping * sizeof *ping);
    }
    room_stream_destroy(stream);
    free(speakers);
    return err;
}

/* -- where everything is at a time, what is in view and until when ---------------------
 */

enum { SIGHT_STEPS = 20000 };
#define NS_PER_S     1e9
#define SIGHT_STEP_S 0.005

bool room_is_drive(const struct room *r)
{
    return r->scene->drive;
}

double room_period_s(const struct room *r)
{
    return r->scene->drive ? r->scene->drive->period_s : 0;
}

double room_time_s(const struct room *r, int64_t wall_ns)
{
    if (!r->scene->drive)
        return 0;
    int64_t period_ns = llround(r->scene->drive->period_s * NS_PER_S);
    int64_t t_ns = wall_ns % period_ns;
    return (double)(t_ns < 0 ? t_ns + period_ns : t_ns) / NS_PER_S;
}

/* Twice the area of the triangle p, q, r: above 0 when they turn left. */
static double turn(const double p[2], const double q[2], const double r[2])
{
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
}

static bool cross(const double a[2], const double b[2], const double p[2],
                  const double q[2])
{
    return (turn(a, b, p) > 0) != (turn(a, b, q) > 0) &&
           (turn(p, q, a) > 0) != (turn(p, q, b) > 0);
}

/* Does the straight line from a to b pass an outline of n >= 3 corners x, z?  Seen from
 * above: y does not count.  n = 0: nothing is in the way. */
static bool sight_clear(const double (*outline)[2], size_t n, const double a[3],
                        const double b[3])
{
    const double from[2] = {a[0], a[2]}, to[2] = {b[0], b[2]};
    for (size_t i = 0, j = n - 1; i < n; j = i++)
        if (cross(from, to, outline[j], outline[i]))
            return false;
    return true;
}

/* Does nothing stand between an object's centre and the array's? */
static bool sees(const struct room *r, size_t object, double t_s)
{
    struct drive_frame frame;
    double array[3], centre[3], velocity[3], extent[3];
    drive_frame(&r->drive, t_s, &frame);
    world_array_centre(&r->survey, array);
    drive_to_ground(&frame, array, array);
    traffic_object(&r->traffic, object, t_s, centre, velocity, extent);
    return sight_clear((const double(*)[2])r->scene->building, r->scene->n_building,
                       array, centre);
}

static int add_span(struct sight_spans *s, double from_s, double to_s)
{
    if (list_grow(&s->spans, s->n, &s->room, sizeof *s->spans))
        return -ENOMEM;
    s->spans[s->n++] = (struct sight_span){from_s, to_s};
    return 0;
}

/* When the answer changes between two times that have different ones. */
static double change_s(bool (*in_view)(void *ctx, double t_s), void *ctx, double a_s,
                       double b_s)
{
    bool before = in_view(ctx, a_s);
    for (int i = 0; i < 30; i++) {
        double middle_s = (a_s + b_s) / 2;
        if (in_view(ctx, middle_s) == before)
            a_s = middle_s;
        else
            b_s = middle_s;
    }
    return (a_s + b_s) / 2;
}

/* Asks in_view(ctx, t) at steps from one time to another and halves the steps where the
 * answer changes.  Adds to *out.  0, -ENOMEM. */
static int scan_sight(struct sight_spans *out, bool (*in_view)(void *ctx, double t_s),
                      void *ctx, double from_s, double to_s, double step_s)
{
    double begun_s = from_s, last_s = from_s;
    bool seen = in_view(ctx, from_s);
    while (last_s < to_s) {
        double t_s = fmin(last_s + step_s, to_s);
        if (in_view(ctx, t_s) != seen) {
            double at_s = change_s(in_view, ctx, last_s, t_s);
            if (seen && add_span(out, begun_s, at_s) < 0)
                return -ENOMEM;
            begun_s = at_s;
            seen = !seen;
        }
        last_s = t_s;
    }
    return seen ? add_span(out, begun_s, to_s) : 0;
}

/* Seconds from t until a span begins; 0 within one, NaN when none comes. */
static double until_sight_s(const struct sight_spans *s, double t_s)
{
    for (size_t i = 0; i < s->n; i++)
        if (t_s < s->spans[i].to_s)
            return fmax(s->spans[i].from_s - t_s, 0);
    return NAN;
}

struct watch { /* an object, from the array */
    const struct room *room;
    size_t object;
};

static bool is_in_view(void *ctx, double t_s)
{
    const struct watch *w = ctx;
    return sees(w->room, w->object, t_s);
}

/* Into r->sights, when each object of a drive is in view.  0, -ENOMEM. */
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
        err = scan_sight(&r->sights[i], is_in_view, &w, present_s ? present_s[0] : 0,
                         present_s ? present_s[1] : drive->period_s,
                         fmax(SIGHT_STEP_S, drive->period_s / SIGHT_STEPS));
    }
    return err;
}

/* A direction of the array frame in the vehicle's. */
static void turn_to_vehicle(const struct survey *s, const double v[3], double out[3])
{
    static const double nowhere[3] = {0, 0, 0};
    double origin[3];
    survey_to_vehicle(s, nowhere, origin);
    survey_to_vehicle(s, v, out);
    vector_add(out, -1, origin, out);
}

/* A size along axes: of the box around the turned box. */
static void turn_extent(const struct room *r, const struct drive_frame *frame,
                        const double extent[3], double out[3])
{
    memset(out, 0, 3 * sizeof *out);
    for (int a = 0; a < 3; a++) {
        double edge[3] = {0, 0, 0};
        edge[a] = extent[a];
        drive_turn_from_ground(frame, edge, edge);
        turn_to_vehicle(&r->survey, edge, edge);
        for (int k = 0; k < 3; k++)
            out[k] += fabs(edge[k]);
    }
}

static void tell(const struct room *r, size_t object, double t_s, struct room_truth *out)
{
    const struct survey *s = &r->survey;
    struct drive_frame frame;
    double centre[3], velocity[3], extent[3], p[3];
    drive_frame(&r->drive, t_s, &frame);
    traffic_object(&r->traffic, object, t_s, centre, velocity, extent);
    *out = (struct room_truth){.object = object};
    memcpy(out->name, r->world.objects[object].name, sizeof out->name);
    memcpy(out->kind, r->world.objects[object].kind, sizeof out->kind);
    drive_from_ground(&frame, centre, p);
    survey_to_vehicle(s, p, out->position_m);
    drive_turn_from_ground(&frame, velocity, p);
    turn_to_vehicle(s, p, out->velocity_m_s);
    turn_extent(r, &frame, extent, out->extent_m);
    vector_mirror(s->wall_normal, s->wall_distance_m, centre, p);
    drive_from_ground(&frame, p, out->virtual_m);
    out->line_of_sight = sees(r, object, t_s);
    out->until_sight_s = out->line_of_sight ? 0
                         : r->scene->drive  ? until_sight_s(&r->sights[object], t_s)
                                            : NAN;
}

size_t room_truth(const struct room *r, double t_s, struct room_truth *out, size_t max)
{
    size_t n = 0;
    t_s = drive_time_s(&r->drive, t_s);
    for (size_t i = 0; i < r->world.n_objects; i++) {
        if (!world_has(&r->scene->objects[i], t_s))
            continue;
        if (n < max)
            tell(r, i, t_s, &out[n]);
        n++;
    }
    return n;
}

void room_ego(const struct room *r, double t_s, struct room_ego *out)
{
    drive_ego(&r->drive, drive_time_s(&r->drive, t_s), out);
}

void room_wall(const struct room *r, double t_s, double normal[3], double *distance_m)
{
    const struct survey *s = &r->survey;
    struct drive_frame frame;
    drive_frame(&r->drive, drive_time_s(&r->drive, t_s), &frame);
    *distance_m = s->wall_distance_m - vector_dot(s->wall_normal, frame.origin_m);
    drive_turn_from_ground(&frame, s->wall_normal, normal);
}

void room_vehicle_wall(const struct room *r, double t_s, double normal[3],
                       double *distance_m)
{
    static const double zero[3] = {0.0, 0.0, 0.0};
    double n[3], origin[3], tip[3];

    room_wall(r, t_s, n, distance_m);
    survey_to_vehicle(&r->survey, zero, origin);
    survey_to_vehicle(&r->survey, n, tip);
    for (int a = 0; a < 3; a++)
        normal[a] = tip[a] - origin[a];
    *distance_m += vector_dot(normal, origin);
}

enum { PROBED_POSITIONS = 8, RING_SAMPLES = 256, STREAM_DRAWS = 12 };
#define TEMPERATURE_DEFAULT_C 20.0
#define SLOWEST_SOUND         0.85 /* of the nominal speed, with 30 K of drift */

/* -- how far sound gets -----------------------------------------------------------------
 */

#define STEP_S      0.02
#define STEPS       5000
#define EGO_MAX_M_S 30.0 /* as scene.c has it */

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
    float *chirp = firing_emission(&r->survey, down, &r->n_chirp);
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
        if (prepare_standing(r, false, PASS_SCENE, position, true, false) < 0)
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
