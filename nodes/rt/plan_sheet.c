/* SPDX-License-Identifier: MIT */
#include "nodes/rt/plan_sheet.h"

#include <math.h>

#include "nodes/rt/plan_view.h"

#define WIDEST    760.0
#define HIGHEST   640.0
#define PAD       0.06 /* of the larger side */
#define CAR_SHOWN 0.9
#define WENT_M    0.3  /* before it is shown, the vehicle has to go so far */
#define FASTEST   20.0 /* m/s of an arrow */

void sheet_place(const struct sheet *p, const double at[2], double out[2])
{
    out[0] = SHEET_LEFT + p->per_metre * (at[0] - p->low[0]);
    out[1] = SHEET_TOP + p->per_metre * (p->high[1] - at[1]);
}

static void include(struct sheet *p, const double at[2])
{
    for (int i = 0; i < 2; i++) {
        p->low[i] = fmin(p->low[i], at[i]);
        p->high[i] = fmax(p->high[i], at[i]);
    }
}

bool sheet_in_vehicle(const struct plan_picture *pic)
{
    return pic->survey->has_mount;
}

void sheet_element(const struct plan_picture *pic, size_t i, double out[2])
{
    const struct survey *s = pic->survey;
    double there[3];

    survey_to_vehicle(
        s, i < s->n_speakers ? s->speakers_m[i] : s->microphones_m[i - s->n_speakers],
        there);
    plan_point(s->has_mount, there, out);
}

double sheet_front_of_car(const struct plan_picture *pic)
{
    double front = -INFINITY, at[2];

    for (size_t i = 0; i < pic->survey->n_speakers + pic->survey->n_microphones; i++) {
        sheet_element(pic, i, at);
        front = fmax(front, at[1]);
    }
    return front;
}

const struct plan_track *sheet_track(const struct plan_picture *pic, uint32_t id)
{
    for (size_t i = 0; i < pic->n_tracks; i++)
        if (pic->tracks[i].id == id)
            return &pic->tracks[i];
    return NULL;
}

bool sheet_tip(const struct plan_picture *pic, const struct trail *k, double out[2])
{
    const struct plan_track *track = k->n ? sheet_track(pic, k->id) : NULL;
    double velocity[2];

    if (!track || !(hypot(track->velocity_m_s[0], track->velocity_m_s[1]) < FASTEST))
        return false;
    plan_point(true,
               (const double[3]){track->velocity_m_s[0], track->velocity_m_s[1], 0.0},
               velocity);
    plan_point(sheet_in_vehicle(pic), k->points[k->n - 1].at_m, out);
    for (int i = 0; i < 2; i++)
        out[i] += velocity[i];
    return true;
}

static void include_trail(struct sheet *p, const struct plan_picture *pic,
                          const struct trail *k)
{
    double at[2];

    for (size_t i = 0; i < k->n; i++) {
        plan_point(sheet_in_vehicle(pic), k->points[i].at_m, at);
        include(p, at);
    }
}

/* The vehicle's own trail ends at its origin. */
bool sheet_has_gone(const struct trail *own)
{
    for (size_t i = 0; i < own->n; i++)
        if (hypot(own->points[i].at_m[0], own->points[i].at_m[1]) > WENT_M)
            return true;
    return false;
}

const struct wall *sheet_first_wall(const struct plan_picture *pic)
{
    return pic->walls->n ? &pic->walls->list[0].plane : NULL;
}

static void include_all(struct sheet *p, const struct plan_picture *pic)
{
    double at[2], direction[2], corners[4][2];

    for (int i = 0; i < 2; i++) {
        p->low[i] = INFINITY;
        p->high[i] = -INFINITY;
    }
    for (size_t i = 0; i < pic->survey->n_speakers + pic->survey->n_microphones; i++) {
        sheet_element(pic, i, at);
        include(p, at);
    }
    if (sheet_in_vehicle(pic))
        include(p, (const double[2]){0.0, sheet_front_of_car(pic) - CAR_SHOWN});
    if (sheet_has_gone(&pic->trails->own))
        include_trail(p, pic, &pic->trails->own);
    for (size_t i = 0; i < TRAILS_MAX; i++) {
        include_trail(p, pic, &pic->trails->list[i]);
        if (sheet_tip(pic, &pic->trails->list[i], at))
            include(p, at);
    }
    for (size_t i = 0; i < pic->walls->n; i++)
        if (plan_wall(pic->survey, &pic->walls->list[i].plane, at, direction))
            include(p, at);
    if (!pic->grid)
        return;
    plan_footprint(pic->survey, sheet_first_wall(pic), pic->grid, corners);
    for (int c = 0; c < 4; c++)
        include(p, corners[c]);
}

void sheet_lay_out(struct sheet *p, const struct plan_picture *pic)
{
    include_all(p, pic);
    double pad = PAD * fmax(fmax(p->high[0] - p->low[0], p->high[1] - p->low[1]), 0.5);

    for (int i = 0; i < 2; i++) {
        p->low[i] -= pad;
        p->high[i] += pad;
    }
    double w = p->high[0] - p->low[0], h = p->high[1] - p->low[1];
    p->per_metre = fmin(WIDEST / w, HIGHEST / h);
    double more = 0.5 * (WIDEST / p->per_metre - w); /* the width is there anyway */
    p->low[0] -= more;
    p->high[0] += more;
    p->w = WIDEST;
    p->h = round(p->per_metre * h);
}

void sheet_go(const struct sheet *p, const double at[2], bool draws)
{
    double xy[2];

    sheet_place(p, at, xy);
    if (draws)
        cairo_line_to(p->cr, xy[0], xy[1]);
    else
        cairo_move_to(p->cr, xy[0], xy[1]);
}
