/* SPDX-License-Identifier: MIT */
#include "recon/tracking/track_passing.h"

#include <math.h>

#include "recon/tracking/track_state.h"

#define PSD_SHARE   0.3  /* of the acceleration of who walks */
#define RUNS_M_S    2.25 /* so fast somebody may run, who is short, */
#define RIDES_M_S   3.0  /* and so fast he rides */
#define UNFIT_LOOKS 2.0  /* by then it is begun anew from what is heard */

/* Logarithms of how much better it fits as the one than as the other, and at most. */
#define CAR_FITS     1.0
#define BICYCLE_FITS 0.3
#define FITS_MOST    3.0
#define FITS_WELL    3.2  /* as 4 of 5 do (chi-squared, 2 degrees of freedom), */
#define FITS_BADLY   17.0 /* and what is worse tells no more */

/* From the middle to where the spot stays while the body comes near, or goes away; the
 * cosine between way and sight at which it is 0.7 as far: a flank is not quite flat; and
 * how far off the spot is from there, one sigma.  By 1900 detections of cars and cyclists
 * in another simulator. */
static const struct {
    double along_m, across_m, turns, along_sigma_m, across_sigma_m;
} body[TRACK_PASSING] = {
    [TRACK_AS_BICYCLE] = {0.40, 0.09, 0.25, 0.20, 0.06},
    [TRACK_AS_CAR] = {1.90, 0.85, 0.15, 0.20, 0.15},
};

void track_passing_spot(int as, double speed_m_s, const double u[2],
                        const double sight[2], double out[2])
{
    double in[2], spot_m[2], rides = 1.0;

    if (as == TRACK_AS_BICYCLE)
        rides = fmin(fmax((speed_m_s - RUNS_M_S) / (RIDES_M_S - RUNS_M_S), 0.0), 1.0);
    track_outline_turn_in(u, sight, in);
    spot_m[0] = -rides * body[as].along_m * in[0] / hypot(in[0], body[as].turns);
    spot_m[1] = -body[as].across_m * in[1] / hypot(in[1], body[as].turns);
    track_outline_turn_out(u, spot_m, out);
}

static double speed_of(const struct track_filter *f)
{
    return hypot(f->state[2], f->state[3]);
}

/* A glint on the flank is anywhere along it, and what is heard from before or behind
 * anywhere across an end. */
static void spot_variance(int as, double cosine, double *along_m2, double *across_m2)
{
    double turns2 = body[as].turns * body[as].turns;
    double glint = turns2 / (turns2 + cosine * cosine), end = cosine * cosine;

    *along_m2 = body[as].along_sigma_m * body[as].along_sigma_m +
                glint * body[as].along_m * body[as].along_m / 3.0;
    *across_m2 = body[as].across_sigma_m * body[as].across_sigma_m +
                 end * body[as].across_m * body[as].across_m / 3.0;
}

/* What was heard, as a place of the middle.  The way is that of what is heard: by its own
 * a filter would turn the spots so that they fit a wrong one. */
static struct track_position middle_of(const struct track *k, int as,
                                       const struct track_position *p,
                                       const double sight[2], double fresh)
{
    const struct track_filter *f = &k->passing.as[as];
    struct track_position out = *p;
    double u[2], spot_m[2], along_m2, across_m2;

    track_outline_heading(&k->filter, u);
    track_passing_spot(as, speed_of(f), u, sight, spot_m);
    spot_variance(as, u[0] * sight[0] + u[1] * sight[1], &along_m2, &across_m2);
    for (int a = 0; a < 2; a++) {
        out.at_m[a] -= spot_m[a];
        for (int b = 0; b < 2; b++)
            out.covariance_m2[a][b] +=
                ((a == b ? across_m2 : 0.0) + (along_m2 - across_m2) * u[a] * u[b]) /
                fresh;
    }
    return out;
}

static void begin(struct track *k, int as)
{
    const double *heard_m = k->filter.state;
    const struct track_position at = {.at_m = {heard_m[0], heard_m[1]}};
    struct track_filter *f = &k->passing.as[as];

    *f = k->filter;
    const struct track_position p = middle_of(k, as, &at, k->body.sight, 1.0);
    k->passing.unfit[as] = 0.0;
    for (int a = 0; a < 2; a++) {
        f->state[a] = p.at_m[a];
        for (int b = 0; b < 2; b++)
            f->covariance[a][b] += p.covariance_m2[a][b];
    }
}

/* By how much one look fits worse than what is so does.  (The spot of a car wanders more
 * than that of a bicycle: what fits well as both is nearer to a car's by the covariance
 * of each, and likelier a bicycle by its norm.  Neither tells which it is.) */
static double misfit(const struct track *k, int as, const struct track_position *heard,
                     double doubt)
{
    struct track_position p = middle_of(k, as, heard, k->body.sight, 1.0);

    track_position_doubt(&p, doubt);
    double distance2 = track_filter_match(&k->passing.as[as], &p).distance2;
    return fmin(fmax(distance2, FITS_WELL), FITS_BADLY) - FITS_WELL;
}

/* The strongest of what is the track's own: what is heard of it besides, a wheel or the
 * far corner, is not where its surface faces the array. */
static void take_strongest(const struct tracker *t, struct track *k, int as, double fresh,
                           double doubt)
{
    struct track_filter *f = &k->passing.as[as];
    struct track_position p =
        middle_of(k, as, &t->positions[k->detection], k->body.sight, fresh);

    track_position_doubt(&p, doubt);
    if (track_filter_match(f, &p).distance2 < t->cfg.gate2) {
        track_filter_update(f, &p);
        k->passing.unfit[as] = 0.0;
    } else {
        k->passing.unfit[as] += fresh;
    }
}

void track_passing_predict(struct track *k, double dt_s, double psd_m2_s3,
                           double lost_psd_m2_s3)
{
    for (int as = 0; k->passing.begun && as < TRACK_PASSING; as++)
        track_filter_predict(&k->passing.as[as], dt_s,
                             PSD_SHARE * psd_m2_s3 + lost_psd_m2_s3);
}

struct track_match track_passing_match(const struct tracker *t, const struct track *k,
                                       const struct track_scan *scan, size_t detection,
                                       double fresh)
{
    double sight[2];

    if (!k->passing.begun || (scan->standing_left && !k->outline.car))
        return (struct track_match){.distance2 = INFINITY};
    track_turn(t->pose.dyaw, scan->detections[detection].sight, sight);
    const struct track_position p =
        middle_of(k, TRACK_AS_CAR, &t->positions[detection], sight, fresh);
    return track_filter_match(&k->passing.as[TRACK_AS_CAR], &p);
}

void track_passing_update(const struct tracker *t, const struct track_scan *scan,
                          struct track *k, double fresh, double doubt)
{
    double worse[TRACK_PASSING] = {0.0}, *fits = &k->passing.fits_car;
    bool passes = (k->outline.fast || k->outline.car) &&
                  hypot(k->body.sight[0], k->body.sight[1]) > 0.5; /* it is known */

    for (int as = 0; passes && as < TRACK_PASSING; as++) {
        if (k->passing.begun) {
            worse[as] = misfit(k, as, &t->positions[k->detection], doubt);
            take_strongest(t, k, as, fresh, doubt);
        }
        if (!k->passing.begun || k->passing.unfit[as] > UNFIT_LOOKS)
            begin(k, as);
    }
    if (!scan->standing_left)
        *fits += 0.5 * fresh * (worse[TRACK_AS_BICYCLE] - worse[TRACK_AS_CAR]);
    *fits = fmin(fmax(*fits, -FITS_MOST), FITS_MOST);
    k->passing.begun = passes;
}

bool track_passing_fits_car(const struct track *k)
{
    return k->passing.fits_car > CAR_FITS;
}

bool track_passing_fits_bicycle(const struct track *k)
{
    return k->passing.fits_car < -BICYCLE_FITS;
}

const struct track_filter *track_passing_told(const struct track *k)
{
    const struct track_filter *car = &k->passing.as[TRACK_AS_CAR];

    if (!k->passing.begun)
        return NULL;
    if (!k->outline.car)
        return &k->passing.as[TRACK_AS_BICYCLE];
    return speed_of(car) > speed_of(&k->filter) ? car : NULL;
}
