/* SPDX-License-Identifier: MIT */
#include "nodes/rt/stage_line.h"

#include <math.h>

#define LEAST_REPORTS 3
#define BACK_NS       INT64_C(1000000000) /* later than its reports are ever told */

void stage_line_add(struct stage_line *l, int64_t at_ns, double place_m)
{
    int64_t newest_ns = l->n ? l->at_ns[(l->n - 1) % STAGE_LINE_REPORTS] : INT64_MIN;
    if (at_ns <= newest_ns && newest_ns - at_ns < BACK_NS)
        return;
    if (at_ns <= newest_ns)
        l->n = 0; /* what was told before lies in the future */
    l->at_ns[l->n % STAGE_LINE_REPORTS] = at_ns;
    l->place_m[l->n % STAGE_LINE_REPORTS] = place_m;
    l->n++;
}

/* Times and places from the first report of the span on, so that no sum cancels. */
struct sums {
    size_t n, first;
    double t, x, tt, tx, xx;
};

static void add(struct sums *s, const struct stage_line *l, size_t k)
{
    s->first = s->n ? s->first : k;
    double t = 1e-9 * (double)(l->at_ns[k] - l->at_ns[s->first]);
    double x = l->place_m[k] - l->place_m[s->first];
    s->n++;
    s->t += t;
    s->x += x;
    s->tt += t * t;
    s->tx += t * x;
    s->xx += x * x;
}

bool stage_line_fit(const struct stage_line *l, int64_t from_ns, int64_t to_ns,
                    struct stage_line_fit *out)
{
    struct sums s = {.n = 0};
    size_t oldest = l->n > STAGE_LINE_REPORTS ? l->n - STAGE_LINE_REPORTS : 0;
    for (size_t i = oldest; i < l->n; i++) {
        size_t k = i % STAGE_LINE_REPORTS;
        if (l->at_ns[k] >= from_ns && l->at_ns[k] <= to_ns)
            add(&s, l, k);
    }
    double n = (double)s.n, spread = s.n ? s.tt - s.t * s.t / n : 0.0;
    if (s.n < LEAST_REPORTS || !(spread > 0.0))
        return false;
    double along = s.tx - s.t * s.x / n, across = s.xx - s.x * s.x / n;
    *out = (struct stage_line_fit){
        .n = s.n,
        .at_ns = l->at_ns[s.first] + llrint(1e9 * s.t / n),
        .place_m = l->place_m[s.first] + s.x / n,
        .speed_m_s = along / spread,
        .jitter_m = sqrt(fmax(across - along * along / spread, 0.0) / n)};
    return true;
}

double stage_line_place_m(const struct stage_line_fit *f, int64_t at_ns)
{
    return f->place_m + 1e-9 * (double)(at_ns - f->at_ns) * f->speed_m_s;
}

int64_t stage_line_time_ns(const struct stage_line_fit *f, double place_m)
{
    return f->at_ns + llrint(1e9 * (place_m - f->place_m) / f->speed_m_s);
}
