/* SPDX-License-Identifier: MIT */
#include "dsp/cfar_map.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"
#include "dsp/vector.h"

#define LONGEST_S 1.0

struct cfar_map {
    size_t n;
    float *levels; /* [n]; 0: not known */
    float *sample; /* [n], scratch */
    bool *nothing; /* [n]: held */
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
    m->nothing = calloc(n_cells, sizeof *m->nothing);
    if (!m->levels || !m->sample || !m->nothing) {
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

/* held: bools, of which the compiler would make no vectors. */
VECTOR_CLONES
static void follow(size_t n, const float *restrict image, const uint8_t *restrict held,
                   float up, float down, float most, float *restrict levels)
{
    for (size_t i = 0; i < n; i++) {
        float now = image[i], was = levels[i];
        float higher = was * up < now ? was * up : now;
        float lower = was * down > now ? was * down : now;
        float next = now > was ? higher : lower;
        float first = now < most ? now : most;
        next = now > 0.0f ? next : was;
        next = was == 0.0f ? first : next;
        levels[i] = held[i] ? was : next;
    }
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
    follow(m->n, image, (const uint8_t *)(held ? held : m->nothing), up, down, most,
           m->levels);
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
    free(m->nothing);
    free(m);
}
