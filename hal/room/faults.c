/* SPDX-License-Identifier: MIT */
#include "hal/room/faults.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "hal/random.h"

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
