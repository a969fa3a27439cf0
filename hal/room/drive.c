/* SPDX-License-Identifier: MIT */
#include "hal/room/drive.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hal/room/vector.h"

#define DRIVE_STEP_S 0.01

static void ego_at(const struct drive *d, double t_s, double *speed_m_s,
                   double *yaw_rate_rad_s)
{
    const struct scene_motion *ego = d->scene ? d->scene->ego : NULL;
    unsigned n = ego ? d->scene->n_ego : 0, k = 0;
    *speed_m_s = *yaw_rate_rad_s = 0;
    if (!n)
        return;
    while (k + 1 < n && t_s >= ego[k + 1].t_s)
        k++;
    const struct scene_motion *a = &ego[k], *b = a + (k + 1 < n);
    double part = b == a || t_s < a->t_s ? 0 : (t_s - a->t_s) / (b->t_s - a->t_s);
    *speed_m_s = a->speed_m_s + part * (b->speed_m_s - a->speed_m_s);
    *yaw_rate_rad_s =
        (a->yaw_rate_deg_s + part * (b->yaw_rate_deg_s - a->yaw_rate_deg_s)) * M_PI / 180;
}

/* Moves a place from one time to a later one, without a knot in between: the yaw's
 * parabola is exact, the way is Simpson's rule. */
static void advance_smooth(const struct drive *d, double from_s, double to_s,
                           double place[3])
{
    static const double weights[3] = {1 / 6.0, 4 / 6.0, 1 / 6.0};
    double h = to_s - from_s, x = 0, y = 0, v, w0, w1;
    ego_at(d, from_s, &v, &w0);
    ego_at(d, to_s - 1e-9 * h, &v, &w1);
    for (int i = 0; i < 3; i++) {
        double part = i / 2.0, w;
        double yaw = place[2] + h * part * (w0 + part * (w1 - w0) / 2);
        ego_at(d, from_s + (i == 2 ? 1 - 1e-9 : part) * h, &v, &w);
        x += weights[i] * h * v * cos(yaw);
        y += weights[i] * h * v * sin(yaw);
    }
    place[0] += x;
    place[1] += y;
    place[2] += h * (w0 + w1) / 2;
}

static void advance(const struct drive *d, double from_s, double to_s, double place[3])
{
    for (unsigned k = 0; d->scene && k < d->scene->n_ego; k++) {
        double t_s = d->scene->ego[k].t_s;
        if (!(t_s > from_s && t_s < to_s))
            continue;
        advance_smooth(d, from_s, t_s, place);
        from_s = t_s;
    }
    if (to_s > from_s)
        advance_smooth(d, from_s, to_s, place);
}

int drive_create(struct drive *out, const struct scene_drive *drive,
                 const struct survey *s)
{
    *out = (struct drive){.scene = drive, .survey = s, .n_places = 1};
    if (drive)
        out->n_places = (size_t)(drive->period_s / DRIVE_STEP_S) + 2;
    out->places = calloc(out->n_places, sizeof *out->places);
    if (!out->places)
        return -ENOMEM;
    for (size_t i = 1; i < out->n_places; i++) {
        memcpy(out->places[i], out->places[i - 1], sizeof *out->places);
        advance(out, (double)(i - 1) * DRIVE_STEP_S, (double)i * DRIVE_STEP_S,
                out->places[i]);
    }
    return 0;
}

void drive_clear(struct drive *d)
{
    free(d->places);
    *d = (struct drive){.scene = NULL};
}

double drive_time_s(const struct drive *d, double t_s)
{
    if (!d->scene)
        return 0;
    double t = fmod(t_s, d->scene->period_s);
    return t < 0 ? t + d->scene->period_s : t;
}

void drive_ego(const struct drive *d, double t_s, struct room_ego *out)
{
    double place[3];
    size_t i = (size_t)(fmax(t_s, 0) / DRIVE_STEP_S);
    i = i < d->n_places ? i : d->n_places - 1;
    memcpy(place, d->places[i], sizeof place);
    if (d->scene)
        advance(d, (double)i * DRIVE_STEP_S, t_s, place);
    *out = (struct room_ego){.x_m = place[0], .y_m = place[1], .yaw_rad = place[2]};
    ego_at(d, t_s, &out->speed_m_s, &out->yaw_rate_rad_s);
    out->standstill = out->speed_m_s == 0 && out->yaw_rate_rad_s == 0;
}

/* By what the vehicle stands elsewhere than its wheels say. */
static void rock(const struct scene_drive *drive, double t_s, struct room_ego *place)
{
    const struct scene_rock *r = drive->rock;
    double turns = round(r->frequency_hz * drive->period_s) * t_s / drive->period_s;
    double forward_m = r->forward_m * sin(2 * M_PI * turns);
    double left_m = r->left_m * sin(2 * M_PI * (turns + 1 / 3.0));
    double c = cos(place->yaw_rad), s = sin(place->yaw_rad);
    place->x_m += c * forward_m - s * left_m;
    place->y_m += s * forward_m + c * left_m;
    place->yaw_rad += r->yaw_deg * M_PI / 180 * sin(2 * M_PI * (turns + 2 / 3.0));
}

/* The mount's axes: rows x, y, z of the array in the vehicle frame. */
static void mount_axes(const struct survey *s, double axes[3][3])
{
    memcpy(axes[0], s->mount_x_axis, sizeof axes[0]);
    memcpy(axes[1], s->mount_y_axis, sizeof axes[1]);
    vector_cross(axes[0], axes[1], axes[2]);
}

void drive_frame(const struct drive *d, double t_s, struct drive_frame *out)
{
    struct room_ego ego;
    double mount[3][3], moved[3];
    *out = (struct drive_frame){.axes = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    if (!d->scene)
        return;
    drive_ego(d, t_s, &ego);
    if (d->scene->rock)
        rock(d->scene, t_s, &ego);
    mount_axes(d->survey, mount);
    double c = cos(ego.yaw_rad), s = sin(ego.yaw_rad);
    const double *o = d->survey->mount_origin_m;
    moved[0] = c * o[0] - s * o[1] + ego.x_m - o[0];
    moved[1] = s * o[0] + c * o[1] + ego.y_m - o[1];
    moved[2] = 0;
    for (int k = 0; k < 3; k++) {
        const double *m = mount[k];
        double turned[3] = {c * m[0] - s * m[1], s * m[0] + c * m[1], m[2]};
        out->origin_m[k] = vector_dot(mount[k], moved);
        for (int a = 0; a < 3; a++)
            out->axes[k][a] = vector_dot(mount[a], turned);
    }
}

void drive_to_ground(const struct drive_frame *f, const double p[3], double out[3])
{
    double q[3];
    memcpy(q, f->origin_m, sizeof q);
    for (int k = 0; k < 3; k++)
        vector_add(q, p[k], f->axes[k], q);
    memcpy(out, q, sizeof q);
}

void drive_turn_from_ground(const struct drive_frame *f, const double v[3], double out[3])
{
    double q[3];
    for (int k = 0; k < 3; k++)
        q[k] = vector_dot(f->axes[k], v);
    memcpy(out, q, sizeof q);
}

void drive_from_ground(const struct drive_frame *f, const double p[3], double out[3])
{
    double q[3];
    vector_add(p, -1, f->origin_m, q);
    drive_turn_from_ground(f, q, out);
}
