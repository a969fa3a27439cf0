/* SPDX-License-Identifier: MIT */
#include "recon/static_array/first_return.h"

#include <math.h>

#include "recon/geometry.h"

#define FADE_SAMPLES 8 /* a sharp edge rings in the interpolation */

void first_return_survey(struct first_return *f, const struct survey *s)
{
    if (!f->told)
        walls_from_survey(&f->walls, s);
}

void first_return_walls(struct first_return *f, const struct walls *walls,
                        int64_t stamp_ns)
{
    if (walls->n || f->told)
        *f = (struct first_return){*walls, true, stamp_ns};
}

/* By way of the nearest wall from a speaker to a microphone. */
static double earliest_s(const struct walls *walls, const struct survey *s,
                         const double from[3], const double to[3])
{
    double least_m = INFINITY, image[3];

    for (size_t i = 0; i < walls->n; i++) {
        wall_mirror(&walls->list[i].plane, to, image);
        least_m = fmin(least_m, geometry_distance(from, image));
    }
    return (least_m + 2.0 * FIRST_RETURN_M) / s->sound_speed_m_s;
}

static void mute_until(double end, size_t n, float complex *x)
{
    for (size_t k = 0; k < n && (double)k < end; k++) {
        double left = fmin((end - (double)k) / FADE_SAMPLES, 1.0);
        x[k] *= (float)(0.5 + 0.5 * cos(M_PI * left));
    }
}

void first_return_mute(const struct first_return *f, const struct survey *s,
                       const struct ego_path *path, size_t speaker, int64_t stamp_ns,
                       const struct trace_format *format, float complex *traces)
{
    struct walls walls = f->walls;
    struct ego_step step;

    if (!walls.n)
        return;
    if (f->told && path && !ego_path_between(path, f->stamp_ns, stamp_ns, &step))
        walls_step(&walls, s, &step);
    for (size_t m = 0; m < s->n_microphones; m++) {
        double end_s = earliest_s(&walls, s, s->speakers_m[speaker], s->microphones_m[m]);
        mute_until((end_s - format->t0_s) * format->rate_hz, format->n_samples,
                   traces + m * format->n_samples);
    }
}
