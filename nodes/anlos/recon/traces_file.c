/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/recon/traces_file.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/fft.h"
#include "dsp/rank.h"
#include "dsp/stationary.h"
#include "nodes/anlos/mat_file.h"
#include "recon/imaging/imager.h"

#define OVERSAMPLING 2.2              /* rate over band width */
#define MARGIN       0.02             /* of the band, kept on each side */
#define SMOOTH       STATIONARY_PARTS /* the spectrum is looked at in so many parts */
#define FAINTEST     1e-4 /* of the largest power density belongs to the band */
#define SIGMAS       8.0  /* and so many deviations of the noise's mean above it */
#define FLAT         3.0  /* times the faintest tenth: there is nothing but band */
#define TAPER        0.1  /* of a trace, at each end, before its spectrum is looked at */
#define PAD          32   /* samples between a trace's end and its start, at least */

#define WORTH 0.1 /* of the power of echoes: noise that is not worth to be cut */

/* Means of SMOOTH parts of the spectrum, and what a part must have to count. */
static double part_powers(const double *power, size_t n_used, size_t n_spectra,
                          size_t n_parts, double *part)
{
    double ranked[SMOOTH], values = (double)(n_spectra * n_used / n_parts);
    double noise = 1.0 + SIGMAS / sqrt(values); /* each has a deviation as its mean */
    for (size_t p = 0; p < n_parts; p++) {
        size_t from = p * n_used / n_parts, to = (p + 1) * n_used / n_parts;
        part[p] = 0.0;
        for (size_t b = from; b < to; b++)
            part[p] += power[b] / (double)(to - from);
    }
    memcpy(ranked, part, n_parts * sizeof *ranked);
    double most = rank_double(ranked, n_parts, n_parts);
    double floor_power = rank_double(ranked, n_parts, n_parts / 10 + 1);
    if (most < FLAT * floor_power)
        return 0.0;
    return fmax(FAINTEST * most, fmin(noise * floor_power, sqrt(floor_power * most)));
}

int traces_band(const double *power, size_t n, size_t n_used, size_t n_spectra,
                size_t *first, size_t *width)
{
    double part[SMOOTH];
    size_t n_parts = n_used < SMOOTH ? n_used : SMOOTH;
    double least = part_powers(power, n_used, n_spectra, n_parts, part);
    size_t gap = 0, best = 0, end = 0; /* end: the part behind the widest gap */
    if (!(least >= 0.0 && least < INFINITY))
        return -EINVAL;
    bool whole = n_used == n; /* the other half of a real signal's is no gap of its own */
    for (size_t p = 0; p < (whole ? 2 : 1) * n_parts; p++) {
        gap = part[p % n_parts] > least ? 0 : gap + 1;
        if (whole && gap > best && gap <= n_parts) {
            best = gap;
            end = p + 1;
        }
    }
    size_t from = end % n_parts, parts = n_parts - best;
    if (!whole) {
        while (from < n_parts && part[from] <= least)
            from++;
        for (parts = n_parts; parts > from && part[parts - 1] <= least;)
            parts--;
        parts -= from;
    }
    if (!parts || parts > n_parts)
        return -EINVAL;
    *first = from * n_used / n_parts;
    *width = parts * n_used / n_parts;
    return 0;
}

/* -- noise and echoes -------------------------------------------------------------------
 */
struct parts {
    size_t n;
    enum stationary_kind kind[SMOOTH];
    double power[SMOOTH]; /* as it was */
    bool sunk[SMOOTH];
};

/* 0, -EINVAL (traces are too short for it), -ENOMEM. */
static int find_kinds(struct parts *p, const struct traces_raw *r, const bool *masked)
{
    struct stationary *s;

    *p = (struct parts){.n = 0};
    int err = stationary_create(&s, r->n_samples, r->real);
    if (err)
        return err;
    for (size_t k = 0; k < r->n_pings; k++)
        if (!masked[k])
            stationary_take(s, r->traces + k * r->stride, r->step);
    p->n = stationary_parts(s);
    stationary_judge(s, p->kind);
    stationary_destroy(s);
    return 0;
}

/* Marks the noise that stands out of the spectrum.  How much louder than the echoes it
 * is. */
static double find_noise(const struct parts *p, const double *part, double least,
                         bool *noisy)
{
    double echoes = 0.0, noise = 0.0;

    for (size_t q = 0; q < p->n; q++) {
        noisy[q] = p->kind[q] == STATIONARY_NOISE && part[q] > least;
        echoes += p->kind[q] == STATIONARY_ECHOES ? part[q] : 0.0;
        noise += noisy[q] ? part[q] : 0.0;
    }
    return echoes > 0.0 && least > 0.0 ? noise / echoes : 0.0;
}

/* power [n]: where noise stands out it sinks to the floor; then what it outshone, such as
 * its own flanks, stands out. */
static void sink_noise(struct parts *p, double *power, size_t n_used, size_t n_spectra)
{
    double part[SMOOTH], floor_power = INFINITY;
    bool noisy[SMOOTH], more = true;

    double least = part_powers(power, n_used, n_spectra, p->n, part);
    memcpy(p->power, part, sizeof part);
    if (find_noise(p, part, least, noisy) < WORTH)
        return;
    for (size_t q = 0; q < p->n; q++)
        floor_power = fmin(floor_power, part[q]);
    while (more) {
        more = false;
        for (size_t q = 0; q < p->n; q++) {
            if (!noisy[q] || p->sunk[q])
                continue;
            size_t to = (q + 1) * n_used / p->n;
            for (size_t b = q * n_used / p->n; b < to; b++)
                power[b] = fmin(power[b], floor_power);
            p->sunk[q] = more = true;
        }
        least = part_powers(power, n_used, n_spectra, p->n, part);
        find_noise(p, part, least, noisy);
    }
}

/* Of n parts the lower end of one, or the upper end of the last; parts in the upper half
 * of complex traces lie below the carrier. */
static double edge_hz(const struct traces_raw *r, size_t n, size_t edge, bool upper)
{
    double turns = (double)edge / (double)n * (r->real ? 0.5 : 1.0);

    return r->carrier_hz + (turns - (upper ? 1.0 : 0.0)) * r->rate_hz;
}

static void add_island(struct traces_file *t, double from_hz, double to_hz)
{
    size_t last = t->n_cut - 1;

    if (t->n_cut && last < TRACES_MAX_CUT && t->cut[last].to_hz >= from_hz)
        t->cut[last].to_hz = to_hz;
    else if (t->n_cut++ < TRACES_MAX_CUT)
        t->cut[last + 1] = (struct traces_island){from_hz, to_hz};
}

/* Sounds have positive frequencies, whatever their sign is in the traces. */
static void turn_positive(struct traces_file *t)
{
    for (size_t i = 0; i < t->n_cut && i < TRACES_MAX_CUT; i++) {
        double from_hz = t->cut[i].from_hz, to_hz = t->cut[i].to_hz;
        double ends_hz[2] = {fabs(from_hz), fabs(to_hz)};
        t->cut[i].from_hz = from_hz < 0.0 && to_hz > 0.0 ? 0.0
                                                         : fmin(ends_hz[0], ends_hz[1]);
        t->cut[i].to_hz = fmax(ends_hz[0], ends_hz[1]);
    }
}

/* Noise that the band [first, first + width) of n_used bins, circular, leaves out, from
 * the lowest frequency on; and is there as much noise as anything else in it? */
static void tell_noise(const struct parts *p, const struct traces_raw *r, size_t n_used,
                       size_t first, size_t width, struct traces_file *t)
{
    size_t half = r->real ? 0 : (p->n + 1) / 2;
    double cut = 0.0, all = 0.0, inside[3] = {0.0};

    for (size_t i = 0; i < p->n; i++) {
        size_t q = (i + half) % p->n, middle = (2 * q + 1) * n_used / (2 * p->n);
        bool upper = !r->real && q >= half;
        all += p->power[q];
        if ((middle + n_used - first) % n_used < width) {
            inside[p->kind[q]] += p->power[q];
        } else if (p->sunk[q]) {
            cut += p->power[q];
            add_island(t, edge_hz(r, p->n, q, upper), edge_hz(r, p->n, q + 1, upper));
        }
    }
    turn_positive(t);
    t->cut_share = cut > 0.0 ? cut / all : 0.0;
    t->unsure = !(inside[STATIONARY_ECHOES] > 0.0) &&
                inside[STATIONARY_NOISE] > inside[STATIONARY_UNCLEAR];
}

/* -- the band and its rate --------------------------------------------------------------
 */
struct rebander {
    size_t n, m;          /* lengths of the two transforms */
    float *in, *spectrum; /* [n] complex */
    float *bins, *out;    /* [m] complex */
    fftwf_plan forward, backward;
    long first; /* bin of `spectrum` that is the lowest of the band */
    size_t width;
    bool conjugate;
};

static void rebander_clear(struct rebander *x)
{
    fftwf_destroy_plan(x->forward);
    fftwf_destroy_plan(x->backward);
    fftwf_free(x->in);
    fftwf_free(x->spectrum);
    fftwf_free(x->bins);
    fftwf_free(x->out);
}

static int rebander_create(struct rebander *x, const struct traces_raw *r)
{
    memset(x, 0, sizeof *x);
    x->n = fft_size(r->n_samples + PAD, 1.2);
    x->in = fftwf_malloc(2 * x->n * sizeof(float));
    x->spectrum = fftwf_malloc(2 * x->n * sizeof(float));
    if (!x->in || !x->spectrum)
        return -ENOMEM;
    x->forward = fft_plan(x->n, x->in, x->spectrum, FFTW_FORWARD);
    return x->forward ? 0 : -ENOMEM;
}

/* Tukey's window: what a trace begins and ends with would else show at all frequencies.
 */
static float taper(size_t n, size_t n_samples)
{
    double to_end = (double)(n < n_samples - 1 - n ? n : n_samples - 1 - n) + 0.5;
    double share = to_end / (TAPER * (double)n_samples);

    return share < 1.0 ? (float)(0.5 - 0.5 * cos(M_PI * share)) : 1.0f;
}

static void transform_ping(struct rebander *x, const struct traces_raw *r, size_t k,
                           bool tapered)
{
    memset(x->in, 0, 2 * x->n * sizeof *x->in);
    for (size_t n = 0; n < r->n_samples; n++) {
        float complex v = r->traces[k * r->stride + n * r->step];
        if (tapered)
            v *= taper(n, r->n_samples);
        x->in[2 * n] = crealf(v);
        x->in[2 * n + 1] = x->conjugate ? -cimagf(v) : cimagf(v);
    }
    fftwf_execute(x->forward);
}

/* Power of all pings together. */
static void sum_spectra(struct rebander *x, const struct traces_raw *r,
                        const bool *masked, double *power)
{
    memset(power, 0, x->n * sizeof *power);
    for (size_t k = 0; k < r->n_pings; k++) {
        if (masked[k])
            continue;
        transform_ping(x, r, k, true);
        for (size_t b = 0; b < x->n; b++)
            power[b] += (double)x->spectrum[2 * b] * (double)x->spectrum[2 * b] +
                        (double)x->spectrum[2 * b + 1] * (double)x->spectrum[2 * b + 1];
    }
}

/* Bins of what stands out.  0, -EINVAL, -ENOMEM. */
static int find_band(const struct rebander *x, const struct traces_raw *r,
                     struct traces_file *t, double *power, size_t *first, size_t *width)
{
    size_t n_used = r->real ? x->n / 2 : x->n, n_spectra = 0;
    struct parts parts;

    for (size_t k = 0; k < r->n_pings; k++)
        n_spectra += !t->masked[k];
    int err = find_kinds(&parts, r, t->masked);

    if (err == -ENOMEM)
        return err;
    if (!err)
        sink_noise(&parts, power, n_used, n_spectra);
    err = traces_band(power, x->n, n_used, n_spectra, first, width);
    if (err)
        return err;
    tell_noise(&parts, r, n_used, *first, *width, t);
    return 0;
}

/* What was found, with a margin on each side. */
static void take_found(struct rebander *x, const struct traces_raw *r, size_t first,
                       size_t width)
{
    long margin = (long)ceil(MARGIN * (double)width), n = (long)x->n;

    x->first = (long)first - margin;
    x->width = (size_t)((long)width + 2 * margin);
    if (x->width >= x->n) { /* filled to the brim: around the carrier, or above 0 */
        x->width = x->n;
        x->first = r->carrier_hz > 0.0 ? -n / 2 : 0;
        width = 0;
    }
    /* Sounds have positive frequencies: those above half the rate are negative ones, of
     * the other sign convention or below the carrier. */
    if (r->carrier_hz == 0.0 && 2 * (long)first >= n) {
        x->conjugate = true;
        x->first = n - x->first - (long)x->width + 1;
    } else if (r->carrier_hz > 0.0 && width && 2 * (x->first + (long)x->width / 2) >= n) {
        x->first -= n;
    }
}

static double power_within(const struct rebander *x, const double *power, long first,
                           long width)
{
    long n = (long)x->n;
    double sum = 0.0;

    for (long b = first; b < first + width; b++)
        sum += power[((b % n) + n) % n];
    return sum;
}

/* How far apart the frequencies are that traces of this length tell. */
static double traces_bin_hz(const struct traces_raw *r)
{
    return r->rate_hz / (double)fft_size(r->n_samples + PAD, 1.2);
}

/* What was asked for, as it is.  Of the other sign convention if there is more.  0,
 * -ERANGE, -EDOM. */
static int take_wanted(struct rebander *x, const struct traces_raw *r,
                       const double *power, const double band_hz[2])
{
    double bin_hz = r->rate_hz / (double)x->n;
    double low = ceil((band_hz[0] - r->carrier_hz) / bin_hz);
    double high = floor((band_hz[1] - r->carrier_hz) / bin_hz), n = (double)x->n;
    double lowest = r->carrier_hz > 0.0 ? ceil(-0.5 * n) : 0.0;
    double highest = r->real || r->carrier_hz > 0.0 ? floor(0.5 * n) : n - 1.0;

    if (!(low >= lowest && high <= highest))
        return -ERANGE;
    if (!((r->carrier_hz > 0.0 ? low : fmax(low, 1.0)) < high))
        return -EDOM;
    x->first = (long)low;
    x->width = (size_t)(high - low) + 1;
    x->conjugate = !r->real && r->carrier_hz == 0.0 &&
                   power_within(x, power, -(long)high, (long)x->width) >
                       power_within(x, power, x->first, (long)x->width);
    return 0;
}

/* Sets first, width, conjugate, and the band and the format of the traces. */
static int choose_band(struct rebander *x, const struct traces_raw *r,
                       const double band_hz[2], struct traces_file *t)
{
    double *power = malloc(x->n * sizeof *power);
    size_t first, width;
    if (!power)
        return -ENOMEM;
    sum_spectra(x, r, t->masked, power);
    int err = band_hz ? take_wanted(x, r, power, band_hz)
                      : find_band(x, r, t, power, &first, &width);
    if (!err && !band_hz)
        take_found(x, r, first, width);
    free(power);
    if (err)
        return err;
    if (r->carrier_hz == 0.0 && x->first < 1) {
        x->width -= (size_t)(1 - x->first);
        x->first = 1;
    }
    double bin_hz = r->rate_hz / (double)x->n;
    t->band_hz[0] = fmax(r->carrier_hz + (double)x->first * bin_hz, 0.0);
    t->band_hz[1] = r->carrier_hz + (double)(x->first + (long)x->width - 1) * bin_hz;
    return t->band_hz[1] > t->band_hz[0] ? 0 : -EINVAL;
}

static int plan_output(struct rebander *x, const struct traces_raw *r,
                       struct traces_file *t)
{
    x->m = fft_size((size_t)ceil(OVERSAMPLING * (double)x->width) + 2, 1.2);
    x->bins = fftwf_malloc(2 * x->m * sizeof(float));
    x->out = fftwf_malloc(2 * x->m * sizeof(float));
    if (!x->bins || !x->out)
        return -ENOMEM;
    x->backward = fft_plan(x->m, x->bins, x->out, FFTW_BACKWARD);
    double bin_hz = r->rate_hz / (double)x->n;
    double rate_hz = (double)x->m * bin_hz, length_s = (double)r->n_samples / r->rate_hz;
    long middle = x->first + (long)x->width / 2;
    t->format =
        (struct trace_format){.t0_s = r->t0_s,
                              .rate_hz = rate_hz,
                              .carrier_hz = r->carrier_hz + (double)middle * bin_hz,
                              .n_samples = (size_t)ceil(length_s * rate_hz)};
    if (t->format.n_samples > x->m)
        t->format.n_samples = x->m;
    t->traces = malloc(t->n_pings * t->format.n_samples * sizeof *t->traces);
    return x->backward && t->traces ? 0 : -ENOMEM;
}

/* A bin's phase at t0 in the file counts from the trace's first sample; in the new
 * format only the carrier's is taken out, from time 0. */
static void convert(struct rebander *x, const struct traces_raw *r, struct traces_file *t)
{
    long middle = x->first + (long)x->width / 2, n = (long)x->n, m = (long)x->m;
    double turns = (t->format.carrier_hz - r->carrier_hz) * r->t0_s;
    double angle = -2.0 * M_PI * (turns - floor(turns));
    double gain = (r->real ? 2.0 : 1.0) / (double)x->n;
    float re = (float)(gain * cos(angle)), im = (float)(gain * sin(angle));
    for (size_t k = 0; k < t->n_pings; k++) {
        float complex *y = t->traces + k * t->format.n_samples;
        memset(y, 0, t->format.n_samples * sizeof *y);
        if (t->masked[k])
            continue;
        transform_ping(x, r, k, false);
        memset(x->bins, 0, 2 * x->m * sizeof *x->bins);
        for (long b = x->first; b < x->first + (long)x->width; b++) {
            const float *from = x->spectrum + 2 * (((b % n) + n) % n);
            float *to = x->bins + 2 * ((b - middle + m) % m);
            to[0] = from[0];
            to[1] = from[1];
        }
        fftwf_execute(x->backward);
        float *out = (float *)y;
        for (size_t i = 0; i < t->format.n_samples; i++) {
            float a = x->out[2 * i], b = x->out[2 * i + 1];
            out[2 * i] = a * re - b * im;
            out[2 * i + 1] = a * im + b * re;
        }
    }
}

/* From n_pings and masked: band_hz, format, traces, cut and unsure of *t.  band_hz [2]:
 * the band that is wanted; NULL: it is found.  Noise (dsp/stationary.h) may be louder
 * than the echoes: where there are some, the band is of them and of what may be some, and
 * what was cut outside of it is told.  0, -EINVAL (no band), -ERANGE (band_hz: there is
 * no such frequency in the traces), -EDOM (it is narrower than two of traces_bin_hz above
 * 0), -ENOMEM. */
static int traces_reband(struct traces_file *t, const struct traces_raw *r,
                         const double band_hz[2])
{
    struct rebander x;
    int err = rebander_create(&x, r);
    if (!err)
        err = choose_band(&x, r, band_hz, t);
    if (!err)
        err = plan_output(&x, r, t);
    if (!err)
        convert(&x, r, t);
    rebander_clear(&x);
    return err;
}

/* [n][3]; HDF5 files that MATLAB did not write often have [3][n]. */
static int read_places(struct mat_file *f, const char *path, const char *name,
                       size_t which, struct traces_file *t, struct error *why)
{
    size_t extents[2];
    double *at = NULL;
    int err = mat_file_read_double(f, name, 2, extents, &at, why);
    if (err)
        return err;
    bool turned = extents[1] != 3 && extents[0] == 3;
    size_t n = extents[turned];
    if (extents[!turned] != 3 || (t->n_pings && n != t->n_pings)) {
        err = error_say(why, -EINVAL, "%s: %s: %zu x %zu, expected %s x 3", path, name,
                        extents[0], extents[1],
                        t->n_pings ? "as many pings as tx_m" : "pings");
        goto out;
    }
    if (!t->pings_m)
        t->pings_m = calloc(n, sizeof *t->pings_m);
    t->n_pings = n;
    if (!t->pings_m) {
        err = error_say(why, -ENOMEM, "%s: out of memory", path);
        goto out;
    }
    for (size_t k = 0; !err && k < n; k++)
        for (size_t a = 0; a < 3; a++) {
            double x = turned ? at[3 * k + a] : at[a * n + k];
            t->pings_m[k][which][a] = x;
            if (!err && !isfinite(x))
                err = error_say(why, -EINVAL, "%s: %s: row %zu is not finite", path, name,
                                k + 1);
        }
out:
    free(at);
    return err;
}

static int read_traces(struct mat_file *f, const char *path, struct traces_raw *r,
                       struct error *why)
{
    size_t extents[2];
    int err = mat_file_read_complex(f, "traces", 2, extents, &r->traces, why);
    if (err)
        return err;
    bool turned = extents[0] != r->n_pings && extents[1] == r->n_pings;
    r->n_samples = extents[!turned];
    r->stride = turned ? r->n_samples : 1;
    r->step = turned ? 1 : r->n_pings;
    if (extents[turned] != r->n_pings || r->n_samples < 2)
        return error_say(
            why, -EINVAL,
            "%s: traces: %zu x %zu, expected %zu pings, as many as tx_m has, "
            "of 2 samples or more",
            path, extents[0], extents[1], r->n_pings);
    return 0;
}

static int read_numbers(struct mat_file *f, const char *path, struct traces_file *t,
                        struct traces_raw *r, struct error *why)
{
    const struct {
        const char *name;
        double *out, min, max;
    } numbers[] = {{"fs_hz", &r->rate_hz, 1.0, 1e12},
                   {"t0_s", &r->t0_s, -1e6, 1e6},
                   {"fc_hz", &r->carrier_hz, 0.0, 1e12},
                   {"c_m_s", &t->sound_speed_m_s, 1.0, 1e9}};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        int err = mat_file_read_number(f, numbers[i].name, numbers[i].out, why);
        if (err)
            return err;
        if (!(*numbers[i].out >= numbers[i].min && *numbers[i].out <= numbers[i].max))
            return error_say(why, -EINVAL, "%s: %s: is %g, expected %g to %g", path,
                             numbers[i].name, *numbers[i].out, numbers[i].min,
                             numbers[i].max);
    }
    return 0;
}

/* NaN: the file does not say. */
static int read_band(struct mat_file *f, const char *path, double band_hz[2],
                     struct error *why)
{
    size_t extents[2];
    double *v = NULL;

    band_hz[0] = band_hz[1] = NAN;
    if (!mat_file_has(f, "band_hz"))
        return 0;
    int err = mat_file_read_double(f, "band_hz", 2, extents, &v, why);
    if (err)
        return err;
    if (extents[0] * extents[1] == 2 && v[0] >= 0.0 && v[0] < v[1] && isfinite(v[1]))
        memcpy(band_hz, v, 2 * sizeof *v);
    else
        err = error_say(why, -EINVAL,
                        "%s: band_hz: expected two numbers, the lower and the upper end",
                        path);
    free(v);
    return err;
}

static int read_file(struct traces_file *t, struct traces_raw *r, const char *path,
                     double band_hz[2], struct error *why)
{
    struct mat_file *f = NULL;
    int err = mat_file_open(&f, path, why);
    if (!err)
        err = read_numbers(f, path, t, r, why);
    if (!err)
        err = read_band(f, path, band_hz, why);
    if (!err)
        err = read_places(f, path, "tx_m", 0, t, why);
    if (!err)
        err = read_places(f, path, "rx_m", 1, t, why);
    if (!err) {
        r->n_pings = t->n_pings;
        err = read_traces(f, path, r, why);
    }
    mat_file_close(f);
    return err;
}

/* Which pings are of use, and whether anything is imaginary. */
static int look(struct traces_file *t, struct traces_raw *r, const char *path,
                struct error *why)
{
    r->real = r->carrier_hz == 0.0;
    t->masked = calloc(t->n_pings, sizeof *t->masked);
    if (!t->masked)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    for (size_t k = 0; k < t->n_pings; k++) {
        bool finite = true, silent = true, loud = false;
        for (size_t n = 0; n < r->n_samples; n++) {
            float complex x = r->traces[k * r->stride + n * r->step];
            finite = finite && isfinite(crealf(x)) && isfinite(cimagf(x));
            loud = loud || fabsf(crealf(x)) >= TRACE_LOUDEST ||
                   fabsf(cimagf(x)) >= TRACE_LOUDEST;
            silent = silent && crealf(x) == 0.0f && cimagf(x) == 0.0f;
            r->real = r->real && cimagf(x) == 0.0f;
        }
        t->n_not_finite += !finite;
        t->n_silent += silent;
        t->n_too_loud += finite && loud;
        t->masked[k] = !finite || silent || loud;
    }
    if (t->n_not_finite + t->n_silent + t->n_too_loud < t->n_pings)
        return 0;
    return error_say(why, -ENODATA,
                     "%s: traces: all are silent or not finite, or louder than %g", path,
                     (double)TRACE_LOUDEST);
}

/* Between samples traces may be louder than at any, and at another rate these are seen.
 */
static void look_again(struct traces_file *t)
{
    size_t n = t->format.n_samples;
    for (size_t k = 0; k < t->n_pings; k++) {
        if (t->masked[k] || trace_check(t->traces + k * n, n))
            continue;
        t->masked[k] = true;
        t->n_too_loud++;
    }
}

/* The highest frequency that traces of this rate can have. */
static double top_hz(const struct traces_raw *r)
{
    return r->carrier_hz > 0.0 ? r->carrier_hz + 0.5 * r->rate_hz
           : r->real           ? 0.5 * r->rate_hz
                               : r->rate_hz;
}

int traces_load(struct traces_file *out, const char *path, const double wanted_hz[2],
                struct error *why)
{
    struct traces_raw r = {0};
    double band_hz[2];
    memset(out, 0, sizeof *out);
    int err = read_file(out, &r, path, band_hz, why);
    if (!err)
        err = look(out, &r, path, why);
    if (!err) {
        if (wanted_hz)
            memcpy(band_hz, wanted_hz, sizeof band_hz);
        err = traces_reband(out, &r, isnan(band_hz[0]) ? NULL : band_hz);
        if (err == -EINVAL)
            error_say(why, err,
                      "%s: traces: no band stands out of their spectrum; name it with "
                      "--band-hz LOW,HIGH",
                      path);
        else if (err == -ERANGE)
            error_say(
                why, err = -EINVAL,
                "%s: %s: %g to %g Hz, but traces with a rate of %g Hz hold %g to %g "
                "Hz",
                path, wanted_hz ? "--band-hz" : "band_hz", band_hz[0], band_hz[1],
                r.rate_hz, fmax(r.carrier_hz - 0.5 * r.rate_hz, 0.0), top_hz(&r));
        else if (err == -EDOM)
            error_say(
                why, err = -EINVAL,
                "%s: %s: %g to %g Hz, but of traces of %g ms only frequencies %.3g Hz "
                "apart are known: a band has to be %.3g Hz wide or more",
                path, wanted_hz ? "--band-hz" : "band_hz", band_hz[0], band_hz[1],
                1e3 * (double)r.n_samples / r.rate_hz, traces_bin_hz(&r),
                2.0 * traces_bin_hz(&r));
        else if (err)
            error_say(why, err, "%s: out of memory", path);
    }
    if (!err)
        look_again(out);
    free(r.traces);
    return err;
}

int traces_cut(struct traces_file *t, const double gate_s[2])
{
    struct trace_format *f = &t->format;
    double last = floor((gate_s[1] - f->t0_s) * f->rate_hz + 1e-6);
    double first = fmax(ceil((gate_s[0] - f->t0_s) * f->rate_hz - 1e-6), 0.0);
    size_t before = f->n_samples;
    last = fmin(last, (double)(before - 1));
    if (!(last >= first + 1.0))
        return -ERANGE;
    size_t skip = (size_t)first, n = (size_t)last - skip + 1;
    for (size_t k = 0; k < t->n_pings; k++)
        memmove(t->traces + k * n, t->traces + k * before + skip, n * sizeof *t->traces);
    f->t0_s += first / f->rate_hz;
    f->n_samples = n;
    return 0;
}

void traces_clear(struct traces_file *t)
{
    free(t->pings_m);
    free(t->traces);
    free(t->masked);
    memset(t, 0, sizeof *t);
}
