/* SPDX-License-Identifier: MIT */
#include "recon/detection/lobes.h"

#include <math.h>
#include <stdbool.h>

#define PAIRS    2048 /* at most so many are asked */
#define WINDOW   16.0 /* of an echo, times one over the band */
#define FAINTER  3.0  /* dB by which a lobe may be brighter than what makes it */
#define BESIDE_M 0.15 /* length of a pulse, and of what it comes back from */
/* By which the spectra of objects differ: small ones echo with f^2. */
#define REAL_DB 6.0
/* How often there is one, over how differently they lack what is low. */
#define LOBE    0.1
#define LOBE_DB 20.0 /* from which on that is a lobe's */
/* The first sidelobe of a point is 18 dB below it, any other 24 or more
 * (launch/accuracy.md): these are fainter than that by 6 dB; so far even odds. */
#define OTHERS_DB 4.0

enum { TONES = 8, LOW = 1, HIGH = 5, WIDE = 2 }; /* compared; the ends are the window's */

struct tones {
    double hz[TONES];
    double complex sum[TONES]; /* of all pairs, in step */
};

static void listen(const struct trace_set *set, size_t trace, const double at_m[3],
                   struct tones *t)
{
    const struct trace_format *f = &set->format;
    const float complex *y = set->traces + trace * f->n_samples;
    double speaker[3], microphone[3];

    geometry_pair(set->geometry, trace, speaker, microphone);
    double delay_s =
        (geometry_distance(speaker, at_m) + geometry_distance(microphone, at_m)) /
        set->geometry->sound_speed_m_s;
    double half = 0.5 * WINDOW * f->rate_hz / (set->band_hz[1] - set->band_hz[0]);
    double middle = (delay_s - f->t0_s) * f->rate_hz;
    double first = fmax(ceil(middle - half), 0.0);
    double last = fmin(floor(middle + half), (double)f->n_samples - 1.0);
    for (int k = 0; k < TONES; k++) {
        double beat = -2.0 * M_PI * (t->hz[k] - f->carrier_hz) / f->rate_hz;
        double complex turn = cexp(I * beat), x = 0.0;
        double complex phase =
            cexp(I * (2.0 * M_PI * f->carrier_hz * delay_s + beat * (first - middle)));
        for (size_t n = (size_t)first; (double)n <= last; n++, phase *= turn) {
            double w = 0.5 + 0.5 * cos(M_PI * ((double)n - middle) / half);
            x += w * phase * y[n];
        }
        t->sum[k] += x;
    }
}

/* power [TONES] of a place, all pairs in step. */
static void ask(const struct trace_set *set, const double at_m[3], double power[TONES])
{
    size_t n = set->geometry->n_positions * trace_set_pairs(set);
    size_t step = n / PAIRS + 1;
    struct tones t = {.sum = {0.0}};

    while (step > 1 && n % step == 0) /* or a pattern of the array would be asked */
        step++;
    for (int k = 0; k < TONES; k++)
        t.hz[k] = set->band_hz[0] +
                  (set->band_hz[1] - set->band_hz[0]) * (k + 0.5) / TONES;
    for (size_t q = 0; q < n; q += step)
        if (set->heard[q])
            listen(set, q, at_m, &t);
    for (int k = 0; k < TONES; k++)
        power[k] = creal(t.sum[k] * conj(t.sum[k]));
}

/* By how much less of g than of p is heard low in the band than high: at most 0. */
static double lacks_db(const double g[TONES], const double p[TONES])
{
    double low = 0.0, high = 0.0;

    for (int k = 0; k < WIDE; k++) {
        low += p[LOW + k] > 0.0 ? g[LOW + k] / p[LOW + k] : 0.0;
        high += p[HIGH + k] > 0.0 ? g[HIGH + k] / p[HIGH + k] : 0.0;
    }
    return low > 0.0 && high > 0.0 ? fmin(10.0 * log10(low / high), 0.0) : 0.0;
}

static bool reaches(const double p_m[3], const double g_m[3], const double low[3],
                    const double high[3])
{
    double range_p = 0.0, range_g = 0.0, u_p[3], u_g[3], walk_m = BESIDE_M;

    for (int a = 0; a < 3; a++) {
        u_p[a] = p_m[a] - 0.5 * (low[a] + high[a]);
        u_g[a] = g_m[a] - 0.5 * (low[a] + high[a]);
        range_p = hypot(range_p, u_p[a]);
        range_g = hypot(range_g, u_g[a]);
    }
    for (int a = 0; a < 3; a++)
        walk_m += 0.5 * (high[a] - low[a]) *
                  fabs(u_p[a] / fmax(range_p, 1e-9) - u_g[a] / fmax(range_g, 1e-9));
    return fabs(range_p - range_g) < walk_m;
}

bool lobes_reach(const struct geometry *g, const double from_m[3], const double to_m[3])
{
    double low[3], high[3];

    geometry_aperture(g, low, high);
    return reaches(from_m, to_m, low, high);
}

static bool may_make(const struct detection *p, const struct detection *g,
                     const double low[3], const double high[3])
{
    return p->level_db > g->level_db - FAINTER &&
           reaches(p->position_m, g->position_m, low, high);
}

void lobes_judge(const struct trace_set *set, struct detection *found, size_t n)
{
    double low[3], high[3], power[LOBES_MAX][TONES];
    bool asked[LOBES_MAX] = {false};

    n = n < LOBES_MAX ? n : LOBES_MAX;
    geometry_aperture(set->geometry, low, high);
    for (size_t g = 0; g < n; g++) {
        double db = 0.0;
        for (size_t p = 0; p < n; p++) {
            if (p == g || !may_make(&found[p], &found[g], low, high))
                continue;
            const size_t both[2] = {p, g};
            for (int i = 0; i < 2; i++)
                if (!asked[both[i]])
                    ask(set, found[both[i]].position_m, power[both[i]]);
            asked[p] = asked[g] = true;
            db = fmin(db, lacks_db(power[g], power[p]));
        }
        double object = exp(-0.5 * db * db / (REAL_DB * REAL_DB));
        double lobe = LOBE * fmin(-db / LOBE_DB, 1.0);
        found[g].existence *= object / (object + lobe);
    }
}

void lobes_suspect(const struct geometry *g, struct detection *found, size_t n)
{
    double low[3], high[3];

    geometry_aperture(g, low, high);
    for (size_t i = 0; i < n; i++) {
        double most = 0.0;
        for (size_t p = 0; p < n; p++) {
            double fainter_db = found[p].level_db - found[i].level_db;
            if (p != i && found[p].at_border && may_make(&found[p], &found[i], low, high))
                most =
                    fmax(most, 1.0 / (1.0 + pow(10.0, (OTHERS_DB - fainter_db) / 5.0)));
        }
        found[i].existence *= 1.0 - most;
    }
}
