#include "recon/walls.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "recon/vehicle_frame.h"

static const double array_up[3] = {0.0, 1.0, 0.0};

void walls_from_survey(struct walls *out, const struct survey *s)
{
    *out = (struct walls){.n = s->n_walls};
    for (size_t i = 0; i < s->n_walls; i++) {
        struct wall_gate *w = &out->list[i];
        w->id = (uint32_t)i + 1;
        out->existence[i] = 1.0;
        w->plane.distance_m = s->walls[i].distance_m;
        memcpy(w->plane.normal, s->walls[i].normal, sizeof w->plane.normal);
        memcpy(w->gate_m, s->walls[i].gate_m, sizeof w->gate_m);
    }
    if (!s->has_wall || s->n_walls)
        return;
    out->n = 1;
    out->existence[0] = 1.0;
    out->list[0] = (struct wall_gate){
        .id = 1,
        .plane = {.distance_m = s->wall_distance_m},
        .gate_m = {0.0, WALLS_FAR_M},
    };
    memcpy(out->list[0].plane.normal, s->wall_normal, sizeof s->wall_normal);
}

void walls_step(struct walls *w, const struct survey *s, const struct ego_step *step)
{
    struct mount mount;
    double r[3][3], t[3];

    vehicle_frame_mount(s, &mount);
    mount_step(&mount, step, r, t);
    for (size_t i = 0; i < w->n; i++)
        wall_move(&w->list[i].plane, array_up, (const double(*)[3])r, t,
                  &w->list[i].plane);
}

/* A line from p to infinity crosses the border an odd number of times (Shimrat 1962). */
bool walls_in_free_view(const struct walls *w, const double p[3])
{
    bool inside = false;

    for (size_t i = 0, k = w->n_corners - 1; i < w->n_corners; k = i++) {
        const double *a = w->free_view_m[i], *b = w->free_view_m[k];
        if ((a[1] > p[2]) != (b[1] > p[2]) &&
            p[0] < a[0] + (b[0] - a[0]) * (p[2] - a[1]) / (b[1] - a[1]))
            inside = !inside;
    }
    return inside;
}
