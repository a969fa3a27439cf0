/* SPDX-License-Identifier: MIT */
#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "hal/survey/element_places.h"
#include "nodes/anlos/calibrate/calibrate.h"
#include "nodes/anlos/calibrate/paths.h"
#include "nodes/rt/stop.h"
#include "recon/walls/wall_fit.h"

#define PLACED_MM     10.0 /* what a tape measure leaves */
#define SPEED_SIGMA   3.0  /* m/s: 5 K */
#define KNOWN_SIGMA   0.35 /* m/s: of a speed from the air's temperature, 0.1 % */
#define CHANNEL_SIGMA 0.05 /* samples: what a microphone's phase does to an arrival */
#define CLEAR_M       0.25 /* of path, between the direct sound and an echo */
#define REACH_NEAR_M  0.3
#define REACH_FAR_M   5.0
#define TILT_RAD      0.5
#define LEVEL_M       0.1   /* of height: a level line cannot tell how walls lean */
#define LEAN_RAD      0.035 /* of walls, 2 degrees */
#define PEAKS         6     /* of a trace */
#define THRESHOLD_DB  12.0
#define RANGE_DB      30.0
#define LEAST_ECHO    0.1  /* of a perfect mirror's: ripple and clutter are weaker */
#define TOLERANCE_M   0.06 /* of path: misplaced elements, and a wall not yet fitted */
#define MOST_PAIRS    0.8  /* hear a wall, and agree: clutter and objects do not manage */
#define MOST_RMS_M    2e-3 /* of the paths that agree */
#define MOST_EARLY    0.1  /* samples */
#define TOLD          0.5  /* of the uncertainty before: what stays larger is not told */

struct measurement {
    struct element_arrival *arrivals;
    size_t n;
    struct element_plane walls[CALIBRATE_MAX_ARRAYS];
    size_t n_walls;
    struct straight {
        double sum_s;
        size_t n;
    } * straight;                           /* [n_speakers][n_microphones] */
    size_t n_straight, n_mirrored, n_pairs; /* heard; looked at by way of walls */
    size_t retaken;
    double latency_s, speed_m_s; /* as known before */
};

/* Echoes of one wall, from all positions it was heard from. */
struct echoes {
    struct wall_echo *list;
    size_t n, n_pairs;
    size_t n_expected; /* pairs that hear each other straight */
};

static int out_of_memory(struct session *s)
{
    return error_say(&s->why, -ENOMEM, "out of memory");
}

static int check(struct session *s)
{
    const struct survey *y = s->survey;
    int err = session_check(s);
    if (err)
        return err;
    if (y->n_speakers + y->n_microphones > ELEMENT_PLACES_MOST)
        return error_say(&s->why, -EINVAL,
                         "places are found of up to %d speakers and microphones, and "
                         "this array has %zu",
                         ELEMENT_PLACES_MOST, y->n_speakers + y->n_microphones);
    if (s->options->n_also && y->source == SURVEY_LIVE && !isatty(STDIN_FILENO))
        return error_say(&s->why, -EINVAL,
                         "a live array before several walls asks for each on a terminal");
    return 0;
}

/* -- what is heard ----------------------------------------------------------------------
 */

/* The same path from everywhere, with the same small errors: it counts once. */
static void add_straight(struct measurement *m, const struct survey *y,
                         const struct path *direct)
{
    for (size_t p = 0; p < y->n_speakers * y->n_microphones; p++)
        if (direct[p].heard) {
            m->straight[p].sum_s += direct[p].arrival.time_s;
            m->straight[p].n++;
        }
}

static void count_straight(struct measurement *m, const struct survey *y)
{
    for (size_t p = 0; p < y->n_speakers * y->n_microphones; p++)
        if (m->straight[p].n) {
            m->arrivals[m->n++] = (struct element_arrival){
                .speaker = (uint32_t)(p / y->n_microphones),
                .microphone = (uint32_t)(p % y->n_microphones),
                .plane = ELEMENT_PLACES_STRAIGHT,
                .arrival_s = m->straight[p].sum_s / (double)m->straight[p].n};
            m->n_straight++;
        }
}

/* What a perfect mirror would make of the straight sound at that distance: 1. */
static double strength(const struct path *direct, double amplitude, double path_m)
{
    double straight = cabs(direct->arrival.peak) * direct->distance_m;
    return direct->heard && straight > 0.0 ? amplitude * path_m / straight : 1.0;
}

/* What comes after the straight sound of a pair, as far as a wall may stand. */
static void add_pair(struct echoes *e, const struct wall_echo *pair,
                     const struct path *direct, double late_m,
                     const struct trace_format *f, const float complex *trace,
                     double speed_m_s)
{
    struct wall_echo_peak peaks[PEAKS];
    const double path_m[2] = {late_m + direct->distance_m + CLEAR_M,
                              late_m + 2.0 * REACH_FAR_M};
    size_t n = wall_echo_peaks(f, trace, speed_m_s, path_m, THRESHOLD_DB, RANGE_DB, peaks,
                               PEAKS);
    for (size_t k = 0; k < n; k++) {
        struct wall_echo *one = &e->list[e->n];
        *one = *pair;
        one->path_m = peaks[k].path_m - late_m;
        one->weight = fmin(1.0, strength(direct, peaks[k].amplitude, one->path_m));
        e->n += one->weight >= LEAST_ECHO;
    }
    e->n_pairs++;
    e->n_expected += direct->heard;
}

static void add_echoes(struct echoes *e, const struct measurement *m,
                       const struct survey *y, size_t position, struct sounding *sounding,
                       const struct path *direct)
{
    struct trace_format f;
    double carried_m = y->stage_positions_m[position];
    sounding_format(sounding, &f);
    for (size_t j = 0; j < y->n_speakers; j++) {
        const float complex *traces = sounding_traces(sounding, j);
        for (size_t i = 0; i < y->n_microphones; i++) {
            struct wall_echo pair = {.pair = (uint32_t)e->n_pairs,
                                     .speaker = (uint32_t)j,
                                     .microphone = (uint32_t)i,
                                     .place = (uint32_t)position};
            for (int a = 0; a < 3; a++) {
                pair.speaker_m[a] = y->speakers_m[j][a] + y->stage_axis[a] * carried_m;
                pair.microphone_m[a] = y->microphones_m[i][a] +
                                       y->stage_axis[a] * carried_m;
            }
            add_pair(e, &pair, &direct[j * y->n_microphones + i],
                     m->latency_s * m->speed_m_s, &f, traces + i * f.n_samples,
                     m->speed_m_s);
        }
    }
}

static int hear_from(struct session *s, struct measurement *m, struct array *array,
                     size_t position, struct echoes *e)
{
    const struct survey *y = array_survey(array);
    struct sounding *sounding;
    struct time_zero zero;
    struct path *direct = paths_direct(y);
    if (!direct)
        return out_of_memory(s);
    int err =
        sounding_take(&sounding, array, position, SIZE_MAX, s->options->takes, &s->why);
    if (!err) {
        err = paths_fit_latency(direct, sounding, m->speed_m_s, &zero, &s->why);
        if (!err) {
            if (isnan(m->latency_s)) /* one to go by, for all; the fit has the best */
                m->latency_s = zero.latency_s;
            add_straight(m, y, direct);
            add_echoes(e, m, y, position, sounding, direct);
        }
        m->retaken += sounding_retaken(sounding);
        sounding_destroy(sounding);
    }
    free(direct);
    return err;
}

/* -- the wall among it ------------------------------------------------------------------
 */
static void measure_aperture(const struct echoes *e, double wide_m[3])
{
    double low[3], high[3];
    memcpy(low, e->list[0].speaker_m, sizeof low);
    memcpy(high, low, sizeof high);
    for (size_t i = 0; i < e->n; i++)
        for (int a = 0; a < 3; a++) {
            low[a] = fmin(low[a], e->list[i].microphone_m[a]);
            high[a] = fmax(high[a], e->list[i].microphone_m[a]);
        }
    for (int a = 0; a < 3; a++)
        wide_m[a] = high[a] - low[a];
}

/* Of each pair the echo that comes nearest to the wall's. */
static size_t add_mirrored(struct measurement *m, const struct session *s,
                           const struct echoes *e, const struct wall *wall)
{
    const double *axis = s->survey->stage_axis;
    size_t heard = 0;
    for (size_t i = 0; i < e->n;) {
        const struct wall_echo *best = NULL;
        double least_m = TOLERANCE_M;
        for (uint32_t pair = e->list[i].pair; i < e->n && e->list[i].pair == pair; i++) {
            double off_m =
                fabs(e->list[i].path_m - wall_echo_path_m(&e->list[i], &wall, 1));
            if (off_m < least_m) {
                least_m = off_m;
                best = &e->list[i];
            }
        }
        if (!best)
            continue;
        struct element_arrival *a = &m->arrivals[m->n++];
        *a = (struct element_arrival){.speaker = best->speaker,
                                      .microphone = best->microphone,
                                      .plane = (uint32_t)m->n_walls,
                                      .arrival_s = m->latency_s +
                                                   best->path_m / m->speed_m_s};
        for (int k = 0; k < 3; k++)
            a->carried_m[k] = axis[k] * s->survey->stage_positions_m[best->place];
        heard++;
    }
    return heard;
}

static int find_wall(struct session *s, struct measurement *m, const struct echoes *e,
                     const char *uri)
{
    struct wall_prior prior = {.vertical = true, /* as far as a line cannot tell */
                               .sound_speed = 1e-3,
                               .delay_m = 0.01};
    const double tolerance_m[2] = {2.0 * TOLERANCE_M, TOLERANCE_M};
    struct wall_fit fit = {.n_heard = 0};
    size_t heard = 0, agree = 0;
    if (e->n) {
        double wide_m[3];
        measure_aperture(e, wide_m);
        const struct wall_search search = {
            .upright = wide_m[1] < LEVEL_M,
            .reach_m = {REACH_NEAR_M, REACH_FAR_M},
            .aperture_m = fmax(fmax(wide_m[0], wide_m[1]), wide_m[2]),
            .tilt_rad = TILT_RAD};
        prior.vertical_rad = search.upright ? LEAN_RAD : TILT_RAD;
        if (wall_search_best(&search, e->list, e->n, &fit.wall, &agree) < 0)
            return out_of_memory(s);
    }
    if (agree) {
        struct wall_fit better = fit; /* what these places do not tell stays a guess */
        int err = wall_fit_improve(&better, &prior, e->list, e->n, tolerance_m, NULL);
        if (err == -ENOMEM)
            return out_of_memory(s);
        heard = add_mirrored(m, s, e, err ? &fit.wall : &better.wall);
        if (!err)
            fit = better;
    }
    if ((double)heard < MOST_PAIRS * (double)e->n_expected || !heard)
        return error_say(
            &s->why, -ENODATA,
            "%s: no wall is heard within %g m by %.0f %% of the pairs; stand "
            "the array before a large flat wall or board",
            uri, REACH_FAR_M, 100.0 * MOST_PAIRS);
    struct element_plane *w = &m->walls[m->n_walls++];
    memcpy(w->normal, fit.wall.normal, sizeof w->normal);
    w->distance_m = fit.wall.distance_m;
    m->n_mirrored += heard;
    m->n_pairs += e->n_pairs;
    return 0;
}

static int make_room(struct session *s, struct measurement *m, struct echoes *e,
                     size_t n_positions)
{
    size_t pairs = s->survey->n_speakers * s->survey->n_microphones;
    size_t looks = n_positions * pairs;
    void *more = realloc(m->arrivals, (m->n + looks + pairs) * sizeof *m->arrivals);
    if (more)
        m->arrivals = more;
    if (!m->straight)
        m->straight = calloc(pairs, sizeof *m->straight);
    e->list = malloc(looks * PEAKS * sizeof *e->list);
    return more && m->straight && e->list ? 0 : out_of_memory(s);
}

/* From both ends of the stage: how the wall is turned against it, only both tell. */
static int hear_wall(struct session *s, struct measurement *m, struct array *array,
                     const char *uri)
{
    const struct survey *y = array_survey(array);
    bool carried = s->options->stage || y->source != SURVEY_LIVE;
    size_t ends[2] = {s->options->position, y->n_positions - 1};
    size_t n = carried && ends[0] != ends[1] ? 2 : 1;
    struct carrier *carrier = NULL;
    struct echoes e = {.n = 0};
    int err = make_room(s, m, &e, n);
    if (!err && s->options->stage)
        err = carrier_open(&carrier, s->options->stage, y, &s->why);
    for (size_t k = 0; k < n && !err; k++) {
        err = carrier ? carrier_move(carrier, ends[k], &s->why) : 0;
        if (!err)
            err = hear_from(s, m, array, ends[k], &e);
    }
    if (!err)
        err = find_wall(s, m, &e, uri);
    carrier_close(carrier);
    free(e.list);
    return err;
}

/* Waits until somebody has turned the wall. */
static int ask(struct session *s)
{
    int c;
    fprintf(stderr, "Turn the board or the array by 20 to 40 degrees, step aside, and "
                    "press Enter: ");
    do
        c = interrupt_requested() ? EOF : getchar();
    while (c != EOF && c != '\n');
    return c == EOF ? error_say(&s->why, -EINTR, "interrupted") : 0;
}

static bool same_stage(const struct survey *a, const struct survey *b)
{
    return a->n_positions == b->n_positions &&
           !memcmp(a->stage_axis, b->stage_axis, sizeof a->stage_axis) &&
           !memcmp(a->stage_positions_m, b->stage_positions_m,
                   a->n_positions * sizeof *a->stage_positions_m);
}

static int hear_again(struct session *s, struct measurement *m, const char *uri)
{
    struct array *array;
    int err = s->survey->source == SURVEY_LIVE ? ask(s) : 0;
    if (!err && !strcmp(uri, s->options->array)) /* a card can be opened once */
        return hear_wall(s, m, s->array, uri);
    if (!err)
        err = session_open_array(s, uri, &array);
    if (err)
        return err;
    /* What fits the one has to fit the other. */
    calibration_name(s->calibration, s->survey, s->options->array);
    err =
        calibration_fits(s->calibration, array_survey(array), s->options->array, &s->why);
    if (!err && !same_stage(s->survey, array_survey(array)))
        err = error_say(&s->why, -EINVAL, "%s has another stage than %s", uri,
                        s->options->array);
    if (!err)
        err = hear_wall(s, m, array, uri);
    array_close(array);
    return err;
}

/* -- what comes of it -------------------------------------------------------------------
 */
static const char axis_names[3][24] = {"x, along the stage", "y, up", "z, forward"};

struct axis {
    double moved_rms_m, sigma_rms_m;
};

static void sum_up(const struct element_places *p, const struct survey *y,
                   struct axis axes[3], double *sigma_m, size_t *farthest,
                   double *farthest_m)
{
    size_t n = p->n_speakers + p->n_microphones;
    *sigma_m = *farthest_m = 0.0;
    *farthest = 0;
    for (int a = 0; a < 3; a++)
        axes[a] = (struct axis){0.0, 0.0};
    for (size_t e = 0; e < n; e++) {
        const double *was = e < y->n_speakers ? y->speakers_m[e]
                                              : y->microphones_m[e - y->n_speakers];
        double far = 0.0;
        for (int a = 0; a < 3; a++) {
            double moved = p->elements_m[e][a] - was[a];
            far += moved * moved;
            axes[a].moved_rms_m += moved * moved / (double)n;
            axes[a].sigma_rms_m += p->sigma_m[e][a] * p->sigma_m[e][a] / (double)n;
        }
        if (sqrt(far) > *farthest_m) {
            *farthest_m = sqrt(far);
            *farthest = e;
        }
    }
    for (int a = 0; a < 3; a++) {
        *sigma_m += axes[a].sigma_rms_m / 3.0;
        axes[a].moved_rms_m = sqrt(axes[a].moved_rms_m);
        axes[a].sigma_rms_m = sqrt(axes[a].sigma_rms_m);
    }
    *sigma_m = sqrt(*sigma_m);
}

static void print(const struct session *s, const struct measurement *m,
                  const struct element_places *p, const struct axis axes[3],
                  size_t farthest, double farthest_m)
{
    const struct survey *y = s->survey;
    bool speaker = farthest < y->n_speakers;
    printf("places of the elements of %s, %zu wall%s, %zu takes\n", s->options->array,
           m->n_walls, m->n_walls == 1 ? "" : "s", s->options->takes);
    printf("  heard         %zu of %zu pairs straight, %zu of %zu by a wall; %zu of %zu "
           "agree\n",
           m->n_straight, y->n_speakers * y->n_microphones, m->n_mirrored, m->n_pairs,
           p->n_used, m->n);
    for (size_t w = 0; w < p->n_planes; w++)
        printf("  wall %zu        at %.3f m, turned %.1f and tilted %.1f degrees\n", w,
               p->planes[w].distance_m,
               atan2(p->planes[w].normal[0], p->planes[w].normal[2]) * 180.0 / M_PI,
               asin(p->planes[w].normal[1]) * 180.0 / M_PI);
    printf("  paths         off by %.2f mm rms with the survey's places, by %.2f with "
           "these\n",
           p->before_rms_m * 1e3, p->rms_m * 1e3);
    printf("  latency       %.3f samples, +- %.3f\n", p->latency_s * y->sample_rate_hz,
           p->latency_sigma_s * y->sample_rate_hz);
    printf("  sound speed   %.2f m/s, +- %.2f\n", p->sound_speed_m_s,
           p->sound_speed_sigma_m_s);
    for (int a = 0; a < 3; a++)
        printf("  %-19s moved %.2f mm rms, known to %.2f\n", axis_names[a],
               axes[a].moved_rms_m * 1e3, axes[a].sigma_rms_m * 1e3);
    printf("  farthest      %s %zu, %.1f mm from where the survey has it\n",
           speaker ? "speaker" : "microphone",
           speaker ? farthest : farthest - y->n_speakers, farthest_m * 1e3);
    session_print_retaken(m->retaken);
}

static bool judge(const struct element_places *p, const struct measurement *m,
                  double rate_hz, const struct axis axes[3], double placed_m,
                  double farthest_m)
{
    int told = 0;
    for (int a = 0; a < 3; a++)
        told += axes[a].sigma_rms_m < TOLD * placed_m;
    if (!(p->rms_m <= MOST_RMS_M) || (double)p->n_used < MOST_PAIRS * (double)m->n)
        printf("bad: no places near the survey's explain what is heard; is nothing "
               "swapped (anlos calibrate channels), and is the wall flat?\n");
    else if (!(p->sound_speed_m_s >= 300.0 && p->sound_speed_m_s <= 360.0))
        printf("bad: air has 300 to 360 m/s; are the places in the survey right?\n");
    else if (p->latency_s * rate_hz < -MOST_EARLY)
        printf("bad: sound cannot arrive before it is sent; are the places in the survey "
               "right?\n");
    else if (farthest_m > CALIBRATION_MAX_MOVE_M)
        printf("bad: more than %g m is another array; measure the survey anew\n",
               CALIBRATION_MAX_MOVE_M);
    else if (!told)
        printf("bad: what is heard tells the places no better than they were measured\n");
    else {
        for (int a = 0; a < 3; a++)
            if (axes[a].sigma_rms_m >= TOLD * placed_m)
                printf("not told: %s; turn the board or the array by 20 to 40 degrees, "
                       "and name it with another --array\n",
                       axis_names[a]);
        return true;
    }
    return false;
}

/* To a hundredth of a millimetre: easier to read, and no less exact. */
static double rounded(double m)
{
    return round(1e5 * m) / 1e5;
}

static int keep(struct session *s, const struct element_places *p, double sigma_m)
{
    struct calibration *c = s->calibration;
    size_t n = p->n_speakers + p->n_microphones;
    free(c->places_m);
    c->places_m = malloc(n * sizeof *c->places_m);
    if (!c->places_m)
        return out_of_memory(s);
    for (size_t e = 0; e < n; e++)
        for (int a = 0; a < 3; a++)
            c->places_m[e][a] = rounded(p->elements_m[e][a]);
    c->places_sigma_m = fmax(1e-5, rounded(sigma_m));
    c->latency_samples =
        fmax(0.0, session_round(p->latency_s * s->survey->sample_rate_hz));
    c->sound_speed_m_s = session_round(p->sound_speed_m_s);
    c->temperature_c = c->humidity_percent = NAN; /* the air's is another one */
    return session_save(s);
}

static bool is_of_air(const struct calibration *c)
{
    return !isnan(c->temperature_c) && !isnan(c->sound_speed_m_s);
}

static int fit(struct session *s, const struct measurement *m, bool *good)
{
    const struct survey *y = s->survey;
    double placed_mm = isnan(s->options->placed_mm) ? PLACED_MM : s->options->placed_mm;
    const struct element_places_config cfg = {
        .n_speakers = y->n_speakers,
        .n_microphones = y->n_microphones,
        .speakers_m = (const double(*)[3])y->speakers_m,
        .microphones_m = (const double(*)[3])y->microphones_m,
        .placed_sigma_m = placed_mm * 1e-3,
        .sound_speed_m_s = m->speed_m_s,
        .sound_speed_sigma_m_s = is_of_air(s->calibration) ? KNOWN_SIGMA : SPEED_SIGMA,
        .latency_s = m->latency_s,
        .channel_sigma_s = CHANNEL_SIGMA / y->sample_rate_hz,
        .n_planes = m->n_walls,
        .planes = m->walls,
        .lean_sigma_rad = LEAN_RAD};
    struct element_places p;
    struct axis axes[3];
    double sigma_m, farthest_m;
    size_t farthest;
    int err = element_places_fit(&p, &cfg, m->arrivals, m->n, &s->why);
    if (err)
        return err;
    sum_up(&p, y, axes, &sigma_m, &farthest, &farthest_m);
    print(s, m, &p, axes, farthest, farthest_m);
    *good = judge(&p, m, y->sample_rate_hz, axes, placed_mm * 1e-3, farthest_m);
    if (*good)
        err = keep(s, &p, sigma_m);
    else
        printf("nothing was written to %s\n", s->options->out);
    if (!err && *good)
        printf("good: places, known to %.2f mm each axis, are in %s\n", sigma_m * 1e3,
               s->options->out);
    element_places_clear(&p);
    return err;
}

int calibrate_array(struct session *s, bool *good)
{
    /* What an earlier run has found with its places is no knowledge for this one. */
    bool own = s->calibration->places_m && !is_of_air(s->calibration);
    struct measurement m = {.latency_s = NAN,
                            .speed_m_s = own ? s->survey->sound_speed_m_s
                                             : session_speed_m_s(s)};
    int err = check(s);
    if (!err)
        err = hear_wall(s, &m, s->array, s->options->array);
    for (size_t k = 0; k < s->options->n_also && !err; k++)
        err = hear_again(s, &m, s->options->also[k]);
    if (!err) {
        count_straight(&m, s->survey);
        err = fit(s, &m, good);
    }
    free(m.straight);
    free(m.arrivals);
    return err;
}
