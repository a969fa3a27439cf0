/* SPDX-License-Identifier: MIT */
#include "recon/tracking/track.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/tracking/track_state.h"

#define COURSES           2 /* in a row: it does move; */
#define COURSE_SCANS      4 /* of every second image, of which one may show none */
#define AGREEING          4 /* velocities in a row, of phases and places: one thing moves */
#define COURSE_ALONG_M_S  0.6
#define COURSE_ACROSS_M_S 1.5
#define COURSE_SURE       0.97
#define STEADY_PSD_M2_S3  0.02       /* hardly accelerates at all */
#define EXTENT_SHARE      0.3        /* of the newest look at it */
#define STARTED           TRACKS_MAX /* owner of what a track begins with */
#define NEWCOMER_M        1.5        /* from anybody who is known */
#define FAINT             0.3        /* of the usual power: below it is doubted */
#define USUAL_LOOKS       5.0        /* that the usual is a mean of */
#define WAKE_S            0.5        /* so long ago somebody was where he still echoes */
#define MISSED_LOOKS      0.5        /* after more of them it may be something else, */
#define AGREED_LOOKS      2.0        /* or where phases have it go as it went */
#define NAMELESS_LOOKS    2.0        /* what has no name yet ends unseen after them */
#define LONGEST_S         60.0       /* nothing is predicted farther */
#define REACH_M           1.0        /* existence is that of something so near */
#define GLINT_STAYS_S     5.0 /* what does not walk, lost, is rather gone than hidden, */
#define BESIDE_M          4.2 /* as is what began so near to what is fast: a car's length */
#define BESIDE_M_S        1.5 /* and goes like that, give or take so much */
#define BEYOND_SIGMAS     2.0 /* a place is surely where it cannot be */
#define BORDER_M          0.3 /* what is so near to it is heard at an image's border */
#define BORDER_DOUBT      1e4 /* tells nothing of the place of what has gone on */
#define SECOND_NS         1000000000u

/* An echo may come from any height of a body: by how much bodies differ in the mean of
 * all is less.  The mean square of it over an array at 0.4 m is 0.26 m2, give or take
 * 0.05, of an adult, 0.03 of a child: of people 0.16 m2, one sigma, of the 0.64 m2 of a
 * single echo (recon/detection/objects.c). */
#define BODIES_DIFFER 0.06

void track_config_default(struct track_config *cfg)
{
    *cfg = (struct track_config){.acceleration_psd_m2_s3 = 0.5,
                                 .lost_ego_psd_m2_s3 = 9.0,
                                 .new_speed_m_s = 2.5,
                                 .wander_m = 0.05,
                                 .gate2 = 13.8,
                                 .join_m = 0.5,
                                 .detection_probability = 0.8,
                                 .new_existence = 0.3,
                                 .life = {.confirm_hits = 2,
                                          .confirm_of = 3,
                                          .confirm_existence = 0.95,
                                          .delete_existence = 0.02,
                                          .survival_s = 30.0,
                                          .hides_s = 2.0,
                                          .hidden_s = 2.0},
                                 .coast_s = 1.5,
                                 .place_looks = 0.75,
                                 .rest_m = 0.05,
                                 .rest_s = 1.5,
                                 .id_rest_s = 30.0,
                                 .reset_s = 1.0};
}

static bool is_valid(const struct track_config *c)
{
    const double positive[] = {c->acceleration_psd_m2_s3, c->new_speed_m_s, c->gate2,
                               c->detection_probability,  c->new_existence, c->coast_s,
                               c->life.survival_s};

    for (size_t i = 0; i < sizeof positive / sizeof *positive; i++)
        if (!(positive[i] > 0.0))
            return false;
    return c->detection_probability < 1.0 && c->new_existence < 1.0 &&
           c->lost_ego_psd_m2_s3 >= 0.0 && c->wander_m >= 0.0 && c->join_m >= 0.0 &&
           c->rest_m > 0.0 && c->rest_s > 0.0 && c->id_rest_s >= 0.0 &&
           c->place_looks >= 0.0 && c->reset_s >= 0.0 && c->life.confirm_hits >= 1 &&
           c->life.confirm_hits <= c->life.confirm_of &&
           c->life.confirm_of <= TRACK_LOOKS_MAX && c->life.confirm_existence < 0.999 &&
           c->life.delete_existence < 1.0 && c->life.hides_s >= 0.0 &&
           (c->life.hides_s == 0.0 || c->life.hidden_s > 0.0);
}

int tracker_create(struct tracker **out, const struct track_config *cfg)
{
    if (!is_valid(cfg))
        return -EINVAL;
    struct tracker *t = calloc(1, sizeof *t);
    if (!t)
        return -ENOMEM;
    t->cfg = *cfg;
    *out = t;
    return 0;
}

void tracker_destroy(struct tracker *t)
{
    free(t);
}

struct track_counts tracker_counts(const struct tracker *t)
{
    return t->counts;
}

/* -- one track --------------------------------------------------------------------------
 */

/* Of the power density of acceleration: who keeps his pace, who changes it. */
static const double model_share[TRACK_MODELS] = {0.004, 2.0};

size_t track_filters(struct track *k, struct track_filter *out[TRACK_FILTERS])
{
    size_t n = 0;

    out[n++] = &k->filter;
    out[n++] = &k->steady;
    for (int as = 0; k->passing.begun && as < TRACK_PASSING; as++)
        out[n++] = &k->passing.as[as];
    for (size_t i = 0; k->models.begun && i < TRACK_MODELS; i++)
        out[n++] = &k->models.of[i];
    for (size_t j = 0; j < k->past.n; j++)
        for (size_t i = 0; i < TRACK_MODELS; i++)
            out[n++] = &k->past.list[j].models.of[i];
    return n;
}

static void model_psd(const struct tracker *t, double lost_psd, double out[TRACK_MODELS])
{
    for (int i = 0; i < TRACK_MODELS; i++)
        out[i] = model_share[i] * t->cfg.acceleration_psd_m2_s3 + lost_psd;
}

static void predict_filter(const struct tracker *t, struct track *k, double dt_s,
                           double lost_psd)
{
    double psd[TRACK_MODELS];

    model_psd(t, lost_psd, psd);
    if (k->models.begun)
        track_models_predict(&k->models, dt_s, k->state == TRACK_PREDICTED, psd,
                             &k->filter);
    else
        track_filter_predict(&k->filter, dt_s, t->cfg.acceleration_psd_m2_s3 + lost_psd);
}

static void predict(struct tracker *t, double dt_s, bool ego_known)
{
    double lost = ego_known ? 0.0 : t->cfg.lost_ego_psd_m2_s3;

    for (size_t i = 0; i < t->n; i++) {
        struct track *k = &t->tracks[i];
        predict_filter(t, k, dt_s, lost);
        track_filter_predict(&k->steady, dt_s, STEADY_PSD_M2_S3 + lost);
        track_passing_predict(k, dt_s, t->cfg.acceleration_psd_m2_s3, lost);
        track_outline_predict(k, dt_s);
        struct track_life_config life = t->life;
        if ((k->beside || !k->models.begun) && k->state == TRACK_PREDICTED) {
            life.hides_s = 0.0;
            life.survival_s = fmin(life.survival_s, GLINT_STAYS_S);
        }
        track_life_predict(&k->life, &life, dt_s);
    }
}

/* Moving: a velocity that 99 of 100 things that stand do not show (chi-squared, 2 degrees
 * of freedom).  Standing: two standard deviations above it are still slower than a slow
 * walk.  In between it stays what it was. */
static enum track_motion judge_motion(const struct track *k)
{
    const struct track_filter *f = &k->steady;
    const double *v = f->state + 2;
    const double c[2][2] = {{f->covariance[2][2], f->covariance[2][3]},
                            {f->covariance[3][2], f->covariance[3][3]}};
    double half = 0.5 * (c[0][0] - c[1][1]);
    double largest = 0.5 * (c[0][0] + c[1][1]) + hypot(half, c[0][1]);

    if (track_filter_distance2(v, c) > 9.21)
        return TRACK_MOVING;
    if (hypot(v[0], v[1]) + 2.0 * sqrt(largest) < 0.5)
        return TRACK_STANDING;
    return k->motion;
}

/* Noise may go along a course, but not along the same one again. */
static bool goes_on(const struct track_position *p, const double sight[2],
                    const double before_m_s[2])
{
    const double *v = p->velocity_m_s;
    const double turn_m_s[2] = {v[0] - before_m_s[0], v[1] - before_m_s[1]};
    double along_m_s = turn_m_s[0] * sight[0] + turn_m_s[1] * sight[1];
    double across_m_s = turn_m_s[1] * sight[0] - turn_m_s[0] * sight[1];

    return fabs(along_m_s) < COURSE_ALONG_M_S && fabs(across_m_s) < COURSE_ACROSS_M_S;
}

/* As 19 of 20 velocities do, by the phases of pings, of what goes as the filter says. */
static bool agrees(const struct track_position *p, const struct track_filter *f)
{
    const double less_m_s[2] = {p->velocity_m_s[0] - f->state[2],
                                p->velocity_m_s[1] - f->state[3]};
    double c[2][2];

    for (int a = 0; a < 2; a++)
        for (int b = 0; b < 2; b++)
            c[a][b] = p->velocity_m2_s2[a][b] + f->covariance[2 + a][2 + b];
    return track_filter_distance2(less_m_s, (const double(*)[2])c) < 5.99;
}

/* Before the filter takes that velocity. */
static void follow_course(const struct tracker *t, const struct track_scan *scan,
                          struct track *k)
{
    const struct track_position *p = &t->positions[k->detection];
    double sight[2];

    k->course_scans++;
    if (!p->has_velocity)
        return;
    track_turn(t->pose.dyaw, scan->detections[k->detection].sight, sight);
    bool agree = agrees(p, &k->filter) && goes_on(p, sight, k->velocity_m_s);
    k->agreeing = agree ? k->agreeing + 1 : 1;
    memcpy(k->velocity_m_s, p->velocity_m_s, sizeof k->velocity_m_s);
    if (!scan->detections[k->detection].moves)
        return;
    bool on = k->course_scans <= COURSE_SCANS && goes_on(p, sight, k->course_m_s);
    k->courses = on ? k->courses + 1 : 1;
    k->course_scans = 0;
    memcpy(k->course_m_s, p->velocity_m_s, sizeof k->course_m_s);
}

/* 19 of 20 things that rest, at whatever height, glide otherwise. */
static bool goes_by_itself(const struct tracker *t, const struct track_detection *d,
                           const struct track_filter *f)
{
    const double c[2][2] = {{f->covariance[2][2], f->covariance[2][3]},
                            {f->covariance[3][2], f->covariance[3][3]}};
    const double *v = f->state + 2;
    double glides[2], part = 0.0;

    track_turn(t->pose.dyaw, d->gliding_m_s, glides);
    double whole = track_filter_distance2(glides, c);
    if (whole > 0.0) { /* v' C^-1 g, of three squares */
        const double both[2] = {v[0] + glides[0], v[1] + glides[1]};
        part = 0.5 *
               (track_filter_distance2(both, c) - track_filter_distance2(v, c) - whole) /
               whole;
        part = fmin(fmax(part, 0.0), 2.0);
    }
    const double off[2] = {v[0] - part * glides[0], v[1] - part * glides[1]};
    return track_filter_distance2(off, c) > 5.99;
}

/* After a gap or a jump it may be another thing that is seen: what moves is seen moving.
 * Images without what stands show it move; in others the track itself has to, at first
 * steadily; once it has a name it may turn.  So has what a background may have left: of
 * who stood or passed while it was heard a hole, and remains where it does not fit any
 * more. */
static void judge_rest(const struct tracker *t, const struct track_scan *scan,
                       double fresh, struct track *k)
{
    const struct track_position *p = &t->positions[k->detection];
    const struct track_rest_look *look = &t->looks[k->detection];
    bool goes = scan->detections[k->detection].moves;
    double power = scan->detections[k->detection].power;
    bool taken = !scan->standing_left;

    if (k->missed > (k->agreeing > 1 ? AGREED_LOOKS : MISSED_LOOKS) ||
        track_rest_jumps(&k->rest, look))
        k->rest = (struct track_rest){.looks = 0.0};
    k->missed = 0.0;
    if (look->range_m > 0.0)
        track_rest_add(&k->rest, look, fresh, scan->stamp_ns, t->cfg.rest_s);
    k->power += (k->power > 0.0 ? EXTENT_SHARE : 1.0) * (power - k->power);
    if ((taken && (k->id || k->power >= scan->detections[k->detection].remains)) ||
        track_rest_moves(&k->rest, taken, k->agreeing >= AGREEING) ||
        (goes && k->courses >= COURSES) ||
        (k->agreeing >= AGREEING && p->has_velocity &&
         goes_by_itself(t, &scan->detections[k->detection], &k->filter)) ||
        (k->id && track_rest_misfit(&k->rest) > 1.0))
        k->moves_ns = scan->stamp_ns;
}

/* Who goes behind an edge, or off the end of a wall, is heard in part for a moment, ever
 * fainter, and that part stays where the edge is.  What is much fainter than it was has a
 * covariance that is so many times as large.  Of a car now this panel mirrors, now that
 * one. */
static double doubt_faint(struct track *k, double power, double fresh)
{
    double usual = k->usual > 0.0 ? k->usual : power;
    double faint = fmax(FAINT * usual / power, 1.0);

    k->usual = usual + fresh / USUAL_LOOKS * (power - usual);
    return k->outline.car ? 1.0 : faint * faint;
}

/* Who walks has two models, and of his height no noise. */
static void update_filter(struct track *k, double doubt, struct track_position *p,
                          int64_t now_ns)
{
    bool walks = track_outline_may_walk(k);

    if (walks)
        memcpy(p->covariance_m2, p->walker_m2, sizeof p->covariance_m2);
    track_position_doubt(p, doubt);
    if (walks && !k->models.begun)
        track_models_begin(&k->models, &k->filter);
    k->models.begun = walks || (k->models.begun && track_outline_is_slow(k));
    if (k->models.begun) {
        track_models_update(&k->models, p, &k->filter);
        track_past_keep(&k->past, &k->models, now_ns);
    } else {
        track_filter_update(&k->filter, p);
        k->past.n = 0;
    }
}

/* Who walks, when he has not been heard for a while. */
static void lose_walker(const struct tracker *t, const struct track_scan *scan,
                        struct track *k)
{
    double psd[TRACK_MODELS];

    model_psd(t, 0.0, psd);
    if (k->missed > MISSED_LOOKS && k->models.begun && scan->ego_known)
        track_past_restore(&k->past, k->seen_ns, scan->stamp_ns, psd, &k->models,
                           &k->filter);
}

static void measure_height(const struct tracker *t, const struct track_detection *d,
                           struct track *k)
{
    const double h[2][2] = {{d->height_m2[0], d->height_m2[1]},
                            {d->height_m2[1], d->height_m2[3]}};

    track_turn_matrix(t->pose.dyaw, h, k->height_m2);
}

/* From where it is, and was just now: its late echoes come from behind it. */
static double away_from_m(const struct track *k, const double at_m[2])
{
    const double *s = k->filter.state;
    const double way_m[2] = {at_m[0] - s[0], at_m[1] - s[1]};
    double speed2 = s[2] * s[2] + s[3] * s[3];
    double ago_s = speed2 > 0.0 ? -(way_m[0] * s[2] + way_m[1] * s[3]) / speed2 : 0.0;

    ago_s = fmin(fmax(ago_s, 0.0), WAKE_S);
    return hypot(way_m[0] + ago_s * s[2], way_m[1] + ago_s * s[3]);
}

/* Pings one by one tell a newcomer; beside somebody they tell of his limbs and wheels. */
static void prove(const struct tracker *t, const struct track_scan *scan, struct track *k)
{
    const double *at_m = t->positions[k->detection].at_m;

    for (size_t i = 0; i < t->n; i++) {
        const struct track *other = &t->tracks[i];
        if (other != k && other->id && away_from_m(other, at_m) < NEWCOMER_M)
            return;
    }
    track_life_prove(&k->life, &t->life, scan->detections[k->detection].proven);
    if (k->courses >= COURSES && scan->detections[k->detection].moves)
        track_life_prove(&k->life, &t->life, COURSE_SURE);
}

static void from_ground(const struct tracker *t, const struct track *k, double p_m[3])
{
    const double at_m[3] = {k->filter.state[0], k->filter.state[1], k->filter.height_m};
    ego_step_point(&t->pose, at_m, p_m);
}

/* What has left the image is heard at its border for a while, by its sidelobes, ever
 * fainter.  Who walks may have stopped just outside: what is fast cannot. */
static bool is_past_border(const struct tracker *t, const struct track_scan *scan,
                           const struct track *k)
{
    const double *heard_m = scan->detections[k->detection].position_m;
    const struct track_filter *f = &k->filter;
    double at_m[3], way_m[2], v_m_s[2];

    if (track_outline_is_slow(k) || !scan->shows)
        return false;
    from_ground(t, k, at_m);
    for (int a = 0; a < 2; a++)
        way_m[a] = at_m[a] - heard_m[a];
    double length_m = hypot(way_m[0], way_m[1]);
    double sigma_m_s = sqrt(0.5 * (f->covariance[2][2] + f->covariance[3][3]));
    track_turn(-t->pose.dyaw, f->state + 2, v_m_s);
    if (v_m_s[0] * way_m[0] + v_m_s[1] * way_m[1] <= 2.0 * sigma_m_s * length_m)
        return false;
    double part = BORDER_M / length_m;
    const double on_m[3] = {heard_m[0] + part * way_m[0], heard_m[1] + part * way_m[1],
                            heard_m[2]};
    return !scan->shows(scan->context, at_m) && !scan->shows(scan->context, on_m);
}

/* What has just come out is in the newer pings of an image only, which shows it at a
 * later instant than what all of its pings have: taken for the same, it would go half as
 * fast as it does until they have it. */
static void come_later(struct tracker *t, const struct track_scan *scan,
                       const size_t *whose, size_t owner, int64_t since_ns)
{
    double since_s = 1e-9 * (double)(scan->stamp_ns - since_ns);
    double later_s = 0.5 * fmax(scan->span_s - since_s, 0.0);

    for (size_t j = 0; j < scan->n; j++)
        if (whose[j] == owner)
            t->positions[j].lag_s += later_s;
}

/* How much likelier a detection there is of an object that is to be heard. */
static double ratio_of(const struct tracker *t, const struct track_scan *scan,
                       double density)
{
    double seen = t->cfg.detection_probability;

    return 1.0 - seen + seen * density / scan->clutter_m2;
}

/* The part of the scan's detections that belongs to the track. */
static void continue_track(struct tracker *t, const struct track_scan *scan, size_t i,
                           const size_t *whose, double fresh)
{
    struct track *k = &t->tracks[i];
    struct track_gathered its;

    come_later(t, scan, whose, i, k->since_ns);
    track_gather(t, scan, whose, i, k->mirror.id, &its);
    k->detection = its.detection;
    struct track_match m =
        track_body_match(k, k->body.n ? &t->positions[k->detection] : &its.by[0], NULL);
    const struct track_match as_car =
        track_passing_match(t, k, scan, k->detection, fresh);
    bool past = is_past_border(t, scan, k);
    if (!past && as_car.distance2 < t->cfg.gate2 && m.distance2 >= t->cfg.gate2) {
        track_body_begin(k);
        m = as_car;
    }
    track_life_update(&k->life, &t->life, true, ratio_of(t, scan, m.density), fresh);
    /* Each wall that shows it is a look of its own. */
    for (size_t wall = 1; !k->body.n && wall < its.n_walls; wall++) {
        m = track_body_match(k, &its.by[wall], NULL);
        track_life_update(&k->life, &t->life, true, ratio_of(t, scan, m.density), fresh);
    }
    follow_course(t, scan, k);
    prove(t, scan, k);
    if (scan->detections[k->detection].mirror != k->mirror.id)
        k->usual = 0.0; /* it was by way of another wall */
    double doubt = doubt_faint(k, scan->detections[k->detection].power, fresh);
    if (past)
        doubt = BORDER_DOUBT;
    if (k->body.n) {
        k->models.begun = false;
        k->past.n = 0;
        if (!past || k->outline.car) /* of a car the rear may be inside yet */
            track_body_update(t, scan, whose, i, fresh);
    } else {
        for (int a = 0; k->models.begun && a < 2; a++)
            its.middle.at_m[a] += its.middle.middle_m[a];
        track_filter_update(&k->steady, &its.middle);
        update_filter(k, doubt, &its.middle, scan->stamp_ns);
    }
    measure_height(t, &scan->detections[k->detection], k);
    for (int a = 0; a < 3; a++)
        k->extent_m[a] += EXTENT_SHARE * (its.extent_m[a] - k->extent_m[a]);
    track_turn(t->pose.dyaw, scan->detections[k->detection].sight, k->body.sight);
    track_outline_update(k, t->pose.dyaw);
    track_passing_update(t, scan, k, fresh, doubt);
    k->motion = judge_motion(k);
    judge_rest(t, scan, fresh, k);
    track_mirror_measured(t, scan, k, scan->detections[k->detection].mirror);
    k->seen_ns = scan->stamp_ns;
    k->state = TRACK_MEASURED;
}

/* Two objects that run into one in the image leave one of them without a detection. */
static bool is_covered(const struct tracker *t, const struct track_scan *scan, size_t i,
                       const size_t *mine)
{
    const double *at_m = t->tracks[i].filter.state;

    if (!t->tracks[i].life.confirmed)
        return false;
    for (size_t other = 0; other < t->n; other++) {
        if (mine[other] == TRACK_NONE)
            continue;
        const struct track_detection *d = &scan->detections[mine[other]];
        const struct track_position *p = &t->positions[mine[other]];
        double reach_m = t->cfg.join_m + 0.5 * hypot(d->extent_m[0], d->extent_m[1]);
        if (hypot(at_m[0] - p->at_m[0], at_m[1] - p->at_m[1]) < reach_m)
            return true;
    }
    return false;
}

static void miss_track(struct tracker *t, const struct track_scan *scan, size_t i,
                       const size_t *mine, double fresh)
{
    struct track *k = &t->tracks[i];
    double at_m[3];

    from_ground(t, k, at_m);
    bool shown = !scan->shows || scan->shows(scan->context, at_m);
    if (!k->mirror.id && scan->n_mirrors) /* what no mirror can show is not looked for */
        shown = false;
    if (shown && !is_covered(t, scan, i, mine))
        track_life_update(&k->life, &t->life, false, 1.0 - t->cfg.detection_probability,
                          fresh);
    k->missed += fresh;
    k->course_scans++;
    lose_walker(t, scan, k);
    k->waited += k->placed || !scan->n_mirrors ? 0.0 : fresh;
    k->state = TRACK_PREDICTED;
    k->detection = TRACK_NONE;
}

/* -- names ------------------------------------------------------------------------------
 */

/* To begin with: the first one is another in each second.  Who was started again, and had
 * given less than one a second, begins with ids that nobody has heard of lately. */
static void ids_begin(struct track_ids *ids, int64_t now_ns)
{
    ids->last = (unsigned)((uint64_t)now_ns / SECOND_NS % TRACK_ID_MAX);
}

/* The next one round after the last; 0: all are taken or at rest. */
static unsigned ids_take(struct track_ids *ids, int64_t now_ns)
{
    for (unsigned tried = 0; tried < TRACK_ID_MAX; tried++) {
        ids->last = ids->last % TRACK_ID_MAX + 1;
        int64_t until_ns = ids->rest_until_ns[ids->last];
        if (ids->taken[ids->last] || (until_ns && now_ns < until_ns))
            continue;
        ids->taken[ids->last] = true;
        return ids->last;
    }
    return 0;
}

static void ids_give_back(struct track_ids *ids, unsigned id, int64_t now_ns,
                          double rest_s)
{
    ids->taken[id] = false;
    ids->rest_until_ns[id] = now_ns + (int64_t)(1e9 * rest_s);
}

/* After a clock that jumped: all that were given rest from now. */
static void ids_rest(struct track_ids *ids, int64_t now_ns, double rest_s)
{
    for (unsigned id = 1; id <= TRACK_ID_MAX; id++)
        if (ids->taken[id] || ids->rest_until_ns[id])
            ids_give_back(ids, id, now_ns, rest_s);
}

/* -- all of them ------------------------------------------------------------------------
 */

/* What moved by itself in its newest look gets a name. */
static void name_confirmed(struct tracker *t, int64_t now_ns)
{
    for (size_t i = 0; i < t->n; i++) {
        struct track *k = &t->tracks[i];
        if (!k->life.confirmed || k->id || k->moves_ns != k->seen_ns)
            continue;
        k->id = ids_take(&t->ids, now_ns);
        t->counts.crowded += !k->id;
        if (k->id)
            k->state = TRACK_NEW;
    }
}

/* Surely, where it is a car or a bicycle: what is heard of these wavers, and they are
 * told before the mirror. */
static bool is_past_its_mirror(const struct track *k)
{
    const struct track_filter *f = &k->filter;
    const double at_m[3] = {f->state[0], f->state[1], f->height_m};
    const double *n = k->mirror.normal;
    double sigma2 = 0.0;

    for (int a = 0; a < 2 && !track_outline_is_slow(k); a++)
        for (int b = 0; b < 2; b++)
            sigma2 += n[a] * n[b] * f->covariance[a][b];
    return k->state == TRACK_PREDICTED &&
           track_mirror_beyond_m(&k->mirror, at_m) > BEYOND_SIGMAS * sqrt(sigma2);
}

/* Named tracks that end are told once; others are dropped at once. */
static void end_tracks(struct tracker *t, int64_t now_ns)
{
    size_t kept = 0;

    for (size_t i = 0; i < t->n; i++) {
        struct track *k = &t->tracks[i];
        bool over = k->merged || track_life_is_over(&k->life, &t->life) ||
                    is_past_its_mirror(k) || k->waited > t->cfg.place_looks ||
                    (!k->id && k->missed > NAMELESS_LOOKS) ||
                    1e-9 * (double)(now_ns - k->seen_ns) > t->cfg.coast_s ||
                    (k->id && 1e-9 * (double)(now_ns - k->moves_ns) > t->cfg.coast_s);
        if (over && !k->id)
            continue;
        if (over) {
            k->state = TRACK_DELETED;
            ids_give_back(&t->ids, k->id, now_ns, t->cfg.id_rest_s);
        }
        t->tracks[kept++] = *k;
    }
    t->n = kept;
}

static void drop_deleted(struct tracker *t)
{
    size_t kept = 0;

    for (size_t i = 0; i < t->n; i++)
        if (t->tracks[i].state != TRACK_DELETED)
            t->tracks[kept++] = t->tracks[i];
    t->n = kept;
}

/* What is fast, and so near that it may be a part of it; NULL: nothing. */
static const struct track *beside_fast(const struct tracker *t, const double at_m[2])
{
    for (size_t i = 0; i < t->n; i++) {
        const struct track *k = &t->tracks[i];
        if (k->id && (k->outline.fast || k->outline.car) &&
            hypot(k->filter.state[0] - at_m[0], k->filter.state[1] - at_m[1]) < BESIDE_M)
            return k;
    }
    return NULL;
}

static void start_track(struct tracker *t, const struct track_scan *scan,
                        const size_t *whose, double fresh)
{
    struct track *k = &t->tracks[t->n];
    struct track_gathered its;

    if (t->n == TRACKS_MAX) {
        t->counts.crowded++;
        return;
    }
    memset(k, 0, sizeof *k);
    k->since_ns = t->stamp_ns - (int64_t)(0.5e9 * t->apart_s);
    come_later(t, scan, whose, STARTED, k->since_ns);
    track_gather(t, scan, whose, STARTED, 0, &its);
    k->detection = its.detection;
    memcpy(k->extent_m, its.extent_m, sizeof k->extent_m);
    const struct track *fast = beside_fast(t, its.middle.at_m);
    track_life_start(&k->life, &t->life, t->cfg.new_existence * its.existence);
    track_filter_start(&k->filter, &its.by[0], t->cfg.new_speed_m_s);
    for (size_t wall = 1; wall < its.n_walls; wall++) {
        double density = track_filter_match(&k->filter, &its.by[wall]).density;
        track_life_update(&k->life, &t->life, true, ratio_of(t, scan, density), 1.0);
    }
    track_filter_start(&k->filter, &its.middle, fast ? BESIDE_M_S : t->cfg.new_speed_m_s);
    for (int a = 0; fast && a < 2; a++)
        k->filter.state[2 + a] += fast->filter.state[2 + a];
    k->steady = k->filter;
    k->state = TRACK_MEASURED;
    k->first_ns = k->seen_ns = scan->stamp_ns;
    k->beside = fast;
    track_mirror_measured(t, scan, k, scan->detections[k->detection].mirror);
    follow_course(t, scan, k);
    prove(t, scan, k);
    judge_rest(t, scan, fresh, k);
    t->n++;
}

/* What is nobody's begins tracks: the first that is left, with all that is near it. */
static void start_tracks(struct tracker *t, const struct track_scan *scan, size_t *whose,
                         double fresh)
{
    for (size_t j = 0; j < scan->n; j++) {
        if (whose[j] != TRACK_NONE)
            continue;
        const double *at_m = t->positions[j].at_m;
        for (size_t other = j; other < scan->n; other++) {
            const double *its_m = t->positions[other].at_m;
            double away_m = hypot(at_m[0] - its_m[0], at_m[1] - its_m[1]);
            if (whose[other] == TRACK_NONE && away_m <= t->cfg.join_m)
                whose[other] = STARTED;
        }
        start_track(t, scan, whose, fresh);
        for (size_t other = j; other < scan->n; other++)
            if (whose[other] == STARTED)
                whose[other] = STARTED + 1;
    }
}

/* 0: the scan is to be taken; *dt_s since the one before. */
static int follow_time(struct tracker *t, int64_t stamp_ns, double *dt_s)
{
    *dt_s = t->began ? 1e-9 * (double)(stamp_ns - t->stamp_ns) : 0.0;
    if (t->began && *dt_s <= 0.0 && -*dt_s <= t->cfg.reset_s) {
        t->counts.late++;
        return -ESTALE;
    }
    if (*dt_s < 0.0) {
        t->counts.resets++;
        t->n = 0;
        t->pose = (struct ego_step){0};
        ids_rest(&t->ids, stamp_ns, t->cfg.id_rest_s);
        *dt_s = 0.0;
    }
    *dt_s = fmin(*dt_s, LONGEST_S);
    if (!t->began)
        ids_begin(&t->ids, stamp_ns);
    t->apart_s = *dt_s > 0.0 ? *dt_s : LONGEST_S; /* who is there then was before */
    t->began = true;
    t->stamp_ns = stamp_ns;
    return 0;
}

/* Things at rest that are heard in turn look like one that moves: twice in a row often.
 */
static struct track_life_config life_of(const struct track_config *cfg,
                                        const struct track_scan *scan)
{
    struct track_life_config life = cfg->life;

    if ((scan->standing_left || scan->settling) && life.confirm_hits > 1 &&
        life.confirm_of + 2 <= TRACK_LOOKS_MAX) {
        life.confirm_hits += 1;
        life.confirm_of += 2;
    }
    return life;
}

int tracker_step(struct tracker *t, const struct track_scan *scan)
{
    size_t mine[TRACKS_MAX], whose[TRACK_DETECTIONS];
    double fresh = fmin(fmax(scan->fresh, 0.01), 1.0), dt_s;

    int err = follow_time(t, scan->stamp_ns, &dt_s);
    if (err)
        return err;
    drop_deleted(t);
    t->life = life_of(&t->cfg, scan);
    ego_step_join(&t->pose, &scan->ego, &t->pose);
    predict(t, dt_s, scan->ego_known);
    track_mirror_follow(t, scan);
    track_place(t, scan, fresh);
    track_associate(t, scan, fresh, mine, whose);
    for (size_t i = 0; i < t->n; i++) {
        if (mine[i] == TRACK_NONE)
            miss_track(t, scan, i, mine, fresh);
        else
            continue_track(t, scan, i, whose, fresh);
    }
    track_body_merge(t);
    track_join_walkers(t, fresh);
    if (scan->standing_left || scan->settling)
        track_absorb(t);
    end_tracks(t, scan->stamp_ns);
    start_tracks(t, scan, whose, fresh);
    name_confirmed(t, scan->stamp_ns);
    return 0;
}

/* -- the report -------------------------------------------------------------------------
 */

/* What is measured there is before its mirror: its filter, or what is taken to belong to
 * it, is where it cannot be. */
static void keep_before(const struct track_mirror *m, double p_m[3])
{
    double beyond_m = track_mirror_beyond_m(m, p_m);

    for (int a = 0; a < 3 && beyond_m > 0.0; a++)
        p_m[a] -= beyond_m * m->normal[a];
}

/* All looks at a body are wrong alike by what its height is not as assumed.  Its filter
 * has that as noise, unless it walks. */
static void add_height(const struct track *k, double covariance_m2[2][2])
{
    for (int a = 0; a < 2 && track_outline_may_walk(k); a++)
        for (int b = 0; b < 2; b++)
            covariance_m2[a][b] += BODIES_DIFFER * k->height_m2[a][b];
}

/* Of what is predicted: that it is within reach of where it is told, by what its filter
 * knows and how much faster or slower what is heard of it may be.  (Of a normal
 * distribution in the plane, as if it were round.) */
static double still_there(const struct tracker *t, const struct track *k)
{
    const struct track_filter *f = &k->filter;
    double faster_m2_s2[2][2] = {{0.0}};
    double unseen_s = 1e-9 * (double)(t->stamp_ns - k->seen_ns);

    if (k->state != TRACK_PREDICTED)
        return 1.0;
    track_outline_uncertain_velocity(k, faster_m2_s2);
    double m2 = 0.5 * (f->covariance[0][0] + f->covariance[1][1]) +
                0.5 * unseen_s * unseen_s * (faster_m2_s2[0][0] + faster_m2_s2[1][1]);
    return 1.0 - exp(-0.5 * REACH_M * REACH_M / m2);
}

static void report(const struct tracker *t, const struct track *k,
                   struct track_report *out)
{
    const struct track_filter *passing = track_passing_told(k), *heard = &k->filter;
    const struct track_filter *f = passing ? passing : heard;
    const struct track_outline *o = &k->outline;
    const double heard_m[3] = {heard->state[0] + o->heard_m[0],
                               heard->state[1] + o->heard_m[1], heard->height_m};
    const double at_m[3] = {f->state[0] + (passing ? 0.0 : o->middle_m[0]),
                            f->state[1] + (passing ? 0.0 : o->middle_m[1]), f->height_m};
    double block[2][2], turned[2][2], size_m[2], yaw = t->pose.dyaw;

    memset(out, 0, sizeof *out);
    out->id = k->id;
    out->state = k->state;
    ego_step_point(&t->pose, at_m, out->position_m);
    ego_step_point(&t->pose, heard_m, out->heard_m);
    out->mirror = track_mirror_after(&t->pose, &k->mirror);
    out->placed = k->placed;
    keep_before(&out->mirror, out->position_m);
    track_turn(-yaw, f->state + 2, out->velocity_m_s);
    for (int i = 0; i < 2; i++)
        memcpy(block[i], f->covariance[i], sizeof block[i]);
    track_outline_uncertain(k, block);
    add_height(k, block);
    track_turn_matrix(-yaw, (const double(*)[2])block, turned);
    out->covariance_m2[0] = turned[0][0];
    out->covariance_m2[1] = turned[0][1];
    out->covariance_m2[3] = turned[1][1];
    out->covariance_m2[5] = f->height_m2;
    for (int i = 0; i < 2; i++)
        memcpy(block[i], f->covariance[2 + i] + 2, sizeof block[i]);
    track_outline_uncertain_velocity(k, block);
    track_turn_matrix(-yaw, (const double(*)[2])block, turned);
    out->velocity_m2_s2[0] = turned[0][0];
    out->velocity_m2_s2[1] = turned[0][1];
    out->velocity_m2_s2[2] = turned[1][1];
    track_outline_size(k, yaw, size_m);
    memcpy(out->extent_m, k->extent_m, sizeof out->extent_m);
    for (int i = 0; i < 2; i++)
        out->extent_m[i] = fmax(out->extent_m[i], size_m[i]);
    out->existence = k->life.existence * still_there(t, k);
    out->motion = k->motion;
    out->age_s = 1e-9 * (double)(t->stamp_ns - k->first_ns);
    out->unseen_s = 1e-9 * (double)(t->stamp_ns - k->seen_ns);
    out->detection = k->detection;
}

static int by_existence(const void *a, const void *b)
{
    const struct track_report *x = a, *y = b;

    if (x->existence != y->existence)
        return x->existence < y->existence ? 1 : -1;
    return x->id < y->id ? -1 : x->id > y->id;
}

size_t tracker_report(const struct tracker *t, struct track_report out[TRACKS_MAX])
{
    size_t n = 0;

    for (size_t i = 0; i < t->n; i++)
        if (t->tracks[i].id)
            report(t, &t->tracks[i], &out[n++]);
    qsort(out, n, sizeof *out, by_existence);
    return n;
}
