/* SPDX-License-Identifier: MIT */
#include "recon/planning/scan_plan.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "recon/tail.h"

#define SLOT_STEP 16   /* samples */
#define GAIN_LOST 2.7  /* Hann's window, spreading, `fast`'s weights; measured by Pd */
#define AS_GOOD   1.05 /* times an error is no worse */
#define AS_QUICK  1.02
#define LEAST_M   0.001 /* errors below are all the same */
#define AS_QUIET  1.1   /* times so many traces have as little noise */

/* -- how long it takes ------------------------------------------------------------------
 */

static double move_s(const struct scan_stage *stage, double m)
{
    double v = stage->speed_m_s, a = stage->acceleration_m_s2;
    return m < v * v / a ? 2.0 * sqrt(m / a) : m / v + v / a;
}

#define STEADY_S 0.2 /* before the first round it must be seen to be at its speed */

/* To a speed above 0.  INFINITY: it is not up to it in time, however often it is tried.
 */
static double run_up_m(const struct scan_stage *stage, double v)
{
    double m = SCAN_RUN_UP_S * v + v * v / (2.0 * SCAN_RUN_UP_M_S2);
    double least_m = STEADY_S * v + v * v / (2.0 * stage->acceleration_m_s2);
    for (int tries = 1; m < least_m; tries++) {
        if (tries == SCAN_RUN_TRIES)
            return INFINITY;
        m *= SCAN_MORE_RUN_UP;
    }
    return m;
}

static void find_room(double room_m[2], const struct survey *s,
                      const struct scan_stage *stage)
{
    double v = survey_speed_m_s(s), first_m = s->stage_positions_m[0];
    double end_m = first_m + v * survey_duration_s(s), m = run_up_m(stage, fabs(v));
    room_m[0] = first_m - copysign(m, v);
    room_m[1] = end_m + copysign((SCAN_RUN_OUT_S - SCAN_RUN_UP_S) * fabs(v) + m, v);
}

static bool reaches(const struct scan_stage *stage, const double room_m[2])
{
    const double *reach_m = stage->reach_m;
    return reach_m[0] == reach_m[1] || (fmin(room_m[0], room_m[1]) >= reach_m[0] &&
                                        fmax(room_m[0], room_m[1]) <= reach_m[1]);
}

static double pass_s(const struct survey *s, const struct scan_stage *stage)
{
    double tail_s = (double)tail_samples(s) / s->sample_rate_hz;
    double pings_s = survey_duration_s(s), last = (double)(s->n_positions - 1);
    double way_m =
        fabs(s->stage_positions_m[s->n_positions - 1] - s->stage_positions_m[0]);
    if (!s->continuous)
        return pings_s + (last + 1.0) * tail_s +
               last * (move_s(stage, way_m / last) + stage->settle_s);
    double v = fabs(survey_speed_m_s(s)), up_m = run_up_m(stage, v);
    return move_s(stage, up_m) + stage->settle_s + v / stage->acceleration_m_s2 +
           (up_m - v * v / (2.0 * stage->acceleration_m_s2)) / v + pings_s + tail_s;
}

/* -- the ways ---------------------------------------------------------------------------
 */

int scan_way_survey(struct survey *out, const struct survey *s, const struct scan_way *w,
                    struct error *why)
{
    if (survey_copy(out, s))
        return error_say(why, -ENOMEM, "out of memory");
    out->continuous = w->continuous;
    out->slot_samples = w->slot_samples;
    out->together = w->together;
    out->chirp_alternates = w->alternates;
    survey_spread_positions(out, w->n_positions);
    int err = survey_check(out, why);
    if (err)
        survey_clear(out);
    return err;
}

/* The shortest in which the gate is heard before the next speaker; 0: there is no gate.
 */
static size_t shortest_slot(const struct survey *s)
{
    struct survey own = *s;
    if (!s->has_gate)
        return 0;
    own.slot_samples = SLOT_STEP;
    while (survey_gate_limit_m(&own) < s->gate_m[1])
        own.slot_samples += SLOT_STEP;
    return own.slot_samples;
}

static int time_of(const struct scan_plan_config *cfg, struct scan_way *w,
                   struct error *why)
{
    struct survey s;
    int err = scan_way_survey(&s, cfg->survey, w, why);
    if (err)
        return err;
    w->time_s = pass_s(&s, &cfg->stage);
    w->speed_m_s = survey_speed_m_s(&s);
    if (s.continuous)
        find_room(w->room_m, &s, &cfg->stage);
    survey_clear(&s);
    return 0;
}

/* As many positions as the time allows; 0: not two. */
static size_t most_positions(const struct scan_plan_config *cfg, struct scan_way w)
{
    struct error why;
    size_t least = 2, most = cfg->survey->n_positions;
    while (least <= most) {
        w.n_positions = (least + most) / 2;
        if (time_of(cfg, &w, &why) || w.time_s > cfg->time_s)
            most = w.n_positions - 1;
        else
            least = w.n_positions + 1;
    }
    return most < 2 ? 0 : most;
}

static bool is_there(const struct scan_plan *p, const struct scan_way *w)
{
    for (size_t i = 0; i < p->n_ways; i++) {
        const struct scan_way *v = &p->ways[i];
        if (v->continuous == w->continuous && v->slot_samples == w->slot_samples &&
            v->together == w->together && v->n_positions == w->n_positions)
            return true;
    }
    return false;
}

static void add_positions(struct scan_plan *out, const struct scan_plan_config *cfg,
                          struct scan_way w)
{
    size_t all = cfg->survey->n_positions;
    const size_t numbers[] = {all, 3 * all / 4, all / 2, all / 4,
                              isfinite(cfg->time_s) ? most_positions(cfg, w) : 0};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        w.n_positions = numbers[i];
        if (w.n_positions >= 2 && !is_there(out, &w))
            out->ways[out->n_ways++] = w;
    }
}

static void list_ways(struct scan_plan *out, const struct scan_plan_config *cfg)
{
    const struct survey *s = cfg->survey;
    size_t shortest = shortest_slot(s);
    const size_t slots[] = {s->slot_samples, shortest < s->slot_samples ? shortest : 0};
    out->n_ways = 0;
    for (int stage = 0; stage < 2; stage++)
        for (int slot = 0; slot < 2; slot++)
            for (size_t together = 1; together <= 2; together++)
                if (slots[slot] && (together == 1 || s->n_speakers > 1))
                    add_positions(out, cfg,
                                  (struct scan_way){
                                      .continuous = stage,
                                      .slot_samples = slots[slot],
                                      .together = together,
                                      .alternates = together == 2 || s->chirp_alternates,
                                  });
}

/* -- what each is worth -----------------------------------------------------------------
 */

static double noise_m(const struct scan_plan_config *cfg, const struct scan_way *w)
{
    const struct survey *s = cfg->survey;
    double raw = pow(10.0, 0.1 * cfg->snr_db), sum = 0.0;
    double alone = s->together > 1 ? 2.0 : 1.0;
    double snr = raw * w->image.traces * (double)s->slot_samples /
                 (4.0 * alone * GAIN_LOST);
    for (int a = 0; a < 2; a++)
        sum += w->image.width_m[a] * w->image.width_m[a];
    return sqrt(sum / (8.0 * log(4.0) * snr));
}

static int judge(const struct scan_plan *p, const struct scan_plan_config *cfg,
                 struct scan_way *w, struct error *why)
{
    struct error inner;
    struct survey s;
    int err = time_of(cfg, w, &inner);
    if (!err && fabs(w->speed_m_s) > cfg->stage.speed_m_s)
        err = error_say(&inner, -EINVAL, "the stage would have to go at %.3f m/s",
                        fabs(w->speed_m_s));
    if (!err && w->continuous && !isfinite(w->room_m[0]))
        err = error_say(&inner, -EINVAL,
                        "the stage would not be at %.3f m/s in time: its acceleration is "
                        "too small",
                        fabs(w->speed_m_s));
    if (!err && w->continuous && !reaches(&cfg->stage, w->room_m))
        err = error_say(&inner, -EINVAL,
                        "the stage would have to go from %.3f to %.3f m, to get up to "
                        "speed before its positions and brake behind them",
                        w->room_m[0], w->room_m[1]);
    if (!err && w->time_s > cfg->time_s)
        err = error_say(&inner, -EINVAL, SCAN_TOO_SLOW);
    if (!err)
        err = scan_way_survey(&s, cfg->survey, w, &inner);
    if (err) {
        snprintf(w->why_not, sizeof w->why_not, "%.199s", inner.text);
        return err == -ENOMEM ? error_say(why, err, "out of memory") : 0;
    }
    err = point_image(&w->image, &s, cfg->at_m, cfg->pool, why);
    survey_clear(&s);
    if (err)
        return err;
    w->noise_m = noise_m(cfg, w);
    w->error_m = hypot(hypot(w->image.beside_m[0], w->image.beside_m[1]), w->noise_m);
    if (w->image.sidelobe_db < p->whole.sidelobe_db - SCAN_SIDELOBES_DB)
        snprintf(w->why_not, sizeof w->why_not, "sidelobes %.1f dB higher",
                 p->whole.sidelobe_db - w->image.sidelobe_db);
    else if (cfg->error_m > 0.0 && w->error_m > cfg->error_m)
        snprintf(w->why_not, sizeof w->why_not, "not as exact");
    return 0;
}

/* What is as good goes by what hears more, then by what is simpler. */
static bool is_simpler(const struct scan_way *a, const struct scan_way *b)
{
    if (a->together != b->together)
        return a->together < b->together;
    if (a->slot_samples != b->slot_samples)
        return a->slot_samples > b->slot_samples;
    if (a->continuous != b->continuous)
        return b->continuous;
    return a->time_s < b->time_s;
}

static bool is_better(const struct scan_plan_config *cfg, const struct scan_way *a,
                      const struct scan_way *b)
{
    bool by_time = cfg->error_m > 0.0;
    double x = by_time ? a->time_s : fmax(a->error_m, LEAST_M);
    double y = by_time ? b->time_s : fmax(b->error_m, LEAST_M);
    double alike = by_time ? AS_QUICK : AS_GOOD;
    if (x > y * alike || y > x * alike)
        return x < y;
    double p = a->image.traces, q = b->image.traces;
    if (!by_time && (p > q * AS_QUIET || q > p * AS_QUIET))
        return p > q;
    return is_simpler(a, b);
}

static int look_at_whole(struct scan_plan *out, const struct scan_plan_config *cfg,
                         struct error *why)
{
    struct survey s;
    if (survey_copy(&s, cfg->survey))
        return error_say(why, -ENOMEM, "out of memory");
    s.continuous = false;
    int err = point_image(&out->whole, &s, cfg->at_m, cfg->pool, why);
    survey_clear(&s);
    return err;
}

int scan_plan(struct scan_plan *out, const struct scan_plan_config *cfg,
              struct error *why)
{
    const struct survey *s = cfg->survey;
    memset(out, 0, sizeof *out);
    if (s->pings_m || s->n_positions < 2)
        return error_say(why, -EINVAL,
                         "there is %s; expected a stage with positions_m of two or more",
                         s->pings_m ? "a recording of pings" : "one position");
    int err = look_at_whole(out, cfg, why);
    if (err)
        return err;
    list_ways(out, cfg);
    for (size_t i = 0; i < out->n_ways; i++) {
        struct scan_way *w = &out->ways[i];
        err = judge(out, cfg, w, why);
        if (err)
            return err;
        if (!w->why_not[0] && (!out->best || is_better(cfg, w, out->best)))
            out->best = w;
    }
    return 0;
}
