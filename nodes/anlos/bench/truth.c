#include "nodes/anlos/bench/truth.h"

#include <errno.h>
#include <math.h>
#include <string.h>

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

int bench_truth_add_point(struct bench_truth *t, const double at_m[3],
                          struct complaint *why)
{
    if (t->n_points == BENCH_MAX_POINTS)
        return complain(why, -E2BIG, "more than %d points", BENCH_MAX_POINTS);
    memcpy(t->points_m[t->n_points++], at_m, sizeof *t->points_m);
    return 0;
}

int bench_truth_add_mask(struct bench_truth *t, const struct bench_mask *m,
                         struct complaint *why)
{
    if (t->n_masks == BENCH_MAX_MASKS)
        return complain(why, -E2BIG, "more than %d letters", BENCH_MAX_MASKS);
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
