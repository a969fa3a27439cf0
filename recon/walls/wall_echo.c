/* SPDX-License-Identifier: MIT */
#include "recon/walls/wall_echo.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "recon/geometry.h"

#define HISTOGRAM_BINS 512 /* of powers, 0.25 dB each */
#define BIN_DB         0.25
#define FLOOR_DB       (-110.0)
#define ROUGH_BITS     20 /* of a float that do not count: an eighth of an octave */
#define ROUGH_BINS     (1 << (31 - ROUGH_BITS))
#define MEDIAN_OF_MEAN 0.693147 /* of the power of complex noise */
#define BENT_ROUNDS    8        /* of Newton's method, from the flat wall's point */

double wall_echo_lag_s(const struct chirp *chirp)
{
    double middle_hz = 0.5 * (chirp->start_hz + chirp->stop_hz);
    return chirp->duration_s * middle_hz / (chirp->stop_hz - chirp->start_hz);
}

static double power(float complex x)
{
    double re = (double)crealf(x), im = (double)cimagf(x);
    return re * re + im * im;
}

/* Relative to the strongest. */
static size_t bin_of(double p, double strongest)
{
    double bin = (10.0 * log10(p / strongest + 1e-12) - FLOOR_DB) / BIN_DB;
    return !(bin > 0.0) ? 0 : bin > HISTOGRAM_BINS - 1 ? HISTOGRAM_BINS - 1 : (size_t)bin;
}

/* Without a logarithm, and in the same order: exponent and the first bits of a float.
 * What is no number may have a sign, which fabsf need not clear: a square counts as
 * positive. */
static size_t rough_bin_of(double p)
{
    float rough = (float)p;
    uint32_t bits;
    memcpy(&bits, &rough, sizeof bits);
    return (bits & INT32_MAX) >> ROUGH_BITS;
}

/* The bin that the k-th is in, counted from 1; k without those in bins before. */
static size_t find_bin(const unsigned *counts, size_t n_bins, size_t *k)
{
    size_t b = 0;
    for (; b < n_bins - 1 && *k > counts[b]; b++)
        *k -= counts[b];
    return b;
}

/* To a quarter of a decibel, without sorting; logarithms, which are dear, of those alone
 * that may be the middle one. */
static double median_power(const float complex *x, size_t n, double strongest)
{
    unsigned rough[ROUGH_BINS] = {0}, counts[HISTOGRAM_BINS] = {0};
    size_t k = (n + 1) / 2;
    for (size_t i = 0; i < n; i++)
        rough[rough_bin_of(power(x[i]))]++;
    size_t middle = find_bin(rough, ROUGH_BINS, &k);
    for (size_t i = 0; i < n; i++)
        if (rough_bin_of(power(x[i])) == middle)
            counts[bin_of(power(x[i]), strongest)]++;
    double bin = (double)find_bin(counts, HISTOGRAM_BINS, &k);
    return strongest * pow(10.0, 0.1 * (FLOOR_DB + (bin + 0.5) * BIN_DB));
}

/* Where between the samples around i the peak is, -0.5..0.5. */
static double offset_of_peak(const float complex *x, size_t i)
{
    double before = log(power(x[i - 1]) + 1e-300), here = log(power(x[i]) + 1e-300);
    double after = log(power(x[i + 1]) + 1e-300);
    double bend = before - 2.0 * here + after;
    return bend < 0.0 ? 0.5 * (before - after) / bend : 0.0;
}

/* Keeps the `most` strongest; returns how many there are then. */
static size_t keep(struct wall_echo_peak *out, size_t n, size_t most,
                   const struct wall_echo_peak *peak)
{
    if (n < most) {
        out[n] = *peak;
        return n + 1;
    }
    size_t weakest = 0;
    for (size_t i = 1; i < n; i++)
        if (out[i].amplitude < out[weakest].amplitude)
            weakest = i;
    if (out[weakest].amplitude >= peak->amplitude)
        return n;
    memmove(out + weakest, out + weakest + 1, (n - weakest - 1) * sizeof *out);
    out[n - 1] = *peak; /* the latest: the order by delay stays */
    return n;
}

size_t wall_echo_peaks(const struct trace_format *format, const float complex *trace,
                       double sound_speed_m_s, const double path_m[2],
                       double threshold_db, double range_db, struct wall_echo_peak *out,
                       size_t most)
{
    double per_sample_m = sound_speed_m_s / format->rate_hz;
    double start_m = sound_speed_m_s * format->t0_s;
    double first = ceil((path_m[0] - start_m) / per_sample_m);
    double last = floor((path_m[1] - start_m) / per_sample_m);
    last = fmin(last, (double)format->n_samples - 2.0);
    if (!most || !(fmax(first, 1.0) < last))
        return 0;
    size_t from = (size_t)fmax(first, 1.0), to = (size_t)last, n = 0;
    double strongest = 0.0;
    for (size_t i = from; i <= to; i++)
        strongest = fmax(strongest, power(trace[i]));
    if (!(strongest > 0.0))
        return 0;
    double noise = median_power(trace + from, to + 1 - from, strongest) / MEDIAN_OF_MEAN;
    double least = fmax(noise * pow(10.0, 0.1 * threshold_db),
                        strongest * pow(10.0, -0.1 * range_db));
    for (size_t i = from; i <= to; i++) {
        double p = power(trace[i]);
        if (!(p >= least && p > power(trace[i - 1]) && p >= power(trace[i + 1])))
            continue;
        double at = (double)i + offset_of_peak(trace, i);
        const struct wall_echo_peak peak = {start_m + at * per_sample_m, sqrt(p)};
        n = keep(out, n, most, &peak);
    }
    return n;
}

/* q = p mirrored, and v its velocity then. */
static void mirror_moving(const struct wall *w, double p[3], double v[3])
{
    const struct wall through_origin = {
        .normal = {w->normal[0], w->normal[1], w->normal[2]}};
    wall_mirror(w, p, p);
    wall_mirror(&through_origin, v, v);
}

double wall_echo_path_m(const struct wall_echo *e, const struct wall *const *walls,
                        size_t n)
{
    double source[3], v[3], growth = 0.0;
    memcpy(source, e->speaker_m, sizeof source);
    memcpy(v, e->velocity_m_s, sizeof v);
    for (size_t i = 0; i < n; i++)
        mirror_moving(walls[i], source, v);
    double path = geometry_distance(source, e->microphone_m);
    for (int a = 0; a < 3 && path > 0.0; a++)
        growth += (source[a] - e->microphone_m[a]) / path * (v[a] - e->velocity_m_s[a]);
    return path + e->lag_s * growth;
}

/* A way in the plan from (along_m, off_m) before the wall to a point x of it, where it is
 * rise_m farther with this slope: its length and what that changes by with x, twice. */
static double way_to(double along_m, double off_m, double x, double curvature,
                     double *first, double *second)
{
    double slope = curvature * x;
    double off = off_m + 0.5 * slope * x, way = hypot(x - along_m, off);
    double rate = (x - along_m + off * slope) / way;

    *first += rate;
    *second += (1.0 + slope * slope + off * curvature - rate * rate) / way;
    return way;
}

double wall_echo_bent_path_m(const struct wall_echo *e, const struct wall *w,
                             const double about_m[3], double curvature_1_m)
{
    double upright[3], level[3], along[2] = {0.0, 0.0}, off[2], rise_m = 0.0;

    wall_axes(w, upright, level);
    off[0] = off[1] = w->distance_m;
    for (int a = 0; a < 3; a++) {
        along[0] += level[a] * (e->speaker_m[a] - about_m[a]);
        along[1] += level[a] * (e->microphone_m[a] - about_m[a]);
        off[0] -= w->normal[a] * e->speaker_m[a];
        off[1] -= w->normal[a] * e->microphone_m[a];
        rise_m += upright[a] * (e->speaker_m[a] - e->microphone_m[a]);
    }
    double flat = hypot(along[0] - along[1], off[0] + off[1]), bent = flat;
    double x = (along[0] * off[1] + along[1] * off[0]) / (off[0] + off[1]);
    for (int k = 0; k < BENT_ROUNDS; k++) {
        double first = 0.0, second = 0.0;
        bent = way_to(along[0], off[0], x, curvature_1_m, &first, &second) +
               way_to(along[1], off[1], x, curvature_1_m, &first, &second);
        if (!(second > 0.0)) /* bends as much as sound does: a focus */
            break;
        x -= first / second;
    }
    return wall_echo_path_m(e, &w, 1) + hypot(bent, rise_m) - hypot(flat, rise_m);
}
