/* SPDX-License-Identifier: MIT */
#include "hal/room/legs.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "hal/room/vector.h"

static int reserve(struct legs *l, size_t n)
{
    if (n <= l->room)
        return 0;
    legs_clear(l);
    l->delay = malloc(n * sizeof *l->delay);
    l->gain = malloc(n * sizeof *l->gain);
    l->cosine = malloc(n * sizeof *l->cosine);
    l->rate = malloc(n * sizeof *l->rate);
    if (!l->delay || !l->gain || !l->cosine || !l->rate) {
        legs_clear(l);
        return -ENOMEM;
    }
    l->room = n;
    return 0;
}

int legs_set(struct legs *l, const double (*elements)[3], size_t n_elements,
             const struct scatter *s, bool outward, const struct mirror *mirror,
             const double *velocity, double delay_per_m)
{
    if (reserve(l, n_elements * s->n) < 0)
        return -ENOMEM;
    l->n_pieces = s->n;
    for (size_t e = 0, k = 0; e < n_elements; e++)
        for (size_t i = 0; i < s->n; i++, k++) {
            const struct scatter_piece *p = &s->pieces[i];
            const double *at = outward ? p->out : p->in;
            double way[3];
            vector_add(elements[e], -1, at, way);
            double r = sqrt(vector_dot(way, way));
            bool front = p->normal[0] != 0 || p->normal[1] != 0 || p->normal[2] != 0;
            double cosine = front ? vector_dot(way, p->normal) / r : 1;
            l->delay[k] = r * delay_per_m;
            bool heard = cosine > 0 &&
                         (!mirror || mirror_reflects(mirror, elements[e], at));
            l->gain[k] = heard ? (float)(1 / r) : 0;
            l->cosine[k] = (float)cosine;
            if (velocity)
                l->rate[k] = (float)(vector_dot(way, velocity) / r);
        }
    return 0;
}

void legs_clear(struct legs *l)
{
    free(l->delay);
    free(l->gain);
    free(l->cosine);
    free(l->rate);
    *l = (struct legs){.n_pieces = 0};
}
