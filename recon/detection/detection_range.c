/* SPDX-License-Identifier: MIT */
#include "recon/detection/detection_range.h"

#include <math.h>
#include <stdbool.h>

#include "dsp/special.h"

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
