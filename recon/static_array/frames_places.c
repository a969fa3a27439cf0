/* SPDX-License-Identifier: MIT */
#include "recon/static_array/frames_places.h"

#include <math.h>
#include <string.h>

#include "recon/static_array/range_doppler.h"

#define DRIFT_NS                                                                         \
    20000000 /* the time over which an element's motion counts as straight               \
              */

/* -- instants ---------------------------------------------------------------------------
 */

double frames_delay_instant_s(const struct frames_config *cfg, bool down)
{
    const struct chirp *c = &cfg->chirp;
    double from = down ? c->stop_hz : c->start_hz, to = down ? c->start_hz : c->stop_hz;
    if (c->duration_s == 0.0)
        return cfg->latency_s;
    return cfg->latency_s + range_doppler_instant_s(from, to, c->duration_s);
}

static int64_t nanoseconds(double s)
{
    return (int64_t)llrint(1e9 * s);
}

/* -- places -----------------------------------------------------------------------------
 */

struct glance { /* from the instant `at` of one ping to the reference */
    const struct frames_motion *motion;
    int64_t reference_ns;
    bool known;
};

static void step_to_reference(struct glance *g, int64_t at_ns, struct ego_step *out)
{
    *out = (struct ego_step){0.0, 0.0, 0.0};
    if (g->motion->path && ego_path_between(g->motion->path, at_ns, g->reference_ns, out))
        g->known = false;
}

/* What is imaged moves on until the reference, and is where it was then when the element
 * moves the other way instead. */
static void look(const struct glance *g, const struct ego_step *step, int64_t at_ns,
                 const double element_m[3], double out[3])
{
    double later_s = 1e-9 * (double)(g->reference_ns - at_ns);
    if (g->motion->path)
        mount_step_point(&g->motion->mount, step, element_m, out);
    else
        memcpy(out, element_m, 3 * sizeof *out);
    for (int a = 0; a < 3; a++)
        out[a] += later_s * g->motion->velocity_m_s[a];
}

static void stand(struct frames_place *p, const double element_m[3])
{
    memcpy(p->delay_at_m, element_m, sizeof p->delay_at_m);
    memcpy(p->phase_at_m, element_m, sizeof p->phase_at_m);
    memset(p->own_m_s, 0, sizeof p->own_m_s);
    memset(p->thing_m_s, 0, sizeof p->thing_m_s);
}

static void element_of(const struct frames_config *cfg, size_t speaker, size_t e,
                       double out[3])
{
    if (e == 0)
        geometry_speaker(cfg->geometry, 0, speaker, out);
    else
        geometry_microphone(cfg->geometry, 0, speaker, e - 1, out);
}

bool frames_places(const struct frames_config *cfg, const struct frames_motion *motion,
                   size_t speaker, bool down, int64_t stamp_ns, int64_t reference_ns,
                   struct frames_place *places)
{
    const int64_t at_ns[3] = {
        stamp_ns + nanoseconds(frames_delay_instant_s(cfg, down)),
        stamp_ns + nanoseconds(cfg->latency_s + 0.5 * cfg->chirp.duration_s),
        stamp_ns + nanoseconds(frames_delay_instant_s(cfg, down)) + DRIFT_NS};
    struct glance g = {motion, reference_ns, true};
    struct ego_step step[3];
    for (int i = 0; motion && i < 3; i++)
        step_to_reference(&g, at_ns[i], &step[i]);
    if (!g.known)
        memset(step, 0, sizeof step);
    for (size_t e = 0; e < 1 + cfg->geometry->n_microphones; e++) {
        double element_m[3], later[3];
        element_of(cfg, speaker, e, element_m);
        stand(&places[e], element_m);
        if (!motion)
            continue;
        look(&g, &step[0], at_ns[0], element_m, places[e].delay_at_m);
        look(&g, &step[1], at_ns[1], element_m, places[e].phase_at_m);
        look(&g, &step[2], at_ns[2], element_m, later);
        for (int a = 0; a < 3; a++) {
            places[e].thing_m_s[a] = -motion->velocity_m_s[a];
            places[e].own_m_s[a] = (later[a] - places[e].delay_at_m[a]) /
                                       (1e-9 * DRIFT_NS) +
                                   motion->velocity_m_s[a];
        }
    }
    return g.known;
}

static bool near(const double a[3], const double b[3], double tolerance)
{
    for (int i = 0; i < 3; i++)
        if (!(fabs(a[i] - b[i]) <= tolerance))
            return false;
    return true;
}

bool frames_places_agree(const struct frames_place *a, const struct frames_place *b,
                         size_t n, double sound_s, double tolerance_m)
{
    for (size_t e = 0; e < n; e++)
        if (!near(a[e].delay_at_m, b[e].delay_at_m, tolerance_m) ||
            !near(a[e].phase_at_m, b[e].phase_at_m, tolerance_m) ||
            !near(a[e].own_m_s, b[e].own_m_s, tolerance_m / sound_s) ||
            !near(a[e].thing_m_s, b[e].thing_m_s, tolerance_m / sound_s))
            return false;
    return true;
}
