/* SPDX-License-Identifier: MIT */
#include "nodes/rt/plan_tracks.h"

#include <math.h>
#include <stdio.h>

#include "nodes/rt/export_ink.h"
#include "nodes/rt/plan_view.h"

#define SHORTEST 8.0 /* units of an arrow */

/* Set apart by lightness too. */
static const double tones[6][3] = {{0.76, 0.30, 0.0},  {0.0, 0.42, 0.30},
                                   {0.55, 0.10, 0.45}, {0.10, 0.25, 0.65},
                                   {0.45, 0.40, 0.0},  {0.75, 0.10, 0.15}};

static void tone(cairo_t *cr, uint32_t id)
{
    const double *rgb = tones[id % 6];

    cairo_set_source_rgb(cr, rgb[0], rgb[1], rgb[2]);
}

void plan_tracks_trail(const struct sheet *p, const struct plan_picture *pic,
                       const struct trail *k)
{
    static const double dashes[2] = {5.0, 4.0};
    double at[2];

    for (size_t i = 1; i < k->n; i++) {
        for (size_t end = 0; end < 2; end++) {
            plan_point(sheet_in_vehicle(pic), k->points[i - 1 + end].at_m, at);
            sheet_go(p, at, end > 0);
        }
        cairo_set_dash(p->cr, dashes, k->points[i].measured ? 0 : 2, 0.0);
        cairo_stroke(p->cr);
    }
    cairo_set_dash(p->cr, dashes, 0, 0.0);
}

/* From where it was last. */
static void draw_arrow(const struct sheet *p, const double from[2], const double tip[2])
{
    double to[2];

    sheet_place(p, tip, to);
    if (!(hypot(to[0] - from[0], to[1] - from[1]) > SHORTEST))
        return;
    double turn = atan2(to[1] - from[1], to[0] - from[0]);
    cairo_move_to(p->cr, from[0], from[1]);
    cairo_line_to(p->cr, to[0], to[1]);
    for (int side = -1; side <= 1; side += 2) {
        cairo_move_to(p->cr, to[0], to[1]);
        cairo_line_to(p->cr, to[0] - 11.0 * cos(turn + 0.45 * side),
                      to[1] - 11.0 * sin(turn + 0.45 * side));
    }
    cairo_stroke(p->cr);
}

/* A dot where it was last. */
static void draw_track(const struct sheet *p, const struct plan_picture *pic,
                       const struct trail *k)
{
    double at[2], xy[2];
    char id[16];

    plan_point(sheet_in_vehicle(pic), k->points[k->n - 1].at_m, at);
    sheet_place(p, at, xy);
    tone(p->cr, k->id);
    cairo_set_line_width(p->cr, 2.4);
    plan_tracks_trail(p, pic, k);
    if (sheet_tip(pic, k, at))
        draw_arrow(p, xy, at);
    cairo_new_sub_path(p->cr);
    cairo_arc(p->cr, xy[0], xy[1], 5.0, 0.0, 2.0 * M_PI);
    cairo_fill(p->cr);
    snprintf(id, sizeof id, "%u", (unsigned)k->id);
    ink_text(p->cr, xy[0], xy[1] - 15.0, SHEET_TEXT, INK_CENTRE, id);
}

static void name_track(const struct sheet *p, const struct plan_picture *pic, uint32_t id,
                       double *y)
{
    const struct plan_track *k = sheet_track(pic, id);
    double speed = k ? hypot(k->velocity_m_s[0], k->velocity_m_s[1]) : NAN;
    double x = SHEET_LEFT + p->w + 16.0;
    char text[96];

    int n = snprintf(text, sizeof text, "%u%s%s", (unsigned)id,
                     k && k->class[0] ? " " : "", k ? k->class : "");
    if (isfinite(speed))
        snprintf(text + n, sizeof text - (size_t)n, ", %.1f m/s", speed);
    tone(p->cr, id);
    cairo_rectangle(p->cr, x, *y - 5.0, 10.0, 10.0);
    cairo_fill(p->cr);
    ink_text(p->cr, x + 16.0, *y, SHEET_TEXT, INK_LEFT, text);
    *y += 22.0;
}

void plan_tracks_draw(const struct sheet *p, const struct plan_picture *pic)
{
    for (size_t i = 0; i < TRAILS_MAX; i++)
        if (pic->trails->list[i].n)
            draw_track(p, pic, &pic->trails->list[i]);
}

void plan_tracks_name(const struct sheet *p, const struct plan_picture *pic)
{
    double y = SHEET_TOP + 18.0;

    for (size_t i = 0; i < TRAILS_MAX && y < SHEET_TOP + p->h; i++)
        if (pic->trails->list[i].n)
            name_track(p, pic, pic->trails->list[i].id, &y);
}
