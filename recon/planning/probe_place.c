#include "recon/planning/probe_place.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/imaging/fold.h"
#include "recon/planning/lean.h"
#include "recon/planning/moveout_error.h"

struct probe_places {
    double band_hz[2];
    struct array { /* with all of the speakers, and with fewer */
        struct geometry geometry;
        float *weight;
    } all, fewer[PROBE_FEWER];
    double (*speakers_m)[3]; /* of all that are fewer, one after the other */
};

/* Every n-th speaker, whose places go to at. */
static int thin_out(struct array *out, const struct geometry *g, size_t stride,
                    double (*at)[3])
{
    out->geometry = *g;
    out->geometry.speakers_m = (const double(*)[3])at;
    out->geometry.n_speakers = 0;
    for (size_t j = 0; j < g->n_speakers; j += stride)
        memcpy(at[out->geometry.n_speakers++], g->speakers_m[j], sizeof *at);
    return fold_weights(&out->geometry, &out->weight);
}

int probe_places_create(struct probe_places **out, const struct trace_set *set)
{
    const struct geometry *g = set->geometry;
    struct probe_places *p = calloc(1, sizeof *p);
    if (!p)
        return -ENOMEM;
    memcpy(p->band_hz, set->band_hz, sizeof p->band_hz);
    p->all.geometry = *g;
    p->speakers_m = malloc((PROBE_FEWER * g->n_speakers + 1) * sizeof *p->speakers_m);
    int err = p->speakers_m ? fold_weights(g, &p->all.weight) : -ENOMEM;
    for (size_t i = 0; !err && !g->pings_m && i < PROBE_FEWER; i++)
        err =
            thin_out(&p->fewer[i], g, (size_t)2 << i, p->speakers_m + i * g->n_speakers);
    if (err) {
        probe_places_destroy(p);
        return err;
    }
    *out = p;
    return 0;
}

void probe_places_describe(const struct probe_places *p, struct probe_object *o)
{
    const struct array *all = &p->all;
    double centre_hz = 0.5 * (p->band_hz[0] + p->band_hz[1]);
    geometry_resolution_at(&all->geometry, p->band_hz, o->position_m, o->width_m);
    lean_of_point(&all->geometry, all->weight, p->band_hz, o->position_m, o->lean);
    moveout_error(&all->geometry, all->weight, o->position_m, centre_hz, o->moveout_m,
                  &o->moveout_rad);
    for (size_t i = 0; i < PROBE_FEWER; i++) {
        const struct array *fewer = &p->fewer[i];
        double shift_m[3], rad;
        if (!fewer->weight)
            continue;
        moveout_error(&fewer->geometry, fewer->weight, o->position_m, centre_hz, shift_m,
                      &rad);
        for (int a = 0; a < 2; a++)
            o->fewer_m[i][a] = shift_m[a] - o->moveout_m[a];
    }
}

void probe_places_destroy(struct probe_places *p)
{
    if (!p)
        return;
    free(p->all.weight);
    for (size_t i = 0; i < PROBE_FEWER; i++)
        free(p->fewer[i].weight);
    free(p->speakers_m);
    free(p);
}
