/* SPDX-License-Identifier: MIT */
#include "recon/tracking/track_body.h"

#include <math.h>
#include <string.h>

#include "recon/tracking/track_state.h"

#define LONGEST_M 6.0 /* a body is no longer, nor wider than half of that */
#define RECENT_S  0.5
#define KEPT_S    1.5  /* a part that is not seen any more */
#define SLIP_M    0.05 /* a bright spot wanders about on its part */

#define SAME_GATE    9.21 /* 99 of 100 velocities that are the same (chi-squared, 2) */
#define AS_ONE_LOOKS 3.0  /* by then two who cross are apart */

/* -- frames -----------------------------------------------------------------------------
 */

/* From the filter's place, as it was at the measured instant. */
static void offset_of(const struct track_filter *f, const struct track_position *p,
                      double out[2])
{
    for (int a = 0; a < 2; a++)
        out[a] = p->at_m[a] - f->state[a] - p->lag_s * f->state[2 + a];
}

static struct track_position without(const struct track_position *p,
                                     const struct track_part *part)
{
    struct track_position out = *p;

    for (int a = 0; a < 2; a++) {
        out.at_m[a] -= part->offset_m[a];
        out.covariance_m2[a][a] += part->variance_m2;
    }
    return out;
}

/* -- association ------------------------------------------------------------------------
 */

struct track_match track_body_match(const struct track *k, const struct track_position *p,
                                    size_t *part)
{
    struct track_match best = {.distance2 = INFINITY};

    if (!k->body.n)
        return track_filter_match(&k->filter, p);
    for (size_t i = 0; i < k->body.n; i++) {
        struct track_position moved = without(p, &k->body.parts[i]);
        struct track_match m = track_filter_match(&k->filter, &moved);
        if (m.distance2 >= best.distance2)
            continue;
        best = m;
        if (part)
            *part = i;
    }
    return best;
}

static const double most_m[2] = {LONGEST_M, 0.5 * LONGEST_M};
/* Between parts, along and across: of the front of a car its corners are heard. */
static const double most_gap_m[2] = {1.3, 1.35};

/* Of a box grown by a place: is that still a body, and how far out was it? */
static double gap_m(const double low[2], const double high[2], const double at[2])
{
    double out[2];

    for (int a = 0; a < 2; a++) {
        double all = fmax(high[a], at[a]) - fmin(low[a], at[a]);
        out[a] = fmax(fmax(low[a] - at[a], at[a] - high[a]), 0.0);
        if (all > most_m[a] || out[a] > most_gap_m[a])
            return INFINITY;
    }
    return hypot(out[0], out[1]);
}

double track_body_gap_m(const struct track *k, const struct track_position *p)
{
    double u[2], offset_m[2], at[2];

    track_outline_heading(&k->filter, u);
    offset_of(&k->filter, p, offset_m);
    track_outline_turn_in(u, offset_m, at);
    return gap_m(k->outline.low_m, k->outline.high_m, at);
}

/* -- parts ------------------------------------------------------------------------------
 */

/* The one that was not seen for longest makes room. */
static struct track_part *new_part(struct track_body *b)
{
    size_t oldest = 0;

    if (b->n < TRACK_PARTS)
        return &b->parts[b->n++];
    for (size_t i = 1; i < b->n; i++)
        if (b->parts[i].seen_ns < b->parts[oldest].seen_ns)
            oldest = i;
    return &b->parts[oldest];
}

static void add_part(struct track *k, const struct track_position *p, double fresh,
                     int64_t now_ns)
{
    struct track_part *part = new_part(&k->body);

    offset_of(&k->filter, p, part->offset_m);
    part->variance_m2 = 0.5 * fresh * (p->covariance_m2[0][0] + p->covariance_m2[1][1]);
    part->looks = fresh;
    part->seen_ns = now_ns;
}

static void update_part(struct track *k, struct track_part *part,
                        const struct track_position *p, double fresh, int64_t now_ns)
{
    struct track_position moved = without(p, part);
    double offset_m[2];

    track_filter_update(&k->filter, &moved);
    track_filter_update(&k->steady, &moved);
    double noise_m2 = 0.5 * (p->covariance_m2[0][0] + p->covariance_m2[1][1]);
    double gain = part->variance_m2 / (part->variance_m2 + noise_m2);
    offset_of(&k->filter, p, offset_m);
    for (int a = 0; a < 2; a++)
        part->offset_m[a] += gain * (offset_m[a] - part->offset_m[a]);
    part->variance_m2 += fresh * SLIP_M * SLIP_M - gain * part->variance_m2;
    part->looks += fresh;
    part->seen_ns = now_ns;
}

static void forget_parts(struct track_body *b, int64_t now_ns)
{
    size_t kept = 0;

    for (size_t i = 0; i < b->n; i++)
        if (1e-9 * (double)(now_ns - b->parts[i].seen_ns) <= KEPT_S)
            b->parts[kept++] = b->parts[i];
    b->n = kept;
}

/* Which part each of the track's detections shows; TRACK_PARTS: none that is known. */
static void sort_out(const struct tracker *t, const struct track_scan *scan,
                     const size_t *whose, size_t i, size_t *of)
{
    const struct track *k = &t->tracks[i];

    for (size_t j = 0; j < scan->n; j++) {
        of[j] = TRACK_NONE;
        if (whose[j] != i)
            continue;
        size_t part = 0;
        double distance2 = track_body_match(k, &t->positions[j], &part).distance2;
        of[j] = distance2 < t->cfg.gate2 ? part : TRACK_PARTS;
    }
}

void track_body_update(struct tracker *t, const struct track_scan *scan,
                       const size_t *whose, size_t i, double fresh)
{
    struct track *k = &t->tracks[i];
    struct track_gathered part_of;
    size_t of[TRACK_DETECTIONS], n = k->body.n;

    sort_out(t, scan, whose, i, of);
    for (size_t part = 0; part < n; part++) {
        bool seen = false;
        for (size_t j = 0; j < scan->n; j++)
            seen |= of[j] == part;
        if (!seen)
            continue;
        track_gather(t, scan, of, part, k->mirror.id, &part_of);
        update_part(k, &k->body.parts[part], &part_of.middle, fresh, scan->stamp_ns);
    }
    for (size_t j = 0; j < scan->n; j++)
        if (of[j] == TRACK_PARTS)
            add_part(k, &t->positions[j], fresh, scan->stamp_ns);
    forget_parts(&k->body, scan->stamp_ns);
}

/* -- two tracks that are one ------------------------------------------------------------
 */

/* Are their velocities the same, as far as these are known? */
static bool go_alike(const struct track *a, const struct track *b)
{
    double dv[2], c[2][2];

    for (int i = 0; i < 2; i++) {
        dv[i] = a->filter.state[2 + i] - b->filter.state[2 + i];
        for (int j = 0; j < 2; j++)
            c[i][j] = a->filter.covariance[2 + i][2 + j] +
                      b->filter.covariance[2 + i][2 + j];
    }
    return track_filter_distance2(dv, (const double(*)[2])c) < SAME_GATE;
}

/* The first one is as sure and as lately seen as the surer and later of both; the other
 * ends. */
static void take_over(struct track *k, struct track *other)
{
    k->seen_ns = k->seen_ns > other->seen_ns ? k->seen_ns : other->seen_ns;
    k->moves_ns = k->moves_ns > other->moves_ns ? k->moves_ns : other->moves_ns;
    k->life.existence = fmax(k->life.existence, other->life.existence);
    other->merged = true;
}

static bool go_together(const struct track *a, const struct track *b)
{
    return track_outline_is_fast(a) && track_outline_is_fast(b) && go_alike(a, b);
}

/* Is b beside what is known of a? */
static bool adjoin(const struct track *a, const struct track *b)
{
    double u[2], offset_m[2], at[2], low[2], high[2], least_m = INFINITY;

    track_outline_heading(&a->filter, u);
    for (int i = 0; i < 2; i++)
        offset_m[i] = b->filter.state[i] - a->filter.state[i];
    track_outline_turn_in(u, offset_m, at);
    for (int i = 0; i < 2; i++) {
        low[i] = at[i] + b->outline.low_m[i];
        high[i] = at[i] + b->outline.high_m[i];
        double all = fmax(a->outline.high_m[i], high[i]) -
                     fmin(a->outline.low_m[i], low[i]);
        if (all > most_m[i])
            return false;
    }
    for (int corner = 0; corner < 4; corner++) {
        const double c[2] = {corner & 1 ? high[0] : low[0],
                             corner & 2 ? high[1] : low[1]};
        least_m = fmin(least_m, gap_m(a->outline.low_m, a->outline.high_m, c));
    }
    return isfinite(least_m);
}

void track_body_begin(struct track *k)
{
    if (k->body.n)
        return;
    k->body.parts[k->body.n++] = (struct track_part){
        .variance_m2 = SLIP_M * SLIP_M, .looks = TRACK_PART_KNOWN, .seen_ns = k->seen_ns};
}

static void take_in_body(struct track *k, struct track *other, double yaw)
{
    track_body_begin(k);
    track_body_begin(other);
    for (size_t i = 0; i < other->body.n; i++) {
        struct track_part *part = new_part(&k->body);
        *part = other->body.parts[i];
        for (int a = 0; a < 2; a++)
            part->offset_m[a] += other->filter.state[a] - k->filter.state[a];
    }
    track_outline_update(k, yaw);
    take_over(k, other);
}

/* And moves by itself: things at rest that glide along by the vehicle's motion do so
 * together. */
static bool is_recent(const struct tracker *t, const struct track *k)
{
    return !k->merged && k->moves_ns &&
           1e-9 * (double)(t->stamp_ns - k->seen_ns) <= RECENT_S;
}

/* The one that has an id stays, else the older one, which comes first. */
void track_body_merge(struct tracker *t)
{
    for (size_t i = 0; i < t->n; i++)
        for (size_t j = i + 1; j < t->n; j++) {
            struct track *a = &t->tracks[i], *b = &t->tracks[j];
            if (!is_recent(t, a) || !is_recent(t, b) || !go_together(a, b) ||
                !adjoin(a, b))
                continue;
            if (a->id || !b->id)
                take_in_body(a, b, t->pose.dyaw);
            else
                take_in_body(b, a, t->pose.dyaw);
        }
}

/* A body takes in what goes with it by itself. */
static bool stands_in(const struct tracker *t, const struct track *k,
                      const struct track *named)
{
    const double *at_m = k->filter.state, *its_m = named->filter.state;

    return named->id && !named->body.n && named->state == TRACK_MEASURED &&
           hypot(at_m[0] - its_m[0], at_m[1] - its_m[1]) < t->cfg.join_m;
}

void track_absorb(struct tracker *t)
{
    for (size_t i = 0; i < t->n; i++)
        for (size_t other = 0; !t->tracks[i].id && other < t->n; other++)
            t->tracks[i].merged |= stands_in(t, &t->tracks[i], &t->tracks[other]);
}

static bool walk_as_one(const struct tracker *t, const struct track *k,
                        const struct track *older)
{
    const double *at_m = k->filter.state, *its_m = older->filter.state;

    return older->id && !older->merged && k->placed == older->placed && !k->body.n &&
           !older->body.n && track_outline_is_slow(k) && track_outline_is_slow(older) &&
           hypot(at_m[0] - its_m[0], at_m[1] - its_m[1]) < t->cfg.join_m &&
           go_alike(k, older);
}

/* In the middle between both, and as sure as the surer one. */
static void take_in_walker(struct track *older, struct track *k)
{
    struct track_filter *filters[TRACK_FILTERS];
    size_t n = track_filters(older, filters);
    double way_m[2];

    for (int a = 0; a < 2; a++)
        way_m[a] = 0.5 * (k->filter.state[a] - older->filter.state[a]);
    for (size_t i = 0; i < n; i++)
        for (int a = 0; a < 2; a++)
            filters[i]->state[a] += way_m[a];
    take_over(older, k);
}

void track_join_walkers(struct tracker *t, double fresh)
{
    for (size_t i = 1; i < t->n; i++) {
        struct track *k = &t->tracks[i];
        size_t other = 0;
        while (other < i && !(k->id && walk_as_one(t, k, &t->tracks[other])))
            other++;
        k->as_one = other < i ? k->as_one + fresh : 0.0;
        if (k->as_one > AS_ONE_LOOKS)
            take_in_walker(&t->tracks[other], k);
    }
}
