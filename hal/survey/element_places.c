/* SPDX-License-Identifier: MIT */
#include "hal/survey/element_places.h"

#include <cminpack.h>
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"

#define BIWEIGHT      4.685 /* of Tukey: 95 % as good as least squares on a normal */
#define MAD_TO_SIGMA  1.4826
#define LEAST_SIGMA_M 5e-5 /* arrivals are not believed to be better */
#define ROUNDS        12   /* of weights */
#define SETTLED       1e-3 /* change of the scale that ends them */
#define PLANE_SIGMA_M 1.0  /* what is known of planes and time zero before: nothing */
#define TURN_SIGMA    0.3  /* about the upright */
#define EVALUATIONS   200

/* The parameters, each in standard deviations of what was known of it before: element by
 * element, then time zero as a path, slowness, and each plane's two turns and distance.
 */
struct problem {
    const struct element_places_config *cfg;
    const struct element_arrival *arrivals;
    size_t n_arrivals, n_elements, n_parameters;
    double (*turns)[2][3]; /* [n_planes]: axes across each first normal: most upright,
                              level */
    double *weights;       /* [n_arrivals], 1 / sigma, 0: does not count */
};

struct state { /* parameters as lengths */
    double elements_m[ELEMENT_PLACES_MOST][3];
    struct element_plane planes[ELEMENT_PLACES_PLANES];
    double late_m, slow; /* time zero's path; slowness over the expected, less 1 */
    double channel_m[ELEMENT_PLACES_MOST];
};

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double slow_sigma(const struct element_places_config *cfg)
{
    return cfg->sound_speed_sigma_m_s / cfg->sound_speed_m_s;
}

static const double *surveyed(const struct element_places_config *cfg, size_t element)
{
    return element < cfg->n_speakers ? cfg->speakers_m[element]
                                     : cfg->microphones_m[element - cfg->n_speakers];
}

static double channel_sigma_m(const struct problem *p)
{
    return p->cfg->channel_sigma_s * p->cfg->sound_speed_m_s;
}

static size_t channel_parameter(const struct problem *p, size_t element)
{
    return 3 * p->n_elements + 2 + element;
}

static size_t plane_parameter(const struct problem *p, size_t plane)
{
    return channel_parameter(p, p->n_elements) + 3 * plane;
}

static double turn_sigma(const struct problem *p, int turn)
{
    return turn ? TURN_SIGMA : p->cfg->lean_sigma_rad;
}

/* The normal before it has length 1 again. */
static double lean(const struct problem *p, size_t plane, const double *x, double out[3])
{
    const double *normal = p->cfg->planes[plane].normal;
    for (int a = 0; a < 3; a++)
        out[a] = normal[a] + turn_sigma(p, 0) * x[0] * p->turns[plane][0][a] +
                 turn_sigma(p, 1) * x[1] * p->turns[plane][1][a];
    return sqrt(dot(out, out));
}

static void unpack(const struct problem *p, const double *x, struct state *s)
{
    const struct element_places_config *cfg = p->cfg;
    for (size_t e = 0; e < p->n_elements; e++)
        for (size_t a = 0; a < 3; a++)
            s->elements_m[e][a] = surveyed(cfg, e)[a] +
                                  cfg->placed_sigma_m * x[3 * e + a];
    s->late_m = PLANE_SIGMA_M * x[3 * p->n_elements];
    s->slow = slow_sigma(cfg) * x[3 * p->n_elements + 1];
    for (size_t e = 0; e < p->n_elements; e++)
        s->channel_m[e] = channel_sigma_m(p) * x[channel_parameter(p, e)];
    for (size_t w = 0; w < cfg->n_planes; w++) {
        const double *q = x + plane_parameter(p, w);
        double length = lean(p, w, q, s->planes[w].normal);
        for (int a = 0; a < 3; a++)
            s->planes[w].normal[a] /= length;
        s->planes[w].distance_m = cfg->planes[w].distance_m + PLANE_SIGMA_M * q[2];
    }
}

/* From the speaker's image to the microphone, or from the speaker itself. */
static double way(const struct element_arrival *a, size_t n_speakers,
                  const double (*elements_m)[3], const struct element_plane *planes,
                  double speaker[3], double direction[3])
{
    const double *microphone = elements_m[n_speakers + a->microphone];
    double length = 0.0, before = 0.0;
    memcpy(speaker, elements_m[a->speaker], 3 * sizeof *speaker);
    for (int k = 0; k < 3; k++)
        direction[k] = speaker[k] - microphone[k];
    if (a->plane != ELEMENT_PLACES_STRAIGHT) {
        const struct element_plane *w = &planes[a->plane];
        for (int k = 0; k < 3; k++)
            speaker[k] += a->carried_m[k];
        before = w->distance_m - dot(w->normal, speaker);
        for (int k = 0; k < 3; k++)
            direction[k] += 2.0 * before * w->normal[k];
    }
    length = sqrt(dot(direction, direction));
    for (int k = 0; k < 3; k++)
        direction[k] /= fmax(length, 1e-9);
    return length;
}

/* Heard less expected, in m of path. */
static double residual_m(const struct problem *p, const struct state *s, size_t i)
{
    const struct element_arrival *a = &p->arrivals[i];
    double heard = (a->arrival_s - p->cfg->latency_s) * p->cfg->sound_speed_m_s;
    double speaker[3], direction[3];
    double way_m =
        way(a, p->cfg->n_speakers, s->elements_m, s->planes, speaker, direction);
    return heard - s->late_m - s->channel_m[a->speaker] -
           s->channel_m[p->cfg->n_speakers + a->microphone] - (1.0 + s->slow) * way_m;
}

/* How the way grows with each parameter, times `scale`. */
static void slopes(const struct problem *p, const struct state *s, const double *x,
                   size_t i, double scale, double *row)
{
    const struct element_places_config *cfg = p->cfg;
    const struct element_arrival *a = &p->arrivals[i];
    double speaker[3], e[3], length;
    memset(row, 0, p->n_parameters * sizeof *row);
    length = way(a, cfg->n_speakers, s->elements_m, s->planes, speaker, e);
    double *from = row + 3 * a->speaker;
    double *to = row + 3 * (cfg->n_speakers + a->microphone);
    double step = scale * (1.0 + s->slow);
    for (int k = 0; k < 3; k++) {
        from[k] = step * cfg->placed_sigma_m * e[k];
        to[k] = -step * cfg->placed_sigma_m * e[k];
    }
    row[3 * p->n_elements] = scale * PLANE_SIGMA_M;
    row[3 * p->n_elements + 1] = scale * slow_sigma(cfg) * length;
    row[channel_parameter(p, a->speaker)] = scale * channel_sigma_m(p);
    row[channel_parameter(p, cfg->n_speakers + a->microphone)] = scale *
                                                                 channel_sigma_m(p);
    if (a->plane == ELEMENT_PLACES_STRAIGHT)
        return;
    const struct element_plane *w = &s->planes[a->plane];
    double *plane = row + plane_parameter(p, a->plane), leaning[3];
    double along = dot(w->normal, e), before = w->distance_m - dot(w->normal, speaker);
    double one = lean(p, a->plane, x + plane_parameter(p, a->plane), leaning);
    for (int k = 0; k < 3; k++)
        from[k] -= 2.0 * step * cfg->placed_sigma_m * along * w->normal[k];
    plane[2] = 2.0 * step * PLANE_SIGMA_M * along;
    for (int t = 0; t < 2; t++) {
        double turn[3], out = dot(w->normal, p->turns[a->plane][t]);
        for (int k = 0; k < 3; k++)
            turn[k] = turn_sigma(p, t) / one *
                      (p->turns[a->plane][t][k] - out * w->normal[k]);
        plane[t] = 2.0 * step * (before * dot(turn, e) - dot(turn, speaker) * along);
    }
}

/* MINPACK's: residuals with flag 1, with k + 2 how the residual k grows.  First those of
 * the arrivals, then each parameter as it was known before. */
static int evaluate(void *user, int m, int n, const double *x, double *residuals,
                    double *row, int flag)
{
    const struct problem *p = user;
    struct state s;
    (void)m;
    (void)n;
    size_t k = (size_t)flag - 2;
    if (flag != 1 && k >= p->n_arrivals) {
        memset(row, 0, p->n_parameters * sizeof *row);
        row[k - p->n_arrivals] = 1.0;
        return 0;
    }
    unpack(p, x, &s);
    if (flag != 1) {
        slopes(p, &s, x, k, -p->weights[k], row);
        return 0;
    }
    for (size_t i = 0; i < p->n_arrivals; i++)
        residuals[i] = p->weights[i] * residual_m(p, &s, i);
    memcpy(residuals + p->n_arrivals, x, p->n_parameters * sizeof *x);
    return 0;
}

/* 1.48 times the median deviation from 0. */
static double spread_m(const double *residuals_m, size_t n, double *scratch)
{
    for (size_t i = 0; i < n; i++)
        scratch[i] = fabs(residuals_m[i]);
    return fmax(MAD_TO_SIGMA * rank_double(scratch, n, n / 2 + 1), LEAST_SIGMA_M);
}

static double biweight(double deviation)
{
    double u = deviation / BIWEIGHT;
    return fabs(u) < 1.0 ? (1.0 - u * u) * (1.0 - u * u) : 0.0;
}

struct solver {
    double *x, *r, *residuals_m, *scratch, *work; /* work: MINPACK's six vectors */
    int *order;
};

static int solver_create(struct solver *v, const struct problem *p)
{
    size_t n = p->n_parameters, m = p->n_arrivals + n;
    v->x = calloc(n, sizeof *v->x);
    v->r = malloc(n * n * sizeof *v->r);
    v->residuals_m = malloc(m * sizeof *v->residuals_m);
    v->scratch = malloc(m * sizeof *v->scratch);
    v->work = malloc((5 * n + m) * sizeof *v->work);
    v->order = malloc(n * sizeof *v->order);
    return v->x && v->r && v->residuals_m && v->scratch && v->work && v->order ? 0
                                                                               : -ENOMEM;
}

static void solver_destroy(struct solver *v)
{
    free(v->x);
    free(v->r);
    free(v->residuals_m);
    free(v->scratch);
    free(v->work);
    free(v->order);
}

static void look(const struct problem *p, struct solver *v)
{
    struct state s;
    unpack(p, v->x, &s);
    for (size_t i = 0; i < p->n_arrivals; i++)
        v->residuals_m[i] = residual_m(p, &s, i);
}

static void minimize(struct problem *p, struct solver *v)
{
    int n = (int)p->n_parameters, m = (int)p->n_arrivals + n, calls, slopes_taken;
    double *w = v->work, *diag = w, *qtf = w + n, *fvec = w + 5 * n;
    lmstr(evaluate, p, m, n, v->x, fvec, v->r, n, 1e-9, 1e-7, 0.0, EVALUATIONS, diag, 1,
          100.0, 0, &calls, &slopes_taken, v->order, qtf, w + 2 * n, w + 3 * n, w + 4 * n,
          v->scratch);
}

/* Weights by the residuals as they are, for arrivals that scatter by scale_m. */
static void weigh(struct problem *p, const struct solver *v, double scale_m)
{
    for (size_t i = 0; i < p->n_arrivals; i++)
        p->weights[i] = sqrt(biweight(v->residuals_m[i] / scale_m)) / scale_m;
}

/* Rounds of weights and places, from those that take all for right. */
static void settle(struct problem *p, struct solver *v)
{
    double scale_m = 0.0;
    look(p, v);
    for (int round = 0; round < ROUNDS; round++) {
        double now_m = spread_m(v->residuals_m, p->n_arrivals, v->scratch);
        if (round && fabs(now_m - scale_m) < SETTLED * scale_m)
            break;
        scale_m = now_m;
        weigh(p, v, scale_m);
        minimize(p, v);
        look(p, v);
    }
}

/* The spread of what agrees, for as many numbers as the arrivals have told: those whose
 * variance [n] in terms of that before is 0. */
static double told_scale_m(const struct problem *p, const struct solver *v,
                           const double *covariance)
{
    double sum = 0.0, count = 0.0, told = 0.0, scale_m = 0.0;
    for (size_t i = 0; i < p->n_arrivals; i++)
        scale_m = fmax(scale_m, p->weights[i]);
    for (size_t i = 0; i < p->n_arrivals; i++) {
        double w = p->weights[i] / scale_m; /* 1: in the middle */
        sum += w * w * v->residuals_m[i] * v->residuals_m[i];
        count += w * w;
    }
    for (size_t k = 0; k < p->n_parameters; k++)
        told += fmax(0.0, 1.0 - covariance[k * (p->n_parameters + 1)]);
    return fmax(sqrt(sum / fmax(1.0, count - told)), LEAST_SIGMA_M);
}

/* The covariance in v->r, of the parameters in their units. */
static void covariance_of(struct problem *p, struct solver *v)
{
    size_t n = p->n_parameters;
    minimize(p, v);
    covar((int)n, v->r, (int)n, v->order, 0.0, v->work);
}

/* -- the array's shape ------------------------------------------------------------------
 */
enum { MOTIONS = 6 };

static int longest_axis(size_t n, const double (*at_m)[3], const double middle_m[3])
{
    double spread[3] = {0};
    for (size_t e = 0; e < n; e++)
        for (int a = 0; a < 3; a++)
            spread[a] += (at_m[e][a] - middle_m[a]) * (at_m[e][a] - middle_m[a]);
    int longest = spread[1] > spread[0];
    return spread[2] > spread[longest] ? 2 : longest;
}

/* Directions of length 1 that moves make, and turns but about the longest axis,
 * [k][3 n]. */
static size_t motions(size_t n, const double (*at_m)[3], double *out)
{
    size_t found = 0;
    double middle[3] = {0};
    for (size_t e = 0; e < n; e++)
        for (int a = 0; a < 3; a++)
            middle[a] += at_m[e][a] / (double)n;
    int longest = longest_axis(n, at_m, middle);
    for (int k = 0; k < MOTIONS; k++) {
        if (k == 3 + longest)
            continue;
        double *v = out + found * 3 * n, length = 0.0, whole = 0.0;
        for (size_t e = 0; e < n; e++) {
            double q[3] = {at_m[e][0] - middle[0], at_m[e][1] - middle[1],
                           at_m[e][2] - middle[2]};
            int a = k % 3, b = (k + 1) % 3, c = (k + 2) % 3;
            v[3 * e + (size_t)a] = k < 3 ? 1.0 : 0.0;
            v[3 * e + (size_t)b] = k < 3 ? 0.0 : -q[c];
            v[3 * e + (size_t)c] = k < 3 ? 0.0 : q[b];
        }
        for (size_t i = 0; i < 3 * n; i++)
            whole += v[i] * v[i];
        for (size_t j = 0; j < found; j++) {
            const double *u = out + j * 3 * n;
            double along = 0.0;
            for (size_t i = 0; i < 3 * n; i++)
                along += u[i] * v[i];
            for (size_t i = 0; i < 3 * n; i++)
                v[i] -= along * u[i];
        }
        for (size_t i = 0; i < 3 * n; i++)
            length += v[i] * v[i];
        if (length <= 1e-9 * whole || length < 1e-12)
            continue;
        for (size_t i = 0; i < 3 * n; i++)
            v[i] /= sqrt(length);
        found++;
    }
    return found;
}

static void take_out(size_t n, size_t found, const double *directions, double *v,
                     size_t stride)
{
    for (size_t j = 0; j < found; j++) {
        const double *u = directions + j * 3 * n;
        double along = 0.0;
        for (size_t i = 0; i < 3 * n; i++)
            along += u[i] * v[i * stride];
        for (size_t i = 0; i < 3 * n; i++)
            v[i * stride] -= along * u[i];
    }
}

int element_places_shape(size_t n, const double (*elements_m)[3], double (*change)[3])
{
    double *directions = malloc(MOTIONS * 3 * n * sizeof *directions);
    if (!directions)
        return -ENOMEM;
    size_t found = motions(n, elements_m, directions);
    take_out(n, found, directions, change[0], 1);
    free(directions);
    return 0;
}

/* Of P C P the diagonal; C, [stride][stride], is changed. */
static int shape_sigmas(const struct problem *p, double *c, double (*elements_m)[3],
                        double (*out)[3])
{
    size_t n = p->n_elements, stride = p->n_parameters;
    double *directions = malloc(MOTIONS * 3 * n * sizeof *directions);
    if (!directions)
        return -ENOMEM;
    size_t found = motions(n, (const double(*)[3])elements_m, directions);
    for (size_t k = 0; k < 3 * n; k++)
        take_out(n, found, directions, c + k * stride, 1);
    for (size_t k = 0; k < 3 * n; k++)
        take_out(n, found, directions, c + k, stride);
    for (size_t k = 0; k < 3 * n; k++)
        out[k / 3][k % 3] = p->cfg->placed_sigma_m * sqrt(fmax(0.0, c[k * (stride + 1)]));
    free(directions);
    return 0;
}

/* -- all of it --------------------------------------------------------------------------
 */
static int check(const struct element_places_config *cfg,
                 const struct element_arrival *arrivals, size_t n, struct error *why)
{
    size_t elements = cfg->n_speakers + cfg->n_microphones;
    if (!cfg->n_speakers || !cfg->n_microphones || elements > ELEMENT_PLACES_MOST)
        return error_say(
            why, -EINVAL,
            "places are found of 2 to %d speakers and microphones, and these "
            "are %zu",
            ELEMENT_PLACES_MOST, elements);
    if (cfg->n_planes > ELEMENT_PLACES_PLANES)
        return error_say(why, -EINVAL, "at most %d planes, and these are %zu",
                         ELEMENT_PLACES_PLANES, cfg->n_planes);
    if (!(cfg->placed_sigma_m > 0.0) || !(cfg->sound_speed_sigma_m_s > 0.0) ||
        !(cfg->sound_speed_m_s > 0.0) || !(cfg->channel_sigma_s > 0.0) ||
        (cfg->n_planes && !(cfg->lean_sigma_rad > 0.0)) || !isfinite(cfg->latency_s))
        return error_say(why, -EINVAL, "what is known before is no number");
    for (size_t i = 0; i < n; i++)
        if (arrivals[i].speaker >= cfg->n_speakers ||
            arrivals[i].microphone >= cfg->n_microphones ||
            (arrivals[i].plane != ELEMENT_PLACES_STRAIGHT &&
             arrivals[i].plane >= cfg->n_planes) ||
            !isfinite(arrivals[i].arrival_s))
            return error_say(why, -EINVAL,
                             "arrival %zu is of no such element, or no time", i);
    return n ? 0 : error_say(why, -ENODATA, "nothing was heard");
}

/* Of a floor x takes the place of up. */
static void across(const double normal[3], double out[2][3])
{
    int up = fabs(normal[1]) < 0.99 ? 1 : 0;
    double length = sqrt(1.0 - normal[up] * normal[up]);
    for (int a = 0; a < 3; a++)
        out[0][a] = ((a == up) - normal[up] * normal[a]) / length;
    for (int a = 0; a < 3; a++)
        out[1][a] = normal[(a + 1) % 3] * out[0][(a + 2) % 3] -
                    normal[(a + 2) % 3] * out[0][(a + 1) % 3];
}

/* Of the arrivals that count, with the places that x says. */
static double rms_m(const struct problem *p, const struct solver *v)
{
    double sum = 0.0;
    size_t count = 0;
    for (size_t i = 0; i < p->n_arrivals; i++)
        if (p->weights[i] > 0.0) {
            sum += v->residuals_m[i] * v->residuals_m[i];
            count++;
        }
    return count ? sqrt(sum / (double)count) : NAN;
}

/* As it was: the survey's places, with the best planes and time zero for them. */
static double before_m(struct problem *p, struct solver *v)
{
    struct element_places_config stiff = *p->cfg;
    const struct element_places_config *cfg = p->cfg;
    stiff.placed_sigma_m *= 1e-6;
    p->cfg = &stiff;
    memset(v->x, 0, p->n_parameters * sizeof *v->x);
    minimize(p, v);
    look(p, v);
    p->cfg = cfg;
    return rms_m(p, v);
}

static int report(struct element_places *out, struct problem *p, struct solver *v)
{
    const struct element_places_config *cfg = p->cfg;
    struct state s;
    size_t late = 3 * p->n_elements, n = p->n_parameters;
    covariance_of(p, v);
    double scale_m = told_scale_m(p, v, v->r);
    weigh(p, v, scale_m);
    covariance_of(p, v);
    look(p, v);
    unpack(p, v->x, &s);
    memcpy(out->elements_m, s.elements_m, p->n_elements * sizeof *out->elements_m);
    memcpy(out->planes, s.planes, cfg->n_planes * sizeof *out->planes);
    for (size_t e = 0; e < p->n_elements; e++)
        out->channel_s[e] = s.channel_m[e] / cfg->sound_speed_m_s;
    out->sound_speed_m_s = cfg->sound_speed_m_s / (1.0 + s.slow);
    out->sound_speed_sigma_m_s = cfg->sound_speed_sigma_m_s *
                                 sqrt(fmax(0.0, v->r[(late + 1) * (n + 1)]));
    out->latency_s = cfg->latency_s + s.late_m / cfg->sound_speed_m_s;
    out->latency_sigma_s = PLANE_SIGMA_M / cfg->sound_speed_m_s *
                           sqrt(fmax(0.0, v->r[late * (n + 1)]));
    out->rms_m = rms_m(p, v);
    for (size_t i = 0; i < p->n_arrivals; i++)
        out->n_used += p->weights[i] > 0.0;
    int err = shape_sigmas(p, v->r, out->elements_m, out->sigma_m);
    out->before_rms_m = before_m(p, v);
    return err;
}

int element_places_fit(struct element_places *out,
                       const struct element_places_config *cfg,
                       const struct element_arrival *arrivals, size_t n,
                       struct error *why)
{
    size_t elements = cfg->n_speakers + cfg->n_microphones;
    struct problem p = {.cfg = cfg,
                        .arrivals = arrivals,
                        .n_arrivals = n,
                        .n_elements = elements,
                        .n_parameters = 4 * elements + 2 + 3 * cfg->n_planes};
    struct solver v = {0};
    *out = (struct element_places){.n_speakers = cfg->n_speakers,
                                   .n_microphones = cfg->n_microphones,
                                   .n_planes = cfg->n_planes};
    int err = check(cfg, arrivals, n, why);
    if (err)
        return err;
    p.turns = malloc((cfg->n_planes + 1) * sizeof *p.turns);
    p.weights = malloc(n * sizeof *p.weights);
    out->elements_m = malloc(elements * sizeof *out->elements_m);
    out->sigma_m = malloc(elements * sizeof *out->sigma_m);
    out->channel_s = malloc(elements * sizeof *out->channel_s);
    if (!p.turns || !p.weights || !out->elements_m || !out->sigma_m || !out->channel_s ||
        solver_create(&v, &p) < 0)
        err = -ENOMEM;
    if (!err) {
        for (size_t w = 0; w < cfg->n_planes; w++)
            across(cfg->planes[w].normal, p.turns[w]);
        settle(&p, &v);
        err = report(out, &p, &v);
    }
    if (err)
        error_say(why, err, "out of memory");
    solver_destroy(&v);
    free(p.turns);
    free(p.weights);
    if (err)
        element_places_clear(out);
    return err;
}

void element_places_clear(struct element_places *p)
{
    free(p->elements_m);
    free(p->sigma_m);
    free(p->channel_s);
    *p = (struct element_places){0};
}
