/* SPDX-License-Identifier: MIT */
#include "recon/tracking/track_models.h"

#include <math.h>
#include <string.h>

/* Every 10 s somebody stops, sets off or turns, and has done so within one.  Who is lost
 * does more often: behind a corner is where people stop. */
#define CHANGES_HZ 0.1
#define LOST_HZ    0.3
#define KEEPS_HZ   1.0
#define LEAST      1e-9 /* no model is ruled out for good */

static double in_the_long_run(int model, double changes_hz)
{
    double changes = changes_hz / (changes_hz + KEEPS_HZ);

    return model == TRACK_CHANGES_PACE ? changes : 1.0 - changes;
}

void track_models_begin(struct track_models *m, const struct track_filter *f)
{
    m->begun = true;
    for (int i = 0; i < TRACK_MODELS; i++) {
        m->share[i] = in_the_long_run(i, CHANGES_HZ);
        m->of[i] = *f;
    }
}

/* The moments of a mixture.  Heights have one model. */
static void mix(const struct track_filter of[TRACK_MODELS],
                const double share[TRACK_MODELS], struct track_filter *out)
{
    struct track_filter f = of[0];

    memset(f.state, 0, sizeof f.state);
    memset(f.covariance, 0, sizeof f.covariance);
    for (int m = 0; m < TRACK_MODELS; m++)
        for (int i = 0; i < 4; i++)
            f.state[i] += share[m] * of[m].state[i];
    for (int m = 0; m < TRACK_MODELS; m++)
        for (int i = 0; i < 4; i++)
            for (int j = 0; j < 4; j++)
                f.covariance[i][j] += share[m] * (of[m].covariance[i][j] +
                                                  (of[m].state[i] - f.state[i]) *
                                                      (of[m].state[j] - f.state[j]));
    *out = f;
}

/* Each model goes on from what it may have been before: a Markov chain in continuous time
 * of two states forgets where it began. */
static void interact(struct track_models *m, double dt_s, double changes_hz)
{
    const struct track_models was = *m;
    double left = exp(-dt_s * (changes_hz + KEEPS_HZ));

    for (int j = 0; j < TRACK_MODELS; j++) {
        double from[TRACK_MODELS];
        m->share[j] = 0.0;
        for (int i = 0; i < TRACK_MODELS; i++) {
            double to = (1.0 - left) * in_the_long_run(j, changes_hz) +
                        (i == j ? left : 0.0);
            from[i] = was.share[i] * to;
            m->share[j] += from[i];
        }
        for (int i = 0; i < TRACK_MODELS; i++)
            from[i] = m->share[j] > 0.0 ? from[i] / m->share[j] : i == j;
        mix(was.of, from, &m->of[j]);
    }
}

void track_models_predict(struct track_models *m, double dt_s, bool lost,
                          const double psd_m2_s3[TRACK_MODELS], struct track_filter *out)
{
    interact(m, dt_s, lost ? LOST_HZ : CHANGES_HZ);
    for (int i = 0; i < TRACK_MODELS; i++)
        track_filter_predict(&m->of[i], dt_s, psd_m2_s3[i]);
    mix(m->of, m->share, out);
}

void track_models_update(struct track_models *m, const struct track_position *p,
                         struct track_filter *out)
{
    double sum = 0.0;

    for (int i = 0; i < TRACK_MODELS; i++) {
        m->share[i] *= track_filter_match(&m->of[i], p).density;
        track_filter_update(&m->of[i], p);
        sum += m->share[i];
    }
    for (int i = 0; i < TRACK_MODELS; i++)
        m->share[i] = sum > 0.0 ? fmax(m->share[i] / sum, LEAST) : 1.0 / TRACK_MODELS;
    mix(m->of, m->share, out);
}

/* -- looks that are taken back ----------------------------------------------------------
 */

#define BACK_NS  400000000LL
#define EVERY_NS 80000000LL
#define LESS_M_S 0.3
#define TURN_M_S 0.6 /* no part that is left of him seems to go so much otherwise, */
#define WALK_M_S 2.0 /* and what is faster does not stop so soon */

_Static_assert((TRACK_PAST - 1) * EVERY_NS >= BACK_NS, "");

void track_past_keep(struct track_past *p, const struct track_models *m, int64_t at_ns)
{
    if (p->n && at_ns - p->list[0].at_ns < EVERY_NS)
        return;
    p->n = p->n < TRACK_PAST ? p->n + 1 : TRACK_PAST;
    memmove(p->list + 1, p->list, (p->n - 1) * sizeof *p->list);
    p->list[0].at_ns = at_ns;
    p->list[0].models = *m;
}

static double speed_m2_s2(const struct track_filter *f)
{
    return f->covariance[2][2] + f->covariance[3][3];
}

void track_past_restore(struct track_past *p, int64_t seen_ns, int64_t now_ns,
                        const double psd_m2_s3[TRACK_MODELS], struct track_models *m,
                        struct track_filter *out)
{
    struct track_filter then;
    size_t i = 0;

    while (i < p->n && seen_ns - p->list[i].at_ns < BACK_NS)
        i++;
    if (i == p->n)
        return;
    struct track_models past = p->list[i].models;
    track_models_predict(&past, 1e-9 * (double)(now_ns - p->list[i].at_ns), true,
                         psd_m2_s3, &then);
    p->n = 0;
    double turn_m_s = hypot(out->state[2] - then.state[2], out->state[3] - then.state[3]);
    if (speed_m2_s2(&then) > speed_m2_s2(out) + 2.0 * LESS_M_S * LESS_M_S ||
        (turn_m_s > TURN_M_S && hypot(then.state[2], then.state[3]) < WALK_M_S))
        return;
    *m = past;
    *out = then;
}
