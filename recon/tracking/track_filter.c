/* SPDX-License-Identifier: MIT */
#include "recon/tracking/track_filter.h"

#include <math.h>
#include <string.h>

#define VELOCITY_GATE 13.8  /* chi-squared, 2 */
#define ANY_M2_S2     100.0 /* a velocity that is wrong is anywhere in that */
#define LEAST_M2      1e-8  /* a covariance that says "exactly" is not believed: 0.1 mm */

double track_filter_distance2(const double v[2], const double c[2][2])
{
    double det = c[0][0] * c[1][1] - c[0][1] * c[1][0];
    return (c[1][1] * v[0] * v[0] - 2.0 * c[0][1] * v[0] * v[1] + c[0][0] * v[1] * v[1]) /
           det;
}

static double density(const double v[2], const double c[2][2])
{
    return exp(-0.5 * track_filter_distance2(v, c)) /
           (2.0 * M_PI * sqrt(c[0][0] * c[1][1] - c[0][1] * c[1][0]));
}

static void noise(const struct track_position *p, double r[2][2])
{
    memcpy(r, p->covariance_m2, sizeof p->covariance_m2);
    r[0][0] += LEAST_M2;
    r[1][1] += LEAST_M2;
}

void track_filter_predict(struct track_filter *f, double dt_s, double psd_m2_s3)
{
    double(*c)[4] = f->covariance;

    for (int i = 0; i < 2; i++)
        f->state[i] += dt_s * f->state[2 + i];
    for (int j = 0; j < 4; j++)
        for (int i = 0; i < 2; i++)
            c[i][j] += dt_s * c[2 + i][j];
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 2; j++)
            c[i][j] += dt_s * c[i][2 + j];
    for (int i = 0; i < 2; i++) {
        c[i][i] += psd_m2_s3 * dt_s * dt_s * dt_s / 3.0;
        c[i][2 + i] += psd_m2_s3 * dt_s * dt_s / 2.0;
        c[2 + i][i] = c[i][2 + i];
        c[2 + i][2 + i] += psd_m2_s3 * dt_s;
    }
}

/* A state shows as of_position position + of_velocity velocity. */
struct shown {
    double of_position, of_velocity;
    const double *at, (*noise)[2];
};

/* Residual, its covariance s, and across = covariance h'. */
static void compare(const struct track_filter *f, const struct shown *m,
                    double residual[2], double s[2][2], double across[4][2])
{
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 2; j++)
            across[i][j] = m->of_position * f->covariance[i][j] +
                           m->of_velocity * f->covariance[i][2 + j];
    for (int i = 0; i < 2; i++) {
        residual[i] = m->at[i] - m->of_position * f->state[i] -
                      m->of_velocity * f->state[2 + i];
        for (int j = 0; j < 2; j++)
            s[i][j] = m->noise[i][j] +
                      (m->of_position * across[i][j] + m->of_velocity * across[2 + i][j]);
    }
}

struct track_match track_filter_match(const struct track_filter *f,
                                      const struct track_position *p)
{
    double residual[2], r[2][2], s[2][2], across[4][2];

    noise(p, r);
    const struct shown place = {1.0, p->lag_s, p->at_m, (const double(*)[2])r};
    compare(f, &place, residual, s, across);
    double d2 = track_filter_distance2(residual, (const double(*)[2])s);
    struct track_match m = {.distance2 = d2};
    m.density = density(residual, (const double(*)[2])s);
    if (!p->height_assumed) {
        double off = p->height_m - f->height_m;
        m.distance2 += off * off / (f->height_m2 + p->height_m2 + LEAST_M2);
    }
    return m;
}

/* Joseph's form keeps the covariance positive: (I - K h) C (I - K h)' + K R K'. */
static void shrink(struct track_filter *f, const struct shown *m, const double gain[4][2])
{
    double keep[4][4], half[4][4], out[4][4];

    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            keep[i][j] = (i == j) -
                         gain[i][j % 2] * (j < 2 ? m->of_position : m->of_velocity);
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            half[i][j] = 0.0;
            for (int k = 0; k < 4; k++)
                half[i][j] += keep[i][k] * f->covariance[k][j];
        }
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            out[i][j] = 0.0;
            for (int k = 0; k < 4; k++)
                out[i][j] += half[i][k] * keep[j][k];
            for (int k = 0; k < 2; k++)
                for (int l = 0; l < 2; l++)
                    out[i][j] += gain[i][k] * m->noise[k][l] * gain[j][l];
        }
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            f->covariance[i][j] = 0.5 * (out[i][j] + out[j][i]);
}

static void update_height(struct track_filter *f, const struct track_position *p)
{
    double gain = f->height_m2 / (f->height_m2 + p->height_m2 + LEAST_M2);

    if (p->height_assumed) {
        f->height_m = p->height_m;
        f->height_m2 = p->height_m2;
        return;
    }
    f->height_m += gain * (p->height_m - f->height_m);
    f->height_m2 *= 1.0 - gain;
}

static void update(struct track_filter *f, const struct shown *m, double gate2)
{
    double residual[2], s[2][2], across[4][2], gain[4][2];

    compare(f, m, residual, s, across);
    if (track_filter_distance2(residual, (const double(*)[2])s) > gate2)
        return;
    double det = s[0][0] * s[1][1] - s[0][1] * s[1][0];
    for (int i = 0; i < 4; i++) {
        gain[i][0] = (across[i][0] * s[1][1] - across[i][1] * s[1][0]) / det;
        gain[i][1] = (across[i][1] * s[0][0] - across[i][0] * s[0][1]) / det;
        f->state[i] += gain[i][0] * residual[0] + gain[i][1] * residual[1];
    }
    shrink(f, m, (const double(*)[2])gain);
}

/* Between what the filter was and what it is, of which the latter is true with this
 * probability. */
static void mix(const struct track_filter *was, double probability,
                struct track_filter *f)
{
    double way[4], left = 1.0 - probability;

    for (int i = 0; i < 4; i++)
        way[i] = f->state[i] - was->state[i];
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            f->covariance[i][j] = probability * f->covariance[i][j] +
                                  left * was->covariance[i][j] +
                                  probability * left * way[i] * way[j];
    for (int i = 0; i < 4; i++)
        f->state[i] = was->state[i] + probability * way[i];
}

static void update_velocity(struct track_filter *f, const struct track_position *p)
{
    const struct shown velocity = {0.0, 1.0, p->velocity_m_s, p->velocity_m2_s2};
    const struct track_filter was = *f;
    double residual[2], s[2][2], across[4][2];

    if (!p->has_velocity)
        return;
    update(f, &velocity, VELOCITY_GATE);
    if (!(p->velocity_doubt > 0.0))
        return;
    compare(&was, &velocity, residual, s, across);
    double right = (1.0 - p->velocity_doubt) * density(residual, (const double(*)[2])s);
    double wrong = p->velocity_doubt / ANY_M2_S2;
    mix(&was, 1.0 - pow(wrong / (right + wrong), p->velocity_fresh), f);
}

void track_filter_update(struct track_filter *f, const struct track_position *p)
{
    double r[2][2];

    noise(p, r);
    const struct shown place = {1.0, p->lag_s, p->at_m, (const double(*)[2])r};
    update(f, &place, INFINITY);
    update_height(f, p);
    update_velocity(f, p);
}

void track_position_doubt(struct track_position *p, double times)
{
    for (int a = 0; a < 2; a++)
        for (int b = 0; b < 2; b++)
            p->covariance_m2[a][b] *= times;
}

/* What the other one counts for: A (A + B)^-1.  false: they are too far apart. */
static bool weigh(const double apart[2], const double a[2][2], const double b[2][2],
                  double gate2, double gain[2][2])
{
    double sum[2][2];

    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
            sum[i][j] = a[i][j] + b[i][j] + (i == j ? LEAST_M2 : 0.0);
    double det = sum[0][0] * sum[1][1] - sum[0][1] * sum[1][0];
    for (int i = 0; i < 2; i++) {
        gain[i][0] = (a[i][0] * sum[1][1] - a[i][1] * sum[1][0]) / det;
        gain[i][1] = (a[i][1] * sum[0][0] - a[i][0] * sum[0][1]) / det;
    }
    return track_filter_distance2(apart, (const double(*)[2])sum) <= gate2;
}

static void blend(const double gain[2][2], double v[2], const double other[2])
{
    const double way[2] = {other[0] - v[0], other[1] - v[1]};

    for (int i = 0; i < 2; i++)
        v[i] += gain[i][0] * way[0] + gain[i][1] * way[1];
}

/* (I - K) A (I - K)' + K B K', with any gain. */
static void blend_covariance(const double gain[2][2], double a[2][2],
                             const double b[2][2])
{
    double out[2][2] = {{0.0}};

    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
            for (int k = 0; k < 2; k++)
                for (int l = 0; l < 2; l++)
                    out[i][j] += ((i == k) - gain[i][k]) * a[k][l] *
                                     ((j == l) - gain[j][l]) +
                                 gain[i][k] * b[k][l] * gain[j][l];
    memcpy(a, out, sizeof out);
}

static void join_velocity(struct track_position *p, const struct track_position *other)
{
    double gain[2][2];
    const double apart_m_s[2] = {other->velocity_m_s[0] - p->velocity_m_s[0],
                                 other->velocity_m_s[1] - p->velocity_m_s[1]};

    if (!p->has_velocity || !other->has_velocity || p->velocity_doubt > 0.0 ||
        other->velocity_doubt > 0.0 ||
        !weigh(apart_m_s, (const double(*)[2])p->velocity_m2_s2,
               (const double(*)[2])other->velocity_m2_s2, VELOCITY_GATE, gain))
        return;
    blend((const double(*)[2])gain, p->velocity_m_s, other->velocity_m_s);
    blend_covariance((const double(*)[2])gain, p->velocity_m2_s2,
                     (const double(*)[2])other->velocity_m2_s2);
}

bool track_position_join(struct track_position *p, const struct track_position *other,
                         double gate2)
{
    const double apart_m[2] = {other->at_m[0] - p->at_m[0], other->at_m[1] - p->at_m[1]};
    double gain[2][2];

    if (!weigh(apart_m, (const double(*)[2])p->walker_m2,
               (const double(*)[2])other->walker_m2, gate2, gain))
        return false;
    const double(*k)[2] = (const double(*)[2])gain;
    blend(k, p->at_m, other->at_m);
    blend(k, p->middle_m, other->middle_m);
    blend_covariance(k, p->walker_m2, (const double(*)[2])other->walker_m2);
    blend_covariance(k, p->covariance_m2, (const double(*)[2])other->covariance_m2);
    join_velocity(p, other);
    return true;
}

void track_filter_start(struct track_filter *f, const struct track_position *p,
                        double speed_m_s)
{
    double speed2 = speed_m_s * speed_m_s;
    double r[2][2];

    noise(p, r);
    memset(f, 0, sizeof *f);
    for (int i = 0; i < 2; i++) {
        f->state[i] = p->at_m[i];
        f->covariance[2 + i][2 + i] = speed2;
        f->covariance[i][2 + i] = f->covariance[2 + i][i] = -speed2 * p->lag_s;
        for (int j = 0; j < 2; j++)
            f->covariance[i][j] = r[i][j] + (i == j ? speed2 * p->lag_s * p->lag_s : 0.0);
    }
    f->height_m = p->height_m;
    f->height_m2 = p->height_m2;
    update_velocity(f, p);
}
