/* SPDX-License-Identifier: MIT */
#include "nodes/rt/export_plan.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>

#include "nodes/rt/export_ink.h"
#include "nodes/rt/plan_view.h"

/* In units of a picture about 900 wide. */
#define FINENESS   1.5
#define RIGHT      210.0 /* names of tracks */
#define BOTTOM     112.0
#define TITLE_TEXT 20.0
#define SHORTEST   8.0 /* of an arrow */
#define CAR_WIDTH  1.8 /* m; the outline is a picture, not a measurement */

/* -- how it lies on paper ------------------------------------------------------------ */

#define SHEET_LEFT 78.0 /* of the plot, in units of the picture */
#define SHEET_TOP  52.0
#define SHEET_TEXT 15.0

struct sheet {
    cairo_t *cr;
    double low[2], high[2]; /* metres to the right and ahead, at the plot's edges */
    double per_metre, w, h; /* units; of the plot */
};

#define WIDEST    760.0
#define HIGHEST   640.0
#define PAD       0.06 /* of the larger side */
#define CAR_SHOWN 0.9
#define WENT_M    0.3  /* before it is shown, the vehicle has to go so far */
#define FASTEST   20.0 /* m/s of an arrow */

/* A place on the plan, in units from the picture's upper left corner. */
static void sheet_place(const struct sheet *p, const double at[2], double out[2])
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

static bool sheet_in_vehicle(const struct plan_picture *pic)
{
    return pic->survey->has_mount;
}

/* Of the i-th element, speakers first, on the plan; and the foremost of them all. */
static void sheet_element(const struct plan_picture *pic, size_t i, double out[2])
{
    const struct survey *s = pic->survey;
    double there[3];

    survey_to_vehicle(
        s, i < s->n_speakers ? s->speakers_m[i] : s->microphones_m[i - s->n_speakers],
        there);
    plan_point(s->has_mount, there, out);
}

static double sheet_front_of_car(const struct plan_picture *pic)
{
    double front = -INFINITY, at[2];

    for (size_t i = 0; i < pic->survey->n_speakers + pic->survey->n_microphones; i++) {
        sheet_element(pic, i, at);
        front = fmax(front, at[1]);
    }
    return front;
}

/* The last word of a track; NULL: there is none. */
static const struct plan_track *sheet_track(const struct plan_picture *pic, uint32_t id)
{
    for (size_t i = 0; i < pic->n_tracks; i++)
        if (pic->tracks[i].id == id)
            return &pic->tracks[i];
    return NULL;
}

/* The tip of a track's arrow on the plan: where it would be a second later.  false: its
 * velocity is not known, or too great to be drawn. */
static bool sheet_tip(const struct plan_picture *pic, const struct trail *k,
                      double out[2])
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

/* Has the vehicle moved?  Its own trail ends at its origin. */
/* The vehicle's own trail ends at its origin. */
static bool sheet_has_gone(const struct trail *own)
{
    for (size_t i = 0; i < own->n; i++)
        if (hypot(own->points[i].at_m[0], own->points[i].at_m[1]) > WENT_M)
            return true;
    return false;
}

/* The wall that the image is mirrored at; NULL: none. */
static const struct wall *sheet_first_wall(const struct plan_picture *pic)
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

/* Leaves cr alone. */
static void sheet_lay_out(struct sheet *p, const struct plan_picture *pic)
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

/* Moves cr to a place on the plan, or draws a line to it. */
static void sheet_go(const struct sheet *p, const double at[2], bool draws)
{
    double xy[2];

    sheet_place(p, at, xy);
    if (draws)
        cairo_line_to(p->cr, xy[0], xy[1]);
    else
        cairo_move_to(p->cr, xy[0], xy[1]);
}

/* -- what is drawn ------------------------------------------------------------------- */

static const double ink[3] = {0.15, 0.15, 0.18}, wall_blue[3] = {0.18, 0.37, 0.55},
                    area_blue[3] = {0.53, 0.68, 0.84}, car_grey[3] = {0.9, 0.91, 0.93};

static void colour(cairo_t *cr, const double rgb[3], double alpha)
{
    cairo_set_source_rgba(cr, rgb[0], rgb[1], rgb[2], alpha);
}

static void draw_axis(const struct sheet *p, const struct plan_picture *pic, int axis)
{
    double step = ink_tick_step(p->high[axis] - p->low[axis],
                                fmax((axis ? p->h : p->w) / 75.0, 2.0));
    const char *label[2] = {sheet_in_vehicle(pic) ? "y (m), left of the vehicle"
                                                  : "x (m)",
                            sheet_in_vehicle(pic) ? "x (m), ahead" : "z (m)"};
    char text[32];

    for (double i = ceil(p->low[axis] / step - 1e-9); i * step <= p->high[axis];
         i += 1.0) {
        double at[2] = {axis ? p->low[0] : i * step, axis ? i * step : p->low[1]}, xy[2];
        double value = !axis && sheet_in_vehicle(pic) ? -i * step : i * step;
        sheet_place(p, at, xy);
        colour(p->cr, ink, 0.12);
        cairo_set_line_width(p->cr, 1.0);
        cairo_move_to(p->cr, xy[0], axis ? xy[1] : SHEET_TOP);
        cairo_line_to(p->cr, axis ? SHEET_LEFT + p->w : xy[0],
                      axis ? xy[1] : SHEET_TOP + p->h);
        cairo_stroke(p->cr);
        colour(p->cr, ink, 1.0);
        snprintf(text, sizeof text, "%.*f", ink_digits(step), value + 0.0);
        ink_text(p->cr, axis ? SHEET_LEFT - 9.0 : xy[0],
                 axis ? xy[1] : SHEET_TOP + p->h + 16.0, SHEET_TEXT,
                 axis ? INK_RIGHT : INK_CENTRE, text);
    }
    cairo_save(p->cr);
    cairo_translate(p->cr, axis ? SHEET_LEFT - 58.0 : SHEET_LEFT + 0.5 * p->w,
                    axis ? SHEET_TOP + 0.5 * p->h : SHEET_TOP + p->h + 40.0);
    cairo_rotate(p->cr, axis ? -M_PI / 2.0 : 0.0);
    ink_text(p->cr, 0.0, 0.0, SHEET_TEXT, INK_CENTRE, label[axis]);
    cairo_restore(p->cr);
}

static void draw_area(const struct sheet *p, const struct plan_picture *pic)
{
    double corners[4][2];

    if (!pic->grid)
        return;
    plan_footprint(pic->survey, sheet_first_wall(pic), pic->grid, corners);
    for (int c = 0; c < 4; c++)
        sheet_go(p, corners[c], c > 0);
    cairo_close_path(p->cr);
    colour(p->cr, area_blue, 0.18);
    cairo_fill(p->cr);
}

static void draw_walls(const struct sheet *p, const struct plan_picture *pic)
{
    double at[2], direction[2];

    for (size_t i = 0; i < pic->walls->n; i++) {
        if (!plan_wall(pic->survey, &pic->walls->list[i].plane, at, direction))
            continue;
        for (int end = 0; end < 2; end++) {
            double far = end ? 1e3 : -1e3;
            sheet_go(
                p,
                (const double[2]){at[0] + far * direction[0], at[1] + far * direction[1]},
                end);
        }
        colour(p->cr, wall_blue, 1.0);
        cairo_set_line_width(p->cr, 5.0);
        cairo_stroke(p->cr);
    }
}

static void draw_car(const struct sheet *p, const struct plan_picture *pic)
{
    double front = sheet_front_of_car(pic), left[2], right[2];

    if (!sheet_in_vehicle(pic))
        return;
    sheet_place(p, (const double[2]){-0.5 * CAR_WIDTH, front - 0.03}, left);
    sheet_place(p, (const double[2]){0.5 * CAR_WIDTH, front - 5.0}, right);
    cairo_rectangle(p->cr, left[0], left[1], right[0] - left[0], right[1] - left[1]);
    colour(p->cr, car_grey, 1.0);
    cairo_fill_preserve(p->cr);
    colour(p->cr, ink, 0.6);
    cairo_set_line_width(p->cr, 1.2);
    cairo_stroke(p->cr);
}

static void draw_array(const struct sheet *p, const struct plan_picture *pic)
{
    double at[2], xy[2];

    for (size_t i = 0; i < pic->survey->n_speakers + pic->survey->n_microphones; i++) {
        sheet_element(pic, i, at);
        sheet_place(p, at, xy);
        cairo_new_sub_path(p->cr);
        cairo_arc(p->cr, xy[0], xy[1], 2.5, 0.0, 2.0 * M_PI);
    }
    colour(p->cr, ink, 1.0);
    cairo_fill(p->cr);
}

/* Each track has a colour of its own; set apart by lightness too. */
static const double tones[6][3] = {{0.76, 0.30, 0.0},  {0.0, 0.42, 0.30},
                                   {0.55, 0.10, 0.45}, {0.10, 0.25, 0.65},
                                   {0.45, 0.40, 0.0},  {0.75, 0.10, 0.15}};

static void tone(cairo_t *cr, uint32_t id)
{
    const double *rgb = tones[id % 6];

    cairo_set_source_rgb(cr, rgb[0], rgb[1], rgb[2]);
}

/* In the pen's colour; dashed where it was predicted. */
static void draw_trail(const struct sheet *p, const struct plan_picture *pic,
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
    draw_trail(p, pic, k);
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

    snprintf(text, sizeof text, "%u%s%s", (unsigned)id, k && k->class[0] ? " " : "",
             k ? k->class : "");
    if (isfinite(speed))
        text_add(text, sizeof text, ", ", "%.1f m/s", speed);
    tone(p->cr, id);
    cairo_rectangle(p->cr, x, *y - 5.0, 10.0, 10.0);
    cairo_fill(p->cr);
    ink_text(p->cr, x + 16.0, *y, SHEET_TEXT, INK_LEFT, text);
    *y += 22.0;
}

static void draw_tracks(const struct sheet *p, const struct plan_picture *pic)
{
    for (size_t i = 0; i < TRAILS_MAX; i++)
        if (pic->trails->list[i].n)
            draw_track(p, pic, &pic->trails->list[i]);
}

/* Beside the plan, where no trail crosses them, as many as there is room for. */
static void name_tracks(const struct sheet *p, const struct plan_picture *pic)
{
    double y = SHEET_TOP + 18.0;

    for (size_t i = 0; i < TRAILS_MAX && y < SHEET_TOP + p->h; i++)
        if (pic->trails->list[i].n)
            name_track(p, pic, pic->trails->list[i].id, &y);
}

static void draw_plot(const struct sheet *p, const struct plan_picture *pic)
{
    cairo_save(p->cr);
    cairo_rectangle(p->cr, SHEET_LEFT, SHEET_TOP, p->w, p->h);
    cairo_clip(p->cr);
    draw_area(p, pic);
    draw_car(p, pic);
    draw_walls(p, pic);
    colour(p->cr, ink, 0.7);
    cairo_set_line_width(p->cr, 1.5);
    if (sheet_has_gone(&pic->trails->own))
        draw_trail(p, pic, &pic->trails->own);
    draw_array(p, pic);
    draw_tracks(p, pic);
    cairo_restore(p->cr);
    name_tracks(p, pic);
}

static void draw(struct sheet *p, const struct plan_picture *pic)
{
    cairo_scale(p->cr, FINENESS, FINENESS);
    cairo_set_source_rgb(p->cr, 1.0, 1.0, 1.0);
    cairo_paint(p->cr);
    cairo_select_font_face(p->cr, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                           CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_line_cap(p->cr, CAIRO_LINE_CAP_BUTT);
    cairo_set_line_join(p->cr, CAIRO_LINE_JOIN_ROUND);
    draw_axis(p, pic, 0);
    draw_axis(p, pic, 1);
    draw_plot(p, pic);
    colour(p->cr, ink, 1.0);
    cairo_set_line_width(p->cr, 1.5);
    cairo_rectangle(p->cr, SHEET_LEFT, SHEET_TOP, p->w, p->h);
    cairo_stroke(p->cr);
    ink_text(
        p->cr, SHEET_LEFT, SHEET_TOP + p->h + 70.0, SHEET_TEXT, INK_LEFT,
        "Blue: walls, and shaded what is imaged.  Dashed: where a track was not seen.");
    ink_text(p->cr, SHEET_LEFT, SHEET_TOP + p->h + 92.0, SHEET_TEXT, INK_LEFT,
             "Dot and arrow: where it was last, and its motion over ground in a second.");
    cairo_select_font_face(p->cr, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                           CAIRO_FONT_WEIGHT_BOLD);
    ink_text(p->cr, SHEET_LEFT + 0.5 * p->w, SHEET_TOP - 26.0, TITLE_TEXT, INK_CENTRE,
             pic->title);
}

int export_plan(const char *folder, const char *name, const struct plan_picture *pic,
                struct error *why)
{
    struct sheet p;

    sheet_lay_out(&p, pic);
    cairo_surface_t *surface = cairo_image_surface_create(
        CAIRO_FORMAT_RGB24, (int)lrint(FINENESS * (SHEET_LEFT + p.w + RIGHT)),
        (int)lrint(FINENESS * (SHEET_TOP + p.h + BOTTOM)));
    p.cr = cairo_create(surface);
    draw(&p, pic);
    int err = cairo_status(p.cr) == CAIRO_STATUS_SUCCESS ? 0 : -ENOMEM;
    cairo_destroy(p.cr);
    if (!err)
        err = ink_png(folder, name, surface, why);
    if (err == -ENOMEM)
        error_say(why, err, "%s/%s: out of memory", folder, name);
    cairo_surface_destroy(surface);
    return err;
}
