/* SPDX-License-Identifier: MIT */
#include "recon/frontend/own_sound.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"
#include "dsp/vector.h"

#define LOUD 16.0f /* 12 dB over what comes before */

enum {
    ROUNDS = 9, /* 3.5 s of sixteen speakers */
    FEWEST = 3, /* of which one may be spoiled */
    SPREAD = 3, /* samples, to each side of what is loud: its pulse */
    LANES = 16
};

struct own_sound {
    size_t n_speakers, n_microphones, n_samples, behind;
    bool *known;    /* [n_microphones], what was subtracted from the newest ping */
    size_t *learnt; /* [n_speakers][n_microphones], rounds */
    float *rounds;  /* [n_speakers][n_microphones][ROUNDS][n_samples][re, im] */
    float *heard;   /* [n_samples][re, im], before it is subtracted from */
    float *power;   /* [n_microphones] */
};

int own_sound_create(struct own_sound **out, size_t n_speakers, size_t n_microphones,
                     size_t n_samples, size_t behind)
{
    if (!n_speakers || !n_microphones || !n_samples || behind > n_samples)
        return -EINVAL;
    struct own_sound *o = calloc(1, sizeof *o);
    if (!o)
        return -ENOMEM;
    *o = (struct own_sound){.n_speakers = n_speakers,
                            .n_microphones = n_microphones,
                            .n_samples = n_samples,
                            .behind = behind};
    o->known = calloc(n_microphones, sizeof *o->known);
    o->learnt = calloc(n_speakers * n_microphones, sizeof *o->learnt);
    o->rounds =
        calloc(n_speakers * n_microphones, ROUNDS * 2 * n_samples * sizeof *o->rounds);
    o->heard = calloc(2 * n_samples, sizeof *o->heard);
    o->power = calloc(n_microphones, sizeof *o->power);
    if (!o->known || !o->learnt || !o->rounds || !o->heard || !o->power) {
        own_sound_destroy(o);
        return -ENOMEM;
    }
    *out = o;
    return 0;
}

void own_sound_destroy(struct own_sound *o)
{
    if (!o)
        return;
    free(o->known);
    free(o->learnt);
    free(o->rounds);
    free(o->heard);
    free(o->power);
    free(o);
}

static inline void order(float *restrict a, float *restrict b)
{
    for (int i = 0; i < LANES; i++) {
        float less = a[i] < b[i] ? a[i] : b[i];
        b[i] = a[i] < b[i] ? b[i] : a[i];
        a[i] = less;
    }
}

/* x[n] -= the median of nine, by comparing pairs of them in an order that leaves it in
 * the middle (Paeth 1990, "Median finding on a 3 x 3 grid"). */
VECTOR_CLONES
static void subtract_median(float *restrict x, const float *restrict rounds, size_t n)
{
    static const unsigned char pairs[][2] = {
        {1, 2}, {4, 5}, {7, 8}, {0, 1}, {3, 4}, {6, 7}, {1, 2}, {4, 5}, {7, 8}, {0, 3},
        {5, 8}, {4, 7}, {3, 6}, {1, 4}, {2, 5}, {4, 7}, {4, 2}, {6, 4}, {4, 2}};
    float p[ROUNDS][LANES];

    for (size_t first = 0; first < n; first += LANES) {
        size_t lanes = n - first < LANES ? n - first : LANES;
        memset(p, 0, sizeof p);
        for (int r = 0; r < ROUNDS; r++)
            memcpy(p[r], rounds + (size_t)r * n + first, lanes * sizeof **p);
        for (size_t i = 0; i < sizeof pairs / sizeof *pairs; i++)
            order(p[pairs[i][0]], p[pairs[i][1]]);
        for (size_t i = 0; i < lanes; i++)
            x[first + i] -= p[ROUNDS / 2][i];
    }
}

/* The newest, its n-th, takes the place of the oldest; as long as there are fewer than
 * ROUNDS they stand for the others, too. */
static void learn(const struct own_sound *o, size_t n, float *rounds)
{
    size_t each = 2 * o->n_samples;

    memcpy(rounds + n % ROUNDS * each, o->heard, each * sizeof *rounds);
    for (size_t r = n + 1; r < ROUNDS; r++)
        memcpy(rounds + r * each, rounds + r % (n + 1) * each, each * sizeof *rounds);
}

void own_sound_subtract(struct own_sound *o, size_t speaker, bool moves,
                        const bool *masked, float complex *traces)
{
    size_t each = 2 * o->n_samples;

    for (size_t m = 0; m < o->n_microphones; m++) {
        size_t pair = speaker * o->n_microphones + m;
        float *x = (float *)(traces + m * o->n_samples);
        float *rounds = o->rounds + pair * ROUNDS * each;
        o->known[m] = o->learnt[pair] >= FEWEST;
        if (masked[m])
            continue;
        memcpy(o->heard, x, each * sizeof *o->heard);
        if (o->known[m])
            subtract_median(x, rounds, each);
        if (moves)
            learn(o, o->learnt[pair]++, rounds);
    }
}

static float power(float complex x)
{
    return crealf(x) * crealf(x) + cimagf(x) * cimagf(x);
}

/* Of what comes before: in its later half, of the microphone in their middle. */
static float power_before(struct own_sound *o, const float complex *traces)
{
    size_t from = o->behind / 2;

    for (size_t m = 0; m < o->n_microphones; m++) {
        const float complex *x = traces + m * o->n_samples;
        o->power[m] = 0.0f;
        for (size_t k = from; k < o->behind; k++)
            o->power[m] += power(x[k]) / (float)(o->behind - from);
    }
    return rank_smallest(o->power, o->n_microphones, o->n_microphones / 2 + 1);
}

void own_sound_mute(struct own_sound *o, float complex *traces)
{
    size_t n = o->n_samples - o->behind;
    float loud = LOUD * power_before(o, traces);

    for (size_t m = 0; m < o->n_microphones; m++) {
        float complex *x = traces + m * o->n_samples + o->behind;
        float most = o->known[m] ? loud : -1.0f;
        size_t until = 0;
        for (size_t ahead = 0; ahead < n + SPREAD; ahead++) {
            if (ahead < n && power(x[ahead]) > most)
                until = ahead + SPREAD + 1;
            if (ahead >= SPREAD && ahead - SPREAD < until)
                x[ahead - SPREAD] = 0.0f;
        }
    }
}
