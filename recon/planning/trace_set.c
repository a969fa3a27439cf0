/* SPDX-License-Identifier: MIT */
#include "recon/planning/trace_set.h"

#include <errno.h>
#include <stdlib.h>

struct imager_config trace_set_imager(const struct trace_set *s, const struct grid *grid,
                                      struct pool *pool)
{
    return (struct imager_config){.geometry = s->geometry,
                                  .format = s->format,
                                  .band_hz = {s->band_hz[0], s->band_hz[1]},
                                  .gate_m = {s->gate_m[0], s->gate_m[1]},
                                  .grid = *grid,
                                  .pool = pool};
}

struct feeding {
    const struct trace_set *set;
    struct imager *imager;
    bool *masked; /* [threads][n_microphones] */
};

static void feed_position(void *ctx, size_t position, size_t thread)
{
    const struct feeding *f = ctx;
    const struct geometry *g = f->set->geometry;
    size_t n_mic = g->n_microphones;
    bool *masked = f->masked + thread * n_mic;
    for (size_t j = 0; j < g->n_speakers; j++) {
        size_t first = (position * g->n_speakers + j) * n_mic, n_heard = 0;
        for (size_t i = 0; i < n_mic; i++) {
            masked[i] = !f->set->heard[first + i];
            n_heard += f->set->heard[first + i];
        }
        if (n_heard)
            imager_add(f->imager, position, j,
                       f->set->traces + first * f->set->format.n_samples, masked);
    }
}

int trace_set_feed(const struct trace_set *s, struct imager *im, struct pool *pool)
{
    struct feeding f = {s, im, NULL};
    f.masked = malloc(pool_threads(pool) * s->geometry->n_microphones * sizeof *f.masked);
    if (!f.masked)
        return -ENOMEM;
    pool_run(pool, s->geometry->n_positions, feed_position, &f);
    free(f.masked);
    return pool_stopped(pool) ? -ECANCELED : 0;
}
