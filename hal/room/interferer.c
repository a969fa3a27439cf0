/* SPDX-License-Identifier: MIT */
#include "hal/room/interferer.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hal/room/elements.h"
#include "hal/room/propagate.h"
#include "hal/room/vector.h"
#include "hal/survey/firing.h"

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
