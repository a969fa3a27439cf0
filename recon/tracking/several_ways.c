/* SPDX-License-Identifier: MIT */
#include "recon/tracking/several_ways.h"

#include <math.h>

#include "recon/processing.h"
#include "recon/tracking/sidelobes.h"

#define ABOUT_M   0.35 /* what is bright of a body is so near to its middle */
#define SAME_M    1e-3
#define GLINTS_DB 6.0  /* by more it does not get brighter from image to image */
#define FRONT_DB  12.0 /* nor than the side that a wall shows, where it is another */

static const double array_m[3] = {0.0, 0.0, 0.0};
static const struct track_mirror no_mirror = {.id = 0};

void several_ways_init(struct several_ways *s, const struct sight *sight,
                       const struct survey *survey)
{
    struct sidelobe_array array;

    sidelobe_array_measure(&array, survey);
    s->sight = sight;
    s->n_walls = sight_mirrors(sight, s->mirrors);
    s->half_m = array.half_m[0];
    s->far_m = survey->has_gate ? survey->gate_m[1] + PROCESSING_BEYOND_M : INFINITY;
    s->n = 0;
}

static double range_of(const double p_m[3])
{
    return hypot(hypot(p_m[0], p_m[1]), p_m[2]);
}

/* Sound on the straight way to an image turns back at the wall between its ends, and in
 * front of the others, give or take what an array looks past an end.  Where a wall is
 * looked at as far as all is heard, it shows what comes from beyond that. */
static bool is_shown(const struct several_ways *s, size_t by, const double virtual_m[3])
{
    const struct walls *walls = s->sight->walls;
    const struct wall *w = &walls->list[by].plane;
    const double *gate_m = walls->list[by].gate_m;
    double along, foot_m[3], range_m = range_of(virtual_m);

    if (!wall_crosses(w, array_m, virtual_m, &along) || range_m < gate_m[0] ||
        (range_m > gate_m[1] && gate_m[1] + PROCESSING_BEYOND_M < s->far_m - SAME_M))
        return false;
    for (int a = 0; a < 3; a++)
        foot_m[a] = along * virtual_m[a];
    if (wall_beyond_end_m(w, foot_m) > WALL_END_MARGIN_M)
        return false;
    for (size_t i = 0; i < walls->n; i++) {
        const struct wall *other = &walls->list[i].plane;
        if (i != by && wall_beyond_end_m(other, foot_m) <= 0.0 &&
            sight_behind_m(s->sight, walls->list[i].id, foot_m) > WALL_END_MARGIN_M)
            return false;
    }
    return true;
}

/* How far a place is from what is at a range toward another one, in units of how far it
 * may be: smear_m more along the way there. */
static double misfit(const double virtual_m[3], const double toward_m[3], double range_m,
                     double smear_m)
{
    const double *v = virtual_m, *to = toward_m;
    double across_m = (v[0] * to[2] - v[2] * to[0]) / hypot(to[0], to[2]);
    double along_m = range_of(v) - range_m;

    return hypot(across_m / ABOUT_M, along_m / (ABOUT_M + smear_m));
}

/* Of a body, by way of a wall; beyond: of what is heard of it at the end of the image,
 * which it has left. */
static double misfit_by(const struct several_ways *s, const struct several_ways_body *b,
                        size_t wall, const double virtual_m[3], bool *beyond)
{
    double range_m = range_of(b->virtual_m[wall]);

    *beyond = range_m > s->far_m;
    return b->shown[wall]
               ? misfit(virtual_m, b->virtual_m[wall], fmin(range_m, s->far_m), 0.0)
               : INFINITY;
}

/* Out one way and back by way of a wall.  A speaker off the middle of the array is nearer
 * to the one image than to the other; and the shorter these ways, the louder. */
static double misfit_across(const struct several_ways *s,
                            const struct several_ways_body *b, const double from_m[3],
                            size_t back, const double virtual_m[3], double over_db)
{
    const double *to_m = b->virtual_m[back];
    double back_m = range_of(to_m), out_m = range_of(from_m);
    double known_m = range_of(b->virtual_m[b->wall]);
    double nearer_db = 20.0 * log10(known_m * known_m / (back_m * out_m));
    double smear_m = 0.5 * s->half_m * fabs(from_m[0] / out_m - to_m[0] / back_m);

    return over_db <= fmax(nearer_db, 0.0)
               ? misfit(virtual_m, to_m, 0.5 * (out_m + back_m), smear_m)
               : INFINITY;
}

/* Out by way of one wall and back by way of another. */
static double misfit_by_two(const struct several_ways *s,
                            const struct several_ways_body *b, const double virtual_m[3],
                            double level_db)
{
    double best = INFINITY, over_db = level_db - b->level_db - GLINTS_DB;

    for (size_t back = 0; back < s->n_walls; back++)
        for (size_t out = 0; out < s->n_walls; out++)
            if (out != back && b->shown[back] && b->shown[out])
                best = fmin(best, misfit_across(s, b, b->virtual_m[out], back, virtual_m,
                                                over_db));
    return best;
}

/* Straight there, as far as the array sees the body, and back by way of a wall. */
static double misfit_straight(const struct several_ways *s,
                              const struct several_ways_body *b, size_t back,
                              const double virtual_m[3], double level_db)
{
    return b->shown[back] ? misfit_across(s, b, b->straight_m, back, virtual_m,
                                          level_db - b->level_db - FRONT_DB)
                          : INFINITY;
}

/* The least misfit of who is known with what is imaged somewhere: by the wall that he is
 * known by, by another one, and by none: across, straight, or where the image ends. */
struct fit {
    double known, other, straight, none;
    uint32_t known_by, other_by;
};

static void fit_by(const struct several_ways *s, const struct several_ways_body *b,
                   size_t w, const double virtual_m[3], double level_db, struct fit *f)
{
    bool beyond;
    double off = misfit_by(s, b, w, virtual_m, &beyond);

    f->straight = fmin(f->straight, misfit_straight(s, b, w, virtual_m, level_db));
    if (beyond) {
        f->none = s->n_walls > 1 ? fmin(f->none, off) : f->none;
    } else if (w == b->wall && off < f->known) {
        f->known = off;
        f->known_by = s->mirrors[w].id;
    } else if (w != b->wall && off < f->other) {
        f->other = off;
        f->other_by = s->mirrors[w].id;
    }
}

static struct fit fit_all(const struct several_ways *s, const double virtual_m[3],
                          double level_db)
{
    struct fit f = {INFINITY, INFINITY, INFINITY, INFINITY, 0, 0};

    for (size_t i = 0; i < s->n; i++) {
        const struct several_ways_body *b = &s->bodies[i];
        f.none = fmin(f.none, misfit_by_two(s, b, virtual_m, level_db));
        for (size_t w = 0; w < s->n_walls; w++)
            fit_by(s, b, w, virtual_m, level_db, &f);
    }
    return f;
}

uint32_t several_ways_show(const struct several_ways *s, const double virtual_m[3],
                           uint32_t wall, double level_db)
{
    const struct fit f = fit_all(s, virtual_m, level_db);

    if (f.known <= 1.0)
        return f.known_by;
    if (fmin(f.none, f.straight) <= 1.0)
        return SEVERAL_WAYS_NOBODY;
    return f.other <= 1.0 ? f.other_by : wall;
}

/* How far he is whose image and himself are as far as this on the mean, on an ellipse
 * about the array and its own image: with n the wall's normal, d its distance and u the
 * direction, his image r u is as far from both as 2 range = r + |r u - 2 d n|. */
static double straight_by(struct wall w, const double virtual_m[3])
{
    double range_m = range_of(virtual_m), toward_m = 0.0;

    wall_face(&w);
    for (int a = 0; a < 3; a++)
        toward_m += w.distance_m * w.normal[a] * virtual_m[a] / range_m;
    double image_m = (range_m * range_m - w.distance_m * w.distance_m) /
                     (range_m - toward_m);
    return 2.0 * range_m - image_m;
}

const struct several_ways_body *several_ways_see(const struct several_ways *s,
                                                 const double virtual_m[3],
                                                 double level_db, double *straight_m)
{
    const struct several_ways_body *who = NULL;
    double least = 1.0;

    for (size_t i = 0; i < s->n; i++)
        for (size_t w = 0; w < s->n_walls; w++) {
            double off = misfit_straight(s, &s->bodies[i], w, virtual_m, level_db);
            if (off <= least) {
                least = off;
                who = &s->bodies[i];
                *straight_m = straight_by(s->sight->walls->list[w].plane, virtual_m);
            }
        }
    return who;
}

static struct several_ways_body body_at(const struct several_ways *s,
                                        const double at_m[3], double level_db)
{
    struct several_ways_body b = {.level_db = level_db};

    sight_virtual(s->sight, &no_mirror, at_m, b.straight_m);
    for (size_t i = 0; i < s->n_walls; i++) {
        sight_virtual(s->sight, &s->mirrors[i], at_m, b.virtual_m[i]);
        b.shown[i] = is_shown(s, i, b.virtual_m[i]);
    }
    return b;
}

size_t several_ways_images(const struct several_ways *s, const double at_m[3],
                           const struct track_mirror *own, double (*out)[3], size_t max)
{
    const struct several_ways_body b = body_at(s, at_m, 0.0);
    size_t n = 0;

    if (max)
        sight_virtual(s->sight, own, at_m, out[n++]);
    for (size_t back = 0; back < s->n_walls; back++)
        for (size_t way = 0; way < s->n_walls && n < max; way++) {
            double range_m = range_of(b.virtual_m[back]);
            double part = 0.5 + 0.5 * range_of(b.virtual_m[way]) / range_m;
            bool is_own = back == way && s->mirrors[back].id == own->id;
            if (is_own || !b.shown[back] || !b.shown[way])
                continue;
            for (int a = 0; a < 3; a++)
                out[n][a] = part * b.virtual_m[back][a];
            n++;
        }
    return n;
}

struct several_ways_body *several_ways_know(struct several_ways *s, const double at_m[3],
                                            uint32_t wall, double level_db)
{
    struct several_ways_body b = body_at(s, at_m, level_db);

    while (b.wall < s->n_walls && s->mirrors[b.wall].id != wall)
        b.wall++;
    if (b.wall == s->n_walls)
        return NULL;
    const struct fit f = fit_all(s, b.virtual_m[b.wall], level_db);
    if (f.none <= 1.0 && f.none < f.known)
        return NULL;
    s->bodies[s->n] = b;
    return &s->bodies[s->n++];
}
