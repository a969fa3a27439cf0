/* SPDX-License-Identifier: MIT */
#include "tests/recon/moving.h"

#include <math.h>

#include "tests/recon/reference.h"

enum { ROUNDS = 4 }; /* each leaves 1 % of the error */

/* The vehicle's place and heading on its circle, or straight line. */
static void drive(const struct moving *m, double t, double at[2], double *heading)
{
    double w = m->yaw_rate_rad_s, v = m->speed_m_s;
    *heading = w * t;
    at[0] = w != 0.0 ? v / w * sin(w * t) : v * t;
    at[1] = w != 0.0 ? v / w * (1.0 - cos(w * t)) : 0.0;
}

void moving_to_ground(const struct moving *m, double time_s, const double p[3],
                      double out[3])
{
    double at[2], heading;
    double x = m->mount_m[0] + p[2], y = m->mount_m[1] + p[0], z = m->mount_m[2] + p[1];
    drive(m, time_s, at, &heading);
    out[0] = at[0] + cos(heading) * x - sin(heading) * y;
    out[1] = at[1] + sin(heading) * x + cos(heading) * y;
    out[2] = z;
}

void moving_to_array(const struct moving *m, double time_s, const double p[3],
                     double out[3])
{
    double at[2], heading;
    drive(m, time_s, at, &heading);
    double x = p[0] - at[0], y = p[1] - at[1];
    out[2] = cos(heading) * x + sin(heading) * y - m->mount_m[0];
    out[0] = cos(heading) * y - sin(heading) * x - m->mount_m[1];
    out[1] = p[2] - m->mount_m[2];
}

static void point(const struct moving *m, double t, double out[3])
{
    for (int a = 0; a < 3; a++)
        out[a] = m->at_m[a] + t * m->velocity_m_s[a];
}

/* When the sound that arrives at `hit` at p left the speaker. */
static double left_for(const struct moving *m, const double speaker[3], double hit,
                       const double p[3], double *way)
{
    double mouth[3], leaves = hit;
    for (int r = 0; r < ROUNDS; r++) {
        moving_to_ground(m, leaves, speaker, mouth);
        *way = reference_distance(p, mouth);
        leaves = hit - *way / m->sound_speed_m_s;
    }
    return leaves;
}

static bool is_plane(const struct moving *m)
{
    return m->normal[0] != 0.0 || m->normal[1] != 0.0 || m->normal[2] != 0.0;
}

/* By the plane: straight to the microphone's mirror image. */
static double emitted_plane(const struct moving *m, const double speaker[3],
                            const double microphone[3], double arrives, double *way)
{
    double p[3], depth_m = 0.0;
    moving_to_ground(m, arrives, microphone, p);
    for (int a = 0; a < 3; a++)
        depth_m += m->normal[a] * (p[a] - m->at_m[a]);
    for (int a = 0; a < 3; a++)
        p[a] -= 2.0 * depth_m * m->normal[a];
    return left_for(m, speaker, arrives, p, way);
}

/* When the sound that arrives at a time left. */
static double emitted(const struct moving *m, const double speaker[3],
                      const double microphone[3], double arrives, double ways[2])
{
    double subscription[3], p[3], hit = arrives;
    if (is_plane(m)) {
        ways[1] = 1.0;
        return emitted_plane(m, speaker, microphone, arrives, &ways[0]);
    }
    moving_to_ground(m, arrives, microphone, subscription);
    for (int r = 0; r < ROUNDS; r++) {
        point(m, hit, p);
        ways[1] = reference_distance(p, subscription);
        hit = arrives - ways[1] / m->sound_speed_m_s;
    }
    point(m, hit, p);
    return left_for(m, speaker, hit, p, &ways[0]);
}

static double chirp_at(const struct moving *m, bool down, double t)
{
    double from = m->chirp_hz[down], to = m->chirp_hz[!down];
    if (t < 0.0 || t >= m->chirp_s)
        return 0.0;
    return cos(2.0 * M_PI * t * (from + 0.5 * (to - from) * t / m->chirp_s));
}

void moving_record(const struct moving *m, double time_s, double chirp_at_s, bool down,
                   const double speaker[3], const double microphone[3], size_t n,
                   float *rx)
{
    double gain = pow(10.0, m->level_db / 20.0);
    for (size_t q = 0; gain > 0.0 && q < n; q++) {
        double t = time_s + (double)q / m->sample_rate_hz, ways[2];
        double left = emitted(m, speaker, microphone, t, ways) - chirp_at_s;
        if (left >= m->chirp_s)
            return;
        if (left >= 0.0)
            rx[q] += (float)(gain * chirp_at(m, down, left) / (ways[0] * ways[1]));
        else /* Doppler brings it no more than a tenth earlier */
            q += (size_t)(-0.9 * left * m->sample_rate_hz);
    }
}
