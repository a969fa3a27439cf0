/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/score/drive_result.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/list.h"

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
    int err = list_grow(&m->at, m->n, &m->room, sizeof *m->at);

    if (!err)
        m->at[m->n++] = *moment;
    return err;
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

/* What is drawn from one sum: its mean, or of squares the root of that. */
static const struct figure {
    const char *name;
    bool more_is_better, squares;
    size_t sum; /* where it stands in struct drive_result; 0: made of something else */
} figures[DRIVE_FIGURES] = {
#define SUM(name) offsetof(struct drive_result, name)
    [DRIVE_GOSPA] = {"gospa_m", false, false, SUM(gospa)},
    [DRIVE_OSPA] = {"ospa_m", false, false, SUM(ospa)},
    [DRIVE_LOCALISATION] = {"localisation_m", false, false, SUM(localisation)},
    [DRIVE_MISSED] = {"missed_m", false, false, SUM(missed)},
    [DRIVE_FALSE] = {"false_m", false, false, SUM(false_ones)},
    [DRIVE_SEEN] = {"detection_probability", true, false, SUM(seen)},
    [DRIVE_SEEN_FAR] = {"detection_probability_far", true, false, SUM(seen_far)},
    [DRIVE_TOLD] = {"told", true, false, SUM(told)},
    [DRIVE_TOLD_FAR] = {"told_far", true, false, SUM(told_far)},
    [DRIVE_FALSE_TRACKS] = {"false_tracks", false, false, 0},
    [DRIVE_DELAY] = {"echo_to_track_s", false, false, SUM(delay)},
    [DRIVE_DELAY_WORST] = {"echo_to_track_worst_s", false, false, 0},
    [DRIVE_LEAD] = {"lead_before_sight_s", true, false, SUM(lead)},
    [DRIVE_POSITION] = {"position_rms_m", false, true, SUM(position2)},
    [DRIVE_VELOCITY] = {"velocity_rms_m_s", false, true, SUM(velocity2)},
#undef SUM
};

const char *drive_figure_name(enum drive_figure which)
{
    return figures[which].name;
}

static const struct drive_sum *sum_of(const struct drive_result *r,
                                      const struct figure *f)
{
    return (const void *)((const char *)r + f->sum);
}

double drive_figure(const struct drive_result *r, enum drive_figure which)
{
    const struct figure *f = &figures[which];

    if (which == DRIVE_FALSE_TRACKS)
        return (double)r->n_false_tracks;
    if (which == DRIVE_DELAY_WORST)
        return r->delay.n ? r->worst_delay_s : NAN;
    return f->squares ? drive_rms(sum_of(r, f)) : drive_mean(sum_of(r, f));
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
    add_certainty(&t->all, r);
    t->all.seconds += r->seconds;
    t->all.n_lists += r->n_lists;
    t->all.worst_delay_s = fmax(t->all.worst_delay_s, r->worst_delay_s);
    t->all.n_entries += r->n_entries;
    t->all.n_late += r->n_late;
    t->all.n_false_tracks += r->n_false_tracks;
    for (int i = 0; i < DRIVE_FIGURES; i++) { /* fmin and fmax pass NaN over */
        const struct figure *f = &figures[i];
        double x = drive_figure(r, (enum drive_figure)i);
        t->worst[i] = f->more_is_better ? fmin(t->worst[i], x) : fmax(t->worst[i], x);
        if (f->sum)
            pool((void *)((char *)&t->all + f->sum), sum_of(r, f));
    }
}
