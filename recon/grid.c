/* SPDX-License-Identifier: MIT */
#include "recon/grid.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>

#define MAX_VOXELS ((size_t)1 << 28)

/* Beyond the array's own footprint a mirror-like object sends nothing back to it. */
#define MARGIN_M 0.05

/* Voxels in the width of a point: what its position needs to be read to a fiftieth. */
#define STEPS      3.6
#define MIN_STEP_M 0.005
#define MAX_STEP_M 0.05

void grid_place(const struct grid *g, size_t voxel, size_t at[3])
{
    at[0] = voxel % g->n[0];
    at[1] = voxel / g->n[0] % g->n[1];
    at[2] = voxel / (g->n[0] * g->n[1]);
}

size_t grid_neighbours(const struct grid *g, size_t voxel, size_t out[26])
{
    size_t at[3], n = 0;
    grid_place(g, voxel, at);
    for (int dz = -1; dz <= 1; dz++) {
        for (int dy = -1; dy <= 1; dy++) {
            for (int dx = -1; dx <= 1; dx++) {
                size_t x = at[0] + (size_t)dx, y = at[1] + (size_t)dy,
                       z = at[2] + (size_t)dz;
                if ((dx || dy || dz) && x < g->n[0] && y < g->n[1] && z < g->n[2])
                    out[n++] = (z * g->n[1] + y) * g->n[0] + x;
            }
        }
    }
    return n;
}

static double nice_step(double step)
{
    double decade = pow(10.0, floor(log10(step)));
    static const double steps[] = {5.0, 2.5, 2.0, 1.0};
    for (int i = 0; i < 4; i++)
        if (steps[i] * decade <= step)
            return steps[i] * decade;
    return decade;
}

static void set_axis(struct grid *g, int axis, double min, double max, double step)
{
    g->origin_m[axis] = min;
    g->step_m[axis] = step;
    g->n[axis] = (size_t)floor((max - min) / step + 1e-6) + 1;
}

/* A step that divides the stage's, so that back-projection takes its fast way. */
static double divide_pitch(const struct geometry *g, double step_m)
{
    if (g->n_positions < 2 || g->stage_axis[0] < 0.999)
        return step_m;
    double travel_m = g->stage_positions_m[g->n_positions - 1] - g->stage_positions_m[0];
    double pitch_m = travel_m / (double)(g->n_positions - 1);
    return pitch_m > 0.5 * step_m ? pitch_m / fmax(rint(pitch_m / step_m), 1.0) : step_m;
}

void grid_default(struct grid *out, const struct geometry *g, const double gate_m[2],
                  const double band_hz[2])
{
    double min[3], max[3];
    geometry_aperture(g, min, max);
    double width_m[3];
    geometry_resolution(g, band_hz, 0.5 * (gate_m[0] + gate_m[1]), width_m);
    for (int a = 0; a < 2; a++) {
        double step_m = fmin(fmax(width_m[a] / STEPS, MIN_STEP_M), MAX_STEP_M);
        step_m = nice_step(step_m);
        if (a == 0)
            step_m = divide_pitch(g, step_m);
        set_axis(out, a, min[a] - MARGIN_M, max[a] + MARGIN_M, step_m);
    }
    double step_m = nice_step(width_m[2] / STEPS);
    double first_m = ceil((max[2] + gate_m[0]) / step_m - 1e-6) * step_m;
    set_axis(out, 2, first_m, max[2] + gate_m[1], step_m);
}

int grid_from_limits(struct grid *out, const double limits[3][3])
{
    double voxels = 1.0;
    for (int a = 0; a < 3; a++) {
        double min = limits[a][0], max = limits[a][1], step = limits[a][2];
        if (!(step > 0.0) || !(max >= min) || !isfinite(max - min + step))
            return -EINVAL;
        voxels *= floor((max - min) / step + 1e-6) + 1.0;
        if (voxels > (double)MAX_VOXELS)
            return -EFBIG;
        set_axis(out, a, min, max, step);
    }
    return 0;
}

/* Nearest and farthest distance from a point to the box of the grid. */
static void box_distances(const struct grid *g, const double p[3], double *near,
                          double *far)
{
    double near2 = 0.0, far2 = 0.0;
    for (int a = 0; a < 3; a++) {
        double low = g->origin_m[a];
        double high = low + (double)(g->n[a] - 1) * g->step_m[a];
        double outside = fmax(fmax(low - p[a], p[a] - high), 0.0);
        double across = fmax(fabs(low - p[a]), fabs(high - p[a]));
        near2 += outside * outside;
        far2 += across * across;
    }
    *near = sqrt(near2);
    *far = sqrt(far2);
}

/* Nearest and farthest distance from any speaker of a position, or any microphone; of a
 * stage that does not stop, when the first or the last speaker sounds. */
static void elements_distances(const struct grid *grid, const struct geometry *g,
                               size_t position, bool microphones, double out[2])
{
    size_t last = geometry_places(g) > 1 ? g->n_speakers - 1 : 0;
    size_t n = microphones ? g->n_microphones : g->n_speakers;
    out[0] = INFINITY;
    out[1] = 0.0;
    for (size_t e = 0; e < n; e++) {
        double p[3], near, far;
        for (size_t speaker = 0; speaker <= last; speaker += last ? last : 1) {
            if (microphones)
                geometry_microphone(g, position, speaker, e, p);
            else
                geometry_speaker(g, position, e, p);
            box_distances(grid, p, &near, &far);
            out[0] = fmin(out[0], near);
            out[1] = fmax(out[1], far);
        }
    }
}

void grid_delays(const struct grid *grid, const struct geometry *g, double delays_s[2])
{
    delays_s[0] = INFINITY;
    delays_s[1] = 0.0;
    for (size_t k = 0; k < g->n_positions; k++) {
        double in[2], out[2];
        elements_distances(grid, g, k, false, in);
        elements_distances(grid, g, k, true, out);
        delays_s[0] = fmin(delays_s[0], (in[0] + out[0]) / g->sound_speed_m_s);
        delays_s[1] = fmax(delays_s[1], (in[1] + out[1]) / g->sound_speed_m_s);
    }
}
