#include "nodes/dsp/standing.h"

#include <math.h>

void standing_hear(struct standing *s, const Anlos__EgoMotion *ego, int64_t capture_ns)
{
    const struct ego_motion motion = {
        .speed_m_s = ego->standstill ? 0.0 : ego->speed_m_s,
        .yaw_rate_rad_s = ego->standstill ? 0.0 : ego->yaw_rate_rad_s};

    s->heard = true;
    if (ego->valid)
        ego_path_add(&s->path, capture_ns, &motion);
}

static bool is_slow(const struct ego_motion *m)
{
    return fabs(m->speed_m_s) < STANDING_M_S && fabs(m->yaw_rate_rad_s) < STANDING_RAD_S;
}

static bool stands_at(const struct ego_path *p, int64_t at_ns)
{
    struct ego_motion now;

    return !ego_path_at(p, at_ns, &now) && is_slow(&now);
}

bool standing_between(const struct standing *s, int64_t from_ns, int64_t to_ns)
{
    const struct ego_path *p = &s->path;
    bool stands = stands_at(p, from_ns) && stands_at(p, to_ns);

    if (!s->heard)
        return true;
    for (size_t k = 0; stands && k < p->n; k++)
        stands = p->stamp_ns[k] < from_ns || p->stamp_ns[k] > to_ns ||
                 is_slow(&p->motion[k]);
    return stands;
}
