/* SPDX-License-Identifier: MIT */
#include "hal/room/slams.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "hal/random.h"
#include "hal/room/vector.h"

enum { STREAM_SLAM = 13, DECAYS = 8 /* 69 dB down */ };

static int create_one(struct slam *out, const struct scene_slam *from, size_t number,
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

int slams_create(struct slams *out, const struct scene *scene, const struct survey *s,
                 double sound_speed_m_s)
{
    unsigned n = scene->drive ? scene->noise->n_slams : 0;
    *out = (struct slams){.n_microphones = s->n_microphones,
                          .sample_rate_hz = s->sample_rate_hz};
    if (!n)
        return 0;
    out->period_s = scene->drive->period_s;
    out->list = calloc(n, sizeof *out->list);
    if (!out->list)
        return -ENOMEM;
    for (out->n = 0; out->n < n; out->n++)
        if (create_one(&out->list[out->n], &scene->noise->slams[out->n], out->n,
                       scene->seed, s, sound_speed_m_s) < 0) {
            out->n++;
            slams_clear(out);
            return -ENOMEM;
        }
    return 0;
}

void slams_clear(struct slams *s)
{
    for (size_t i = 0; i < s->n; i++) {
        free(s->list[i].heard_s);
        free(s->list[i].wave);
    }
    free(s->list);
    *s = (struct slams){.n = 0};
}

/* What of it sounds is where the time since it began is within its wave; the drive
 * repeats. */
static void add_one(const struct slams *s, const struct slam *slam, double since_s,
                    float *x, size_t n)
{
    double turn_s = fmod(since_s, s->period_s);
    int64_t period = llround(s->period_s * s->sample_rate_hz);
    int64_t at =
        llround((turn_s < 0 ? turn_s + s->period_s : turn_s) * s->sample_rate_hz);
    for (size_t i = 0; i < n; i++, at++) {
        at = at >= period ? at - period : at;
        if (at < (int64_t)slam->n_wave)
            x[i] += slam->wave[at];
    }
}

void slams_add(const struct slams *s, double t_s, float *samples, size_t stride, size_t n)
{
    for (size_t i = 0; i < s->n; i++)
        for (size_t m = 0; m < s->n_microphones; m++)
            add_one(s, &s->list[i], t_s - s->list[i].heard_s[m], samples + m * stride, n);
}
