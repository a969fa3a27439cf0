#include "recon/geometry.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

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
    if (out->speakers_m && out->microphones_m && out->stage_positions_m)
        return 0;
    geometry_clear(out);
    return -ENOMEM;
}

void geometry_clear(struct geometry *g)
{
    free((void *)g->speakers_m);
    free((void *)g->microphones_m);
    free((void *)g->stage_positions_m);
    memset(g, 0, sizeof *g);
}

static void moved(const struct geometry *g, size_t position, const double at[3],
                  double out[3])
{
    for (int a = 0; a < 3; a++)
        out[a] = at[a] + g->stage_axis[a] * g->stage_positions_m[position];
}

void geometry_speaker(const struct geometry *g, size_t position, size_t speaker,
                      double out[3])
{
    moved(g, position, g->speakers_m[speaker], out);
}

void geometry_microphone(const struct geometry *g, size_t position, size_t microphone,
                         double out[3])
{
    moved(g, position, g->microphones_m[microphone], out);
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

void geometry_aperture(const struct geometry *g, double min[3], double max[3])
{
    for (int a = 0; a < 3; a++) {
        double s[2], m[2], shift[2] = {INFINITY, -INFINITY};
        extremes(g->speakers_m, g->n_speakers, a, &s[0], &s[1]);
        extremes(g->microphones_m, g->n_microphones, a, &m[0], &m[1]);
        for (size_t k = 0; k < g->n_positions; k++) {
            double d = g->stage_axis[a] * g->stage_positions_m[k];
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
