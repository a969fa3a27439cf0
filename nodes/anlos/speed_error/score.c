/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/speed_error/score.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"

bool bench_truth_depth(const struct bench_truth *t, double z_m[2])
{
    z_m[0] = INFINITY;
    z_m[1] = -INFINITY;
    for (size_t i = 0; i < t->n_points + t->n_masks; i++) {
        double z = i < t->n_points ? t->points_m[i][2] : t->masks[i - t->n_points].z_m;
        z_m[0] = fmin(z_m[0], z);
        z_m[1] = fmax(z_m[1], z);
    }
    return t->n_points + t->n_masks > 0;
}

bool bench_truth_covers(const struct bench_truth *t, double x_m, double y_m)
{
    for (size_t i = 0; i < t->n_masks; i++) {
        const struct bench_mask *m = &t->masks[i];
        double x = x_m - m->centre_m[0], y = y_m - m->centre_m[1];
        for (size_t b = 0; b < m->n_bars; b++)
            if (x >= m->bars_m[b][0] && x <= m->bars_m[b][1] && y >= m->bars_m[b][2] &&
                y <= m->bars_m[b][3])
                return true;
    }
    return false;
}

int bench_truth_add_point(struct bench_truth *t, const double at_m[3], struct error *why)
{
    if (t->n_points == BENCH_MAX_POINTS)
        return error_say(why, -E2BIG, "more than %d points", BENCH_MAX_POINTS);
    memcpy(t->points_m[t->n_points++], at_m, sizeof *t->points_m);
    return 0;
}

int bench_truth_add_mask(struct bench_truth *t, const struct bench_mask *m,
                         struct error *why)
{
    if (t->n_masks == BENCH_MAX_MASKS)
        return error_say(why, -E2BIG, "more than %d letters", BENCH_MAX_MASKS);
    t->masks[t->n_masks++] = *m;
    return 0;
}

enum { LEFT, RIGHT, TOP, MIDDLE, BOTTOM, STEM, BARS };

int bench_mask_letter(struct bench_mask *m, char letter, const double size_m[2],
                      double stroke_m)
{
    static const struct {
        char letter;
        bool bars[BARS];
    } letters[] = {{'C', {[LEFT] = 1, [TOP] = 1, [BOTTOM] = 1}},
                   {'E', {[LEFT] = 1, [TOP] = 1, [MIDDLE] = 1, [BOTTOM] = 1}},
                   {'F', {[LEFT] = 1, [TOP] = 1, [MIDDLE] = 1}},
                   {'H', {[LEFT] = 1, [RIGHT] = 1, [MIDDLE] = 1}},
                   {'I', {[STEM] = 1}},
                   {'L', {[LEFT] = 1, [BOTTOM] = 1}},
                   {'O', {[LEFT] = 1, [RIGHT] = 1, [TOP] = 1, [BOTTOM] = 1}},
                   {'T', {[TOP] = 1, [STEM] = 1}},
                   {'U', {[LEFT] = 1, [RIGHT] = 1, [BOTTOM] = 1}}};
    double w = 0.5 * size_m[0], h = 0.5 * size_m[1], s = stroke_m;
    const double bars[BARS][4] = {
        [LEFT] = {-w, s - w, -h, h},   [RIGHT] = {w - s, w, -h, h},
        [TOP] = {-w, w, h - s, h},     [MIDDLE] = {-w, w, -0.5 * s, 0.5 * s},
        [BOTTOM] = {-w, w, -h, s - h}, [STEM] = {-0.5 * s, 0.5 * s, -h, h}};
    m->n_bars = 0;
    for (size_t i = 0; i < sizeof letters / sizeof *letters; i++)
        for (int b = 0; b < BARS && letters[i].letter == letter; b++)
            if (letters[i].bars[b])
                memcpy(m->bars_m[m->n_bars++], bars[b], sizeof bars[b]);
    return m->n_bars ? 0 : -EINVAL;
}

#define GATE_M           0.12
#define EXCLUDED_M       0.15 /* across */
#define EXCLUDED_DEPTH_M 0.10
#define WIDTH_LEVEL      0.25
#define LETTER_DEPTH_M   0.15
#define PIXEL_M          0.01
#define TINY             1e-30

double bench_score_error(const struct bench_score *s)
{
    return isnan(s->iou) ? 100.0 * s->lateral_m : 1.0 - s->iou;
}

static double coordinate(const struct grid *g, int axis, double index)
{
    return g->origin_m[axis] + g->step_m[axis] * index;
}

static bool near_point(const struct grid *g, size_t voxel, const double p[3],
                       double across_m, double depth_m)
{
    size_t at[3];
    grid_place(g, voxel, at);
    double x = coordinate(g, 0, (double)at[0]) - p[0];
    double y = coordinate(g, 1, (double)at[1]) - p[1];
    double z = coordinate(g, 2, (double)at[2]) - p[2];
    return hypot(x, y) < across_m && fabs(z) < depth_m;
}

/* -- points -----------------------------------------------------------------------------
 */
struct line { /* of voxels through a peak */
    const float *v;
    size_t n, stride, peak;
};

static double value(const struct line *l, size_t i)
{
    return (double)l->v[i * l->stride];
}

static double refine(const struct line *l)
{
    size_t i = l->peak;
    if (i == 0 || i + 1 >= l->n)
        return (double)i;
    double a = log(value(l, i - 1) + TINY), b = log(value(l, i) + TINY);
    double c = log(value(l, i + 1) + TINY), bend = a - 2.0 * b + c;
    return (double)i + (bend < 0.0 ? 0.5 * (a - c) / bend : 0.0);
}

/* Voxels from the peak to where the line falls through the level, one way. */
static double half_width(const struct line *l, int way)
{
    double level = WIDTH_LEVEL * value(l, l->peak);
    size_t i = l->peak, end = way > 0 ? l->n - 1 : 0;
    while (i != end && value(l, i) > level)
        i = way > 0 ? i + 1 : i - 1;
    if (i == l->peak)
        return 0.0;
    double inner = value(l, way > 0 ? i - 1 : i + 1), here = value(l, i);
    double steps = (double)(way > 0 ? i - l->peak : l->peak - i);
    return steps - (level - here) / (inner - here + TINY);
}

struct peak {
    double error_m[3], width_m[3], intensity;
};

/* false: no voxel is near. */
static bool measure_peak(struct peak *out, const double p[3], const struct grid *g,
                         const float *v)
{
    size_t best = SIZE_MAX, n = grid_size(g), at[3];
    for (size_t i = 0; i < n; i++)
        if ((best == SIZE_MAX || v[i] > v[best]) && near_point(g, i, p, GATE_M, GATE_M))
            best = i;
    if (best == SIZE_MAX)
        return false;
    grid_place(g, best, at);
    out->intensity = (double)v[best];
    for (int a = 0; a < 3; a++) {
        size_t stride = a == 0 ? 1 : a == 1 ? g->n[0] : g->n[0] * g->n[1];
        struct line l = {v + best - at[a] * stride, g->n[a], stride, at[a]};
        out->error_m[a] = coordinate(g, a, refine(&l)) - p[a];
        out->width_m[a] = (half_width(&l, 1) + half_width(&l, -1)) * g->step_m[a];
    }
    return true;
}

static double brightest_elsewhere(const struct bench_truth *t, const struct grid *g,
                                  const float *v)
{
    double brightest = 0.0;
    for (size_t i = 0; i < grid_size(g); i++) {
        if (!((double)v[i] > brightest))
            continue;
        bool of_a_point = false;
        for (size_t p = 0; !of_a_point && p < t->n_points; p++)
            of_a_point = near_point(g, i, t->points_m[p], EXCLUDED_M, EXCLUDED_DEPTH_M);
        if (!of_a_point)
            brightest = (double)v[i];
    }
    return brightest;
}

static void score_points(struct bench_score *out, const struct bench_truth *t,
                         const struct grid *g, const float *v)
{
    double widths[3][BENCH_MAX_POINTS], faintest = INFINITY;
    out->lateral_m = out->lateral_worst_m = out->depth_m = 0.0;
    for (size_t p = 0; p < t->n_points; p++) {
        struct peak peak;
        if (!measure_peak(&peak, t->points_m[p], g, v)) {
            out->lateral_m = out->lateral_worst_m = out->depth_m = NAN;
            return;
        }
        double lateral = hypot(peak.error_m[0], peak.error_m[1]);
        out->lateral_m += lateral / (double)t->n_points;
        out->lateral_worst_m = fmax(out->lateral_worst_m, lateral);
        out->depth_m += fabs(peak.error_m[2]) / (double)t->n_points;
        for (int a = 0; a < 3; a++)
            widths[a][p] = peak.width_m[a];
        faintest = fmin(faintest, peak.intensity);
    }
    for (int a = 0; a < 3; a++)
        out->width_m[a] = rank_median(widths[a], t->n_points);
    out->sidelobe_db = 10.0 * log10(faintest / brightest_elsewhere(t, g, v) + TINY);
}

/* -- letters ----------------------------------------------------------------------------
 */

/* plane [ny][nx]: the largest intensity of each column near a letter's depth. */
static void project(float *plane, const struct bench_mask *m, const struct grid *g,
                    const float *v)
{
    size_t n = g->n[0] * g->n[1];
    for (size_t q = 0; q < n; q++)
        plane[q] = 0.0f;
    for (size_t z = 0; z < g->n[2]; z++)
        if (fabs(coordinate(g, 2, (double)z) - m->z_m) < LETTER_DEPTH_M)
            for (size_t q = 0; q < n; q++)
                plane[q] = fmaxf(plane[q], v[z * n + q]);
}

/* Between voxels; 0 outside the grid. */
static double interpolate(const float *plane, const struct grid *g, double x_m,
                          double y_m)
{
    double x = (x_m - g->origin_m[0]) / g->step_m[0];
    double y = (y_m - g->origin_m[1]) / g->step_m[1];
    double last_x = (double)g->n[0] - 1.0, last_y = (double)g->n[1] - 1.0;
    if (!(x >= -1e-9 && y >= -1e-9 && x <= last_x + 1e-9 && y <= last_y + 1e-9))
        return 0.0;
    x = fmin(fmax(x, 0.0), last_x);
    y = fmin(fmax(y, 0.0), last_y);
    size_t i = (size_t)x, j = (size_t)y;
    size_t right = i + 1 < g->n[0] ? i + 1 : i, up = j + 1 < g->n[1] ? j + 1 : j;
    double s = x - (double)i, t = y - (double)j;
    const float *low = plane + j * g->n[0], *high = plane + up * g->n[0];
    return (1.0 - t) * ((1.0 - s) * (double)low[i] + s * (double)low[right]) +
           t * ((1.0 - s) * (double)high[i] + s * (double)high[right]);
}

/* As NumPy's arange steps, to the last bit: an edge of a letter that lies on a line of
 * pixels is then on the same side of it as in the reference. */
static double pixel_m(double from_m, size_t i)
{
    return from_m + (double)i * (from_m + PIXEL_M - from_m);
}

struct picture {
    size_t n[2];
    double *v;  /* [n[1]][n[0]] amplitude */
    bool *mask; /* the truth */
};

static int take_picture(struct picture *p, const struct bench_truth *t, const double w[4],
                        const struct grid *g, const float *v)
{
    float *plane = malloc(g->n[0] * g->n[1] * sizeof *plane);
    for (int a = 0; a < 2; a++)
        p->n[a] = (size_t)floor((w[2 * a + 1] - w[2 * a]) / PIXEL_M + 1e-6) + 1;
    p->v = calloc(p->n[0] * p->n[1], sizeof *p->v);
    p->mask = calloc(p->n[0] * p->n[1], sizeof *p->mask);
    if (!plane || !p->v || !p->mask) {
        free(plane);
        return -ENOMEM;
    }
    for (size_t m = 0; m < t->n_masks; m++) {
        project(plane, &t->masks[m], g, v);
        for (size_t q = 0; q < p->n[0] * p->n[1]; q++) {
            double x = pixel_m(w[0], q % p->n[0]);
            double y = pixel_m(w[2], q / p->n[0]);
            p->v[q] = fmax(p->v[q], interpolate(plane, g, x, y));
            p->mask[q] = bench_truth_covers(t, x, y);
        }
    }
    for (size_t q = 0; q < p->n[0] * p->n[1]; q++)
        p->v[q] = sqrt(p->v[q]);
    free(plane);
    return 0;
}

static double correlate(const struct picture *p)
{
    size_t n = p->n[0] * p->n[1];
    double mean_v = 0.0, mean_m = 0.0, vv = 0.0, mm = 0.0, vm = 0.0;
    for (size_t q = 0; q < n; q++) {
        mean_v += p->v[q] / (double)n;
        mean_m += p->mask[q] / (double)n;
    }
    for (size_t q = 0; q < n; q++) {
        double a = p->v[q] - mean_v, b = p->mask[q] - mean_m;
        vv += a * a;
        mm += b * b;
        vm += a * b;
    }
    return vv > 0.0 && mm > 0.0 ? vm / sqrt(vv * mm) : 0.0;
}

static double best_iou(const struct picture *p)
{
    size_t n = p->n[0] * p->n[1];
    double top = 0.0, best = 0.0;
    for (size_t q = 0; q < n; q++)
        top = fmax(top, p->v[q]);
    for (int percent = 2; percent <= 98; percent++) {
        size_t both = 0, either = 0;
        for (size_t q = 0; q < n; q++) {
            bool bright = p->v[q] > 0.01 * percent * top;
            both += bright && p->mask[q];
            either += bright || p->mask[q];
        }
        if (either)
            best = fmax(best, (double)both / (double)either);
    }
    return best;
}

int bench_score(struct bench_score *out, const struct bench_truth *truth,
                const double window_m[4], const struct grid *grid, const float *intensity)
{
    *out = (struct bench_score){NAN, NAN, NAN, {NAN, NAN, NAN}, NAN, NAN, NAN};
    if (truth->n_points) {
        score_points(out, truth, grid, intensity);
        return 0;
    }
    if (!truth->n_masks)
        return -EINVAL;
    struct picture p = {0};
    int err = take_picture(&p, truth, window_m, grid, intensity);
    if (!err) {
        out->correlation = correlate(&p);
        out->iou = best_iou(&p);
    }
    free(p.v);
    free(p.mask);
    return err;
}

/* On the paper's array x .06 to 1.02 and y .02 to .96, as the reference has it. */
void bench_score_window(double window_m[4], const struct geometry *g)
{
    double min[3], max[3];
    geometry_aperture(g, min, max);
    for (int a = 0; a < 2; a++) {
        window_m[2 * a] = min[a] + 0.02;
        window_m[2 * a + 1] = fmax(max[a] - (a ? 0.035 : 0.015), min[a] + 0.02);
    }
}
