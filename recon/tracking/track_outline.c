/* SPDX-License-Identifier: MIT */
#include "recon/tracking/track_outline.h"

#include <math.h>

#include "recon/tracking/track_state.h"

#define WALK_M_S       2.0  /* no person walks faster, */
#define PERSON_M       0.9  /* nor is longer, as an image has him */
#define GLINT_S        0.7  /* a glint that looks like one is heard for no longer */
#define SLOW_M_S       1.75 /* below, what was faster may be walking after all */
#define SURE_M_S       1.0  /* a velocity that is compared is known to this */
#define BICYCLE_M      1.0  /* what is sure to be heard of one */
#define CAR_M          1.9  /* a body that is longer is no bicycle, */
#define SMEAR_M        0.4  /* nor is one place that is longer by so much: a car, */
#define CAR_WIDER_M    0.6  /* as is one of several places that is wider; */
#define SURELY_CAR_M   3.0  /* what is longer stays one, whatever its spots do; */
#define CAR_LENGTH_M   4.2  /* so long and so wide, */
#define CAR_WIDTH_M    1.7
#define CAR_SHARE      0.5         /* what is fast and was heard shorter is either */
#define CAR_FRONT      (2.0 / 3.0) /* of it: what comes in is heard at its front at first */
#define BRAKES_M_S2    3.0         /* no bicycle does so for longer */
#define SHARE          0.3         /* of the newest look at the middle */
#define MIDDLE_SHARE   0.05 /* of its size, to which the middle of a body is known */
#define FRONT_M        0.09 /* what is heard of a person is before the middle by so much */
#define FRONT_SIGMA_M  0.06
#define WALKER_SIGMA_M 0.03                          /* the same of who walks */
#define BEYOND_M       (0.5 * CAR_WIDTH_M - FRONT_M) /* a car's middle is farther by that */

void track_outline_heading(const struct track_filter *f, double u[2])
{
    double speed = hypot(f->state[2], f->state[3]);

    u[0] = speed > 0.0 ? f->state[2] / speed : 1.0;
    u[1] = speed > 0.0 ? f->state[3] / speed : 0.0;
}

static double speed_of(const struct track_filter *f, double *sigma)
{
    *sigma = sqrt(0.5 * (f->covariance[2][2] + f->covariance[3][3]));
    return hypot(f->state[2], f->state[3]);
}

bool track_outline_is_fast(const struct track *k)
{
    double sigma, speed = speed_of(&k->filter, &sigma);

    return speed > WALK_M_S && sigma <= SURE_M_S;
}

bool track_outline_is_slow(const struct track *k)
{
    const struct track_outline *o = &k->outline;

    return !o->fast && !o->car && !o->glint;
}

bool track_outline_may_walk(const struct track *k)
{
    double sigma;

    speed_of(&k->filter, &sigma);
    return k->outline.followed_s > GLINT_S && track_outline_is_slow(k) &&
           !k->outline.longer && sigma <= SURE_M_S;
}

void track_outline_turn_in(const double u[2], const double v[2], double out[2])
{
    out[0] = u[0] * v[0] + u[1] * v[1];
    out[1] = u[0] * v[1] - u[1] * v[0];
}

void track_outline_turn_out(const double u[2], const double v[2], double out[2])
{
    out[0] = u[0] * v[0] - u[1] * v[1];
    out[1] = u[1] * v[0] + u[0] * v[1];
}

/* Of the parts that were heard for long enough; where none was, it stays as it is. */
static void box_of_parts(struct track *k, const double u[2])
{
    struct track_outline *o = &k->outline;
    bool any = false;
    double at[2];

    for (size_t i = 0; i < k->body.n; i++) {
        if (k->body.parts[i].looks < TRACK_PART_KNOWN)
            continue;
        track_outline_turn_in(u, k->body.parts[i].offset_m, at);
        for (int a = 0; a < 2; a++) {
            o->low_m[a] = any ? fmin(o->low_m[a], at[a]) : at[a];
            o->high_m[a] = any ? fmax(o->high_m[a], at[a]) : at[a];
        }
        any = true;
    }
}

/* Of the one place that is heard, around which its extent is. */
static void box_of_extent(struct track *k, const double u[2], double yaw)
{
    struct track_outline *o = &k->outline;
    double along[2];

    track_turn(-yaw, u, along);
    for (int a = 0; a < 2; a++) {
        double size_m = fabs(along[0]) * k->extent_m[a] +
                        fabs(along[1]) * k->extent_m[1 - a];
        o->low_m[a] = -0.5 * size_m;
        o->high_m[a] = 0.5 * size_m;
    }
}

/* No bicycle slows down like that, unless less and less of it is in sight: a flank that
 * drives on while its glint stays does. */
static bool is_left_behind(const struct track *k)
{
    const struct track_outline *o = &k->outline;
    double sigma, speed = speed_of(&k->filter, &sigma);

    return o->fastest_m_s > WALK_M_S && speed < o->fastest_m_s - o->slowed_m_s;
}

/* As long as that it is known to go. */
static void note_speed(struct track *k)
{
    struct track_outline *o = &k->outline;
    double sigma, speed = speed_of(&k->filter, &sigma);

    if (sigma > SURE_M_S || speed - sigma < o->fastest_m_s - o->slowed_m_s)
        return;
    o->fastest_m_s = speed - sigma;
    o->slowed_m_s = 0.0;
}

static void widen(struct track *k, const double u[2])
{
    struct track_outline *o = &k->outline;
    double length_m = o->high_m[0] - o->low_m[0];
    double unheard_m = CAR_WIDTH_M - (o->high_m[1] - o->low_m[1]);
    double sight[2];

    if (k->body.n || o->fast)
        o->car |= length_m >= CAR_M + (k->body.n ? 0.0 : SMEAR_M);
    if (k->body.n && o->fast)
        o->car |= o->high_m[1] - o->low_m[1] > CAR_WIDER_M;
    o->car |= track_passing_fits_car(k);
    o->car &= o->longest_m > SURELY_CAR_M || !track_passing_fits_bicycle(k);
    o->glint |= is_left_behind(k);
    if (!o->car || unheard_m <= 0.0)
        return;
    track_outline_turn_in(u, k->body.sight, sight);
    o->low_m[1] -= 0.5 * unheard_m * (1.0 - sight[1]);
    o->high_m[1] += 0.5 * unheard_m * (1.0 + sight[1]);
}

/* What walks is heard whole; a speed that wavers about the limit changes nothing. */
static void lengthen(struct track *k)
{
    struct track_outline *o = &k->outline;
    double sigma, speed = speed_of(&k->filter, &sigma);

    o->fast = speed - sigma > WALK_M_S ||
              (o->fast && (speed > SLOW_M_S || o->car || o->glint));
    o->longer = k->body.n || fmax(k->extent_m[0], k->extent_m[1]) > PERSON_M;
    if (o->fast)
        o->longest_m = fmax(o->longest_m, o->high_m[0] - o->low_m[0]);
    o->unheard_m = o->fast ? fmax(BICYCLE_M - o->longest_m, 0.0) : 0.0;
}

/* Over ground, with a share of where it was. */
static void move_middle(const struct track *k, const double u[2], double behind_m,
                        double depth_m, double middle_m[2])
{
    const struct track_outline *o = &k->outline;
    double middle[2], new_m[2];

    for (int a = 0; a < 2; a++)
        middle[a] = 0.5 * (o->low_m[a] + o->high_m[a]);
    middle[0] -= behind_m;
    track_outline_turn_out(u, middle, new_m);
    for (int a = 0; a < 2; a++) {
        new_m[a] += depth_m * k->body.sight[a];
        middle_m[a] += (o->begun ? SHARE : 1.0) * (new_m[a] - middle_m[a]);
    }
}

void track_outline_update(struct track *k, double yaw)
{
    double u[2];

    track_outline_heading(&k->filter, u);
    if (k->body.n)
        box_of_parts(k, u);
    else
        box_of_extent(k, u, yaw);
    move_middle(k, u, 0.0, 0.0, k->outline.heard_m);
    lengthen(k);
    note_speed(k);
    widen(k, u);
    move_middle(k, u, 0.5 * k->outline.unheard_m, k->outline.car ? 0.0 : FRONT_M,
                k->outline.middle_m);
    k->outline.begun = true;
}

void track_outline_size(const struct track *k, double yaw, double size_m[2])
{
    const struct track_outline *o = &k->outline;
    double length_m = o->high_m[0] - o->low_m[0] + o->unheard_m;
    double width_m = o->high_m[1] - o->low_m[1], ground[2], u[2];

    track_outline_heading(&k->filter, ground);
    track_turn(-yaw, ground, u);
    for (int a = 0; a < 2; a++)
        size_m[a] = k->body.n || o->car ? fabs(u[a]) * length_m + fabs(u[1 - a]) * width_m
                                        : k->extent_m[a] + fabs(u[a]) * o->unheard_m;
}

/* Who is fast or longer than a person may be a car of which a corner is heard; a car that
 * goes by twice its own length shows more. */
static double car_share(const struct track_outline *o)
{
    if (o->car || o->glint || !(o->fast || o->longer))
        return 0.0;
    return CAR_SHARE * fmin(fmax(2.0 - o->travelled_m / CAR_LENGTH_M, 0.0), 1.0);
}

void track_outline_predict(struct track *k, double dt_s)
{
    struct track_outline *o = &k->outline;

    if (o->fast || o->longer)
        o->travelled_m += dt_s * hypot(k->filter.state[2], k->filter.state[3]);
    o->followed_s += dt_s;
    o->slowed_m_s += BRAKES_M_S2 * dt_s;
}

/* The middle of the car that it may be is beyond the one that is told, and behind it or,
 * where its rear is heard, before it. */
static void add_car(const struct track *k, const double u[2], double covariance_m2[2][2])
{
    const struct track_outline *o = &k->outline;
    double length_m = o->high_m[0] - o->low_m[0] + o->unheard_m;

    for (int rear = 0; rear < 2; rear++) {
        double share = car_share(o) * (rear ? 1.0 - CAR_FRONT : CAR_FRONT), way_m[2];
        double along_m = (rear ? 0.5 : -0.5) * fmax(CAR_LENGTH_M - length_m, 0.0);
        for (int a = 0; a < 2; a++)
            way_m[a] = BEYOND_M * k->body.sight[a] + along_m * u[a];
        for (int a = 0; a < 2; a++)
            for (int b = 0; b < 2; b++)
                covariance_m2[a][b] += share * way_m[a] * way_m[b];
    }
}

/* What is heard of a car is one of its ends as often as a glint, which is slower by up to
 * half its speed, or by what it has lost since it was faster. */
void track_outline_uncertain_velocity(const struct track *k,
                                      double covariance_m2_s2[2][2])
{
    double sigma, speed = speed_of(&k->filter, &sigma), u[2];
    double slower = fmax(k->outline.fastest_m_s - speed, 0.0);

    if (!k->outline.car && !k->outline.glint)
        return;
    track_outline_heading(&k->filter, u);
    double glint2 = 0.5 * fmax(slower * slower, speed * speed / 3.0);
    for (int a = 0; a < 2; a++)
        for (int b = 0; b < 2; b++)
            covariance_m2_s2[a][b] += glint2 * u[a] * u[b];
}

/* Seen from before or behind it may be the end of a car that is heard, not its flank.  It
 * is as long and wide as that along its velocity, the direction of which is known so
 * well. */
static void add_side(const struct track *k, const double u[2], double variance_m2[2])
{
    const double *sight = k->body.sight;
    double sigma, speed = speed_of(&k->filter, &sigma), in[2];
    double turn = fmin(sigma / fmax(speed, sigma), 1.0);
    double end_m = 0.5 * CAR_WIDTH_M * (1.0 - fabs(u[0] * sight[1] - u[1] * sight[0]));

    track_outline_turn_in(u, k->outline.middle_m, in);
    variance_m2[1] += end_m * end_m;
    for (int a = 0; a < 2; a++)
        variance_m2[a] += turn * turn * in[1 - a] * in[1 - a];
}

/* What is unheard is anywhere in its length; a car is as often heard at one of its ends
 * as somewhere between them.  A glint that is left behind is on a flank, but the rear of
 * a bicycle that goes out of sight looks like one: it is told where it is heard, and the
 * middle of the car is in its covariance. */
void track_outline_uncertain(const struct track *k, double covariance_m2[2][2])
{
    const struct track_outline *o = &k->outline;
    double u[2], variance_m2[2];
    double front_m = track_outline_may_walk(k) ? WALKER_SIGMA_M : FRONT_SIGMA_M;
    double depth_m2 = o->car ? 0.0 : front_m * front_m;
    bool flank = o->car || o->glint;

    track_outline_heading(&k->filter, u);
    add_car(k, u, covariance_m2);
    for (int a = 0; a < 2; a++) {
        double middle_m = MIDDLE_SHARE * (o->high_m[a] - o->low_m[a]);
        variance_m2[a] = middle_m * middle_m;
    }
    double unheard_m = flank ? fmax(CAR_LENGTH_M - o->high_m[0] + o->low_m[0], 0.0)
                             : o->unheard_m;
    variance_m2[0] += unheard_m * unheard_m / (flank ? 6.0 : 12.0);
    if (o->glint && !o->car)
        depth_m2 += BEYOND_M * BEYOND_M;
    const double across[2] = {-u[1], u[0]}, *sight = k->body.sight;
    if (o->car)
        add_side(k, u, variance_m2);
    for (int a = 0; a < 2; a++)
        for (int b = 0; b < 2; b++)
            covariance_m2[a][b] += variance_m2[0] * u[a] * u[b] +
                                   variance_m2[1] * across[a] * across[b] +
                                   depth_m2 * sight[a] * sight[b];
}
