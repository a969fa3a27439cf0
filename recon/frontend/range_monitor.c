/* SPDX-License-Identifier: MIT */
#include "recon/frontend/range_monitor.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "dsp/arrival.h"
#include "dsp/special.h"

/* -- the sonar equation
 * ------------------------------------------------------------------
 */

#define LEAST_LOG -20.0 /* of a threshold and of an snr */
#define MOST_LOG  40.0
#define STEPS     48
#define PARTS     256 /* of the distribution of B */

double detection_range_stay(double speed_m_s, double ping_s, double voxel_m, size_t n)
{
    return fmin(1.0 + voxel_m / (speed_m_s * ping_s), (double)n);
}

/* The part of the sum that is louder: places and weights, dense at both ends. */
struct louder {
    double part[PARTS], weight[PARTS];
};

static void find_louder(struct louder *l, double n, double stay)
{
    double below = 0.0;

    for (int i = 0; i < PARTS; i++) {
        double middle = sin(0.5 * M_PI * (i + 0.5) / PARTS);
        double end = sin(0.5 * M_PI * (i + 1.0) / PARTS);
        double up_to = i + 1 == PARTS ? 1.0 : 0.0;
        if (up_to < 1.0 && stay < n)
            up_to = special_beta_p(end * end, stay, n - stay);
        l->part[i] = stay < n ? middle * middle : 1.0;
        l->weight[i] = up_to - below;
        below = up_to;
    }
}

/* Chance that the sum passes. */
static double passes(const struct louder *l, double n, double snr, double threshold)
{
    double sum = 0.0;

    for (int i = 0; i < PARTS; i++)
        if (l->weight[i] > 0.0)
            sum += l->weight[i] *
                   special_gamma_q(n, threshold / (1.0 + snr * l->part[i]));
    return sum;
}

static bool is_valid(const struct detection_range *d)
{
    return d->n_pings >= 1 && d->false_alarm_rate >= 1e-12 &&
           d->false_alarm_rate <= 0.5 && d->probability >= 0.5 &&
           d->probability <= 0.999 && d->stay >= 1.0 && d->stay <= (double)d->n_pings;
}

/* By halving, which always converges. */
static double threshold_of(double n, double rate)
{
    double low = LEAST_LOG, high = MOST_LOG;

    for (int i = 0; i < STEPS; i++) {
        double middle = 0.5 * (low + high);
        if (special_gamma_q(n, exp(middle)) > rate)
            low = middle;
        else
            high = middle;
    }
    return exp(high);
}

double detection_range_snr(const struct detection_range *d)
{
    double low = LEAST_LOG, high = MOST_LOG, n = (double)d->n_pings;
    struct louder louder;

    if (!is_valid(d))
        return NAN;
    double threshold = threshold_of(n, d->false_alarm_rate);
    find_louder(&louder, n, d->stay);
    for (int i = 0; i < STEPS; i++) {
        double middle = 0.5 * (low + high);
        if (passes(&louder, n, exp(middle), threshold) < d->probability)
            low = middle;
        else
            high = middle;
    }
    return exp(high);
}

double detection_range_m(double scattering_m, double snr, double echo, double noise)
{
    if (!(echo > 0.0))
        return 0.0;
    return pow(echo * scattering_m * scattering_m / (noise * snr), 0.25);
}

/* -- the monitor
 * -------------------------------------------------------------------------
 */

#define ECHO_M     0.5 /* of a path, about the wall's: what a vehicle moves */
#define UNSEEN_S   1.0
#define ECHO_LEAST 1.0 /* over noise: less is none */
#define CLEAR_M    0.1 /* of a path, behind the direct sound's */
#define WALK_M_S   1.2
#define ECHO_PINGS 32.0 /* the reference, which walls change, not weather */

struct range_monitor {
    struct range_config cfg;
    const struct survey *survey;
    struct trace_format format;
    struct walls walls;
    double gate_m[2], ping_s;            /* near, far */
    double snr;                          /* that a person needs, over the noise of... */
    double n_coherent;                   /* so many pings that are added in phase */
    double echo_trace, echo, echo_noise; /* the wall's power in a trace; at 1 m, over
                                            what noise would be there */
    double noise_of_sum;                 /* NaN: no microphone is of use */
    bool has_noise, has_echo, limited;
    unsigned n_less; /* pings in a row with less range than the gate has */
};

/* In an image of powers of a person who walks; a coherent sum is one look. */
static double required_snr(const struct range_monitor *r)
{
    const struct survey *s = r->survey;
    double voxel_m = s->sound_speed_m_s / fabs(s->chirp_stop_hz - s->chirp_start_hz);
    struct detection_range d = {.n_pings = 1,
                                .false_alarm_rate = r->cfg.false_alarm_rate,
                                .probability = RANGE_PROBABILITY,
                                .stay = 1.0};

    if (r->cfg.sum != FRAMES_COHERENT) {
        d.n_pings = r->cfg.n_pings;
        d.stay = detection_range_stay(WALK_M_S, r->ping_s, voxel_m, d.n_pings);
    }
    return detection_range_snr(&d);
}

int range_monitor_create(struct range_monitor **out, const struct range_config *cfg,
                         const struct survey *s, const struct trace_format *format,
                         const double gate_m[2], struct error *why)
{
    struct range_monitor *r = calloc(1, sizeof *r);

    *out = NULL;
    if (!r)
        return error_say(why, -ENOMEM, "not enough memory to say how far it is heard");
    double slot_s = (double)s->slot_samples / s->sample_rate_hz;
    *r = (struct range_monitor){.cfg = *cfg,
                                .survey = s,
                                .format = *format,
                                .gate_m = {gate_m[0], gate_m[1]},
                                .ping_s = slot_s /
                                          (s->together > 1 ? (double)s->together : 1.0)};
    r->n_coherent = cfg->sum == FRAMES_COHERENT ? (double)cfg->n_pings : 1.0;
    if (cfg->ranges)
        r->snr = required_snr(r);
    if (isnan(r->snr)) {
        free(r);
        return error_say(why, -EINVAL,
                         "how far it is heard: no answer for images of %zu pings and "
                         "%g false alarms a voxel",
                         cfg->n_pings, cfg->false_alarm_rate);
    }
    walls_from_survey(&r->walls, s);
    *out = r;
    return 0;
}

void range_monitor_inherit(struct range_monitor *r, const struct range_monitor *before)
{
    r->walls = before->walls;
    r->echo_trace = before->echo_trace;
    r->echo = before->echo;
    r->echo_noise = before->echo_noise;
    r->noise_of_sum = before->noise_of_sum;
    r->has_noise = before->has_noise;
    r->has_echo = before->has_echo;
    r->limited = before->limited;
    r->n_less = before->n_less;
}

void range_monitor_walls(struct range_monitor *r, const struct walls *walls)
{
    r->walls = *walls;
    if (walls->n && (walls->unseen_s[0] > UNSEEN_S || walls->existence[0] < 0.5))
        r->walls.n = 0;
}

const struct wall_gate *range_monitor_wall(const struct range_monitor *r)
{
    return r->walls.n ? &r->walls.list[0] : NULL;
}

static void settle(double *mean, bool known, double value)
{
    *mean = known ? *mean + (value - *mean) / ECHO_PINGS : value;
}

/* What the highest of the samples about an echo is over the mean power, of noise alone:
 * the mean of the highest of n exponential ones.  Every second sample is a new one. */
static double highest_of(const struct range_monitor *r, double within_m)
{
    double n = r->format.rate_hz * within_m / r->survey->sound_speed_m_s;

    return log(fmax(n, 1.0)) + 0.57722;
}

/* The first wall's echo, which would have the same power over all paths of 1 m. */
static void measure_echo(struct range_monitor *r, const struct range_ping *ping)
{
    const struct survey *s = r->survey;
    const double *speaker_m = s->speakers_m[ping->speaker];
    double trace = 0.0, sum = 0.0, noise = 0.0, image[3];
    size_t n = 0;

    if (!r->walls.n || !ping->speaker_usable) /* the reference is what it was */
        return;
    wall_mirror(&r->walls.list[0].plane, speaker_m, image);
    for (size_t m = 0; m < s->n_microphones; m++) {
        double path_m = geometry_distance(image, s->microphones_m[m]);
        double direct_m = geometry_distance(speaker_m, s->microphones_m[m]);
        double delay_s = path_m / s->sound_speed_m_s;
        if (!ping->usable[m] || path_m < direct_m + 2.0 * CLEAR_M ||
            delay_s * r->format.rate_hz > (double)r->format.n_samples)
            continue;
        double within_m = fmin(ECHO_M, path_m - direct_m - CLEAR_M);
        double within_s = within_m / s->sound_speed_m_s;
        double power = arrival_power(&r->format, ping->traces + m * r->format.n_samples,
                                     delay_s - within_s, delay_s + within_s);
        trace += power;
        sum += (power - ping->noise[m] * highest_of(r, within_m)) * path_m * path_m;
        noise += ping->noise[m] * path_m * path_m;
        n++;
    }
    if (!n)
        return;
    settle(&r->echo_trace, r->has_echo, trace / (double)n);
    settle(&r->echo, r->has_echo, sum / (double)n);
    r->echo_noise = noise / (double)n;
    r->has_echo = true;
}

/* Of the microphones that can be used: their mean over how many they are. */
static double noise_of_sum(const struct range_monitor *r, const struct range_ping *ping)
{
    double sum = 0.0, n = 0.0;

    for (size_t m = 0; m < r->survey->n_microphones; m++)
        if (ping->usable[m] && ping->noise[m] > 0.0) {
            sum += ping->noise[m];
            n += 1.0;
        }
    return n > 0.0 ? sum / (n * n) : NAN;
}

static double range_m(const struct range_monitor *r)
{
    if (!r->cfg.ranges || !r->has_noise || !r->has_echo)
        return NAN;
    double echo = r->echo > ECHO_LEAST * r->echo_noise ? r->echo : 0.0;
    return detection_range_m(r->cfg.person_m, r->snr, echo,
                             r->noise_of_sum / r->n_coherent);
}

void range_monitor_take(struct range_monitor *r, const struct range_ping *ping)
{
    r->noise_of_sum = noise_of_sum(r, ping);
    r->has_noise = true;
    measure_echo(r, ping);
    double ratio = r->limited ? RANGE_CLEAR_RATIO : 1.0;
    bool less = range_m(r) < ratio * r->gate_m[1];
    r->n_less = less ? r->n_less + 1 : 0;
    r->limited = less && (r->limited || (double)r->n_less * r->ping_s > RANGE_LESS_S);
}

void range_monitor_levels(const struct range_monitor *r, struct range_levels *out)
{
    double m = range_m(r);

    if (m < r->gate_m[0]) /* nothing nearer is imaged */
        m = 0.0;
    *out = (struct range_levels){
        .echo = r->has_echo ? r->echo_trace : NAN,
        .range_m = isnan(m) ? NAN : fmin(m, r->gate_m[1]),
        .gate_m = r->cfg.ranges && r->gate_m[1] > 0.0 ? r->gate_m[1] : NAN,
        .limited = r->limited};
}

void range_monitor_destroy(struct range_monitor *r)
{
    free(r);
}
