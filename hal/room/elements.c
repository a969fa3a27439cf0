/* SPDX-License-Identifier: MIT */
#include "hal/room/elements.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/random.h"
#include "hal/room/vector.h"
#include "hal/survey/response_file.h"

/* -- where they stand -------------------------------------------------------------------
 */

enum { STREAM_SPEAKERS = 5, STREAM_MICROPHONES = 6, STREAM_STAGE = 7 };

/* nominal NULL: 0. */
static void draw(double (*out)[3], const double (*nominal)[3], size_t n, double rms,
                 uint32_t seed, uint64_t stream)
{
    struct random r;
    random_seed(&r, (uint64_t[]){seed, stream}, 2);
    for (size_t i = 0; i < n; i++)
        for (int a = 0; a < 3; a++)
            out[i][a] = (nominal ? nominal[i][a] : 0.0) + rms * random_normal(&r);
}

int pose_create(struct pose *out, const struct survey *s, double element_m,
                double stage_m, uint32_t seed)
{
    struct pose p = {.survey = s};
    size_t size = sizeof *p.speakers_m;
    p.speakers_at_m = calloc(s->n_speakers, size);
    p.microphones_at_m = calloc(s->n_microphones, size);
    p.stage_errors_m = calloc(s->n_positions, size);
    p.speakers_m = calloc(s->n_speakers, size);
    p.microphones_m = calloc(s->n_microphones, size);
    p.speaker_images_m = calloc(s->n_speakers, size);
    p.microphone_images_m = calloc(s->n_microphones, size);
    *out = p;
    if (!p.speakers_at_m || !p.microphones_at_m || !p.stage_errors_m || !p.speakers_m ||
        !p.microphones_m || !p.speaker_images_m || !p.microphone_images_m) {
        pose_clear(out);
        return -ENOMEM;
    }
    draw(p.speakers_at_m, (const double(*)[3])s->speakers_m, s->n_speakers, element_m,
         seed, STREAM_SPEAKERS);
    draw(p.microphones_at_m, (const double(*)[3])s->microphones_m, s->n_microphones,
         element_m, seed, STREAM_MICROPHONES);
    draw(p.stage_errors_m, NULL, s->n_positions, stage_m, seed, STREAM_STAGE);
    return 0;
}

static void place(const struct survey *s, const double stage[3], size_t n,
                  const double (*at)[3], double (*out)[3], double (*images)[3])
{
    for (size_t i = 0; i < n; i++) {
        vector_add(at[i], 1, stage, out[i]);
        vector_mirror(s->wall_normal, s->wall_distance_m, out[i], images[i]);
    }
}

static void carry(struct pose *p, const double stage[3])
{
    const struct survey *s = p->survey;
    place(s, stage, s->n_speakers, (const double(*)[3])p->speakers_at_m, p->speakers_m,
          p->speaker_images_m);
    place(s, stage, s->n_microphones, (const double(*)[3])p->microphones_at_m,
          p->microphones_m, p->microphone_images_m);
}

void pose_move(struct pose *p, size_t position)
{
    const struct survey *s = p->survey;
    double stage[3];
    vector_add(p->stage_errors_m[position], s->stage_positions_m[position], s->stage_axis,
               stage);
    carry(p, stage);
}

void pose_go(struct pose *p, double stage_m)
{
    const struct survey *s = p->survey;
    const double *at_m = s->stage_positions_m;
    size_t last = s->n_positions - 1, k = 0;
    double stage[3], part = 0;
    if (last) { /* even steps, up or down */
        double along = (stage_m - at_m[0]) / (at_m[last] - at_m[0]) * (double)last;
        along = fmin(fmax(along, 0), (double)last);
        k = (size_t)fmin(floor(along), (double)(last - 1));
        part = along - (double)k;
    }
    for (int a = 0; a < 3; a++) {
        double before = p->stage_errors_m[k][a],
               behind = p->stage_errors_m[k + (last > 0)][a];
        stage[a] = stage_m * s->stage_axis[a] + before + part * (behind - before);
    }
    carry(p, stage);
}

void pose_clear(struct pose *p)
{
    free(p->speakers_at_m);
    free(p->microphones_at_m);
    free(p->stage_errors_m);
    free(p->speakers_m);
    free(p->microphones_m);
    free(p->speaker_images_m);
    free(p->microphone_images_m);
    *p = (struct pose){.survey = NULL};
}

/* -- what the microphones make of it ----------------------------------------------------
 */

enum { N_POINTS = 200, N_WAVES = 4, STREAM_CURVE = 3, STREAM_GAIN = 4 };
#define LOWEST_HZ 20.0

/* Some waves over the octaves, as housings and membranes make them. */
static void invent(struct survey_response *r, double ripple_db, double highest_hz,
                   struct random *random)
{
    double phase[N_WAVES], cycles[N_WAVES];
    for (int w = 0; w < N_WAVES; w++) {
        phase[w] = 2 * M_PI * random_even(random);
        cycles[w] = 0.5 + 3.5 * random_even(random);
    }
    for (int i = 0; i < N_POINTS; i++) {
        double x = (double)i / (N_POINTS - 1), sum = 0;
        for (int w = 0; w < N_WAVES; w++)
            sum += cos(2 * M_PI * cycles[w] * x + phase[w]);
        r->frequency_hz[i] = LOWEST_HZ * pow(highest_hz / LOWEST_HZ, x);
        r->gain_db[i] = ripple_db * sqrt(2.0 / N_WAVES) * sum;
    }
    r->n_points = N_POINTS;
}

int microphones_invent(struct survey *s, double ripple_db, uint32_t seed)
{
    s->responses = calloc(s->n_microphones, sizeof *s->responses);
    if (!s->responses)
        return -ENOMEM;
    for (size_t m = 0; m < s->n_microphones; m++) {
        struct survey_response *r = &s->responses[m];
        struct random random;
        s->n_responses = m + 1;
        random_seed(&random, (uint64_t[]){seed, STREAM_CURVE, m}, 3);
        snprintf(r->serial, sizeof r->serial, "sim%02zu", m);
        r->frequency_hz = malloc(N_POINTS * sizeof *r->frequency_hz);
        r->gain_db = malloc(N_POINTS * sizeof *r->gain_db);
        if (!r->frequency_hz || !r->gain_db)
            return -ENOMEM;
        invent(r, ripple_db, s->sample_rate_hz / 2, &random);
    }
    return 0;
}

void microphones_respond(const struct survey *s, double level, double gain_db,
                         uint32_t seed, size_t n_bins, double bin_hz, float *out)
{
    struct random random;
    random_seed(&random, (uint64_t[]){seed, STREAM_GAIN}, 2);
    for (size_t m = 0; m < s->n_microphones; m++) {
        double gain = level * pow(10, gain_db * random_normal(&random) / 20);
        for (size_t k = 0; k < n_bins; k++) {
            double curve =
                s->n_responses ? response_gain(&s->responses[m], (double)k * bin_hz) : 1;
            out[m * n_bins + k] = (float)(gain * curve);
        }
    }
}

/* -- what is wrong with them ------------------------------------------------------------
 */

enum { STREAM_FAULTS = 9 };

static struct fault *faults_of(const struct scene_fault *list, unsigned n_list, size_t n)
{
    struct fault *out = calloc(n, sizeof *out);
    for (size_t i = 0; out && i < n; i++)
        out[i] =
            (struct fault){.wired_to = i, .gain = 1, .covered = 1, .limit = INFINITY};
    for (unsigned k = 0; out && k < n_list; k++) {
        const struct scene_fault *s = &list[k];
        struct fault *f = &out[s->channel];
        double always_db = s->during_s ? 0 : s->gain_db;
        double gain = s->dead ? 0 : pow(10, always_db / 20);
        if (s->during_s) {
            f->covered = (float)pow(10, s->gain_db / 20);
            memcpy(f->during_s, s->during_s, sizeof f->during_s);
        }
        if (s->moved_m) {
            memcpy(f->moved_m, s->moved_m, sizeof f->moved_m);
            if (!s->during_s)
                f->during_s[1] = INFINITY;
        }
        f->gain = (float)(s->inverted ? -gain : gain);
        f->noise_rms = (float)s->noise_rms;
        if (s->limit)
            f->limit = (float)*s->limit;
        if (s->swapped_with) {
            f->wired_to = *s->swapped_with;
            out[*s->swapped_with].wired_to = s->channel;
        }
    }
    return out;
}

int faults_create(struct faults *out, const struct scene_faults *s, size_t n_speakers,
                  size_t n_microphones)
{
    out->n_speakers = n_speakers;
    out->n_microphones = n_microphones;
    out->speakers = faults_of(s->speakers, s->n_speakers, n_speakers);
    out->microphones = faults_of(s->microphones, s->n_microphones, n_microphones);
    if (out->speakers && out->microphones)
        return 0;
    faults_clear(out);
    return -ENOMEM;
}

void faults_clear(struct faults *f)
{
    free(f->speakers);
    free(f->microphones);
    *f = (struct faults){.speakers = NULL};
}

float faults_cover(const struct fault *f, double t_s)
{
    return t_s >= f->during_s[0] && t_s < f->during_s[1] ? f->covered : 1;
}

void faults_move(const struct fault *f, double t_s, const double p[3], double out[3])
{
    bool is = t_s >= f->during_s[0] && t_s < f->during_s[1];
    for (int k = 0; k < 3; k++)
        out[k] = p[k] + (is ? f->moved_m[k] : 0);
}

static size_t moves(const struct fault *f, size_t n, double t_s)
{
    size_t count = 0;
    for (size_t i = 0; i < n; i++)
        for (int k = 0; k < 2; k++)
            count += t_s >= f[i].during_s[k];
    return count;
}

size_t faults_moves(const struct faults *f, double t_s)
{
    return moves(f->speakers, f->n_speakers, t_s) +
           moves(f->microphones, f->n_microphones, t_s);
}

static void limit(const struct fault *f, float *x, size_t n)
{
    for (size_t i = 0; isfinite(f->limit) && i < n; i++)
        x[i] = fmaxf(-f->limit, fminf(f->limit, x[i]));
}

float *faults_emit(const struct faults *f, const float *chirp, size_t n_chirp)
{
    float *out = malloc(f->n_speakers * n_chirp * sizeof *out);
    for (size_t j = 0; out && j < f->n_speakers; j++) {
        float *emission = out + j * n_chirp;
        for (size_t i = 0; i < n_chirp; i++)
            emission[i] = f->speakers[j].gain * chirp[i];
        limit(&f->speakers[j], emission, n_chirp);
    }
    return out;
}

void faults_add_noise(const struct faults *f, const uint64_t words[4], size_t speaker,
                      float *samples, size_t stride, size_t n)
{
    for (size_t m = 0; m < f->n_microphones; m++) {
        bool own = speaker == FAULTS_NO_SPEAKER;
        float rms = own ? f->microphones[m].noise_rms : f->speakers[speaker].noise_rms;
        struct random random;
        if (!(rms > 0))
            continue;
        random_seed(&random,
                    (uint64_t[]){words[0], STREAM_FAULTS, words[1], words[2], words[3], m,
                                 own ? 0 : 1 + speaker},
                    7);
        random_add_noise(&random, samples + m * stride, n, rms);
    }
}

void faults_limit(const struct faults *f, float *samples, size_t stride, size_t n)
{
    for (size_t m = 0; m < f->n_microphones; m++)
        limit(&f->microphones[m], samples + m * stride, n);
}

void faults_record(const struct faults *f, const struct fault_slots *slots,
                   const uint64_t words[4], float *samples)
{
    size_t n = slots->n_frames, together = slots->together > 1 ? slots->together : 1;
    faults_add_noise(f, words, FAULTS_NO_SPEAKER, samples, n, n);
    for (size_t j = 0; j < slots->n_speakers; j++)
        faults_add_noise(f, words, slots->speakers[j],
                         samples + j / together * slots->slot_samples, n,
                         slots->slot_samples);
    faults_limit(f, samples, n, n);
}
