#include "nodes/anlos/calibrate/wiring.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/channels.h"

#define TOLERANCE_M                                                                      \
    0.015 /* elements are not farther from where the survey has them; the                \
             arrivals' spread says nothing, for swaps make it wide */

struct wiring {
    const struct diagnosis *d;
    const struct path *paths;
    double speed_m_s, tolerance_s;
    double *heard, *expected; /* [n][n_others] */
};

/* out [n] of one kind, when the channels of the other lead to others_as[n_others]
 * (NULL: to their own elements). */
static int order(const struct wiring *w, bool microphones, const size_t *others_as,
                 struct channel_place *out)
{
    const struct diagnosis *d = w->d;
    size_t n = microphones ? d->n_microphones : d->n_speakers;
    size_t n_others = microphones ? d->n_speakers : d->n_microphones;
    for (size_t i = 0; i < n; i++)
        for (size_t o = 0; o < n_others; o++) {
            size_t at = others_as ? others_as[o] : o;
            size_t pair = microphones ? o * d->n_microphones + i
                                      : i * d->n_microphones + o;
            size_t place = microphones ? at * d->n_microphones + i
                                       : i * d->n_microphones + at;
            const struct diagnosis_channel *other = microphones ? &d->speakers[o]
                                                                : &d->microphones[o];
            const struct path *p = &w->paths[pair];
            bool counts = p->heard && !(other->faults & CALIBRATION_DEAD);
            w->heard[i * n_others + o] =
                counts ? p->arrival.time_s - d->time_zero.latency_s : NAN;
            w->expected[i * n_others + o] = w->paths[place].distance_m / w->speed_m_s;
        }
    return channel_order_find(n, n_others, w->heard, w->expected, w->tolerance_s, out);
}

/* Do all channels lead to their own elements? */
static bool take_map(const struct channel_place *places, size_t n, size_t *map)
{
    bool own = true;
    for (size_t i = 0; i < n; i++) {
        map[i] = places[i].answers_as;
        own &= map[i] == i;
    }
    return own;
}

struct maps {                                   /* where channels lead, [n] each */
    size_t *speakers, *microphones;             /* the others taken as they are */
    size_t *speakers_given, *microphones_given; /* the others' map taken */
    bool own_speakers, own_microphones;         /* nothing is swapped, then */
    bool own_speakers_given, own_microphones_given;
};

static int find_maps(const struct wiring *w, struct maps *m, struct channel_place *places)
{
    size_t n_speakers = w->d->n_speakers, n_microphones = w->d->n_microphones;
    if (order(w, false, NULL, places) < 0)
        return -ENOMEM;
    m->own_speakers = take_map(places, n_speakers, m->speakers);
    if (order(w, true, NULL, places) < 0)
        return -ENOMEM;
    m->own_microphones = take_map(places, n_microphones, m->microphones);
    if (order(w, false, m->microphones, places) < 0)
        return -ENOMEM;
    m->own_speakers_given = take_map(places, n_speakers, m->speakers_given);
    if (order(w, true, m->speakers, places) < 0)
        return -ENOMEM;
    m->own_microphones_given = take_map(places, n_microphones, m->microphones_given);
    return 0;
}

/* The explanation with fewest swaps: those of one kind, if they leave the other kind in
 * its places. */
static void choose(struct diagnosis *d, const struct maps *m)
{
    bool by_speakers = m->own_microphones_given, by_microphones = m->own_speakers_given;
    bool swapped = !m->own_speakers && !m->own_microphones;
    bool speakers = by_speakers || !by_microphones;
    d->either_swapped = swapped && by_speakers && by_microphones;
    for (size_t j = 0; j < d->n_speakers; j++)
        d->speakers[j].answers_as = speakers ? m->speakers[j] : j;
    for (size_t i = 0; i < d->n_microphones; i++)
        d->microphones[i].answers_as = speakers ? m->microphones_given[i]
                                                : m->microphones[i];
}

int wiring_find(struct diagnosis *d, const struct path *paths, double speed_m_s)
{
    size_t n = d->n_speakers + d->n_microphones;
    size_t *indices = malloc(2 * n * sizeof *indices);
    struct channel_place *places = malloc(n * sizeof *places);
    struct wiring w = {.d = d,
                       .paths = paths,
                       .speed_m_s = speed_m_s,
                       .tolerance_s = TOLERANCE_M / speed_m_s};
    w.heard = malloc(d->n_speakers * d->n_microphones * sizeof *w.heard);
    w.expected = malloc(d->n_speakers * d->n_microphones * sizeof *w.expected);
    int err = indices && places && w.heard && w.expected ? 0 : -ENOMEM;
    if (!err) {
        struct maps m = {.speakers = indices,
                         .speakers_given = indices + d->n_speakers,
                         .microphones = indices + 2 * d->n_speakers,
                         .microphones_given = indices + 2 * d->n_speakers +
                                              d->n_microphones};
        err = find_maps(&w, &m, places);
        if (!err)
            choose(d, &m);
    }
    free(w.expected);
    free(w.heard);
    free(places);
    free(indices);
    return err;
}
