/* SPDX-License-Identifier: MIT */
#include "nodes/scan/run.h"

#include <math.h>
#include <stdio.h>

#include "recon/planning/scan_plan.h"

/* In its run-up the stage says three times or more that it is at its speed, and the array
 * has time to hear of it. */
#define MOST_LATE 20
#define EARLY_NS  200000000LL /* before the first slot, to tell the array, */
#define LATEST_NS 50000000LL  /* at the latest */
#define SPEED_OFF 0.02        /* that a steady stage may be off its speed */
#define FIT_NS    300000000LL
#define EXACT_OFF 0.005      /* of one whose reports are exact, */
#define EXACT_M   1e-5       /* and how far they lie beside a line */
#define STEADY_NS 90000000LL /* that the reports must span */

void run_begin(struct run *r, double first_m, double end_m, double speed_m_s)
{
    double s = fabs(speed_m_s);

    *r = (struct run){.speed_m_s = speed_m_s, .first_m = first_m, .end_m = end_m};
    r->run_up_m = SCAN_RUN_UP_S * s + s * s / (2.0 * SCAN_RUN_UP_M_S2);
    r->go_m = first_m - copysign(r->run_up_m, speed_m_s);
}

void run_room(const struct run *r, double room_m[2])
{
    double ramp_m = r->run_up_m - SCAN_RUN_UP_S * fabs(r->speed_m_s);

    room_m[0] = r->first_m - copysign(r->run_up_m, r->speed_m_s);
    room_m[1] = r->end_m + SCAN_RUN_OUT_S * r->speed_m_s + copysign(ramp_m, r->speed_m_s);
}

void run_stands(struct run *r)
{
    double room_m[2];

    r->stands = true;
    r->set_off = false;
    r->line.n = 0;
    run_room(r, room_m);
    r->go_m = room_m[1];
}

void run_report(struct run *r, const Anlos__StageState *state, int64_t at_ns)
{
    if (!r->stands || state->state != ANLOS__STAGE_STATE__STATE__MOVING)
        return;
    r->set_off = true;
    stage_line_add(&r->line, at_ns, state->position_m);
}

/* late: it is at its speed, but who was to tell the array was too busy. */
static enum run_progress begin_again(struct run *r, bool late, double speed_m_s)
{
    if (late && ++r->late == MOST_LATE) {
        snprintf(
            r->text, sizeof r->text,
            "its reports came too late to tell the array when to begin, %u times; is "
            "this machine too busy?",
            r->late);
        return RUN_FAILED;
    }
    if (!late && ++r->tries == SCAN_RUN_TRIES) {
        snprintf(r->text, sizeof r->text,
                 "it does not get up to %.4f m/s within %.3f m (%.4f by its reports); is "
                 "its acceleration too small?",
                 fabs(r->speed_m_s), r->run_up_m, fabs(speed_m_s));
        return RUN_FAILED;
    }
    r->run_up_m *= late ? 1.0 : SCAN_MORE_RUN_UP;
    r->stands = r->set_off = false;
    r->go_m = r->first_m - copysign(r->run_up_m, r->speed_m_s);
    return RUN_TO_START;
}

/* By its newest reports, as many as lie on a line: those from when it got up to speed do
 * not. */
static bool is_steady(const struct run *r, struct stage_line_fit *fit)
{
    const struct stage_line *l = &r->line;
    double off_m_s = SPEED_OFF * fabs(r->speed_m_s);
    *fit = (struct stage_line_fit){.n = 0};
    if (!l->n)
        return false;
    int64_t newest_ns = l->at_ns[(l->n - 1) % STAGE_LINE_REPORTS];
    for (int64_t span_ns = STEADY_NS; span_ns <= FIT_NS; span_ns += STEADY_NS / 3) {
        struct stage_line_fit f;
        if (!stage_line_fit(l, newest_ns - span_ns, newest_ns, &f))
            continue;
        if (fit->n && (fabs(f.speed_m_s - r->speed_m_s) > off_m_s ||
                       f.jitter_m > fmax(EXACT_M, 1.5 * fit->jitter_m)))
            break;
        *fit = f;
    }
    return fit->n && fabs(fit->speed_m_s - r->speed_m_s) <= off_m_s;
}

enum run_progress run_step(struct run *r, int64_t now_ns)
{
    struct stage_line_fit fit;

    if (r->fired)
        return RUN_RECORDS;
    if (!r->stands)
        return RUN_TO_START;
    if (!r->set_off)
        return RUN_SETS_OFF;
    bool steady = is_steady(r, &fit);
    if (!r->line.n)
        return RUN_WAITS;
    double reached_m = steady ? stage_line_place_m(&fit, now_ns + LATEST_NS)
                              : r->line.place_m[(r->line.n - 1) % STAGE_LINE_REPORTS];
    if ((reached_m - r->first_m) * r->speed_m_s > 0)
        return begin_again(r, steady, fit.speed_m_s);
    if (!steady)
        return RUN_WAITS;
    /* The longer it is watched, the better its place is known; but who is busy may be
     * late. */
    r->start_ns = stage_line_time_ns(&fit, r->first_m);
    bool exact = fit.jitter_m <= EXACT_M &&
                 fabs(fit.speed_m_s - r->speed_m_s) <= EXACT_OFF * fabs(r->speed_m_s);
    if (r->start_ns - now_ns > (exact ? EARLY_NS : 2 * LATEST_NS))
        return RUN_WAITS;
    r->fired = true;
    return RUN_FIRES;
}
