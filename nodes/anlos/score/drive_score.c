/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/score/drive_score.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "recon/tracking/assignment.h"

_Static_assert(BENCH_SET_MAX <= ASSIGNMENT_ROWS, "");

static double distance_m(const double a[2], const double b[2])
{
    return hypot(a[0] - b[0], a[1] - b[1]);
}

/* The least sum of min(d, c)^p; rows are the smaller set. */
static double assign(const double (*rows)[2], size_t n_rows, const double (*columns)[2],
                     size_t n_columns, double cutoff_m, double order, size_t *column)
{
    double cost[BENCH_SET_MAX * BENCH_SET_MAX];

    for (size_t r = 0; r < n_rows; r++)
        for (size_t c = 0; c < n_columns; c++)
            cost[r * n_columns + c] =
                pow(fmin(distance_m(rows[r], columns[c]), cutoff_m), order);
    return assignment_solve(n_rows, n_columns, cost, column);
}

void bench_set_distance(struct bench_set_distance *out, const double (*truth_m)[2],
                        size_t n_truth, const double (*found_m)[2], size_t n_found,
                        double cutoff_m, double order)
{
    bool fewer_found = n_found < n_truth;
    size_t n = fewer_found ? n_found : n_truth, m = fewer_found ? n_truth : n_found;
    size_t column[ASSIGNMENT_ROWS], n_pairs = 0;
    double full = pow(cutoff_m, order);
    double sum = fewer_found ? assign(found_m, n, truth_m, m, cutoff_m, order, column)
                             : assign(truth_m, n, found_m, m, cutoff_m, order, column);

    *out = (struct bench_set_distance){0};
    for (size_t i = 0; i < n_truth; i++)
        out->match[i] = BENCH_NOBODY;
    for (size_t r = 0; r < n; r++) {
        size_t truth = fewer_found ? column[r] : r, found = fewer_found ? r : column[r];
        double d_m = distance_m(truth_m[truth], found_m[found]);
        if (d_m >= cutoff_m)
            continue;
        out->match[truth] = found;
        out->localisation += pow(d_m, order);
        n_pairs++;
    }
    out->n_missed = n_truth - n_pairs;
    out->n_false = n_found - n_pairs;
    out->missed = 0.5 * full * (double)out->n_missed;
    out->false_ones = 0.5 * full * (double)out->n_false;
    out->gospa_m = pow(out->localisation + out->missed + out->false_ones, 1.0 / order);
    if (m)
        out->ospa_m = pow((sum + full * (double)(m - n)) / (double)m, 1.0 / order);
}

static size_t room_at(const void *context, double t_s, struct room_truth *out, size_t max)
{
    return room_truth(context, t_s, out, max);
}

struct drive_truth drive_truth_room(const struct room *r)
{
    return (struct drive_truth){.at = room_at, .context = r};
}

#define LOOK_S   0.01 /* how finely objects that come in are looked for */
#define INSIDE_M 0.3  /* of a long object's outline */

void drive_score_init(struct drive_score *s, const struct drive_truth *truth,
                      const struct survey *survey, double began_s)
{
    *s = (struct drive_score){.truth = *truth, .looked_s = began_s, .began_s = began_s};
    memcpy(s->gate_m, survey->gate_m, sizeof s->gate_m);
    for (int a = 0; a < 2; a++)
        memcpy(s->volume_m[a], survey->volume_m[2 * a], sizeof s->volume_m[a]);
}

static double range_m(const struct room_truth *t)
{
    return hypot(hypot(t->virtual_m[0], t->virtual_m[1]), t->virtual_m[2]);
}

/* Up to DRIVE_OBJECTS; returns how many of them there are. */
static size_t who_is_there(const struct drive_score *s, double t_s,
                           struct room_truth out[DRIVE_OBJECTS])
{
    size_t n = s->truth.at(s->truth.context, t_s, out, DRIVE_OBJECTS);

    return n < DRIVE_OBJECTS ? n : DRIVE_OBJECTS;
}

static bool is_in_gate(const struct drive_score *s, const struct room_truth *t)
{
    double r = range_m(t);

    return r >= s->gate_m[0] && r <= s->gate_m[1] &&
           t->virtual_m[0] >= s->volume_m[0][0] && t->virtual_m[0] <= s->volume_m[0][1] &&
           t->virtual_m[2] >= s->volume_m[1][0] && t->virtual_m[2] <= s->volume_m[1][1];
}

/* -- objects that come and go -----------------------------------------------------------
 */

/* By its name, or in the place of one that is gone; NULL: too many are there. */
static struct drive_object *find(struct drive_score *s, const char name[32])
{
    struct drive_object *gone = NULL;

    for (size_t i = 0; i < DRIVE_OBJECTS; i++) {
        if (!strcmp(s->objects[i].name, name))
            return &s->objects[i];
        if (!gone && !s->objects[i].in_gate)
            gone = &s->objects[i];
    }
    if (gone) {
        *gone = (struct drive_object){.in_gate = false};
        memcpy(gone->name, name, sizeof gone->name);
    }
    return gone;
}

static void leave(struct drive_score *s, struct drive_object *o)
{
    s->result.n_late += o->in_gate && !o->confirmed;
    o->in_gate = false;
}

/* Who is in the gate at an instant, and since when. */
static void look(struct drive_score *s, double t_s)
{
    struct room_truth truth[DRIVE_OBJECTS];
    size_t n = who_is_there(s, t_s, truth);
    bool here[DRIVE_OBJECTS] = {false};

    for (size_t i = 0; i < n; i++) {
        struct drive_object *o = find(s, truth[i].name);
        if (!o || !is_in_gate(s, &truth[i]))
            continue;
        here[o - s->objects] = true;
        if (o->in_gate)
            continue;
        o->in_gate = true;
        o->confirmed = false;
        o->entered_s = t_s;
        o->hidden_first = !truth[i].line_of_sight;
        s->result.n_entries++;
    }
    for (size_t i = 0; i < DRIVE_OBJECTS; i++)
        if (!here[i])
            leave(s, &s->objects[i]);
}

static void look_until(struct drive_score *s, double t_s)
{
    for (; s->looked_s <= t_s; s->looked_s += LOOK_S)
        look(s, s->looked_s);
}

static double until_sight_s(const struct drive_score *s, const char *name, double t_s)
{
    struct room_truth truth[DRIVE_OBJECTS];
    size_t n = who_is_there(s, t_s, truth);

    for (size_t i = 0; i < n; i++)
        if (!strcmp(truth[i].name, name))
            return truth[i].until_sight_s;
    return NAN;
}

static void confirm(struct drive_score *s, const struct room_truth *t, double out_s)
{
    struct drive_object *o = find(s, t->name);

    if (!o || !o->in_gate || o->confirmed)
        return;
    o->confirmed = true;
    drive_sum_add(&s->result.delay, out_s - o->entered_s);
    s->result.worst_delay_s = fmax(s->result.worst_delay_s, out_s - o->entered_s);
    double lead_s = until_sight_s(s, t->name, out_s);
    if (o->hidden_first && isfinite(lead_s))
        drive_sum_add(&s->result.lead, lead_s);
}

/* -- tracks -----------------------------------------------------------------------------
 */

/* A track is false that no object was near in all of its life. */
static void end_life(struct drive_score *s, size_t i)
{
    s->result.n_false_tracks += !s->lives[i].matched;
    s->lives[i] = s->lives[--s->n_lives];
}

static void live(struct drive_score *s, const Anlos__Detection *track, bool matched)
{
    size_t i = 0;

    while (i < s->n_lives && s->lives[i].id != track->id)
        i++;
    if (i == s->n_lives) {
        if (s->n_lives == DRIVE_LIVES)
            end_life(s, 0);
        i = s->n_lives++;
        s->lives[i] = (struct drive_life){.id = track->id};
    }
    s->lives[i].matched |= matched;
    if (track->measurement == ANLOS__MEASUREMENT__DELETED)
        end_life(s, i);
}

struct matching { /* places of a list and of what is there */
    size_t n_found, n_truth;
    double found_m[BENCH_SET_MAX][2], truth_m[BENCH_SET_MAX][2];
    const Anlos__Detection *found[BENCH_SET_MAX];
    struct room_truth truth[DRIVE_OBJECTS];
    struct bench_set_distance distance;
};

/* The part of an object that is nearest to a place. */
static void nearest_part(const struct room_truth *t, const double p_m[2], double out[2])
{
    for (int a = 0; a < 2; a++) {
        double half_m = fmax(0.5 * t->extent_m[a] - INSIDE_M, 0.0);
        out[a] = fmin(fmax(p_m[a], t->position_m[a] - half_m), t->position_m[a] + half_m);
    }
}

static double away_m(const struct room_truth *t, const double p_m[2])
{
    double part[2];

    nearest_part(t, p_m, part);
    return hypot(part[0] - p_m[0], part[1] - p_m[1]);
}

static void place_truth(struct matching *m, size_t i)
{
    const double *nearest = m->truth[i].position_m;
    double least_m = INFINITY;

    for (size_t j = 0; j < m->n_found; j++) {
        double d_m = away_m(&m->truth[i], m->found_m[j]);
        if (d_m < least_m) {
            least_m = d_m;
            nearest = m->found_m[j];
        }
    }
    nearest_part(&m->truth[i], nearest, m->truth_m[i]);
}

/* Those who are there with what was found. */
static void pair_up(const struct drive_score *s, double t_s, struct matching *m)
{
    m->n_truth = who_is_there(s, t_s, m->truth);
    for (size_t i = 0; i < m->n_truth; i++)
        place_truth(m, i);
    bench_set_distance(&m->distance, (const double(*)[2])m->truth_m, m->n_truth,
                       (const double(*)[2])m->found_m, m->n_found, DRIVE_CUTOFF_M,
                       DRIVE_ORDER);
}

static bool is_somebody(const struct matching *m, size_t found)
{
    for (size_t i = 0; i < m->n_truth; i++)
        if (away_m(&m->truth[i], m->found_m[found]) < DRIVE_CUTOFF_M)
            return true;
    return false;
}

/* measured: of tracks only those that were seen. */
static void match(const struct drive_score *s, double t_s,
                  const Anlos__DetectionList *list, bool measured, struct matching *m)
{
    m->n_found = 0;
    for (size_t i = 0; i < list->n_detections && m->n_found < BENCH_SET_MAX; i++) {
        const Anlos__Detection *d = list->detections[i];
        if (!d->position_m || d->measurement == ANLOS__MEASUREMENT__DELETED ||
            (measured && d->measurement == ANLOS__MEASUREMENT__PREDICTED))
            continue;
        m->found_m[m->n_found][0] = d->position_m->x;
        m->found_m[m->n_found][1] = d->position_m->y;
        m->found[m->n_found++] = d;
    }
    pair_up(s, t_s, m);
}

/* The distance with those left out that need not be found. */
static void measure(struct drive_score *s, const struct matching *m,
                    struct drive_moment *out)
{
    double truth_m[BENCH_SET_MAX][2], found_m[BENCH_SET_MAX][2];
    bool ignored[BENCH_SET_MAX] = {false};
    struct bench_set_distance d;

    for (size_t i = 0; i < m->n_truth; i++) {
        if (is_in_gate(s, &m->truth[i]))
            memcpy(truth_m[out->n_objects++], m->truth_m[i], sizeof truth_m[0]);
        else if (m->distance.match[i] != BENCH_NOBODY)
            ignored[m->distance.match[i]] = true;
    }
    for (size_t i = 0; i < m->n_found; i++)
        if (!ignored[i])
            memcpy(found_m[out->n_tracks++], m->found_m[i], sizeof found_m[0]);
    bench_set_distance(&d, (const double(*)[2])truth_m, out->n_objects,
                       (const double(*)[2])found_m, out->n_tracks, DRIVE_CUTOFF_M,
                       DRIVE_ORDER);
    out->gospa_m = d.gospa_m;
    out->ospa_m = d.ospa_m;
    out->localisation_m = sqrt(d.localisation);
    out->missed_m = sqrt(d.missed);
    out->false_m = sqrt(d.false_ones);
    drive_sum_add(&s->result.gospa, d.gospa_m);
    drive_sum_add(&s->result.ospa, d.ospa_m);
    drive_sum_add(&s->result.localisation, out->localisation_m);
    drive_sum_add(&s->result.missed, out->missed_m);
    drive_sum_add(&s->result.false_ones, out->false_m);
}

static void judge_pair(struct drive_score *s, const struct room_truth *t,
                       const double at_m[2], const Anlos__Detection *d, double out_s)
{
    double dx_m = d->position_m->x - at_m[0], dy_m = d->position_m->y - at_m[1];

    confirm(s, t, out_s);
    if (!is_in_gate(s, t))
        return;
    drive_sum_add(&s->result.position2, dx_m * dx_m + dy_m * dy_m);
    if (d->n_velocity_m_s != 2)
        return;
    double vx = d->velocity_m_s[0] - t->velocity_m_s[0];
    double vy = d->velocity_m_s[1] - t->velocity_m_s[1];
    drive_sum_add(&s->result.velocity2, vx * vx + vy * vy);
}

/* Was each object that can be seen detected in this image?  Returns how many detections
 * there are. */
static size_t judge_detections(struct drive_score *s, double t_s,
                               const Anlos__DetectionList *detections)
{
    struct matching m;

    match(s, t_s, detections, true, &m);
    for (size_t i = 0; i < m.n_truth; i++) {
        double seen = m.distance.match[i] != BENCH_NOBODY;
        if (!is_in_gate(s, &m.truth[i]))
            continue;
        drive_sum_add(&s->result.seen, seen);
        if (range_m(&m.truth[i]) >= DRIVE_FAR_M)
            drive_sum_add(&s->result.seen_far, seen);
    }
    return m.n_found;
}

void drive_score_list(struct drive_score *s, double t_s, double out_s,
                      const Anlos__DetectionList *tracks,
                      const Anlos__DetectionList *detections, struct drive_moment *moment)
{
    struct matching m;

    look_until(s, t_s);
    s->result.seconds = t_s - s->began_s;
    s->result.n_lists++;
    *moment = (struct drive_moment){.t_s = t_s};
    match(s, t_s, tracks, false, &m);
    measure(s, &m, moment);
    for (size_t i = 0; i < m.n_truth; i++) {
        size_t found = m.distance.match[i];
        if (found != BENCH_NOBODY)
            judge_pair(s, &m.truth[i], m.truth_m[i], m.found[found], out_s);
    }
    for (size_t i = 0; i < m.n_found; i++)
        live(s, m.found[i], is_somebody(&m, i));
    for (size_t i = 0; i < tracks->n_detections; i++)
        if (tracks->detections[i]->measurement == ANLOS__MEASUREMENT__DELETED)
            live(s, tracks->detections[i], false);
    moment->n_detections = judge_detections(s, t_s, detections ? detections : tracks);
}

/* -- what the vehicle is told
 * ------------------------------------------------------------
 */

void drive_told_init(struct drive_told *t, const struct launchfile *l)
{
    struct sender_config cfg;

    sender_config_set(&cfg, l);
    *t = (struct drive_told){.last_ns = 0};
    sender_init(&t->sender, &cfg);
}

void drive_told_survey(struct drive_told *t, const Anlos__Survey *survey)
{
    sender_survey(&t->sender, survey);
}

/* Returns how many frames it has. */
static size_t read_object(const struct can_frame_data *f,
                          const struct bus_budget_config *bus, struct can_object *o)
{
    size_t n = bus->motion;

    *o = (struct can_object){.id = 0};
    if (bus->motion)
        can_unpack_object_motion(f++, o);
    if (!bus->fd) {
        can_unpack_object_state(&f[0], o);
        can_unpack_object_dynamics(&f[1], o);
        can_unpack_object_quality(&f[2], o);
        return n + 3;
    }
    can_unpack_object_fd(f, o);
    o->sigma_m[0] = sqrt(o->covariance_m2[0]);
    o->sigma_m[1] = sqrt(o->covariance_m2[3]);
    o->correlation = o->covariance_m2[1] / (o->sigma_m[0] * o->sigma_m[1]);
    return n + 1;
}

/* It goes at now_ns; t->objects are those of its frames, also the deleted. */
static void send_list(struct drive_told *t, const Anlos__DetectionList *list,
                      int64_t capture_ns, int64_t now_ns)
{
    struct sender_list out;

    sender_list(&t->sender, list, capture_ns, &out);
    sender_finalize(&t->sender, &out, now_ns, t->last_ns);
    t->last_ns = now_ns;
    t->n = 0;
    for (size_t i = 2; i < out.n_frames; t->n++) /* after header and time */
        i += read_object(&out.frames[i], &t->sender.cfg.bus, &t->objects[t->n]);
    sender_sent(&t->sender, &out);
}

/* The squared error of a middle over its covariance; NaN where that is not known. */
static double nees_of(const struct can_object *o, const struct room_truth *t)
{
    double x = (o->position_m[0] - t->position_m[0]) / o->sigma_m[0];
    double y = (o->position_m[1] - t->position_m[1]) / o->sigma_m[1];
    double c = o->correlation;

    return (x * x - 2.0 * c * x * y + y * y) / (1.0 - c * c);
}

void drive_score_told(struct drive_score *s, struct drive_told *told, double t_s,
                      const Anlos__DetectionList *list, int64_t capture_ns,
                      int64_t now_ns)
{
    const struct can_object *found[CAN_MAX_OBJECTS];
    struct matching m = {.n_found = 0};

    send_list(told, list, capture_ns, now_ns);
    for (size_t i = 0; i < told->n; i++) {
        const struct can_object *o = &told->objects[i];
        if (o->measurement == CAN_DELETED || isnan(o->position_m[0]))
            continue;
        memcpy(m.found_m[m.n_found], o->position_m, sizeof m.found_m[0]);
        found[m.n_found++] = o;
    }
    pair_up(s, t_s, &m);
    for (size_t i = 0; i < m.n_found; i++)
        if (isfinite(found[i]->existence))
            drive_bins_add(s->result.existence, found[i]->existence, is_somebody(&m, i));
    for (size_t i = 0; i < m.n_truth; i++) {
        size_t k = m.distance.match[i];
        if (!is_in_gate(s, &m.truth[i]))
            continue;
        drive_sum_add(&s->result.told, k != BENCH_NOBODY);
        if (range_m(&m.truth[i]) >= DRIVE_FAR_M)
            drive_sum_add(&s->result.told_far, k != BENCH_NOBODY);
        double nees = k != BENCH_NOBODY ? nees_of(found[k], &m.truth[i]) : NAN;
        if (isfinite(nees))
            drive_nees_add(s->result.nees, m.truth[i].kind, nees);
    }
}

void drive_score_end(struct drive_score *s)
{
    while (s->n_lives)
        end_life(s, 0);
    for (size_t i = 0; i < DRIVE_OBJECTS; i++) /* it was not over with these */
        s->result.n_entries -= s->objects[i].in_gate && !s->objects[i].confirmed;
}
