#include "hal/room/figure.h"

#include <math.h>
#include <string.h>

#include "hal/room/scene.h"
#include "hal/room/vector.h"

/* From the middle of the body; swing: of what goes to and fro along the way; power: its
 * part of the whole, in any unit; front: where a panel looks. */
struct part {
    double ahead_m, left_m, up_m, swing_m, power;
    double front_ahead, front_left;
};

static const struct part person[] = {
    {0.02, 0, 0.78, 0, 9, 0, 0},          /* head */
    {0, 0.20, 0.55, 0, 7, 0, 0},          /* shoulders */
    {0, -0.20, 0.55, 0, 7, 0, 0},         /**/
    {0.12, 0, 0.38, 0, 14, 0, 0},         /* chest, back, belly */
    {-0.12, 0, 0.30, 0, 14, 0, 0},        /**/
    {0.10, 0, 0.14, 0, 9, 0, 0},          /**/
    {-0.02, 0.25, 0.06, -0.14, 5, 0, 0},  /* hands, against the feet */
    {-0.02, -0.25, 0.06, 0.14, 5, 0, 0},  /**/
    {0.03, 0.09, -0.38, 0.11, 9, 0, 0},   /* knees */
    {0.03, -0.09, -0.38, -0.11, 9, 0, 0}, /**/
    {0.05, 0.09, -0.82, 0.22, 6, 0, 0},   /* feet: what stands does not slip */
    {0.05, -0.09, -0.82, -0.22, 6, 0, 0}, /**/
};

static const struct part cyclist[] = {
    {0.10, 0, 0.75, 0, 6, 0, 0},          /* head */
    {0.05, 0.20, 0.50, 0, 6, 0, 0},       /* shoulders */
    {0.05, -0.20, 0.50, 0, 6, 0, 0},      /**/
    {-0.10, 0, 0.35, 0, 14, 0, 0},        /* trunk */
    {-0.25, 0, 0.15, 0, 12, 0, 0},        /**/
    {0.42, 0.22, 0.25, 0, 4, 0, 0},       /* hands */
    {0.42, -0.22, 0.25, 0, 4, 0, 0},      /**/
    {0.02, 0.12, -0.10, 0.14, 6, 0, 0},   /* knees and feet */
    {0.02, -0.12, -0.10, -0.14, 6, 0, 0}, /**/
    {0, 0.12, -0.52, 0.17, 4, 0, 0},      /**/
    {0, -0.12, -0.52, -0.17, 4, 0, 0},    /**/
    {0.82, 0, -0.52, 0, 5, 0, 0},         /* front wheel: rim and hub */
    {0.54, 0, -0.52, 0, 5, 0, 0},         /**/
    {0.54, 0, -0.20, 0, 4, 0, 0},         /* steering head, seat tube */
    {-0.20, 0, -0.30, 0, 4, 0, 0},        /**/
    {-0.50, 0, -0.52, 0, 5, 0, 0},        /* back wheel */
    {-0.82, 0, -0.52, 0, 5, 0, 0},        /**/
};

static const struct part car[] = {
    {2.10, 0.70, -0.20, 0, 6, 0.7, 0.7},   /* corners, where bumpers and lamps are */
    {2.10, -0.70, -0.20, 0, 6, 0.7, -0.7}, /**/
    {-2.10, 0.70, -0.15, 0, 6, -0.7, 0.7}, /**/
    {-2.10, -0.70, -0.15, 0, 6, -0.7, -0.7},
    {2.15, 0.25, -0.25, 0, 8, 1, 0}, /* front and back */
    {2.15, -0.25, -0.10, 0, 8, 1, 0},
    {-2.15, 0.25, -0.05, 0, 8, -1, 0},
    {-2.15, -0.25, -0.25, 0, 8, -1, 0},
    {1.35, 0.86, -0.40, 0, 5, 0, 1}, /* wheels */
    {-1.30, 0.86, -0.40, 0, 5, 0, 1},
    {1.35, -0.86, -0.40, 0, 5, 0, -1},
    {-1.30, -0.86, -0.40, 0, 5, 0, -1},
    {0.60, 0.87, -0.05, 0, 8, 0, 1}, /* doors */
    {-0.50, 0.87, -0.05, 0, 8, 0, 1},
    {0.60, -0.87, -0.05, 0, 8, 0, -1},
    {-0.50, -0.87, -0.05, 0, 8, 0, -1},
    {0.90, 0.80, 0.25, 0, 4, 0, 1}, /* mirrors */
    {0.90, -0.80, 0.25, 0, 4, 0, -1},
    {0.40, 0.65, 0.50, 0, 3, 0.3, 0.9}, /* windows, roof edges */
    {0.40, -0.65, 0.50, 0, 3, 0.3, -0.9},
    {-1.20, 0.60, 0.50, 0, 3, -0.6, 0.8},
    {-1.20, -0.60, 0.50, 0, 3, -0.6, -0.8},
};

/* The limbs swing once in two steps of a walk, once in a turn of the pedals. */
static const struct figure {
    const struct part *parts;
    size_t n;
    double size_m[3]; /* ahead, left, up */
    double scattering_length_m, cycle_m;
} figures[SCENE_KINDS] = {
    [SCENE_PERSON] =
        {person, sizeof person / sizeof *person, {0.3, 0.5, 1.75}, FIGURE_PERSON_M, 1.4},
    [SCENE_CYCLIST] =
        {cyclist, sizeof cyclist / sizeof *cyclist, {1.75, 0.5, 1.7}, 0.2, 4.5},
    /* Half of the panels look away, and those that do not look past the array. */
    [SCENE_CAR] = {car, sizeof car / sizeof *car, {4.3, 1.75, 1.45}, 1.4, 1},
};

size_t figure_size(int kind)
{
    return figures[kind].n;
}

double figure_scattering_length_m(int kind)
{
    return figures[kind].scattering_length_m;
}

static void axes_of(const struct figure_pose *pose, double axes[3][3])
{
    memcpy(axes[0], pose->heading, sizeof axes[0]);
    vector_cross(pose->up, pose->heading, axes[1]);
    memcpy(axes[2], pose->up, sizeof axes[2]);
}

void figure_set(int kind, const struct figure_pose *pose, double scattering_length_m,
                struct scatter_piece *out)
{
    const struct figure *f = &figures[kind];
    double axes[3][3], power = 0, swing = sin(2 * M_PI * pose->walked_m / f->cycle_m);
    axes_of(pose, axes);
    for (size_t i = 0; i < f->n; i++)
        power += f->parts[i].power;
    for (size_t i = 0; i < f->n; i++) {
        const struct part *p = &f->parts[i];
        out[i] = (struct scatter_piece){.weight = scattering_length_m *
                                                  sqrt(p->power / power)};
        vector_add(pose->centre_m, p->ahead_m + swing * p->swing_m, axes[0], out[i].in);
        vector_add(out[i].in, p->left_m, axes[1], out[i].in);
        vector_add(out[i].in, p->up_m, axes[2], out[i].in);
        memcpy(out[i].out, out[i].in, sizeof out[i].out);
        vector_add(out[i].normal, p->front_ahead, axes[0], out[i].normal);
        vector_add(out[i].normal, p->front_left, axes[1], out[i].normal);
        vector_normalize(out[i].normal);
    }
}

void figure_extent(int kind, const struct figure_pose *pose, double out[3])
{
    double axes[3][3];
    axes_of(pose, axes);
    for (int a = 0; a < 3; a++) {
        out[a] = 0;
        for (int k = 0; k < 3; k++)
            out[a] += fabs(axes[k][a]) * figures[kind].size_m[k];
    }
}
