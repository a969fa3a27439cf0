/* SPDX-License-Identifier: MIT */
#include "recon/tracking/sight.h"

#include <math.h>
#include <string.h>

static const double array_m[3] = {0.0, 0.0, 0.0};

void sight_init(struct sight *s, const struct survey *survey, const struct walls *walls,
                const struct walls *lost, const struct grid *grid)
{
    static const double zero[3] = {0.0, 0.0, 0.0};

    s->walls = walls;
    s->lost = lost;
    s->grid = grid;
    survey_to_vehicle(survey, zero, s->origin_m);
    for (int a = 0; a < 3; a++) {
        double unit[3] = {a == 0, a == 1, a == 2}, moved[3];
        survey_to_vehicle(survey, unit, moved);
        for (int b = 0; b < 3; b++)
            s->axes[b][a] = moved[b] - s->origin_m[b];
    }
}

/* Its index; as many as there are: there is none. */
static size_t find_index(const struct sight *s, uint32_t id)
{
    size_t i = 0;

    while (i < s->walls->n && s->walls->list[i].id != id)
        i++;
    return i;
}

static const struct wall *find(const struct sight *s, uint32_t id)
{
    size_t i = find_index(s, id);

    return i < s->walls->n ? &s->walls->list[i].plane : NULL;
}

static void to_array(const struct sight *s, const double p[3], double out[3])
{
    for (int a = 0; a < 3; a++) {
        out[a] = 0.0;
        for (int b = 0; b < 3; b++)
            out[a] += s->axes[b][a] * (p[b] - s->origin_m[b]);
    }
}

_Static_assert(WALLS_MAX <= TRACK_MIRRORS, "");

size_t sight_mirrors(const struct sight *s, struct track_mirror out[TRACK_MIRRORS])
{
    for (size_t i = 0; i < s->walls->n; i++) {
        struct wall w = s->walls->list[i].plane;
        struct track_mirror *m = &out[i];
        wall_face(&w);
        *m = (struct track_mirror){.id = s->walls->list[i].id,
                                   .distance_m = w.distance_m,
                                   .sigma_m = sqrt(w.covariance[5]),
                                   .sigma_rad = sqrt(w.covariance[0])};
        for (int a = 0; a < 3; a++) {
            for (int b = 0; b < 3; b++)
                m->normal[a] += s->axes[a][b] * w.normal[b];
            m->distance_m += m->normal[a] * s->origin_m[a];
        }
    }
    return s->walls->n;
}

void sight_virtual(const struct sight *s, const struct track_mirror *mirror,
                   const double p_m[3], double virtual_m[3])
{
    double imaged_m[3];

    track_mirror_point(mirror, p_m, imaged_m);
    to_array(s, imaged_m, virtual_m);
}

/* Of the walls that are known and then the lost ones, the first on the way there. */
static size_t first_on_the_way(const struct sight *s, const double virtual_m[3])
{
    struct wall_gate all[2 * WALLS_MAX];

    memcpy(all, s->walls->list, s->walls->n * sizeof *all);
    memcpy(all + s->walls->n, s->lost->list, s->lost->n * sizeof *all);
    return wall_that_mirrored(all, s->walls->n + s->lost->n, array_m, virtual_m);
}

size_t sight_lost(const struct sight *s, const double virtual_m[3])
{
    size_t i = first_on_the_way(s, virtual_m);

    return i < s->walls->n ? s->lost->n : i - s->walls->n;
}

size_t sight_stands_before(const void *context, const double imaged_m[3])
{
    const struct sight *s = context;
    double virtual_m[3];

    to_array(s, imaged_m, virtual_m);
    size_t i = first_on_the_way(s, virtual_m);
    return i < s->walls->n ? i : s->walls->n;
}

double sight_existence(const struct sight *s, uint32_t wall)
{
    size_t i = find_index(s, wall);

    return i < s->walls->n ? s->walls->existence[i] : 1.0;
}

void sight_direction(const struct sight *s, uint32_t wall, const double p_m[3],
                     double out[2])
{
    const struct wall *w = find(s, wall);
    double from_m[3] = {0.0, 0.0, 0.0}, at_m[3];

    to_array(s, p_m, at_m);
    if (w)
        wall_mirror(w, from_m, from_m);
    for (int a = 0; a < 2; a++) {
        out[a] = 0.0;
        for (int b = 0; b < 3; b++)
            out[a] += s->axes[a][b] * (at_m[b] - from_m[b]);
    }
    double length = hypot(out[0], out[1]);
    for (int a = 0; a < 2 && length > 0.0; a++)
        out[a] /= length;
}

void sight_way(const struct sight *s, uint32_t wall, const double way_m[3], double out[2])
{
    const struct wall *w = find(s, wall);
    double along_m = 0.0;

    for (int a = 0; w && a < 3; a++)
        along_m += w->normal[a] * way_m[a];
    for (int a = 0; a < 2; a++) {
        out[a] = 0.0;
        for (int b = 0; b < 3; b++)
            out[a] += s->axes[a][b] *
                      (way_m[b] - (w ? 2.0 * along_m * w->normal[b] : 0.0));
    }
}

static bool is_in_image(const struct grid *g, const double p[3])
{
    for (int a = 0; a < 3; a += 2)
        if (p[a] < g->origin_m[a] ||
            p[a] > g->origin_m[a] + g->step_m[a] * (double)(g->n[a] - 1))
            return false;
    return true;
}

/* Does the way to what is imaged there cross a wall between its ends?  It does cross the
 * plane of a wall that shows it. */
static bool crosses_between_ends(const struct wall *w, const double virtual_m[3])
{
    double along, at_m[3];

    if (!wall_ends(w))
        return true;
    if (!wall_crosses(w, array_m, virtual_m, &along))
        return false;
    for (int a = 0; a < 3; a++)
        at_m[a] = along * virtual_m[a];
    return wall_beyond_end_m(w, at_m) <= 0.0;
}

bool sight_shows(const void *context, const double p_m[3])
{
    const struct sight *s = context;
    double at_m[3], virtual_m[3];

    to_array(s, p_m, at_m);
    if (!s->walls->n)
        return is_in_image(s->grid, at_m);
    for (size_t i = 0; i < s->walls->n; i++) {
        const struct wall_gate *w = &s->walls->list[i];
        wall_mirror(&w->plane, at_m, virtual_m);
        double range_m = hypot(virtual_m[0], virtual_m[2]);
        if (range_m >= w->gate_m[0] && range_m <= w->gate_m[1] &&
            is_in_image(s->grid, virtual_m) && crosses_between_ends(&w->plane, virtual_m))
            return true;
    }
    return false;
}

double sight_behind_m(const struct sight *s, uint32_t wall, const double virtual_m[3])
{
    const struct wall *w = find(s, wall);
    struct wall away;

    if (!w)
        return INFINITY;
    away = *w;
    wall_face(&away);
    return away.normal[0] * virtual_m[0] + away.normal[1] * virtual_m[1] +
           away.normal[2] * virtual_m[2] - away.distance_m;
}

void sight_wall_error(const struct sight *s, uint32_t wall, const double virtual_m[3],
                      double covariance_m2[6])
{
    static const double exact[6] = {0.0};
    static const int at[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    const struct wall *w = find(s, wall);
    double c[6];

    memset(covariance_m2, 0, 6 * sizeof *covariance_m2);
    if (!w)
        return;
    wall_mirror_covariance(w, virtual_m, exact, c);
    for (int a = 0; a < 3; a++)
        for (int b = a; b < 3; b++)
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    covariance_m2[at[a][b]] += s->axes[a][i] * c[at[i][j]] *
                                               s->axes[b][j];
}
