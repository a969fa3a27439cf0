/* SPDX-License-Identifier: MIT */
#include "recon/walls/wall_map.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "recon/mount.h"

#define UNSAID_M   0.05
#define UNSAID_RAD 0.035

void wall_map_init(struct wall_map *k, const struct wall_map_config *cfg)
{
    memset(k, 0, sizeof *k);
    k->from = cfg->from;
    wall_track_default(&k->cfg);
    k->cfg.lost_s = cfg->lost_s;
    k->vertical_rad = cfg->vertical_rad;
    k->list.n_corners = cfg->n_corners;
    memcpy(k->list.free_view_m, cfg->free_view_m, sizeof k->list.free_view_m);
}

void wall_map_survey(struct wall_map *k, const struct survey *s, bool keep)
{
    k->survey = s;
    if (!keep)
        k->tracks.n = 0;
    walls_from_survey(&k->configured, s);
    walls_normalise(&k->configured);
}

void wall_map_ego(struct wall_map *k, const struct ego_motion *motion, int64_t stamp_ns)
{
    k->has_ego = true;
    if (motion) /* the path refuses what is older than its newest */
        (void)ego_path_add(&k->path, stamp_ns, motion);
}

const struct ego_path *wall_map_path(const struct wall_map *k)
{
    return k->has_ego ? &k->path : NULL;
}

void wall_map_advance(struct wall_map *k, int64_t to_ns)
{
    struct ego_step step = {0.0, 0.0, 0.0};
    struct wall_motion motion;
    struct mount mount;

    if (to_ns <= k->at_ns)
        return;
    if (k->survey && k->at_ns && k->tracks.n) {
        k->blind = k->has_ego && ego_path_between(&k->path, k->at_ns, to_ns, &step);
        motion.dt_s = 1e-9 * (double)(to_ns - k->at_ns);
        motion.known = !k->blind;
        motion.way_m = hypot(step.dx_m, step.dy_m);
        motion.turn_rad = fabs(step.dyaw);
        mount_of_survey(k->survey, &mount);
        mount_step(&mount, &step, motion.r, motion.t);
        wall_tracks_predict(&k->tracks, &k->cfg, &motion);
    }
    k->at_ns = to_ns;
}

void wall_map_estimates(struct wall_map *k, const struct wall_estimates *e)
{
    struct wall seen[WALL_ESTIMATE_MAX];

    for (size_t i = 0; i < e->n; i++)
        seen[i] = e->list[i].wall;
    k->undetermined = e->n_undetermined;
    k->bent_1_m = e->n_bent ? e->curvature_1_m : 0.0;
    wall_tracks_update(&k->tracks, &k->cfg, seen, e->n);
}

/* What the vehicle does not say of its wall's errors. */
static void complete(const struct wall_map *k, struct wall *w)
{
    double *c = w->covariance;

    if (c[0] == 0.0 && c[5] == 0.0) {
        c[0] = UNSAID_RAD * UNSAID_RAD;
        c[5] = UNSAID_M * UNSAID_M;
    }
    if (c[3] == 0.0)
        c[3] = k->vertical_rad * k->vertical_rad;
}

/* A wall as it was at an instant, carried to the present. */
static void put(struct wall_map *k, const struct wall_gate *w, int64_t at_ns)
{
    struct walls one = {.n = 1, .list = {*w}};
    struct ego_step step = {0.0, 0.0, 0.0};

    if (k->has_ego && at_ns < k->at_ns)
        k->blind = ego_path_between(&k->path, at_ns, k->at_ns, &step) != 0;
    complete(k, &one.list[0].plane);
    walls_step(&one, k->survey, &step);
    wall_tracks_put(&k->tracks, w->id, &one.list[0].plane);
}

int wall_map_given(struct wall_map *k, const struct walls *given, int64_t stamp_ns,
                   struct error *why)
{
    uint32_t ids[WALLS_MAX];
    int err = walls_check(given, why);

    if (err)
        return err;
    struct walls w = *given;
    walls_normalise(&w);
    walls_to_array(&w, k->survey);
    wall_map_advance(k, stamp_ns);
    for (size_t i = 0; i < w.n; i++) {
        double unseen_s = fmin(fmax(w.unseen_s[i], 0.0), k->cfg.lost_s);
        ids[i] = w.list[i].id;
        if (unseen_s > 0.0 && wall_tracks_find(&k->tracks, ids[i]))
            continue; /* said before, and carried along since */
        put(k, &w.list[i], stamp_ns - (int64_t)(1e9 * unseen_s));
    }
    wall_tracks_keep(&k->tracks, ids, w.n);
    return 0;
}

static void add_tracks(struct wall_map *k)
{
    const struct wall_tracks *t = &k->tracks;
    double far_m = k->survey->has_gate ? k->survey->gate_m[1] : WALLS_FAR_M;
    bool done[WALL_TRACKS_MAX] = {false};

    for (size_t round = 0; round < t->n; round++) {
        size_t best = t->n;
        for (size_t i = 0; i < t->n; i++)
            if (!done[i] &&
                (best == t->n || t->list[i].existence > t->list[best].existence))
                best = i;
        done[best] = true;
        const struct wall_track *w = &t->list[best];
        if (!w->confirmed)
            continue;
        size_t i = k->list.n++;
        k->list.list[i] =
            (struct wall_gate){.id = w->id, .plane = w->wall, .gate_m = {0.0, far_m}};
        k->list.existence[i] = w->existence;
        k->list.unseen_s[i] = w->unseen_s;
        k->list.origin[i] = k->from == WALL_FROM_TOPIC ? WALL_GIVEN : WALL_ESTIMATED;
    }
}

static void describe(struct wall_map *k)
{
    const struct wall_tracks *t = &k->tracks;

    k->text[0] = 0;
    if (k->list.n && k->blind)
        snprintf(k->text, sizeof k->text, "nobody tells how the vehicle moves");
    if (k->list.n)
        return;
    if (k->from == WALL_FROM_SURVEY)
        snprintf(k->text, sizeof k->text, "the survey names no wall");
    else if (k->bent_1_m != 0.0)
        snprintf(k->text, sizeof k->text,
                 "a wall is heard that is round, %s by a radius of %.1f m: where it "
                 "mirrors to is not known",
                 k->bent_1_m > 0.0 ? "outwards" : "inwards", 1.0 / fabs(k->bent_1_m));
    else if (k->undetermined)
        snprintf(k->text, sizeof k->text,
                 "a wall is heard, but this array cannot tell how it stands");
    else if (t->n_lost)
        snprintf(k->text, sizeof k->text, "wall %u is lost%s", t->lost_id,
                 k->blind ? ": nobody tells how the vehicle moves" : "");
    else
        snprintf(k->text, sizeof k->text, "no wall is known yet");
}

/* Those of the survey, beside the free view, which is the configuration's. */
static void add_configured(struct wall_map *k)
{
    const struct walls *from = &k->configured;

    k->list.n = from->n;
    memcpy(k->list.list, from->list, sizeof from->list);
    memcpy(k->list.existence, from->existence, sizeof from->existence);
    memcpy(k->list.unseen_s, from->unseen_s, sizeof from->unseen_s);
    memcpy(k->list.origin, from->origin, sizeof from->origin);
}

const struct walls *wall_map_list(struct wall_map *k)
{
    k->list.n = 0;
    if (k->from == WALL_FROM_SURVEY)
        add_configured(k);
    else if (k->survey)
        add_tracks(k);
    describe(k);
    return &k->list;
}
