/* SPDX-License-Identifier: MIT */
#include "recon/tracking/sidelobes.h"

#include <math.h>

#define ABOUT_M 0.3 /* the depth of a person, and the length of a smear */

static void widen(const double (*at_m)[3], size_t n, double low[3], double high[3])
{
    for (size_t i = 0; i < n; i++)
        for (int a = 0; a < 3; a++) {
            low[a] = fmin(low[a], at_m[i][a]);
            high[a] = fmax(high[a], at_m[i][a]);
        }
}

void sidelobe_array_measure(struct sidelobe_array *array, const struct survey *s)
{
    double low[3] = {INFINITY, INFINITY, INFINITY};
    double high[3] = {-INFINITY, -INFINITY, -INFINITY};

    widen((const double(*)[3])s->speakers_m, s->n_speakers, low, high);
    widen((const double(*)[3])s->microphones_m, s->n_microphones, low, high);
    for (int a = 0; a < 3; a++)
        array->half_m[a] = fmax(0.5 * (high[a] - low[a]), 0.0);
    array->gate_m = s->gate_m[1];
}

struct sidelobe_source sidelobe_source_at(const double virtual_m[3], double level_db)
{
    const double *v = virtual_m;
    struct sidelobe_source s = {.range_m = hypot(hypot(v[0], v[1]), v[2]),
                                .level_db = level_db};

    for (int a = 0; a < 3 && s.range_m > 0.0; a++)
        s.direction[a] = v[a] / s.range_m;
    return s;
}

/* How far it may be from a source's range. */
static double reach_m(const struct sidelobe_array *array,
                      const struct sidelobe_source *source,
                      const struct sidelobe_source *what)
{
    double farthest_m = source->range_m, off_m = 0.0;

    for (int a = 0; a < 3; a++) {
        farthest_m += array->half_m[a] * fabs(source->direction[a]);
        off_m += array->half_m[a] * fabs(source->direction[a] - what->direction[a]);
    }
    return farthest_m > array->gate_m ? ABOUT_M + off_m : ABOUT_M;
}

bool sidelobes_may_be(const struct sidelobe_array *array,
                      const struct sidelobe_source *what,
                      const struct sidelobe_source *sources, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (sources[i].level_db - what->level_db >= array->margin_db &&
            fabs(sources[i].range_m - what->range_m) <= reach_m(array, &sources[i], what))
            return true;
    return false;
}
