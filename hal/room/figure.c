/* SPDX-License-Identifier: MIT */
#include "hal/room/figure.h"

#include <math.h>
#include <string.h>

#include "hal/room/scene.h"
#include "hal/room/vector.h"

#define CLOTHES 0.5 /* of the sound's power is reflected */

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

/* Opaque bodies: parts from joint to joint, lengths in m. */

struct builder { /* as it is built */
    const struct figure_pose *pose;
    double axes[3][3], weight;
    struct scatter_piece *pieces;
    struct glint_part *parts;
    size_t n;
};

static void place(const struct builder *b, const double p[3], double out[3])
{
    memcpy(out, b->pose->centre_m, 3 * sizeof *out);
    for (int k = 0; k < 3; k++)
        vector_add(out, p[k], b->axes[k], out);
}

static struct glint_part *add_part(struct builder *b, const double centre[3])
{
    struct scatter_piece *piece = &b->pieces[b->n];
    struct glint_part *part = &b->parts[b->n++];
    *piece = (struct scatter_piece){.weight = b->weight};
    *part = (struct glint_part){.from = {-1, -1, -1}, .to = {1, 1, 1}};
    place(b, centre, piece->in);
    memcpy(piece->out, piece->in, sizeof piece->out);
    return part;
}

/* An ellipsoid whose ends are a tenth beyond two joints; how thick it is to the side, and
 * at right angles to that. */
static void add_limb(struct builder *b, const double from[3], const double to[3],
                     double left_m, double thick_m)
{
    double middle[3], a[3], c[3];
    for (int k = 0; k < 3; k++)
        middle[k] = (from[k] + to[k]) / 2;
    struct glint_part *part = add_part(b, middle);
    place(b, from, a);
    place(b, to, c);
    vector_add(c, -1, a, c);
    for (int k = 0; k < 3; k++) {
        part->half_axes[0][k] = 0.55 * c[k];
        part->half_axes[1][k] = left_m * b->axes[1][k];
    }
    vector_cross(b->axes[1], c, part->half_axes[2]);
    vector_normalize(part->half_axes[2]);
    for (int k = 0; k < 3; k++)
        part->half_axes[2][k] *= thick_m;
}

/* What hangs from a joint at an angle from straight down, forward. */
static void hang(const double joint[3], double length_m, double angle, double left_m,
                 double end[3])
{
    end[0] = joint[0] + length_m * sin(angle);
    end[1] = left_m;
    end[2] = joint[2] - length_m * cos(angle);
}

static void add_leg(struct builder *b, const double hip[3], double thigh, double shank)
{
    double knee[3], ankle[3], heel[3], toe[3];
    hang(hip, 0.43, thigh, hip[1], knee);
    hang(knee, 0.42, shank, hip[1], ankle);
    memcpy(heel, ankle, sizeof heel);
    memcpy(toe, ankle, sizeof toe);
    heel[0] -= 0.05;
    toe[0] += 0.18;
    add_limb(b, hip, knee, 0.075, 0.075);
    add_limb(b, knee, ankle, 0.05, 0.055);
    add_limb(b, heel, toe, 0.04, 0.04);
}

static void add_walker(struct builder *b, double cycle_m)
{
    static const double trunk[3][3] = {{0, 0, 0.10}, {0, 0, 0.36}, {0.02, 0, 0.62}};
    static const double hip[3] = {0, 0, -0.05};
    static const double head[2][3] = {{0.03, 0, 0.63}, {0.03, 0, 0.86}};
    add_limb(b, trunk[0], trunk[2], 0.18, 0.115);
    add_limb(b, hip, trunk[1], 0.17, 0.11);
    add_limb(b, head[0], head[1], 0.08, 0.10);
    for (int side = -1; side <= 1; side += 2) {
        double phase = 2 * M_PI * b->pose->walked_m / cycle_m + (side < 0 ? M_PI : 0);
        double joint[3] = {0, 0.09 * side, 0.03}, shoulder[3] = {0, 0.20 * side, 0.54};
        double elbow[3], hand[3], lift = fmax(cos(phase), 0);
        double thigh = 0.4 * sin(phase), arm = -0.4 * sin(phase);
        add_leg(b, joint, thigh, thigh - 0.1 - 0.9 * lift * lift);
        hang(shoulder, 0.30, arm, 0.23 * side, elbow);
        hang(elbow, 0.27, arm + 0.3, 0.23 * side, hand);
        add_limb(b, shoulder, elbow, 0.045, 0.045);
        add_limb(b, elbow, hand, 0.035, 0.035);
    }
}

/* The two bones of a leg from hip to pedal bend forward at the knee. */
static void add_rider(struct builder *b, double cycle_m)
{
    static const double trunk[2][3] = {{-0.22, 0, 0.10}, {0.10, 0, 0.58}};
    static const double head[2][3] = {{0.20, 0, 0.60}, {0.22, 0, 0.82}};
    const double bone_m = 0.43;
    add_limb(b, trunk[0], trunk[1], 0.17, 0.12);
    add_limb(b, head[0], head[1], 0.08, 0.10);
    for (int side = -1; side <= 1; side += 2) {
        double turn = 2 * M_PI * b->pose->walked_m / cycle_m + (side < 0 ? M_PI : 0);
        double hip[3] = {-0.20, 0.10 * side, 0.10};
        double ahead = 0.17 * cos(turn) + 0.18, down = 0.62 - 0.17 * sin(turn);
        double bend = acos(fmin(hypot(ahead, down) / (2 * bone_m), 1));
        double along = atan2(ahead, down);
        double shoulder[3] = {0.08, 0.19 * side, 0.54},
               grip[3] = {0.42, 0.22 * side, 0.25};
        add_leg(b, hip, along + bend, along - bend);
        add_limb(b, shoulder, grip, 0.04, 0.04);
    }
}

/* A piece of an ellipsoid of which one half-axis is short: a plate that bulges, with its
 * middle at `middle`, `half` its size, `radius` how it is bent, along two axes. */
static void add_panel(struct builder *b, const double middle[3], const double look[3],
                      int across, const double half[2], const double radius[2])
{
    const double deep_m = 0.3;
    double centre[3];
    for (int k = 0; k < 3; k++)
        centre[k] = middle[k] - deep_m * look[k];
    struct glint_part *part = add_part(b, centre);
    for (int k = 0; k < 3; k++)
        vector_add(part->half_axes[0], deep_m * look[k], b->axes[k], part->half_axes[0]);
    part->from[0] = 0;
    for (int i = 0; i < 2; i++) {
        double size_m = sqrt(radius[i] * deep_m);
        vector_add(part->half_axes[1 + i], size_m, b->axes[i ? 2 : across],
                   part->half_axes[1 + i]);
        part->to[1 + i] = fmin(half[i] / size_m, 1);
        part->from[1 + i] = -part->to[1 + i];
    }
}

static void add_vehicle(struct builder *b)
{
    static const double flank_m[2] = {1.75, 0.30}, flank_radius_m[2] = {16, 1.5};
    static const double end_m[2] = {0.55, 0.20}, end_radius_m[2] = {3, 0.6};
    static const double corner_m[3] = {0.20, 0.20, 0.35}, cabin_m[3] = {1.2, 0.70, 0.40};
    static const double cabin[3] = {-0.2, 0, 0.30};
    for (int side = -1; side <= 1; side += 2) {
        const double flank[3] = {0, 0.875 * side, -0.15}, to_side[3] = {0, side, 0};
        const double end[3] = {2.15 * side, 0, -0.2}, ahead[3] = {side, 0, 0};
        add_panel(b, flank, to_side, 0, flank_m, flank_radius_m);
        add_panel(b, end, ahead, 1, end_m, end_radius_m);
        for (int left = -1; left <= 1; left += 2) {
            const double corner[3] = {1.95 * side, 0.675 * left, -0.2};
            struct glint_part *part = add_part(b, corner);
            const double out[3] = {side, left, 1};
            for (int k = 0; k < 3; k++) {
                vector_add(part->half_axes[k], corner_m[k] * out[k], b->axes[k],
                           part->half_axes[k]);
                part->from[k] = k < 2 ? 0 : -1;
            }
        }
    }
    struct glint_part *part = add_part(b, cabin);
    for (int k = 0; k < 3; k++)
        vector_add(part->half_axes[k], cabin_m[k], b->axes[k], part->half_axes[k]);
    part->from[2] = 0;
}

/* The limbs swing once in two steps of a walk, once in a turn of the pedals. */
static const struct figure {
    const struct part *parts;
    size_t n;
    size_t n_opaque, first_point; /* parts; of `parts` the points that remain: a bicycle,
                                     a car's wheels */
    size_t n_points;
    double size_m[3]; /* ahead, left, up */
    double scattering_length_m, cycle_m;
} figures[SCENE_KINDS] = {
    [SCENE_PERSON] = {person,
                      sizeof person / sizeof *person,
                      13,
                      0,
                      0,
                      {0.3, 0.5, 1.75},
                      FIGURE_PERSON_M,
                      1.4},
    [SCENE_CYCLIST] = {cyclist,
                       sizeof cyclist / sizeof *cyclist,
                       10,
                       11,
                       6,
                       {1.75, 0.5, 1.7},
                       0.2,
                       4.5},
    /* Half of the panels look away, and those that do not look past the array. */
    [SCENE_CAR] = {car, sizeof car / sizeof *car, 9, 8, 4, {4.3, 1.75, 1.45}, 1.4, 1},
};

size_t figure_size(int kind, bool opaque)
{
    const struct figure *f = &figures[kind];
    return opaque ? f->n_opaque + f->n_points : f->n;
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

void figure_set_opaque(int kind, const struct figure_pose *pose,
                       double scattering_length_m, struct scatter_piece *out,
                       struct glint_part *parts)
{
    const struct figure *f = &figures[kind];
    double scale = scattering_length_m / f->scattering_length_m;
    struct builder b = {.pose = pose, .pieces = out, .parts = parts};
    struct scatter_piece points[FIGURE_MAX];
    axes_of(pose, b.axes);
    b.weight = scale * (kind == SCENE_CAR ? 1 : sqrt(CLOTHES));
    if (kind == SCENE_PERSON)
        add_walker(&b, f->cycle_m);
    else if (kind == SCENE_CYCLIST)
        add_rider(&b, f->cycle_m);
    else
        add_vehicle(&b);
    figure_set(kind, pose, scattering_length_m, points);
    for (size_t i = 0; i < f->n_points; i++) {
        out[b.n + i] = points[f->first_point + i];
        parts[b.n + i] = (struct glint_part){.from = {0}};
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
