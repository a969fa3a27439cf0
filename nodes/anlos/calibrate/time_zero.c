/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "nodes/anlos/calibrate/calibrate.h"
#include "nodes/anlos/calibrate/paths.h"

#define MOST_SIGMA     0.1 /* samples of the latency's standard deviation */
#define MOST_SPREAD    1.0 /* samples, 7 mm at 48 kHz: coherent imaging needs 5 */
#define MOST_SPEED_OFF 0.1 /* samples that a wrong speed makes of the mean distance */
#define SPEED_SIGMA                                                                      \
    1.0             /* m/s: distances that tell the speed no better do not tell it       \
                     */
#define CERTAIN 4.0 /* standard deviations */

struct measurement {
    struct path *direct; /* [n] */
    size_t n;
    double rate_hz, speed_m_s;   /* the speed that was known before */
    struct time_zero latency;    /* for that speed, or for the fitted one */
    struct time_zero with_speed; /* speed_sigma_m_s INFINITY: cannot be told */
    size_t retaken;
};

static int check(struct session *s)
{
    const struct calibrate_options *o = s->options;
    const struct survey *y = s->survey;
    int err = session_check(s);
    if (err)
        return err;
    if (o->has_pair && (o->pair[0] >= y->n_speakers || o->pair[1] >= y->n_microphones))
        return error_say(&s->why, -EINVAL,
                         "--pair %zu,%zu: there are speakers 0 to %zu and microphones 0 "
                         "to %zu",
                         o->pair[0], o->pair[1], y->n_speakers - 1, y->n_microphones - 1);
    if (!o->has_pair && !isnan(o->distance_m))
        return error_say(&s->why, -EINVAL,
                         "--distance-m: of which speaker and microphone? say --pair S,M");
    return 0;
}

/* Only the pair asked for counts, at the distance asked for. */
static void choose_pair(const struct calibrate_options *o, const struct survey *y,
                        struct path *direct)
{
    size_t pair = o->pair[0] * y->n_microphones + o->pair[1];
    for (size_t p = 0; p < y->n_speakers * y->n_microphones; p++)
        direct[p].ignored = p != pair;
    if (!isnan(o->distance_m))
        direct[pair].distance_m = o->distance_m;
}

/* Of those heard. */
static double mean_distance_m(const struct measurement *m)
{
    double sum = 0.0;
    for (size_t p = 0; p < m->n; p++)
        sum += m->direct[p].heard ? m->direct[p].distance_m : 0.0;
    return sum / (double)m->latency.n_heard;
}

static int fit_speed(struct session *s, struct measurement *m)
{
    struct time_zero_pair *pairs = malloc(m->n * sizeof *pairs);
    if (!pairs)
        return error_say(&s->why, -ENOMEM, "out of memory");
    paths_pairs(m->direct, m->n, pairs);
    int err = time_zero_fit_speed(&m->with_speed, pairs, m->n, m->speed_m_s);
    free(pairs);
    if (err || !(m->with_speed.speed_sigma_m_s <= SPEED_SIGMA))
        m->with_speed.speed_sigma_m_s = INFINITY;
    else if (s->options->fit_speed)
        m->latency = m->with_speed;
    return err == -ENOMEM ? error_say(&s->why, err, "out of memory") : 0;
}

static int measure(struct session *s, struct measurement *m)
{
    const struct calibrate_options *o = s->options;
    struct sounding *sounding;
    m->n = s->survey->n_speakers * s->survey->n_microphones;
    m->rate_hz = s->survey->sample_rate_hz;
    m->speed_m_s = session_speed_m_s(s);
    m->direct = paths_direct(&s->placed);
    if (!m->direct)
        return error_say(&s->why, -ENOMEM, "out of memory");
    if (o->has_pair)
        choose_pair(o, s->survey, m->direct);
    int err = sounding_take(&sounding, s->array, o->position,
                            o->has_pair ? o->pair[0] : SIZE_MAX, o->takes, &s->why);
    if (err)
        return err;
    err = paths_fit_latency(m->direct, sounding, m->speed_m_s, &m->latency, &s->why);
    m->retaken = sounding_retaken(sounding);
    sounding_destroy(sounding);
    return err ? err : fit_speed(s, m);
}

static double off_samples(const struct measurement *m, const struct path *p)
{
    return (p->arrival.time_s - m->latency.latency_s -
            p->distance_m / m->latency.speed_m_s) *
           m->rate_hz;
}

static void print_farthest(const struct session *s, const struct measurement *m)
{
    size_t worst = m->n;
    for (size_t p = 0; p < m->n; p++)
        if (m->direct[p].heard &&
            (worst == m->n || fabs(off_samples(m, &m->direct[p])) >
                                  fabs(off_samples(m, &m->direct[worst]))))
            worst = p;
    double off = off_samples(m, &m->direct[worst]);
    printf("  farthest off  speaker %zu to microphone %zu, %.2f samples %s: %.1f mm\n",
           worst / s->survey->n_microphones, worst % s->survey->n_microphones, fabs(off),
           off < 0.0 ? "early" : "late",
           fabs(off) / m->rate_hz * m->latency.speed_m_s * 1e3);
}

static void print_speed(const struct session *s, const struct measurement *m)
{
    bool known = !isnan(s->calibration->sound_speed_m_s);
    printf("  sound speed   %.2f m/s (%s); ", m->speed_m_s,
           known ? "calibrated" : "survey");
    if (isfinite(m->with_speed.speed_sigma_m_s))
        printf("the distances say %.2f +- %.2f\n", m->with_speed.speed_m_s,
               m->with_speed.speed_sigma_m_s);
    else
        printf("the distances are too equal, or too few, to tell\n");
}

static void print(const struct session *s, const struct measurement *m)
{
    const struct time_zero *z = &m->latency;
    size_t asked = s->options->has_pair ? 1 : m->n;
    printf("time zero of %s, %zu takes\n", s->options->array, s->options->takes);
    printf("  heard         %zu of %zu pairs, %zu agree\n", z->n_heard, asked, z->n_used);
    printf("  latency       %.3f samples, %.4f ms", z->latency_s * m->rate_hz,
           z->latency_s * 1e3);
    if (isfinite(z->latency_sigma_s))
        printf(", +- %.3f samples\n", z->latency_sigma_s * m->rate_hz);
    else
        printf("; one pair does not tell how exact that is\n");
    if (asked > 1) {
        printf("  spread        %.3f samples: %.1f mm\n", z->spread_s * m->rate_hz,
               z->spread_s * z->speed_m_s * 1e3);
        print_farthest(s, m);
        print_speed(s, m);
    }
    session_print_retaken(m->retaken);
}

/* How far a wrong speed would put the latency off; 0 where the distances do not tell. */
static double speed_error_samples(const struct measurement *m)
{
    const struct time_zero *w = &m->with_speed;
    double off_m_s = fabs(w->speed_m_s - m->latency.speed_m_s);
    if (!isfinite(w->speed_sigma_m_s) || off_m_s < CERTAIN * w->speed_sigma_m_s)
        return 0.0;
    return mean_distance_m(m) * off_m_s / (w->speed_m_s * w->speed_m_s) * m->rate_hz;
}

static bool judge(const struct session *s, const struct measurement *m)
{
    const struct time_zero *z = &m->latency;
    double latency = z->latency_s * m->rate_hz, spread = z->spread_s * m->rate_hz;
    double sigma = z->latency_sigma_s * m->rate_hz;
    size_t asked = s->options->has_pair ? 1 : m->n;
    if (s->options->fit_speed && !isfinite(m->with_speed.speed_sigma_m_s))
        printf("bad: the distances do not tell the speed of sound; measure it with "
               "sound-speed\n");
    else if (latency < -MOST_SIGMA)
        printf("bad: sound cannot arrive before it is sent; the places in the survey or "
               "the distance are wrong\n");
    else if (latency >= (double)s->survey->slot_samples)
        printf("bad: the latency is not shorter than a slot, %zu samples\n",
               s->survey->slot_samples);
    else if (2 * z->n_heard < asked)
        printf("bad: fewer than half of the pairs were heard; see anlos calibrate "
               "channels\n");
    else if (2 * z->n_used < z->n_heard)
        printf("bad: fewer than half of the pairs agree; see anlos calibrate channels\n");
    else if (spread > MOST_SPREAD || (asked > 1 && !(sigma <= MOST_SIGMA)))
        printf("bad: the pairs do not agree; is nothing swapped (anlos calibrate "
               "channels), and do the elements stand where the survey says, to 5 mm?\n");
    else if (!(z->speed_m_s >= 300.0 && z->speed_m_s <= 360.0))
        printf("bad: air has 300 to 360 m/s; are the places in the survey right?\n");
    else if (speed_error_samples(m) > MOST_SPEED_OFF)
        printf("bad: the distances say another speed of sound; measure the temperature "
               "(sound-speed), or take the speed along with --fit-speed\n");
    else
        return true;
    return false;
}

int calibrate_time_zero(struct session *s, bool *good)
{
    struct measurement m = {0};
    int err = check(s);
    if (!err)
        err = measure(s, &m);
    if (!err) {
        print(s, &m);
        *good = judge(s, &m);
        if (*good) {
            s->calibration->latency_samples =
                fmax(0.0, session_round(m.latency.latency_s * m.rate_hz));
            if (s->options->fit_speed) { /* and no longer from the air's temperature */
                s->calibration->sound_speed_m_s = session_round(m.latency.speed_m_s);
                s->calibration->temperature_c = NAN;
                s->calibration->humidity_percent = NAN;
            }
            err = session_save(s);
        } else {
            printf("nothing was written to %s\n", s->options->out);
        }
        if (!err && *good)
            printf("good: latency_samples %.3f is in %s\n",
                   s->calibration->latency_samples, s->options->out);
    }
    free(m.direct);
    return err;
}
