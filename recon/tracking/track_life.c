/* SPDX-License-Identifier: MIT */
#include "recon/tracking/track_life.h"

#include <math.h>

#define SUREST 0.999 /* so that a few misses tell */
#define WHOLE  0.999

static unsigned count_hits(const struct track_life *l, const struct track_life_config *c)
{
    uint32_t newest = c->confirm_of < 32 ? (UINT32_C(1) << c->confirm_of) - 1
                                         : UINT32_MAX;
    return (unsigned)__builtin_popcount(l->hits & newest);
}

static void confirm(struct track_life *l, const struct track_life_config *c)
{
    l->confirmed |= count_hits(l, c) >= c->confirm_hits &&
                    l->existence >= c->confirm_existence;
}

void track_life_start(struct track_life *l, const struct track_life_config *cfg,
                      double existence)
{
    *l = (struct track_life){.existence = fmin(existence, SUREST), .hits = 1, .looks = 1};
    confirm(l, cfg);
}

void track_life_predict(struct track_life *l, const struct track_life_config *cfg,
                        double dt_s)
{
    double stays = exp(-dt_s / cfg->survival_s);

    l->existence *= stays;
    l->hidden *= stays;
    if (cfg->hides_s > 0.0) { /* two states forget in which they began */
        double left = exp(-dt_s * (1.0 / cfg->hides_s + 1.0 / cfg->hidden_s));
        double share = cfg->hidden_s / (cfg->hides_s + cfg->hidden_s);
        l->hidden = left * l->hidden + (1.0 - left) * share * l->existence;
    }
}

void track_life_update(struct track_life *l, const struct track_life_config *cfg,
                       bool seen, double ratio, double fresh)
{
    double there = pow(fmax(ratio, 1e-12), fresh) * (l->existence - l->hidden) +
                   l->hidden;
    double all = there + 1.0 - l->existence;

    l->existence = fmin(there / all, SUREST);
    l->hidden = fmin(l->hidden / all, l->existence);
    l->fresh += fresh;
    l->seen_fresh += seen ? fresh : 0.0;
    if (l->fresh >= WHOLE) {
        l->hits = l->hits << 1 | (l->seen_fresh >= 0.5 * l->fresh);
        l->looks += l->looks < cfg->confirm_of;
        l->fresh = l->seen_fresh = 0.0;
    }
    confirm(l, cfg);
}

void track_life_prove(struct track_life *l, const struct track_life_config *cfg,
                      double existence)
{
    l->existence = fmax(l->existence, fmin(existence, SUREST));
    l->confirmed |= cfg->confirm_existence > 0.0 && existence >= cfg->confirm_existence;
}

bool track_life_is_over(const struct track_life *l, const struct track_life_config *cfg)
{
    if (l->existence < cfg->delete_existence)
        return true;
    return !l->confirmed &&
           l->looks - count_hits(l, cfg) > cfg->confirm_of - cfg->confirm_hits;
}
