/* SPDX-License-Identifier: MIT */
#include "hal/room/noise.h"

#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "hal/random.h"
#include "hal/room/vector.h"

enum {
    STREAM_SLAM = 13,
    STREAM_COMB = 17,
    STREAM_TONE_GAIN = 18,
    DECAYS = 8,    /* 69 dB down */
    STRETCH = 256, /* samples for which a frequency stays what it is */
};
#define WANDER_S 10.0

static int create_slam(struct slam *out, const struct scene_slam *from, size_t number,
                       uint32_t seed, const struct survey *s, double sound_speed_m_s)
{
    struct random r;
    random_seed(&r, (uint64_t[]){seed, STREAM_SLAM, number}, 3);
    double at_s = from->during_s[0] +
                  random_even(&r) * (from->during_s[1] - from->during_s[0]);
    out->n_wave = (size_t)(DECAYS * from->decay_s * s->sample_rate_hz);
    out->heard_s = calloc(s->n_microphones, sizeof *out->heard_s);
    out->wave = calloc(out->n_wave + 1, sizeof *out->wave);
    if (!out->heard_s || !out->wave)
        return -ENOMEM;
    for (size_t i = 0; i < out->n_wave; i++)
        out->wave[i] = (float)(from->peak * random_normal(&r) *
                               exp(-(double)i / (from->decay_s * s->sample_rate_hz)));
    for (size_t m = 0; m < s->n_microphones; m++) {
        double way[3] = {0, 0, 0};
        if (from->position_m)
            vector_add(from->position_m, -1, s->microphones_m[m], way);
        out->heard_s[m] = at_s + sqrt(vector_dot(way, way)) / sound_speed_m_s;
    }
    return 0;
}

int noise_create(struct noise *out, const struct scene *scene, const struct survey *s,
                 double sound_speed_m_s)
{
    unsigned n = scene->drive ? scene->noise->n_slams : 0;
    *out = (struct noise){.scene = scene->noise,
                          .seed = scene->seed,
                          .n_microphones = s->n_microphones,
                          .sample_rate_hz = s->sample_rate_hz};
    if (!n)
        return 0;
    out->period_s = scene->drive->period_s;
    out->slams = calloc(n, sizeof *out->slams);
    if (!out->slams)
        return -ENOMEM;
    for (out->n_slams = 0; out->n_slams < n; out->n_slams++)
        if (create_slam(&out->slams[out->n_slams], &scene->noise->slams[out->n_slams],
                        out->n_slams, scene->seed, s, sound_speed_m_s) < 0) {
            out->n_slams++;
            noise_clear(out);
            return -ENOMEM;
        }
    return 0;
}

void noise_clear(struct noise *x)
{
    for (size_t i = 0; i < x->n_slams; i++) {
        free(x->slams[i].heard_s);
        free(x->slams[i].wave);
    }
    free(x->slams);
    *x = (struct noise){.n_slams = 0};
}

/* What of it sounds is where the time since it began is within its wave; the drive
 * repeats. */
static void add_slam(const struct noise *x, const struct slam *slam, double since_s,
                     float *samples, size_t n)
{
    double turn_s = fmod(since_s, x->period_s);
    int64_t period = llround(x->period_s * x->sample_rate_hz);
    int64_t at =
        llround((turn_s < 0 ? turn_s + x->period_s : turn_s) * x->sample_rate_hz);
    for (size_t i = 0; i < n; i++, at++) {
        at = at >= period ? at - period : at;
        if (at < (int64_t)slam->n_wave)
            samples[i] += slam->wave[at];
    }
}

static bool sounds(const struct scene_tone *tone, const struct drive *drive, double t_s)
{
    if (!tone->during_s)
        return true;
    double at_s = drive_time_s(drive, t_s);
    return at_s >= tone->during_s[0] && at_s < tone->during_s[1];
}

/* Cycles of the fundamental since world time 0. */
static double cycles(const struct scene_tone *tone, double t_s)
{
    double turn = 2 * M_PI / WANDER_S;
    return tone->frequency_hz * (t_s + tone->wander * (1 - cos(turn * t_s)) / turn);
}

/* Harmonics of a stretch; a sine goes on by turning a phasor. */
static void make_stretch(const struct scene_tone *tone, struct random phases, double t_s,
                         double sample_rate_hz, double out[STRETCH])
{
    uint32_t one[2] = {1, tone->harmonics ? tone->harmonics : 1};
    const uint32_t *comb = tone->comb ? tone->comb : one;
    double begins = cycles(tone, t_s);
    double step = (cycles(tone, t_s + STRETCH / sample_rate_hz) - begins) / STRETCH;
    memset(out, 0, STRETCH * sizeof *out);
    for (uint32_t h = comb[0]; h <= comb[1] && h * step < 0.5; h++) {
        double level = tone->comb ? 1 / sqrt(comb[1] - comb[0] + 1.0) : 1.0 / h;
        double phase = tone->comb ? random_even(&phases) : 0;
        double complex z = M_SQRT2 * tone->rms * level *
                           cexp(2 * M_PI * I * fmod(h * begins + phase, 1));
        double complex turn = cexp(2 * M_PI * I * h * step);
        for (int i = 0; i < STRETCH; i++, z *= turn)
            out[i] += cimag(z);
    }
}

static void add_tone(const struct noise *x, unsigned number, double t_s, float *samples,
                     size_t stride, size_t n)
{
    const struct scene_tone *tone = &x->scene->tones[number];
    double stretch[STRETCH];
    struct random phases, gains;
    random_seed(&phases, (uint64_t[]){x->seed, STREAM_COMB, number}, 3);
    for (size_t from = 0; from < n; from += STRETCH) {
        make_stretch(tone, phases, t_s + (double)from / x->sample_rate_hz,
                     x->sample_rate_hz, stretch);
        random_seed(&gains, (uint64_t[]){x->seed, STREAM_TONE_GAIN, number}, 3);
        for (size_t m = 0; m < x->n_microphones; m++) {
            double gain = pow(10, tone->spread_db * random_normal(&gains) / 20);
            for (size_t i = from; i < n && i < from + STRETCH; i++)
                samples[m * stride + i] += (float)(gain * stretch[i - from]);
        }
    }
}

static double hiss_rms(const struct noise *x, const struct drive *drive, double t_s)
{
    const struct scene_noise *scene = x->scene;
    double rms = x->rms, at_s = scene->n_rises ? drive_time_s(drive, t_s) : 0;
    for (unsigned i = 0; i < scene->n_rises; i++)
        if (at_s >= scene->rises[i].during_s[0] && at_s < scene->rises[i].during_s[1])
            rms *= pow(10, scene->rises[i].by_db / 20);
    return rms;
}

void noise_add(const struct noise *x, const struct drive *drive, double t_s,
               const uint64_t *words, size_t n_words, float *samples, size_t stride,
               size_t n)
{
    float rms = (float)hiss_rms(x, drive, t_s);
    struct random random;
    for (size_t i = 0; i < x->n_slams; i++)
        for (size_t m = 0; m < x->n_microphones; m++)
            add_slam(x, &x->slams[i], t_s - x->slams[i].heard_s[m], samples + m * stride,
                     n);
    for (unsigned i = 0; i < x->scene->n_tones; i++)
        if (sounds(&x->scene->tones[i], drive, t_s))
            add_tone(x, i, t_s, samples, stride, n);
    if (!(rms > 0))
        return;
    random_seed(&random, words, n_words);
    if (stride == n)
        random_add_noise(&random, samples, x->n_microphones * n, rms);
    for (size_t m = 0; m < x->n_microphones && stride != n; m++)
        random_add_noise(&random, samples + m * stride, n, rms);
}
