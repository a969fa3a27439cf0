#include <inttypes.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>

#include "nodes/anlos/calibrate/calibrate.h"
#include "nodes/anlos/calibrate/diagnosis.h"
#include "nodes/anlos/calibrate/state.h"

#define MOST_LINES 64 /* of more channels only those with a fault are shown */

/* "dead, answers as 3" */
static void print_state(size_t i, const struct diagnosis_channel *c)
{
    char state[STATE_SIZE];
    bool elsewhere = c->answers_as != i;
    if (c->faults || !elsewhere)
        printf("%s", state_print(c->faults, state));
    if (elsewhere)
        printf("%sanswers as %zu", c->faults ? ", " : "", c->answers_as);
    if (c->not_finite)
        printf(", %" PRIu64 " samples are no number", c->not_finite);
}

static void print_channel(const char *kind, size_t i, const struct diagnosis_channel *c,
                          bool has_noise)
{
    printf("  %-10s %3zu  ", kind, i);
    if (isfinite(c->level_db))
        printf("%+7.1f dB  ", c->level_db);
    else
        printf("%7s     ", "-");
    if (has_noise && isfinite(c->noise) && c->noise > 0.0)
        printf("%+7.1f dB  ", 20.0 * log10(c->noise));
    else
        printf("%7s     ", "-");
    if (isfinite(c->overtone))
        printf("%6.1f %%  ", 100.0 * c->overtone);
    else
        printf("%6s    ", "-");
    print_state(i, c);
    if (c->clipped_pings)
        printf(" (while %zu speakers emit)", c->clipped_pings);
    printf("\n");
}

static void print_kind(const char *kind, const struct diagnosis_channel *c, size_t n,
                       const struct diagnosis *d)
{
    bool all = d->n_speakers + d->n_microphones <= MOST_LINES;
    for (size_t i = 0; i < n; i++)
        if (all || c[i].faults || c[i].answers_as != i)
            print_channel(kind, i, &c[i], d->has_noise);
}

static void print(const struct session *s, struct diagnosis *d)
{
    printf("channels of %s, %zu takes\n", s->options->array, s->options->takes);
    printf("  %-10s %3s  %10s  %10s  %8s  state\n", "", "", "level", "noise", "overtone");
    print_kind("speaker", d->speakers, d->n_speakers, d);
    print_kind("microphone", d->microphones, d->n_microphones, d);
    if (!d->has_noise)
        printf("  noise cannot be told: %s\n",
               s->options->takes > 1 ? "all takes are the same" : "that takes --takes 2");
    if (!d->has_overtones)
        printf("  overtones cannot be told of this chirp\n");
    if (d->either_swapped)
        printf(
            "  or the speakers are right and the microphones swapped in like manner\n");
    session_print_retaken(d->retaken);
}

static bool is_bad(size_t i, const struct diagnosis_channel *c)
{
    return c->faults & ~(unsigned)CALIBRATION_INVERTED || c->answers_as != i ||
           c->not_finite;
}

struct count {
    size_t all, corrected, bad;
};

static void count(const struct diagnosis_channel *c, size_t n, struct count *out)
{
    for (size_t i = 0; i < n; i++) {
        bool bad = is_bad(i, &c[i]);
        out->all++;
        out->bad += bad;
        out->corrected += !bad && c[i].faults;
    }
}

static void name_bad(const char *kind, const struct diagnosis_channel *c, size_t n,
                     const char **joint)
{
    for (size_t i = 0; i < n; i++) {
        if (!is_bad(i, &c[i]))
            continue;
        printf("%s%s %zu (", *joint, kind, i);
        print_state(i, &c[i]);
        printf(")");
        *joint = ", ";
    }
}

static bool judge(const struct diagnosis *d, const char *file)
{
    struct count n = {0, 0, 0};
    const char *joint = "";
    count(d->speakers, d->n_speakers, &n);
    count(d->microphones, d->n_microphones, &n);
    if (!n.bad) {
        printf("good: all %zu channels are alive and in their places%s; it is in %s\n",
               n.all, n.corrected ? ", the inverted ones will be set right" : "", file);
        return true;
    }
    printf("bad: %zu of %zu channels have a fault: ", n.bad, n.all);
    name_bad("speaker", d->speakers, d->n_speakers, &joint);
    name_bad("microphone", d->microphones, d->n_microphones, &joint);
    printf("\nwith %s dead and noisy ones are left out and inverted ones set right; what "
           "answers from another place has to be rewired\n",
           file);
    return false;
}

static void keep(struct calibration *c, const struct diagnosis *d)
{
    for (size_t j = 0; j < d->n_speakers; j++)
        c->speakers[j].faults = d->speakers[j].faults;
    for (size_t m = 0; m < d->n_microphones; m++)
        c->microphones[m].faults = d->microphones[m].faults;
    c->has_channels = true;
}

int calibrate_channels(struct session *s, bool *good)
{
    struct sounding *sounding;
    struct diagnosis d = {0};
    int err = session_check(s);
    if (!err)
        err = sounding_take(&sounding, s->array, s->options->position, SIZE_MAX,
                            s->options->takes, &s->why);
    if (err)
        return err;
    err = diagnosis_make(&d, sounding, session_speed_m_s(s), &s->why);
    sounding_destroy(sounding);
    if (!err) {
        print(s, &d);
        keep(s->calibration, &d);
        err = session_save(s);
    }
    if (!err)
        *good = judge(&d, s->options->out);
    diagnosis_clear(&d);
    return err;
}
