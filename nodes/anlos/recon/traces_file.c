#include "nodes/anlos/recon/traces_file.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/mat_file.h"
#include "nodes/anlos/recon/traces_band.h"
#include "recon/trace_check.h"

/* [n][3]; HDF5 files that MATLAB did not write often have [3][n]. */
static int read_places(struct mat_file *f, const char *path, const char *name,
                       size_t which, struct traces_file *t, struct complaint *why)
{
    size_t extents[2];
    double *at = NULL;
    int err = mat_file_read_double(f, name, 2, extents, &at, why);
    if (err)
        return err;
    bool turned = extents[1] != 3 && extents[0] == 3;
    size_t n = extents[turned];
    if (extents[!turned] != 3 || (t->n_pings && n != t->n_pings)) {
        err = complain(why, -EINVAL, "%s: %s: %zu x %zu, expected %s x 3", path, name,
                       extents[0], extents[1],
                       t->n_pings ? "as many pings as tx_m" : "pings");
        goto out;
    }
    if (!t->pings_m)
        t->pings_m = calloc(n, sizeof *t->pings_m);
    t->n_pings = n;
    if (!t->pings_m) {
        err = complain(why, -ENOMEM, "%s: out of memory", path);
        goto out;
    }
    for (size_t k = 0; !err && k < n; k++)
        for (size_t a = 0; a < 3; a++) {
            double x = turned ? at[3 * k + a] : at[a * n + k];
            t->pings_m[k][which][a] = x;
            if (!err && !isfinite(x))
                err = complain(why, -EINVAL, "%s: %s: row %zu is not finite", path, name,
                               k + 1);
        }
out:
    free(at);
    return err;
}

static int read_traces(struct mat_file *f, const char *path, struct traces_raw *r,
                       struct complaint *why)
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
        return complain(why, -EINVAL,
                        "%s: traces: %zu x %zu, expected %zu pings, as many as tx_m has, "
                        "of 2 samples or more",
                        path, extents[0], extents[1], r->n_pings);
    return 0;
}

static int read_numbers(struct mat_file *f, const char *path, struct traces_file *t,
                        struct traces_raw *r, struct complaint *why)
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
            return complain(why, -EINVAL, "%s: %s: is %g, expected %g to %g", path,
                            numbers[i].name, *numbers[i].out, numbers[i].min,
                            numbers[i].max);
    }
    return 0;
}

/* NaN: the file does not say. */
static int read_band(struct mat_file *f, const char *path, double band_hz[2],
                     struct complaint *why)
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
        err = complain(why, -EINVAL,
                       "%s: band_hz: expected two numbers, the lower and the upper end",
                       path);
    free(v);
    return err;
}

static int read_file(struct traces_file *t, struct traces_raw *r, const char *path,
                     double band_hz[2], struct complaint *why)
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
                struct complaint *why)
{
    r->real = r->carrier_hz == 0.0;
    t->masked = calloc(t->n_pings, sizeof *t->masked);
    if (!t->masked)
        return complain(why, -ENOMEM, "%s: out of memory", path);
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
    return complain(why, -ENODATA,
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
                struct complaint *why)
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
            complain(why, err,
                     "%s: traces: no band stands out of their spectrum; name it with "
                     "--band-hz LOW,HIGH",
                     path);
        else if (err == -ERANGE)
            complain(why, err = -EINVAL,
                     "%s: %s: %g to %g Hz, but traces with a rate of %g Hz hold %g to %g "
                     "Hz",
                     path, wanted_hz ? "--band-hz" : "band_hz", band_hz[0], band_hz[1],
                     r.rate_hz, fmax(r.carrier_hz - 0.5 * r.rate_hz, 0.0), top_hz(&r));
        else if (err == -EDOM)
            complain(
                why, err = -EINVAL,
                "%s: %s: %g to %g Hz, but of traces of %g ms only frequencies %.3g Hz "
                "apart are known: a band has to be %.3g Hz wide or more",
                path, wanted_hz ? "--band-hz" : "band_hz", band_hz[0], band_hz[1],
                1e3 * (double)r.n_samples / r.rate_hz, traces_bin_hz(&r),
                2.0 * traces_bin_hz(&r));
        else if (err)
            complain(why, err, "%s: out of memory", path);
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
