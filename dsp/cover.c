/* SPDX-License-Identifier: MIT */
#include "dsp/cover.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/rank.h"

struct pair {
    double spread_db;          /* of sound over the way */
    double learnt_db;          /* its first levels: a sum while n < COVER_ROUNDS */
    double usual_db;           /* without cover; NaN: not known */
    double level_db, noise_db; /* of the newest ping */
    unsigned n;
    bool heard; /* once */
};

struct element {
    bool covered;
};

struct speaker {
    struct element element;
    double drop_db;    /* when it sounded last; 0: none, or not known */
    double nearest_db; /* of its pairs the loudest, as usual; -INFINITY: none is known */
};

struct cover {
    size_t n_speakers, n_microphones;
    struct pair *pairs; /* [n_speakers][n_microphones] */
    struct speaker *speakers;
    struct element *microphones;
    double *scratch; /* [n_speakers * n_microphones] */
    double most_db;
};

int cover_create(struct cover **out, size_t n_speakers, size_t n_microphones,
                 const double *distance_m, double most_db)
{
    size_t n = n_speakers * n_microphones;

    *out = NULL;
    for (size_t i = 0; i < n; i++)
        if (!(distance_m[i] > 0.0))
            return -EINVAL;
    struct cover *c = n ? calloc(1, sizeof *c) : NULL;
    if (!c)
        return n ? -ENOMEM : -EINVAL;
    *c = (struct cover){
        .n_speakers = n_speakers, .n_microphones = n_microphones, .most_db = most_db};
    c->pairs = calloc(n, sizeof *c->pairs);
    c->speakers = calloc(n_speakers, sizeof *c->speakers);
    c->microphones = calloc(n_microphones, sizeof *c->microphones);
    c->scratch = calloc(n, sizeof *c->scratch);
    if (!c->pairs || !c->speakers || !c->microphones || !c->scratch) {
        cover_destroy(c);
        return -ENOMEM;
    }
    for (size_t i = 0; i < n; i++) {
        c->pairs[i].spread_db = -20.0 * log10(distance_m[i]);
        c->pairs[i].usual_db = NAN;
    }
    for (size_t j = 0; j < n_speakers; j++)
        c->speakers[j].nearest_db = -INFINITY;
    *out = c;
    return 0;
}

static bool is_learnt(const struct pair *p)
{
    return p->n == COVER_ROUNDS;
}

/* True: that was the last that it took. */
static bool learn(struct pair *p)
{
    if (is_learnt(p))
        return false;
    p->learnt_db += p->level_db / COVER_ROUNDS;
    p->n++;
    return is_learnt(p);
}

/* Once most are known: what does not fit the others was covered from the start. */
static void find_usual(struct cover *c)
{
    size_t n = 0, all = c->n_speakers * c->n_microphones;

    for (size_t i = 0; i < all; i++)
        if (is_learnt(&c->pairs[i]))
            c->scratch[n++] = c->pairs[i].learnt_db - c->pairs[i].spread_db;
    double common_db = rank_median(c->scratch, n);
    for (size_t i = 0; i < all; i++) {
        struct pair *p = &c->pairs[i];
        struct speaker *s = &c->speakers[i / c->n_microphones];
        double expected_db = common_db + p->spread_db;
        if (i % c->n_microphones == 0)
            s->nearest_db = -INFINITY;
        if (!is_learnt(p))
            continue;
        p->usual_db = expected_db - p->learnt_db > COVER_START_DB ? expected_db
                                                                  : p->learnt_db;
        s->nearest_db = fmax(s->nearest_db, p->usual_db);
    }
}

/* Only those tell that stand out of noise: of a speaker its loudest and what is not much
 * less. */
static bool tells(const struct cover *c, size_t pair)
{
    const struct pair *p = &c->pairs[pair];
    const struct speaker *s = &c->speakers[pair / c->n_microphones];

    return p->heard && p->usual_db - p->noise_db > COVER_AUDIBLE_DB &&
           p->usual_db >= s->nearest_db - COVER_NEAR_DB;
}

/* The drop of a row or a column of pairs.  *heard: it is heard at all.  NaN: nothing
 * tells. */
static double drop_db(struct cover *c, size_t first, size_t stride, size_t n,
                      bool of_microphone, bool *heard)
{
    size_t n_used = 0;

    *heard = false;
    for (size_t i = 0; i < n; i++) {
        size_t at = first + i * stride;
        const struct pair *p = &c->pairs[at];
        if (!tells(c, at))
            continue;
        if (of_microphone && c->speakers[at / c->n_microphones].drop_db > COVER_FREE_DB)
            continue;
        c->scratch[n_used++] = p->usual_db - p->level_db;
        *heard |= p->level_db - p->noise_db > COVER_AUDIBLE_DB;
    }
    return rank_median(c->scratch, n_used);
}

static void judge(const struct cover *c, struct element *e, double drop_db, bool heard)
{
    if (isnan(drop_db))
        return;
    e->covered = heard && drop_db < c->most_db &&
                 drop_db > (e->covered ? COVER_FREE_DB : COVER_DROP_DB);
}

void cover_take(struct cover *c, size_t speaker, const double *direct,
                const double *noise, const bool *unfit)
{
    size_t n = c->n_microphones;
    bool heard, learnt = false;

    for (size_t m = 0; m < n; m++) {
        struct pair *p = &c->pairs[speaker * n + m];
        if ((unfit && unfit[m]) || !(direct[m] > 0.0) || !(noise[m] > 0.0))
            continue;
        p->level_db = 10.0 * log10(direct[m]);
        p->noise_db = 10.0 * log10(noise[m]);
        p->heard = true;
        if (p->level_db - p->noise_db > COVER_AUDIBLE_DB)
            learnt |= learn(p);
    }
    if (learnt)
        find_usual(c);
    double drop = drop_db(c, speaker * n, 1, n, false, &heard);
    judge(c, &c->speakers[speaker].element, drop, heard);
    c->speakers[speaker].drop_db = isnan(drop) ? 0.0 : drop;
    for (size_t m = 0; m < n; m++) {
        drop = drop_db(c, m, n, c->n_speakers, true, &heard);
        judge(c, &c->microphones[m], drop, heard);
    }
}

bool cover_speaker(const struct cover *c, size_t speaker)
{
    return c->speakers[speaker].element.covered;
}

bool cover_microphone(const struct cover *c, size_t microphone)
{
    return c->microphones[microphone].covered;
}

bool cover_expects(const struct cover *c, size_t speaker, size_t microphone, double noise)
{
    const struct pair *p = &c->pairs[speaker * c->n_microphones + microphone];

    return !is_learnt(p) || p->usual_db - 10.0 * log10(noise) > COVER_AUDIBLE_DB;
}

double cover_snr_db(const struct cover *c)
{
    double sum = 0.0;
    size_t n = 0;

    for (size_t j = 0; j < c->n_speakers; j++) {
        double most = -INFINITY;
        for (size_t m = 0; m < c->n_microphones; m++) {
            const struct pair *p = &c->pairs[j * c->n_microphones + m];
            if (is_learnt(p))
                most = fmax(most, p->level_db - p->noise_db);
        }
        if (most > -INFINITY) {
            sum += most;
            n++;
        }
    }
    return n ? sum / (double)n : NAN;
}

void cover_destroy(struct cover *c)
{
    if (!c)
        return;
    free(c->pairs);
    free(c->speakers);
    free(c->microphones);
    free(c->scratch);
    free(c);
}
