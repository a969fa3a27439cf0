/* SPDX-License-Identifier: MIT */
#include "dsp/cfar_map.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"

#define LONGEST_S 1.0

struct cfar_map {
    size_t n;
    float *levels; /* [n]; 0: not known */
    float *sample; /* [n], scratch */
    int64_t stamp_ns;
    bool began;
};

int cfar_map_create(struct cfar_map **out, size_t n_cells)
{
    *out = NULL;
    if (!n_cells)
        return -EINVAL;
    struct cfar_map *m = calloc(1, sizeof *m);
    if (!m)
        return -ENOMEM;
    m->n = n_cells;
    m->levels = calloc(n_cells, sizeof *m->levels);
    m->sample = calloc(n_cells, sizeof *m->sample);
    if (!m->levels || !m->sample) {
        cfar_map_destroy(m);
        return -ENOMEM;
    }
    *out = m;
    return 0;
}

/* The middle one of what was imaged. */
static float typical(struct cfar_map *m, const float *image)
{
    size_t n = 0;

    for (size_t i = 0; i < m->n; i++)
        if (image[i] > 0.0f)
            m->sample[n++] = image[i];
    return n ? rank_smallest(m->sample, n, n / 2 + 1) : 0.0f;
}

void cfar_map_learn(struct cfar_map *m, const float *image, const bool *held,
                    int64_t stamp_ns)
{
    double dt_s = 1e-9 * (double)(stamp_ns - m->stamp_ns);
    double up_db = dt_s > 0.0 && dt_s < LONGEST_S ? CFAR_MAP_UP_DB_S * dt_s : 0.0;
    float up = (float)pow(10.0, 0.1 * up_db);
    float down = (float)pow(10.0, -0.1 * up_db * CFAR_MAP_RARE / (1.0 - CFAR_MAP_RARE));

    float most = m->began ? INFINITY : typical(m, image);
    m->stamp_ns = stamp_ns;
    m->began = m->began || most > 0.0f;
    for (size_t i = 0; i < m->n; i++) {
        float now = image[i], was = m->levels[i];
        if (held && held[i])
            continue;
        if (was == 0.0f)
            m->levels[i] = fminf(now, most);
        else if (now > 0.0f)
            m->levels[i] = now > was ? fminf(was * up, now) : fmaxf(was * down, now);
    }
}

double cfar_map_at(const struct cfar_map *m, size_t cell)
{
    return (double)m->levels[cell];
}

void cfar_map_reset(struct cfar_map *m)
{
    memset(m->levels, 0, m->n * sizeof *m->levels);
    m->began = false;
}

void cfar_map_destroy(struct cfar_map *m)
{
    if (!m)
        return;
    free(m->levels);
    free(m->sample);
    free(m);
}
