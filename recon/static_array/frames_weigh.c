/* SPDX-License-Identifier: MIT */
/* recon/static_array/frames_weigh.c -- each midpoint is to count once, as in
 * back-projection. */
#include <string.h>

#include "recon/static_array/frames_state.h"

static const uint32_t *cells_of(const struct frames *f, const struct held *h)
{
    return f->cell + h->speaker * f->geometry.n_microphones;
}

/* Counts a ping's live pairs at their midpoints; returns how many were the first. */
static size_t count(struct frames *f, const struct held *h)
{
    size_t n_new = 0;
    for (size_t i = 0; i < f->geometry.n_microphones; i++)
        if (h->live[i])
            n_new += f->fold[cells_of(f, h)[i]]++ == 0;
    return n_new;
}

static void forget_counts(struct frames *f)
{
    memset(f->fold, 0, f->n_cells * sizeof *f->fold);
}

static void weigh(const struct frames *f, struct held *h)
{
    for (size_t i = 0; i < f->geometry.n_microphones; i++)
        h->weight[i] = h->live[i] ? 1.0f / (float)f->fold[cells_of(f, h)[i]] : 0.0f;
}

static float over(size_t n)
{
    return n ? 1.0f / (float)n : 0.0f;
}

static void weigh_coherent(struct frames *f)
{
    size_t n_live = 0;
    forget_counts(f);
    for (size_t k = 0; k < f->cfg.n_pings; k++)
        if (f->held[k].counts)
            n_live += count(f, &f->held[k]);
    for (size_t k = 0; k < f->cfg.n_pings; k++) {
        f->held[k].scale = 1.0f;
        if (f->held[k].counts)
            weigh(f, &f->held[k]);
    }
    f->scale = over(n_live) * over(n_live);
}

static void weigh_power(struct frames *f)
{
    size_t n_pings = 0;
    for (size_t k = 0; k < f->cfg.n_pings; k++) {
        struct held *h = &f->held[k];
        if (!h->counts)
            continue;
        forget_counts(f);
        size_t n_live = count(f, h);
        weigh(f, h);
        h->scale = over(n_live) * over(n_live);
        n_pings += n_live > 0;
    }
    f->scale = over(n_pings);
}

void frames_weigh(struct frames *f)
{
    if (f->cfg.sum == FRAMES_POWER)
        weigh_power(f);
    else
        weigh_coherent(f);
}
