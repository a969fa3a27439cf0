#include "dsp/cover.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

struct pair {
    double spread_db;          /* of sound over the way */
    double learnt_db;          /* its usual level: a sum while n < COVER_ROUNDS */
    double level_db, noise_db; /* of the newest ping */
    unsigned n;
    bool heard; /* once */
};

struct element {
    bool covered;
    double drop_db; /* of a speaker, when it sounded last; 0: none, or not known */
};

struct cover {
    size_t n_speakers, n_microphones;
    struct pair *pairs; /* [n_speakers][n_microphones] */
    struct element *speakers, *microphones;
    double *scratch; /* [n_speakers * n_microphones] */
    double most_db;
    double common_db; /* level - spread of most pairs; NaN: not known yet */
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
    *c = (struct cover){.n_speakers = n_speakers,
                        .n_microphones = n_microphones,
                        .most_db = most_db,
                        .common_db = NAN};
    c->pairs = calloc(n, sizeof *c->pairs);
    c->speakers = calloc(n_speakers, sizeof *c->speakers);
    c->microphones = calloc(n_microphones, sizeof *c->microphones);
    c->scratch = calloc(n, sizeof *c->scratch);
    if (!c->pairs || !c->speakers || !c->microphones || !c->scratch) {
        cover_destroy(c);
        return -ENOMEM;
    }
    for (size_t i = 0; i < n; i++)
        c->pairs[i].spread_db = -20.0 * log10(distance_m[i]);
    *out = c;
    return 0;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *x, size_t n)
{
    qsort(x, n, sizeof *x, compare);
    return n % 2 ? x[n / 2] : 0.5 * (x[n / 2 - 1] + x[n / 2]);
}

static bool is_learnt(const struct pair *p)
{
    return p->n == COVER_ROUNDS;
}

/* Once most are known: what does not fit the others was covered from the start. */
static void find_common(struct cover *c)
{
    size_t n = 0, all = c->n_speakers * c->n_microphones;

    for (size_t i = 0; i < all; i++)
        if (is_learnt(&c->pairs[i]))
            c->scratch[n++] = c->pairs[i].learnt_db - c->pairs[i].spread_db;
    c->common_db = n ? median(c->scratch, n) : NAN;
}

static void learn(struct cover *c, struct pair *p, double level_db)
{
    if (is_learnt(p))
        return;
    p->learnt_db += level_db / COVER_ROUNDS;
    p->n++;
    if (is_learnt(p))
        find_common(c);
}

/* What the pair has without cover; NaN: not known. */
static double usual_db(const struct cover *c, const struct pair *p)
{
    double expected_db = c->common_db + p->spread_db;

    if (!is_learnt(p))
        return NAN;
    return expected_db - p->learnt_db > COVER_START_DB ? expected_db : p->learnt_db;
}

static bool stands_out(const struct cover *c, const struct pair *p)
{
    return usual_db(c, p) - p->noise_db > COVER_AUDIBLE_DB;
}

/* Of those that tell: a speaker's loudest and what is not much less. */
static double nearest_db(const struct cover *c, size_t speaker)
{
    double most = -INFINITY;

    for (size_t m = 0; m < c->n_microphones; m++)
        most = fmax(most, usual_db(c, &c->pairs[speaker * c->n_microphones + m]));
    return most;
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
        if (!p->heard || !stands_out(c, p) ||
            usual_db(c, p) < nearest_db(c, at / c->n_microphones) - COVER_NEAR_DB)
            continue;
        if (of_microphone && c->speakers[at / c->n_microphones].drop_db > COVER_FREE_DB)
            continue;
        c->scratch[n_used++] = usual_db(c, p) - p->level_db;
        *heard |= p->level_db - p->noise_db > COVER_AUDIBLE_DB;
    }
    return n_used ? median(c->scratch, n_used) : NAN;
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
    bool heard;

    for (size_t m = 0; m < n; m++) {
        struct pair *p = &c->pairs[speaker * n + m];
        if ((unfit && unfit[m]) || !(direct[m] > 0.0) || !(noise[m] > 0.0))
            continue;
        p->level_db = 10.0 * log10(direct[m]);
        p->noise_db = 10.0 * log10(noise[m]);
        p->heard = true;
        if (p->level_db - p->noise_db > COVER_AUDIBLE_DB)
            learn(c, p, p->level_db);
    }
    double drop = drop_db(c, speaker * n, 1, n, false, &heard);
    judge(c, &c->speakers[speaker], drop, heard);
    c->speakers[speaker].drop_db = isnan(drop) ? 0.0 : drop;
    for (size_t m = 0; m < n; m++) {
        drop = drop_db(c, m, n, c->n_speakers, true, &heard);
        judge(c, &c->microphones[m], drop, heard);
    }
}

bool cover_speaker(const struct cover *c, size_t speaker)
{
    return c->speakers[speaker].covered;
}

bool cover_microphone(const struct cover *c, size_t microphone)
{
    return c->microphones[microphone].covered;
}

bool cover_expects(const struct cover *c, size_t speaker, size_t microphone, double noise)
{
    const struct pair *p = &c->pairs[speaker * c->n_microphones + microphone];

    return !is_learnt(p) || usual_db(c, p) - 10.0 * log10(noise) > COVER_AUDIBLE_DB;
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
