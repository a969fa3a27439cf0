/* SPDX-License-Identifier: MIT */
#include "hal/room/sight.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

/* Twice the area of the triangle p, q, r: above 0 when they turn left. */
static double turn(const double p[2], const double q[2], const double r[2])
{
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
}

static bool cross(const double a[2], const double b[2], const double p[2],
                  const double q[2])
{
    return (turn(a, b, p) > 0) != (turn(a, b, q) > 0) &&
           (turn(p, q, a) > 0) != (turn(p, q, b) > 0);
}

bool sight_clear(const double (*outline)[2], size_t n, const double a[3],
                 const double b[3])
{
    const double from[2] = {a[0], a[2]}, to[2] = {b[0], b[2]};
    for (size_t i = 0, j = n - 1; i < n; j = i++)
        if (cross(from, to, outline[j], outline[i]))
            return false;
    return true;
}

static int add_span(struct sight_spans *s, double from_s, double to_s)
{
    if (s->n == s->room) {
        size_t room = s->room ? 2 * s->room : 4;
        struct sight_span *p = realloc(s->spans, room * sizeof *p);
        if (!p)
            return -ENOMEM;
        s->spans = p;
        s->room = room;
    }
    s->spans[s->n++] = (struct sight_span){from_s, to_s};
    return 0;
}

/* When the answer changes between two times that have different ones. */
static double change_s(bool (*in_view)(void *ctx, double t_s), void *ctx, double a_s,
                       double b_s)
{
    bool before = in_view(ctx, a_s);
    for (int i = 0; i < 30; i++) {
        double middle_s = (a_s + b_s) / 2;
        if (in_view(ctx, middle_s) == before)
            a_s = middle_s;
        else
            b_s = middle_s;
    }
    return (a_s + b_s) / 2;
}

int sight_scan(struct sight_spans *out, bool (*in_view)(void *ctx, double t_s), void *ctx,
               double from_s, double to_s, double step_s)
{
    double begun_s = from_s, last_s = from_s;
    bool seen = in_view(ctx, from_s);
    while (last_s < to_s) {
        double t_s = fmin(last_s + step_s, to_s);
        if (in_view(ctx, t_s) != seen) {
            double at_s = change_s(in_view, ctx, last_s, t_s);
            if (seen && add_span(out, begun_s, at_s) < 0)
                return -ENOMEM;
            begun_s = at_s;
            seen = !seen;
        }
        last_s = t_s;
    }
    return seen ? add_span(out, begun_s, to_s) : 0;
}

double sight_until_s(const struct sight_spans *s, double t_s)
{
    for (size_t i = 0; i < s->n; i++)
        if (t_s < s->spans[i].to_s)
            return fmax(s->spans[i].from_s - t_s, 0);
    return NAN;
}

void sight_clear_spans(struct sight_spans *s)
{
    free(s->spans);
    *s = (struct sight_spans){.n = 0};
}
