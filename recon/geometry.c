/* SPDX-License-Identifier: MIT */
#include "recon/geometry.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define STAGE_OFF_M 1e-4 /* that a stage position may be off its place */

static void *duplicate(const void *data, size_t size)
{
    void *copy = malloc(size ? size : 1);
    if (copy && size)
        memcpy(copy, data, size);
    return copy;
}

int geometry_copy(struct geometry *out, const struct geometry *g)
{
    *out = *g;
    out->speakers_m = duplicate(g->speakers_m, g->n_speakers * sizeof *g->speakers_m);
    out->microphones_m =
        duplicate(g->microphones_m, g->n_microphones * sizeof *g->microphones_m);
    out->stage_positions_m =
        duplicate(g->stage_positions_m, g->n_positions * sizeof *g->stage_positions_m);
    if (g->pings_m)
        out->pings_m = duplicate(g->pings_m, g->n_positions * sizeof *g->pings_m);
    if (out->speakers_m && out->microphones_m && out->stage_positions_m &&
        (!g->pings_m || out->pings_m))
        return 0;
    geometry_clear(out);
    return -ENOMEM;
}

void geometry_clear(struct geometry *g)
{
    free((void *)g->speakers_m);
    free((void *)g->microphones_m);
    free((void *)g->stage_positions_m);
    free((void *)g->pings_m);
    memset(g, 0, sizeof *g);
}

size_t geometry_places(const struct geometry *g)
{
    return g->slot_m == 0.0 ? 1 : g->n_speakers;
}

size_t geometry_place(const struct geometry *g, size_t speaker)
{
    return g->slot_m == 0.0 ? 0 : speaker;
}

double geometry_gone_on_m(const struct geometry *g, size_t speaker)
{
    size_t slot = g->together > 1 ? speaker / g->together : speaker;
    return g->chirp_m[speaker % 2] + g->slot_m * (double)slot;
}

struct geometry geometry_standing(const struct geometry *g)
{
    struct geometry out = *g;
    out.slot_m = out.chirp_m[0] = out.chirp_m[1] = out.echo_m = 0.0;
    return out;
}

static void moved(const struct geometry *g, size_t position, double further_m,
                  const double at[3], double out[3])
{
    double stage_m = g->stage_positions_m[position] + further_m;
    for (int a = 0; a < 3; a++)
        out[a] = at[a] + g->stage_axis[a] * stage_m;
}

void geometry_speaker(const struct geometry *g, size_t position, size_t speaker,
                      double out[3])
{
    if (g->pings_m)
        memcpy(out, g->pings_m[position][0], 3 * sizeof *out);
    else
        moved(g, position, geometry_gone_on_m(g, speaker), g->speakers_m[speaker], out);
}

void geometry_microphone(const struct geometry *g, size_t position, size_t speaker,
                         size_t microphone, double out[3])
{
    if (g->pings_m)
        memcpy(out, g->pings_m[position][1], 3 * sizeof *out);
    else
        moved(g, position, geometry_gone_on_m(g, speaker) + g->echo_m,
              g->microphones_m[microphone], out);
}

static void extremes(const double (*at)[3], size_t n, int axis, double *min, double *max)
{
    *min = INFINITY;
    *max = -INFINITY;
    for (size_t i = 0; i < n; i++) {
        *min = fmin(*min, at[i][axis]);
        *max = fmax(*max, at[i][axis]);
    }
}

static void pings_aperture(const struct geometry *g, double min[3], double max[3])
{
    for (int a = 0; a < 3; a++) {
        min[a] = INFINITY;
        max[a] = -INFINITY;
        for (size_t k = 0; k < g->n_positions; k++) {
            double middle = 0.5 * (g->pings_m[k][0][a] + g->pings_m[k][1][a]);
            min[a] = fmin(min[a], middle);
            max[a] = fmax(max[a], middle);
        }
    }
}

size_t geometry_stage_stride(const struct geometry *g, double step_m)
{
    size_t last = g->n_positions - 1;
    if (g->pings_m || g->n_positions < 2 || fabs(g->stage_axis[0] - 1.0) > 1e-9)
        return 0;
    double travel_m = g->stage_positions_m[last] - g->stage_positions_m[0];
    double stride = rint(travel_m / (double)last / step_m);
    if (stride < 1.0)
        return 0;
    for (size_t k = 0; k <= last; k++) {
        double at = g->stage_positions_m[0] + (double)k * stride * step_m;
        if (fabs(at - g->stage_positions_m[k]) > STAGE_OFF_M)
            return 0;
    }
    return (size_t)stride;
}

void geometry_aperture(const struct geometry *g, double min[3], double max[3])
{
    if (g->pings_m) {
        pings_aperture(g, min, max);
        return;
    }
    for (int a = 0; a < 3; a++) {
        double s[2], m[2], shift[2] = {INFINITY, -INFINITY};
        extremes(g->speakers_m, g->n_speakers, a, &s[0], &s[1]);
        extremes(g->microphones_m, g->n_microphones, a, &m[0], &m[1]);
        for (size_t k = 0; k < g->n_positions * 2; k++) {
            size_t speaker = k % 2 ? g->n_speakers - 1 : 0;
            double on_m = geometry_gone_on_m(g, speaker) + 0.5 * g->echo_m;
            double d = g->stage_axis[a] * (g->stage_positions_m[k / 2] + on_m);
            shift[0] = fmin(shift[0], d);
            shift[1] = fmax(shift[1], d);
        }
        min[a] = 0.5 * (s[0] + m[0]) + shift[0];
        max[a] = 0.5 * (s[1] + m[1]) + shift[1];
    }
}

void geometry_resolution(const struct geometry *g, const double band_hz[2],
                         double range_m, double out[3])
{
    double min[3], max[3];
    double wavelength_m = 2.0 * g->sound_speed_m_s / (band_hz[0] + band_hz[1]);
    geometry_aperture(g, min, max);
    for (int a = 0; a < 2; a++) {
        double aperture_m = max[a] - min[a];
        out[a] = aperture_m > 0.0 ? 1.207 * wavelength_m * range_m / (2.0 * aperture_m)
                                  : INFINITY;
    }
    out[2] = g->sound_speed_m_s / (band_hz[1] - band_hz[0]);
}

void geometry_pair(const struct geometry *g, size_t trace, double speaker[3],
                   double microphone[3])
{
    size_t ping = trace / g->n_microphones, position = ping / g->n_speakers;
    geometry_speaker(g, position, ping % g->n_speakers, speaker);
    geometry_microphone(g, position, ping % g->n_speakers, trace % g->n_microphones,
                        microphone);
}

double geometry_distance(const double a[3], const double b[3])
{
    double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return sqrt(x * x + y * y + z * z);
}

void geometry_direction(const double at_m[3], const double speaker_m[3],
                        const double microphone_m[3], double out[3])
{
    double rs = geometry_distance(at_m, speaker_m);
    double rm = geometry_distance(at_m, microphone_m);
    for (int a = 0; a < 3; a++)
        out[a] = (rs > 0.0 ? (at_m[a] - speaker_m[a]) / rs : 0.0) +
                 (rm > 0.0 ? (at_m[a] - microphone_m[a]) / rm : 0.0);
}

void geometry_resolution_at(const struct geometry *g, const double band_hz[2],
                            const double at_m[3], double out[3])
{
    double low[3] = {INFINITY, INFINITY, INFINITY};
    double high[3] = {-INFINITY, -INFINITY, -INFINITY};
    size_t n = g->n_positions * g->n_speakers * g->n_microphones;
    for (size_t t = 0; t < n; t++) {
        double s[3], m[3], u[3];
        geometry_pair(g, t, s, m);
        geometry_direction(at_m, s, m, u);
        for (int a = 0; a < 3; a++) {
            low[a] = fmin(low[a], u[a]);
            high[a] = fmax(high[a], u[a]);
        }
    }
    double wavelength_m = 2.0 * g->sound_speed_m_s / (band_hz[0] + band_hz[1]);
    double depth_m = g->sound_speed_m_s / (band_hz[1] - band_hz[0]);
    for (int a = 0; a < 3; a++) {
        double by_pings = (high[a] - low[a]) / (1.207 * wavelength_m);
        double by_band = fmax(fabs(low[a]), fabs(high[a])) / (2.0 * depth_m);
        out[a] = 1.0 / hypot(by_pings, by_band);
    }
}
