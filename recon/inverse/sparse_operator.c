#include "recon/inverse/sparse_operator_plan.h"

#include <math.h>
#include <string.h>

#include "dsp/vector.h"

/* -- points -----------------------------------------------------------------------------
 */

struct places {
    struct sparse_operator *s;
    const double (*at_m)[3];
};

/* Delays and phasors of all elements at one stage position, in double until they are
 * folded to a turn. */
static void place_position(void *ctx, size_t k, size_t thread)
{
    const struct places *p = ctx;
    struct sparse_operator *s = p->s;
    const struct geometry *g = &s->geometry;
    (void)thread;
    for (size_t e = 0; e < sparse_elements(s); e++) {
        double from[3];
        size_t at = (k * sparse_elements(s) + e) * s->max_points;
        if (e < g->n_speakers)
            geometry_speaker(g, k, e, from);
        else
            geometry_microphone(g, k, e - g->n_speakers, from);
        for (size_t v = 0; v < s->n; v++) {
            double d[3];
            for (int a = 0; a < 3; a++)
                d[a] = p->at_m[v][a] - from[a];
            double r = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
            double delay_s = r / g->sound_speed_m_s;
            double turns = s->format.carrier_hz * delay_s, gain = 1.0 / fmax(r, 1e-3);
            double angle = 2.0 * M_PI * (turns - rint(turns));
            s->delay[at + v] =
                (float)((delay_s - 0.5 * s->format.t0_s) * s->format.rate_hz);
            s->re[at + v] = (float)(gain * cos(angle));
            s->im[at + v] = (float)(-gain * sin(angle));
        }
    }
}

/* Each midpoint counts once. */
static void weigh(struct sparse_operator *s)
{
    memset(s->fold, 0, s->n_cells * sizeof *s->fold);
    for (size_t t = 0; t < s->n_traces; t++)
        s->fold[s->cell[t]] += s->live[t];
    for (size_t t = 0; t < s->n_traces; t++)
        s->weight[t] = s->live[t] ? 1.0f / sqrtf((float)s->fold[s->cell[t]]) : 0.0f;
}

/* Columns of length 1: |p|^2 hardly depends on the fraction, the rest is known. */
static void scale_columns(struct sparse_operator *s)
{
    size_t taps = 2 * s->half, n_s = s->geometry.n_speakers;
    size_t n_m = s->geometry.n_microphones;
    double energy = 0.0;
    for (size_t k = 0; k < taps; k++)
        energy += pow(s->pulse[SPARSE_FRACTIONS / 2 * taps + k], 2.0);
    for (size_t v = 0; v < s->n; v++) {
        double sum = 0.0;
        for (size_t k = 0; k < s->geometry.n_positions; k++) {
            const float *re = s->re + k * sparse_elements(s) * s->max_points + v;
            const float *im = s->im + k * sparse_elements(s) * s->max_points + v;
            for (size_t pair = 0; pair < s->pairs; pair++) {
                size_t j = pair / n_m * s->max_points;
                size_t i = (n_s + pair % n_m) * s->max_points;
                double gj = (double)re[j] * re[j] + (double)im[j] * im[j];
                double gi = (double)re[i] * re[i] + (double)im[i] * im[i];
                sum += pow(s->weight[k * s->pairs + pair], 2.0) * gj * gi;
            }
        }
        s->scale[v] = sum > 0.0 ? (float)(1.0 / sqrt(sum * energy)) : 0.0f;
    }
}

void sparse_operator_place(struct sparse_operator *s, size_t n, const double (*at_m)[3])
{
    struct places p = {s, at_m};
    s->n = n < s->max_points ? n : s->max_points;
    weigh(s);
    pool_run(s->pool, s->geometry.n_positions, place_position, &p);
    scale_columns(s);
}

void sparse_operator_keep(struct sparse_operator *s, size_t n, const size_t *which)
{
    for (size_t e = 0; e < s->geometry.n_positions * sparse_elements(s); e++) {
        size_t at = e * s->max_points;
        for (size_t v = 0; v < n; v++) {
            s->delay[at + v] = s->delay[at + which[v]];
            s->re[at + v] = s->re[at + which[v]];
            s->im[at + v] = s->im[at + which[v]];
        }
    }
    for (size_t v = 0; v < n; v++)
        s->scale[v] = s->scale[which[v]];
    s->n = n;
}

/* -- pairs ------------------------------------------------------------------------------
 */

/* Where the pulse of a point begins in the window (the trace with `half` samples around
 * it), and its shape; false: it misses the trace. */
VECTOR_INLINE int begin(const struct sparse_pair *p, size_t v, size_t half, float last,
                        size_t *sample, size_t *fraction)
{
    float at = p->delay_s[v] + p->delay_m[v];
    if (!(at >= 0.0f && at < last))
        return 0;
    size_t q = (size_t)at;
    *sample = q + 1; /* of half - 1 before q, in a window that starts half before */
    *fraction = (size_t)((at - (float)q) * SPARSE_FRACTIONS + 0.5f) * 2 * half;
    return 1;
}

VECTOR_CLONES
static void spread(const struct sparse_pair *p, size_t n, const float *x_re,
                   const float *x_im, const float *pulse, size_t half, float last,
                   float weight, float *restrict re, float *restrict im)
{
    for (size_t v = 0; v < n; v++) {
        size_t sample, fraction;
        if ((x_re[v] == 0.0f && x_im[v] == 0.0f) ||
            !begin(p, v, half, last, &sample, &fraction))
            continue;
        float cr = p->re_s[v] * p->re_m[v] - p->im_s[v] * p->im_m[v];
        float ci = p->re_s[v] * p->im_m[v] + p->im_s[v] * p->re_m[v];
        float ar = weight * (cr * x_re[v] - ci * x_im[v]);
        float ai = weight * (cr * x_im[v] + ci * x_re[v]);
        const float *shape = pulse + fraction;
        float *restrict to_re = re + sample, *restrict to_im = im + sample;
        for (size_t k = 0; k < 2 * half; k++) {
            to_re[k] += ar * shape[k];
            to_im[k] += ai * shape[k];
        }
    }
}

VECTOR_CLONES
static void collect(const struct sparse_pair *p, size_t n, const float *restrict re,
                    const float *restrict im, const float *pulse, size_t half, float last,
                    float weight, float *restrict sum_re, float *restrict sum_im)
{
    for (size_t v = 0; v < n; v++) {
        size_t sample, fraction;
        if (!begin(p, v, half, last, &sample, &fraction))
            continue;
        const float *shape = pulse + fraction, *from_re = re + sample;
        const float *from_im = im + sample;
        float lanes_re[8] = {0}, lanes_im[8] = {0};
        for (size_t k = 0; k < half / 4 * 8; k += 8)
            for (size_t l = 0; l < 8; l++) {
                lanes_re[l] += from_re[k + l] * shape[k + l];
                lanes_im[l] += from_im[k + l] * shape[k + l];
            }
        for (size_t k = half / 4 * 8; k < 2 * half; k++) {
            lanes_re[k % 8] += from_re[k] * shape[k];
            lanes_im[k % 8] += from_im[k] * shape[k];
        }
        float yr = ((lanes_re[0] + lanes_re[4]) + (lanes_re[1] + lanes_re[5])) +
                   ((lanes_re[2] + lanes_re[6]) + (lanes_re[3] + lanes_re[7]));
        float yi = ((lanes_im[0] + lanes_im[4]) + (lanes_im[1] + lanes_im[5])) +
                   ((lanes_im[2] + lanes_im[6]) + (lanes_im[3] + lanes_im[7]));
        float cr = p->re_s[v] * p->re_m[v] - p->im_s[v] * p->im_m[v];
        float ci = p->re_s[v] * p->im_m[v] + p->im_s[v] * p->re_m[v];
        sum_re[v] += weight * (cr * yr + ci * yi);
        sum_im[v] += weight * (cr * yi - ci * yr);
    }
}

static void split_trace(const float *trace, size_t n, float *re, float *im)
{
    for (size_t q = 0; q < n; q++) {
        re[q] = trace[2 * q];
        im[q] = trace[2 * q + 1];
    }
}

static void do_trace(struct sparse_operator *s, struct sparse_run *run, size_t k,
                     size_t pair)
{
    size_t t = k * s->pairs + pair, n = s->format.n_samples;
    float *re = run->window, *im = re + sparse_window(s), last = (float)(n - 1);
    struct sparse_pair p = sparse_find_pair(s, k, pair);
    if (s->forward) {
        memset(run->window, 0, 2 * sparse_window(s) * sizeof(float));
        spread(&p, s->n, s->x_re, s->x_im, s->pulse, s->half, last, s->weight[t], re, im);
        /* what falls before or behind the trace was never recorded */
        memset(re, 0, s->half * sizeof(float));
        memset(im, 0, s->half * sizeof(float));
        memset(re + s->half + n, 0, s->half * sizeof(float));
        memset(im + s->half + n, 0, s->half * sizeof(float));
    } else {
        split_trace(s->from + 2 * t * n, n, re + s->half, im + s->half);
    }
    float weight = s->weight[t] * (s->recorded ? s->weight[t] : 1.0f);
    if (s->adjoint)
        collect(&p, s->n, re, im, s->pulse, s->half, last, weight, run->sum_re,
                run->sum_im);
    else
        for (size_t q = 0; q < n; q++) {
            s->to[2 * (t * n + q)] = re[s->half + q];
            s->to[2 * (t * n + q) + 1] = im[s->half + q];
        }
}

/* Every SPARSE_RUNS-th stage position. */
static void do_run(void *ctx, size_t item, size_t thread)
{
    struct sparse_operator *s = ctx;
    struct sparse_run *run = &s->runs[item];
    (void)thread;
    memset(run->sum_re, 0, s->n * sizeof(float));
    memset(run->sum_im, 0, s->n * sizeof(float));
    memset(run->window, 0, 2 * sparse_window(s) * sizeof(float));
    for (size_t k = item; k < s->geometry.n_positions; k += SPARSE_RUNS)
        for (size_t pair = 0; pair < s->pairs; pair++)
            if (s->weight[k * s->pairs + pair] > 0.0f)
                do_trace(s, run, k, pair);
}

static void load(struct sparse_operator *s, const float *x)
{
    for (size_t v = 0; v < s->n; v++) {
        s->x_re[v] = s->scale[v] * x[2 * v];
        s->x_im[v] = s->scale[v] * x[2 * v + 1];
    }
}

static void sum_runs(const struct sparse_operator *s, float *x)
{
    for (size_t v = 0; v < s->n; v++) {
        double re = 0.0, im = 0.0;
        for (size_t r = 0; r < SPARSE_RUNS; r++) {
            re += (double)s->runs[r].sum_re[v];
            im += (double)s->runs[r].sum_im[v];
        }
        x[2 * v] = (float)(re * s->scale[v]);
        x[2 * v + 1] = (float)(im * s->scale[v]);
    }
}

void sparse_operator_forward(struct sparse_operator *s, const float *x,
                             float complex *traces)
{
    load(s, x);
    s->forward = true;
    s->adjoint = false;
    s->to = (float *)traces;
    memset(traces, 0, s->n_traces * s->format.n_samples * sizeof *traces);
    pool_run(s->pool, SPARSE_RUNS, do_run, s);
}

void sparse_operator_residual(struct sparse_operator *s, const float *x,
                              float complex *residual)
{
    size_t n = 2 * s->format.n_samples;

    sparse_operator_forward(s, x, residual);
    for (size_t t = 0; t < s->n_traces; t++) {
        float *rest = (float *)residual + t * n, over = 0.0f;
        const float *heard = s->traces + t * n;
        if (s->weight[t] > 0.0f)
            over = 1.0f / s->weight[t];
        for (size_t q = 0; q < n; q++)
            rest[q] = s->live[t] ? heard[q] - over * rest[q] : 0.0f;
    }
}

static void adjoint(struct sparse_operator *s, const float *traces, float *x)
{
    s->forward = false;
    s->adjoint = true;
    s->from = traces;
    pool_run(s->pool, SPARSE_RUNS, do_run, s);
    sum_runs(s, x);
}

void sparse_operator_adjoint(struct sparse_operator *s, const float complex *traces,
                             float *x)
{
    adjoint(s, (const float *)traces, x);
}

void sparse_operator_data(struct sparse_operator *s, float *out)
{
    s->recorded = true;
    adjoint(s, s->traces, out);
    s->recorded = false;
}

void sparse_operator_normal(struct sparse_operator *s, const float *x, float *out)
{
    load(s, x);
    s->forward = s->adjoint = true;
    pool_run(s->pool, SPARSE_RUNS, do_run, s);
    sum_runs(s, out);
}
