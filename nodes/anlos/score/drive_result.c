/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/score/drive_result.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The probability of up to n events; by logarithms, which many events do not overflow. */
static double up_to(size_t n, double mean)
{
    double sum = 0.0;

    for (size_t k = 0; k <= n; k++)
        sum += exp((double)k * log(mean) - mean - lgamma((double)k + 1.0));
    return sum;
}

double poisson_bound(size_t n, double confidence)
{
    double low = 1e-12, high = (double)n + 20.0 * sqrt((double)n + 1.0) + 50.0;

    for (int i = 0; i < 60; i++) {
        double middle = 0.5 * (low + high);
        if (up_to(n, middle) > 1.0 - confidence)
            low = middle;
        else
            high = middle;
    }
    return high;
}

int drive_moments_add(struct drive_moments *m, const struct drive_moment *moment)
{
    if (m->n == m->room) {
        size_t room = m->room ? 2 * m->room : 256;
        struct drive_moment *at = realloc(m->at, room * sizeof *at);
        if (!at)
            return -ENOMEM;
        m->at = at;
        m->room = room;
    }
    m->at[m->n++] = *moment;
    return 0;
}

#define S_PER_HOUR 3600.0

void drive_sum_add(struct drive_sum *s, double value)
{
    s->sum += value;
    s->n++;
}

double drive_mean(const struct drive_sum *s)
{
    return s->n ? s->sum / (double)s->n : NAN;
}

double drive_rms(const struct drive_sum *squares)
{
    return sqrt(drive_mean(squares));
}

double drive_bin_from(size_t bin)
{
    static const double from[DRIVE_BINS + 1] = {0,   0.5,  0.6,  0.7, 0.8,
                                                0.9, 0.95, 0.99, 1};
    return from[bin];
}

const char *drive_class_name(size_t class)
{
    static const char *const names[DRIVE_CLASSES] = {"person", "cyclist", "car", "other"};

    return names[class];
}

void drive_bins_add(struct drive_bin bins[DRIVE_BINS], double existence, bool is_true)
{
    size_t b = DRIVE_BINS - 1;

    while (b && existence < drive_bin_from(b))
        b--;
    bins[b].stated += existence;
    bins[b].n++;
    bins[b].n_true += is_true;
}

void drive_nees_add(struct drive_nees by_class[DRIVE_CLASSES], const char *kind,
                    double nees)
{
    size_t c = 0;

    while (c + 1 < DRIVE_CLASSES && strcmp(kind, drive_class_name(c)))
        c++;
    drive_sum_add(&by_class[c].sum, nees);
    by_class[c].n_within += nees < DRIVE_NEES_95;
}

static const struct {
    const char *name;
    bool more_is_better;
} figures[DRIVE_FIGURES] = {
    [DRIVE_GOSPA] = {"gospa_m", false},
    [DRIVE_OSPA] = {"ospa_m", false},
    [DRIVE_LOCALISATION] = {"localisation_m", false},
    [DRIVE_MISSED] = {"missed_m", false},
    [DRIVE_FALSE] = {"false_m", false},
    [DRIVE_SEEN] = {"detection_probability", true},
    [DRIVE_SEEN_FAR] = {"detection_probability_far", true},
    [DRIVE_TOLD] = {"told", true},
    [DRIVE_TOLD_FAR] = {"told_far", true},
    [DRIVE_FALSE_TRACKS] = {"false_tracks", false},
    [DRIVE_DELAY] = {"echo_to_track_s", false},
    [DRIVE_DELAY_WORST] = {"echo_to_track_worst_s", false},
    [DRIVE_LEAD] = {"lead_before_sight_s", true},
    [DRIVE_POSITION] = {"position_rms_m", false},
    [DRIVE_VELOCITY] = {"velocity_rms_m_s", false},
};

const char *drive_figure_name(enum drive_figure which)
{
    return figures[which].name;
}

double drive_figure(const struct drive_result *r, enum drive_figure which)
{
    switch (which) {
    case DRIVE_GOSPA:
        return drive_mean(&r->gospa);
    case DRIVE_OSPA:
        return drive_mean(&r->ospa);
    case DRIVE_LOCALISATION:
        return drive_mean(&r->localisation);
    case DRIVE_MISSED:
        return drive_mean(&r->missed);
    case DRIVE_FALSE:
        return drive_mean(&r->false_ones);
    case DRIVE_SEEN:
        return drive_mean(&r->seen);
    case DRIVE_SEEN_FAR:
        return drive_mean(&r->seen_far);
    case DRIVE_TOLD:
        return drive_mean(&r->told);
    case DRIVE_TOLD_FAR:
        return drive_mean(&r->told_far);
    case DRIVE_FALSE_TRACKS:
        return (double)r->n_false_tracks;
    case DRIVE_DELAY:
        return drive_mean(&r->delay);
    case DRIVE_DELAY_WORST:
        return r->delay.n ? r->worst_delay_s : NAN;
    case DRIVE_LEAD:
        return drive_mean(&r->lead);
    case DRIVE_POSITION:
        return drive_rms(&r->position2);
    default:
        return drive_rms(&r->velocity2);
    }
}

double drive_false_per_hour(const struct drive_result *r)
{
    return (double)r->n_false_tracks * S_PER_HOUR / r->seconds;
}

double drive_false_per_hour_bound(const struct drive_result *r)
{
    return poisson_bound(r->n_false_tracks, DRIVE_CONFIDENCE) * S_PER_HOUR / r->seconds;
}

/* -- several ----------------------------------------------------------------------------
 */
void drive_tally_init(struct drive_tally *t)
{
    *t = (struct drive_tally){.n = 0};
    for (int i = 0; i < DRIVE_FIGURES; i++)
        t->worst[i] = NAN;
}

static void pool(struct drive_sum *into, const struct drive_sum *s)
{
    into->sum += s->sum;
    into->n += s->n;
}

static void add_sums(struct drive_result *all, const struct drive_result *r)
{
    pool(&all->gospa, &r->gospa);
    pool(&all->ospa, &r->ospa);
    pool(&all->localisation, &r->localisation);
    pool(&all->missed, &r->missed);
    pool(&all->false_ones, &r->false_ones);
    pool(&all->position2, &r->position2);
    pool(&all->velocity2, &r->velocity2);
    pool(&all->seen, &r->seen);
    pool(&all->seen_far, &r->seen_far);
    pool(&all->told, &r->told);
    pool(&all->told_far, &r->told_far);
    pool(&all->delay, &r->delay);
    pool(&all->lead, &r->lead);
}

static void add_certainty(struct drive_result *all, const struct drive_result *r)
{
    for (size_t b = 0; b < DRIVE_BINS; b++) {
        all->existence[b].stated += r->existence[b].stated;
        all->existence[b].n += r->existence[b].n;
        all->existence[b].n_true += r->existence[b].n_true;
    }
    for (size_t c = 0; c < DRIVE_CLASSES; c++) {
        pool(&all->nees[c].sum, &r->nees[c].sum);
        all->nees[c].n_within += r->nees[c].n_within;
    }
}

void drive_tally_add(struct drive_tally *t, const struct drive_result *r)
{
    t->n++;
    add_sums(&t->all, r);
    add_certainty(&t->all, r);
    t->all.seconds += r->seconds;
    t->all.n_lists += r->n_lists;
    t->all.worst_delay_s = fmax(t->all.worst_delay_s, r->worst_delay_s);
    t->all.n_entries += r->n_entries;
    t->all.n_late += r->n_late;
    t->all.n_false_tracks += r->n_false_tracks;
    for (int i = 0; i < DRIVE_FIGURES; i++) { /* fmin and fmax pass NaN over */
        double x = drive_figure(r, (enum drive_figure)i);
        t->worst[i] = figures[i].more_is_better ? fmin(t->worst[i], x)
                                                : fmax(t->worst[i], x);
    }
}
