/* SPDX-License-Identifier: MIT */
/* hal/room/vector.h -- three-vectors. */
#ifndef ANLOS_HAL_ROOM_VECTOR_H
#define ANLOS_HAL_ROOM_VECTOR_H

#include <math.h>

static inline double vector_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* out = a + t b; out may be a or b. */
static inline void vector_add(const double a[3], double t, const double b[3],
                              double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[i] + t * b[i];
}

static inline void vector_cross(const double a[3], const double b[3], double out[3])
{
    double c[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                   a[0] * b[1] - a[1] * b[0]};
    for (int i = 0; i < 3; i++)
        out[i] = c[i];
}

/* Scales to length 1 and returns the length before; a null vector stays. */
static inline double vector_normalize(double a[3])
{
    double length = sqrt(vector_dot(a, a));
    for (int i = 0; i < 3 && length > 0; i++)
        a[i] /= length;
    return length;
}

/* The mirror image of p at the plane { q : normal . q = distance }. */
static inline void vector_mirror(const double normal[3], double distance,
                                 const double p[3], double out[3])
{
    vector_add(p, 2 * (distance - vector_dot(normal, p)), normal, out);
}

#endif
