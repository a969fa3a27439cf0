/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/channels.h"
#include "nodes/anlos/calibrate/calibrate.h"
#include "nodes/anlos/calibrate/paths.h"

#define MOST_RESIDUAL_DB 2.0

struct measurement {
    struct path *direct, *target; /* [n] */
    size_t n, n_heard, retaken;
    double *level_db;                   /* [n_speakers][n_microphones] */
    double *speaker_db, *microphone_db; /* [n_speakers], [n_microphones] */
    struct levels levels;
};

static int take_target(struct session *s, struct measurement *m)
{
    static const double ahead[3] = {0, 0, 1};
    const struct survey *y = s->survey;
    const struct calibrate_options *o = s->options;
    int err = session_check(s);
    if (err)
        return err;
    if (isnan(o->range_m) && !y->has_wall)
        return error_say(&s->why, -EINVAL,
                         "gains: how far is the flat target? say --range-m; the survey "
                         "has no wall");
    m->n = y->n_speakers * y->n_microphones;
    m->direct = paths_direct(y);
    m->target = isnan(o->range_m)
                    ? paths_reflected(y, o->position, y->wall_normal, y->wall_distance_m)
                    : paths_reflected(y, o->position, ahead, o->range_m);
    m->level_db = malloc(m->n * sizeof *m->level_db);
    m->speaker_db = malloc(y->n_speakers * sizeof *m->speaker_db);
    m->microphone_db = malloc(y->n_microphones * sizeof *m->microphone_db);
    if (!m->direct || !m->target || !m->level_db || !m->speaker_db || !m->microphone_db)
        return error_say(&s->why, -ENOMEM, "out of memory");
    return 0;
}

/* The latency that is known, or that of the direct paths. */
static int find_latency(struct session *s, struct measurement *m,
                        struct sounding *sounding, double *latency_s)
{
    struct time_zero z;
    *latency_s = s->calibration->latency_samples / s->survey->sample_rate_hz;
    if (!isnan(*latency_s))
        return 0;
    int err = paths_fit_latency(m->direct, sounding, session_speed_m_s(s), &z, &s->why);
    *latency_s = z.latency_s;
    return err;
}

/* What the way takes is given back: a mirror's echo fades with the whole way. */
static int fit(struct session *s, struct measurement *m, struct sounding *sounding)
{
    double latency_s;
    int err = find_latency(s, m, sounding, &latency_s);
    if (err)
        return err;
    if (paths_hear_near(m->target, sounding, latency_s, session_speed_m_s(s),
                        paths_window_s(s->survey)) < 0)
        return error_say(&s->why, -ENOMEM, "out of memory");
    for (size_t p = 0; p < m->n; p++) {
        const struct path *t = &m->target[p];
        m->n_heard += t->heard;
        m->level_db[p] = t->heard ? 20.0 * log10(cabs(t->arrival.peak) * t->distance_m)
                                  : NAN;
    }
    err = levels_fit(&m->levels, s->survey->n_speakers, s->survey->n_microphones,
                     m->level_db, m->speaker_db, m->microphone_db);
    if (err == -ENODATA)
        return error_say(
            &s->why, err,
            "no echo of the target is heard where it should be; is the range "
            "right, and the sound speed?");
    return err ? error_say(&s->why, err, "out of memory") : 0;
}

struct verdict {
    size_t implausible, missing; /* missing: neither heard nor known to be dead */
};

static void print_gains(const char *kind, const double *gain_db,
                        const struct calibration_channel *known, size_t n,
                        struct verdict *v)
{
    for (size_t i = 0; i < n; i++) {
        bool dead = known[i].faults & CALIBRATION_DEAD;
        if (isnan(gain_db[i]))
            printf("  %-10s %3zu  not heard%s\n", kind, i,
                   dead ? ", known to be dead" : "");
        else
            printf("  %-10s %3zu  %+6.2f dB\n", kind, i, gain_db[i]);
        v->missing += isnan(gain_db[i]) && !dead;
        v->implausible += fabs(gain_db[i]) > CALIBRATION_MAX_GAIN_DB;
    }
}

static bool judge(const struct session *s, const struct measurement *m)
{
    const struct levels *l = &m->levels;
    struct verdict v = {0, 0};
    printf("gains of %s, %zu takes\n", s->options->array, s->options->takes);
    print_gains("speaker", m->speaker_db, s->calibration->speakers, s->survey->n_speakers,
                &v);
    print_gains("microphone", m->microphone_db, s->calibration->microphones,
                s->survey->n_microphones, &v);
    printf("  heard           %zu of %zu pairs, %zu used\n", m->n_heard, m->n, l->n_used);
    printf("  average pair    %+.2f dB at 1 m\n", l->mean_db);
    printf("  unexplained     %.2f dB rms\n", l->residual_db);
    session_print_retaken(m->retaken);
    if (2 * l->n_used < m->n)
        printf("bad: fewer than half of the pairs hear the target\n");
    else if (v.missing)
        printf("bad: %zu channels were not heard; see anlos calibrate channels\n",
               v.missing);
    else if (v.implausible)
        printf("bad: a gain beyond +-%g dB is a fault of the hardware; see anlos "
               "calibrate channels\n",
               CALIBRATION_MAX_GAIN_DB);
    else if (l->residual_db > MOST_RESIDUAL_DB)
        printf("bad: gains of channels do not explain the levels; is the target flat and "
               "large, and nothing else as far away?\n");
    else
        return true;
    return false;
}

/* Dead channels have none. */
static double known(double gain_db)
{
    return isnan(gain_db) ? 0.0 : session_round(gain_db);
}

static int keep(struct session *s, const struct measurement *m)
{
    struct calibration *c = s->calibration;
    for (size_t j = 0; j < c->n_speakers; j++)
        c->speakers[j].gain_db = known(m->speaker_db[j]);
    for (size_t i = 0; i < c->n_microphones; i++)
        c->microphones[i].gain_db = known(m->microphone_db[i]);
    c->has_gains = true;
    int err = session_save(s);
    if (!err)
        printf("good: the gains are in %s\n", s->options->out);
    return err;
}

int calibrate_gains(struct session *s, bool *good)
{
    struct measurement m = {0};
    struct sounding *sounding;
    int err = take_target(s, &m);
    if (!err)
        err = sounding_take(&sounding, s->array, s->options->position, SIZE_MAX,
                            s->options->takes, &s->why);
    if (!err) {
        err = fit(s, &m, sounding);
        m.retaken = sounding_retaken(sounding);
        sounding_destroy(sounding);
    }
    if (!err) {
        *good = judge(s, &m);
        if (*good)
            err = keep(s, &m);
        else
            printf("nothing was written to %s\n", s->options->out);
    }
    free(m.direct);
    free(m.target);
    free(m.level_db);
    free(m.speaker_db);
    free(m.microphone_db);
    return err;
}
