/* SPDX-License-Identifier: MIT */
#include "hal/room/noise.h"

#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "hal/random.h"
#include "hal/room/elements.h"
#include "hal/room/propagate.h"
#include "hal/room/vector.h"
#include "hal/survey/firing.h"

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

/* -- other arrays -----------------------------------------------------------------------
 */

enum { STREAM_INTERFERER = 16, RING_SAMPLES = 256 };
#define SLOWEST_SOUND 0.85 /* of the nominal speed, with 30 K of drift */

/* Its elements stand as ours do, turned about the upright axis and moved. */
static int place(struct interferer *out, const struct survey *s)
{
    double up[3], middle[3] = {0, 0, 0}, turn = out->scene->turn_deg * M_PI / 180;
    out->speakers_m = calloc(s->n_speakers, sizeof *out->speakers_m);
    if (!out->speakers_m)
        return -ENOMEM;
    out->n_speakers = s->n_speakers;
    scene_up(s, up);
    for (size_t i = 0; i < s->n_speakers; i++)
        vector_add(middle, 1.0 / (double)s->n_speakers, s->speakers_m[i], middle);
    for (size_t i = 0; i < s->n_speakers; i++) { /* Rodrigues 1840 */
        double p[3], across[3], *at = out->speakers_m[i];
        vector_add(s->speakers_m[i], -1, middle, p);
        vector_cross(up, p, across);
        vector_add(out->scene->position_m, cos(turn), p, at);
        vector_add(at, sin(turn), across, at);
        vector_add(at, (1 - cos(turn)) * vector_dot(up, p), up, at);
    }
    return 0;
}

/* Beyond the plane of the wall it is heard where there is none in between. */
static void set_gains(struct interferer *i, const struct interferers_config *cfg)
{
    const struct mirror *m = cfg->mirror;
    double side = vector_dot(m->normal, i->scene->position_m) - m->distance_m;
    double origin[3] = {0, 0, 0}, meets[3];
    bool beyond = side * m->distance_m > 0;
    vector_add(origin, m->distance_m / (side + m->distance_m), i->scene->position_m,
               meets);
    i->direct = beyond && mirror_is_at(m, meets) ? 0 : 1;
    i->wall_echo = beyond ? 0 : cfg->scene->wall_sound->reflectivity;
}

static int create_emitter(struct interferer *i, const struct interferers_config *cfg,
                          size_t n_heard)
{
    const struct survey *s = cfg->survey;
    size_t n_bins = n_heard / 2 + 1, n_chirp;
    float *chirp = firing_emission(s, i->scene->down, &n_chirp);
    float *responses = malloc(s->n_microphones * n_bins * sizeof *responses);
    int err = chirp && responses ? 0 : -ENOMEM;
    if (!err) {
        double level = *cfg->scene->level * pow(10, i->scene->level_db / 20);
        microphones_respond(s, level, cfg->scene->errors->gain_db, cfg->scene->seed,
                            n_bins, s->sample_rate_hz / (double)n_heard, responses);
        for (size_t k = 0; k < s->n_microphones * n_bins; k++)
            responses[k] *= cfg->faults->microphones[k / n_bins].gain;
        err = emitter_create(&i->emitter,
                             &(struct emitter_config){.sample_rate_hz = s->sample_rate_hz,
                                                      .n_samples = n_heard,
                                                      .n_speakers = 1,
                                                      .n_microphones = s->n_microphones,
                                                      .emissions = {chirp, NULL},
                                                      .n_chirp = n_chirp,
                                                      .responses = responses});
    }
    free(chirp);
    free(responses);
    return err;
}

static int create_one(struct interferer *out, const struct interferers_config *cfg,
                      unsigned number, size_t n_heard)
{
    const struct survey *s = cfg->survey;
    const struct scene_interferer *from = &cfg->scene->interferers[number];
    uint64_t seed = (uint64_t)cfg->scene->seed << 32 | STREAM_INTERFERER << 16 | number;
    struct survey of_its = *s; /* borrows */
    if (from->slot_samples)
        of_its.slot_samples = *from->slot_samples;
    const struct firing firing = {.jitter_samples = from->jitter_samples};
    bool staggers = !from->stagger || *from->stagger;
    *out =
        (struct interferer){.scene = from,
                            .clock_hz = s->sample_rate_hz * (1 + 1e-6 * from->clock_ppm),
                            .slots = firing_slots(&of_its, &firing, staggers, seed)};
    set_gains(out, cfg);
    int err = place(out, s);
    return err ? err : create_emitter(out, cfg, n_heard);
}

int interferers_create(struct interferers *out, const struct interferers_config *cfg)
{
    unsigned n = cfg->scene->drive ? cfg->scene->n_interferers : 0;
    const struct survey *s = cfg->survey;
    double away_m = 0;
    *out = (struct interferers){.n = 0};
    if (!n)
        return 0;
    for (unsigned i = 0; i < n; i++) {
        const double *p = cfg->scene->interferers[i].position_m;
        away_m = fmax(away_m, sqrt(vector_dot(p, p)));
    }
    double latest_s = (away_m + cfg->longest_m) / (SLOWEST_SOUND * cfg->sound_speed_m_s);
    out->n_heard = propagate_length(
        (size_t)((latest_s + s->chirp_duration_s) * s->sample_rate_hz) + RING_SAMPLES);
    out->list = calloc(n, sizeof *out->list);
    out->heard = calloc(s->n_microphones * out->n_heard, sizeof *out->heard);
    int err = out->list && out->heard ? 0 : -ENOMEM;
    for (; out->n < n && !err; out->n++)
        err = create_one(&out->list[out->n], cfg, (unsigned)out->n, out->n_heard);
    if (err)
        interferers_clear(out);
    return err;
}

void interferers_clear(struct interferers *all)
{
    for (size_t i = 0; i < all->n; i++) {
        emitter_destroy(all->list[i].emitter);
        free(all->list[i].speakers_m);
    }
    free(all->list);
    free(all->heard);
    *all = (struct interferers){.n = 0};
}

void interferer_emission(const struct interferer *i, double period_s, uint64_t number,
                         struct interferer_emission *out)
{
    const double *during_s = i->scene->during_s;
    out->t_s = i->scene->start_s + (double)firing_start(&i->slots, number) / i->clock_hz;
    out->speaker = (size_t)(number % i->n_speakers);
    double at_s = fmod(out->t_s, period_s);
    out->sounds = !during_s || (at_s >= during_s[0] && at_s < during_s[1]);
}

uint64_t interferer_next(const struct interferer *i, double t_s)
{
    return firing_slot_before(&i->slots, (t_s - i->scene->start_s) * i->clock_hz);
}
