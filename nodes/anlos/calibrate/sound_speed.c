/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "nodes/anlos/calibrate/calibrate.h"
#include "nodes/anlos/calibrate/paths.h"

#define HUMIDITY_PERCENT                                                                 \
    50.0                  /* when none is given: off by 40 % it costs 0.15 % at 20 C */
#define SPEED_SIGMA   1.0 /* m/s: worse is no measurement */
#define RANGE_ERROR_M 0.005

/* -- from the air -----------------------------------------------------------------------
 */

static int from_air(struct session *s, bool *good)
{
    const struct calibrate_options *o = s->options;
    struct calibration *c = s->calibration;
    bool given = !isnan(o->humidity_percent);
    c->temperature_c = o->temperature_c;
    c->humidity_percent = given ? o->humidity_percent : HUMIDITY_PERCENT;
    c->sound_speed_m_s = session_round(
        survey_humid_sound_speed_m_s(c->temperature_c, c->humidity_percent / 100.0));
    printf("sound speed in air of %.2f C and %.0f %% humidity%s (Cramer 1993)\n",
           c->temperature_c, c->humidity_percent, given ? "" : ", assumed");
    printf("  sound speed   %.2f m/s; %.2f in dry air\n", c->sound_speed_m_s,
           survey_sound_speed_m_s(c->temperature_c));
    printf("  off by 1 C    %.2f m/s\n",
           survey_humid_sound_speed_m_s(c->temperature_c + 1.0,
                                        c->humidity_percent / 100.0) -
               c->sound_speed_m_s);
    *good = true;
    return 0;
}

/* -- from a reflector at known range ----------------------------------------------------
 */

struct measurement {
    struct path *direct, *reflected; /* [n] */
    size_t n, retaken;
    struct time_zero direct_only, both;
};

/* Direct and reflected paths lie on one line of arrival over distance: the latency falls
 * out, and the speed comes of the difference. */
static int fit(struct session *s, struct measurement *m, struct sounding *sounding)
{
    double speed_m_s = session_speed_m_s(s);
    int err = paths_fit_latency(m->direct, sounding, speed_m_s, &m->direct_only, &s->why);
    if (err)
        return err;
    struct time_zero_pair *pairs = malloc(2 * m->n * sizeof *pairs);
    /* 5 % of speed: 25 K. */
    double window_s = 0.05 * 2.0 * s->options->range_m / speed_m_s +
                      paths_window_s(s->survey);
    if (!pairs || paths_hear_near(m->reflected, sounding, m->direct_only.latency_s,
                                  speed_m_s, window_s) < 0) {
        err = error_say(&s->why, -ENOMEM, "out of memory");
    } else {
        paths_pairs(m->direct, m->n, pairs);
        paths_pairs(m->reflected, m->n, pairs + m->n);
        err = time_zero_fit_speed(&m->both, pairs, 2 * m->n, speed_m_s);
        if (err == -ENODATA)
            error_say(&s->why, err,
                      "no reflector is heard at %.3f m: nothing where its echo should be",
                      s->options->range_m);
    }
    free(pairs);
    return err;
}

static size_t count_heard(const struct path *paths, size_t n)
{
    size_t heard = 0;
    for (size_t p = 0; p < n; p++)
        heard += paths[p].heard;
    return heard;
}

static bool judge(struct session *s, const struct measurement *m)
{
    const struct time_zero *z = &m->both;
    size_t heard = count_heard(m->reflected, m->n);
    double range_m = s->options->range_m;
    printf("sound speed from a flat reflector at z = %.4f m, %zu takes\n", range_m,
           s->options->takes);
    printf("  heard         direct %zu of %zu pairs, reflected %zu; %zu agree\n",
           count_heard(m->direct, m->n), m->n, heard, z->n_used);
    printf("  sound speed   %.2f m/s +- %.2f; %.1f mm of error in the range would be "
           "%.2f\n",
           z->speed_m_s, z->speed_sigma_m_s, RANGE_ERROR_M * 1e3,
           z->speed_m_s * RANGE_ERROR_M / range_m);
    printf("  air           %.1f C if it is dry\n",
           20.0 + (z->speed_m_s - survey_sound_speed_m_s(20.0)) /
                      (survey_sound_speed_m_s(20.5) - survey_sound_speed_m_s(19.5)));
    session_print_retaken(m->retaken);
    if (2 * heard < m->n)
        printf("bad: fewer than half of the pairs hear the reflector\n");
    else if (2 * z->n_used < z->n_heard)
        printf("bad: fewer than half of the arrivals lie on one line; is the reflector "
               "flat, and parallel to the array?\n");
    else if (!(z->speed_sigma_m_s <= SPEED_SIGMA))
        printf("bad: the arrivals scatter too much to tell\n");
    else if (!(z->speed_m_s >= 300.0 && z->speed_m_s <= 360.0))
        printf("bad: air has 300 to 360 m/s; is the range right?\n");
    else
        return true;
    return false;
}

static int from_reflector(struct session *s, bool *good)
{
    static const double ahead[3] = {0, 0, 1};
    const struct calibrate_options *o = s->options;
    struct measurement m = {0};
    struct sounding *sounding;
    int err = session_check(s);
    if (err)
        return err;
    m.n = s->survey->n_speakers * s->survey->n_microphones;
    m.direct = paths_direct(&s->placed);
    m.reflected = paths_reflected(&s->placed, o->position, ahead, o->range_m);
    err = m.direct && m.reflected ? sounding_take(&sounding, s->array, o->position,
                                                  SIZE_MAX, o->takes, &s->why)
                                  : error_say(&s->why, -ENOMEM, "out of memory");
    if (!err) {
        err = fit(s, &m, sounding);
        m.retaken = sounding_retaken(sounding);
        sounding_destroy(sounding);
    }
    if (!err) {
        *good = judge(s, &m);
        if (*good) {
            s->calibration->sound_speed_m_s = session_round(m.both.speed_m_s);
            s->calibration->temperature_c = s->calibration->humidity_percent = NAN;
        }
    }
    free(m.direct);
    free(m.reflected);
    return err;
}

int calibrate_sound_speed(struct session *s, bool *good)
{
    const struct calibrate_options *o = s->options;
    bool air = !isnan(o->temperature_c), range = !isnan(o->range_m);
    if (air == range)
        return error_say(&s->why, -EINVAL,
                         "sound-speed: expected --temperature-c (and --humidity), or "
                         "--range-m of a flat reflector");
    int err = air ? from_air(s, good) : from_reflector(s, good);
    if (err)
        return err;
    if (!*good) {
        printf("nothing was written to %s\n", o->out);
        return 0;
    }
    err = session_save(s);
    if (!err)
        printf("good: sound_speed_m_s %.2f is in %s%s\n", s->calibration->sound_speed_m_s,
               o->out,
               isnan(s->calibration->latency_samples)
                   ? ""
                   : "; measure time-zero again, it was found with another speed");
    return err;
}
