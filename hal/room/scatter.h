/* SPDX-License-Identifier: MIT */
/* hal/room/scatter.h -- what throws sound back, cut into pieces: points, and facets of
 * rigid surfaces under half a wavelength (Kirchhoff). */
#ifndef ANLOS_HAL_ROOM_SCATTER_H
#define ANLOS_HAL_ROOM_SCATTER_H

#include <stdbool.h>
#include <stddef.h>

#define SCATTER_LETTERS "C, E, F, H, I, L, O, T, U"

/* Sound reaches a piece at `in` and leaves it at `out`; only for the facets of a corner
 * reflector are these two places. */
struct scatter_piece {
    double in[3], out[3];
    double normal[3]; /* unit, of the front; 0: a point that looks everywhere */
    double weight;    /* point: scattering length in m; facet: reflectivity x area, m2 */
};

struct scatter {
    size_t n, room;
    struct scatter_piece *pieces; /* [n] */
};

/* A plane with axes u (right) and v (up) seen from where its normal points. */
struct scatter_plane {
    double centre[3], u[3], v[3], normal[3];
};

/* Axes of a plane at centre that faces a direction (unit), with v nearest to `up`. */
void scatter_plane_set(struct scatter_plane *p, const double centre[3],
                       const double facing[3], const double up[3]);

/* Which part of a plane is solid. */
struct scatter_shape {
    enum { SHAPE_RECTANGLE, SHAPE_POLYGON, SHAPE_LETTER, SHAPE_DISC } kind;
    double min[2], max[2]; /* bounds in u, v */
    char letter;
    double stroke_m;
    const double (*outline)[2]; /* [n_outline] */
    size_t n_outline;
};

/* 0, -ENOMEM. */
int scatter_add(struct scatter *s, const struct scatter_piece *piece);
int scatter_add_point(struct scatter *s, const double at[3], double scattering_length_m);

/* Facets of at most pitch_m.  retro: sound leaves on the other side of the centre.
 * 0, -ENOMEM. */
int scatter_add_shape(struct scatter *s, const struct scatter_plane *plane,
                      const struct scatter_shape *shape, double pitch_m,
                      double reflectivity, bool retro);

bool scatter_letter_known(char letter);
void scatter_clear(struct scatter *s);

#endif
