/* SPDX-License-Identifier: MIT */
#include "hal/room/scatter.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/list.h"
#include "hal/room/vector.h"

enum { LEFT = 1, RIGHT = 2, TOP = 4, MIDDLE = 8, BOTTOM = 16, STEM = 32 };

static const struct {
    char letter;
    unsigned bars;
} letters[] = {{'C', LEFT | TOP | BOTTOM},
               {'E', LEFT | TOP | MIDDLE | BOTTOM},
               {'F', LEFT | TOP | MIDDLE},
               {'H', LEFT | RIGHT | MIDDLE},
               {'I', STEM},
               {'L', LEFT | BOTTOM},
               {'O', LEFT | RIGHT | TOP | BOTTOM},
               {'T', TOP | STEM},
               {'U', LEFT | RIGHT | BOTTOM}};

static unsigned bars_of(char letter)
{
    for (size_t i = 0; i < sizeof letters / sizeof *letters; i++)
        if (letters[i].letter == letter)
            return letters[i].bars;
    return 0;
}

bool scatter_letter_known(char letter)
{
    return bars_of(letter) != 0;
}

void scatter_plane_set(struct scatter_plane *p, const double centre[3],
                       const double facing[3], const double up[3])
{
    static const double spare[3] = {1, 0, 0};
    memcpy(p->centre, centre, sizeof p->centre);
    memcpy(p->normal, facing, sizeof p->normal);
    vector_cross(up, facing, p->u);
    if (vector_normalize(p->u) < 1e-6) { /* it faces up */
        vector_cross(spare, facing, p->u);
        vector_normalize(p->u);
    }
    vector_cross(facing, p->u, p->v);
}

int scatter_add(struct scatter *s, const struct scatter_piece *piece)
{
    if (list_grow(&s->pieces, s->n, &s->room, sizeof *s->pieces))
        return -ENOMEM;
    s->pieces[s->n++] = *piece;
    return 0;
}

int scatter_add_point(struct scatter *s, const double at[3], double scattering_length_m)
{
    struct scatter_piece piece = {.weight = scattering_length_m};
    memcpy(piece.in, at, sizeof piece.in);
    memcpy(piece.out, at, sizeof piece.out);
    return scatter_add(s, &piece);
}

static bool letter_has(const struct scatter_shape *s, double x, double y)
{
    unsigned bars = bars_of(s->letter);
    double t = s->stroke_m;
    return (bars & LEFT && x < s->min[0] + t) || (bars & RIGHT && x > s->max[0] - t) ||
           (bars & TOP && y > s->max[1] - t) || (bars & BOTTOM && y < s->min[1] + t) ||
           (bars & MIDDLE && fabs(y) < t / 2) || (bars & STEM && fabs(x) < t / 2);
}

/* Even-odd: a ray to the right crosses the outline an odd number of times. */
static bool polygon_has(const struct scatter_shape *s, double x, double y)
{
    bool in = false;
    for (size_t i = 0, j = s->n_outline - 1; i < s->n_outline; j = i++) {
        const double *a = s->outline[i], *b = s->outline[j];
        if ((a[1] > y) != (b[1] > y) &&
            x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
            in = !in;
    }
    return in;
}

static bool shape_has(const struct scatter_shape *s, double x, double y)
{
    if (s->kind == SHAPE_LETTER)
        return letter_has(s, x, y);
    if (s->kind == SHAPE_POLYGON)
        return polygon_has(s, x, y);
    if (s->kind == SHAPE_DISC)
        return x * x + y * y < s->max[0] * s->max[0];
    return true;
}

/* How much of a cell is solid, and where the middle of that is; in 4 x 4 parts, so that
 * an edge through a cell keeps the area. */
static double cell_cover(const struct scatter_shape *s, const double corner[2],
                         const double size[2], double middle[2])
{
    enum { PARTS = 4 };
    int hits = 0;
    middle[0] = middle[1] = 0;
    for (int i = 0; i < PARTS * PARTS; i++) {
        double x = corner[0] + (i % PARTS + 0.5) / PARTS * size[0];
        double y = corner[1] + (i / PARTS + 0.5) / PARTS * size[1];
        if (!shape_has(s, x, y))
            continue;
        hits++;
        middle[0] += x;
        middle[1] += y;
    }
    for (int a = 0; a < 2 && hits; a++)
        middle[a] /= hits;
    return (double)hits / (PARTS * PARTS);
}

static int add_cell(struct scatter *s, const struct scatter_plane *p,
                    const double middle[2], double weight, bool retro)
{
    struct scatter_piece piece = {.weight = weight};
    double side = retro ? -1 : 1;
    vector_add(p->centre, middle[0], p->u, piece.in);
    vector_add(piece.in, middle[1], p->v, piece.in);
    vector_add(p->centre, side * middle[0], p->u, piece.out);
    vector_add(piece.out, side * middle[1], p->v, piece.out);
    memcpy(piece.normal, p->normal, sizeof piece.normal);
    return scatter_add(s, &piece);
}

int scatter_add_shape(struct scatter *s, const struct scatter_plane *plane,
                      const struct scatter_shape *shape, double pitch_m,
                      double reflectivity, bool retro)
{
    double size[2];
    size_t n[2];
    for (int a = 0; a < 2; a++) {
        double width = shape->max[a] - shape->min[a];
        n[a] = (size_t)fmax(1, ceil(width / pitch_m));
        size[a] = width / (double)n[a];
    }
    for (size_t i = 0; i < n[0] * n[1]; i++) {
        double corner[2] = {shape->min[0] + (double)(i % n[0]) * size[0],
                            shape->min[1] + (double)(i / n[0]) * size[1]};
        double middle[2], cover = cell_cover(shape, corner, size, middle);
        if (cover > 0 && add_cell(s, plane, middle,
                                  reflectivity * cover * size[0] * size[1], retro) < 0)
            return -ENOMEM;
    }
    return 0;
}

void scatter_clear(struct scatter *s)
{
    free(s->pieces);
    *s = (struct scatter){.n = 0};
}
