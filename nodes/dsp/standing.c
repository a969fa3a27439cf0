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

bool standing_at(const struct standing *s, int64_t at_ns)
{
    struct ego_motion now;

    if (!s->heard)
        return true;
    return !ego_path_at(&s->path, at_ns, &now) && fabs(now.speed_m_s) < STANDING_M_S &&
           fabs(now.yaw_rate_rad_s) < STANDING_RAD_S;
}
