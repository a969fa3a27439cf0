/* SPDX-License-Identifier: MIT */
#include "hal/room/mirror.h"

#include <string.h>

#include "hal/room/vector.h"

void mirror_set(struct mirror *m, const struct survey *s, const struct scene_wall *wall,
                const double up[3])
{
    *m = (struct mirror){.distance_m = s->wall_distance_m,
                         .spans_m = (const double(*)[2])wall->spans_m,
                         .n_spans = wall->n_spans};
    memcpy(m->normal, s->wall_normal, sizeof m->normal);
    vector_cross(up, m->normal, m->along);
    vector_normalize(m->along);
    for (int k = 0; k < 3 && m->distance_m < 0; k++) /* it looks at the array */
        m->along[k] = -m->along[k];
}

bool mirror_is_at(const struct mirror *m, const double p[3])
{
    double at_m = vector_dot(m->along, p);
    bool is_there = !m->n_spans;
    for (unsigned i = 0; i < m->n_spans; i++)
        is_there |= at_m >= m->spans_m[i][0] && at_m <= m->spans_m[i][1];
    return is_there;
}

bool mirror_reflects(const struct mirror *m, const double image[3], const double p[3])
{
    if (!m->n_spans)
        return true;
    double a = vector_dot(m->normal, image) - m->distance_m;
    double b = vector_dot(m->normal, p) - m->distance_m, meets[3];
    vector_add(p, -1, image, meets);
    vector_add(image, a / (a - b), meets, meets);
    return a * b < 0 && mirror_is_at(m, meets);
}
