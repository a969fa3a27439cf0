/* SPDX-License-Identifier: MIT */
#include "hal/room/propagate.h"

#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <fftw3.h>

#include "hal/room/mirror.h"
#include "hal/room/scatter.h"
#include "hal/room/vector.h"

enum { POINTS, FACETS, CLUTTER, MIRRORED, GROUPS };
enum { GRID = 2 }; /* samples of the impulse responses for each sample */

/* Impulses at any time onto that grid, band-limited. */
enum { ARRIVALS_TAPS = 12, ARRIVALS_PHASES = 4096 };

struct arrivals {
    float weights[ARRIVALS_PHASES + 1][ARRIVALS_TAPS];
};

/* Modified Bessel function of the first kind, order 0: its series. */
static double bessel_i0(double x)
{
    double sum = 1, term = 1;
    for (int k = 1; term > 1e-17 * sum; k++) {
        term *= x / (2 * k) * (x / (2 * k));
        sum += term;
    }
    return sum;
}

/* Kaiser's rule (1974): 12 taps and a transition of half the band stop 90 dB down. */
static double kernel(double x)
{
    const double half = ARRIVALS_TAPS / 2, beta = 8.8;
    if (fabs(x) >= half)
        return 0;
    double sinc = x == 0 ? 1 : sin(M_PI * x) / (M_PI * x);
    return sinc * bessel_i0(beta * sqrt(1 - x * x / (half * half))) / bessel_i0(beta);
}

/* The table, for signals in the lower half of the grid's band.  free() it; NULL: no
 * memory. */
static struct arrivals *arrivals_create(void)
{
    struct arrivals *a = malloc(sizeof *a);
    if (!a)
        return NULL;
    for (int p = 0; p <= ARRIVALS_PHASES; p++) {
        double w[ARRIVALS_TAPS], sum = 0;
        for (int k = 0; k < ARRIVALS_TAPS; k++) {
            double at = k - (ARRIVALS_TAPS / 2 - 1);
            w[k] = kernel(at - (double)p / ARRIVALS_PHASES);
            sum += w[k];
        }
        for (int k = 0; k < ARRIVALS_TAPS; k++)
            a->weights[p][k] = (float)(w[k] / sum);
    }
    return a;
}

/* Adds an impulse at sample t of h[n]; one that does not fit with its taps is left out.
 */
static void arrivals_add(const struct arrivals *a, float *restrict h, size_t n, double t,
                         float amplitude)
{
    const double before = ARRIVALS_TAPS / 2 - 1;
    if (!(t >= before) || t + ARRIVALS_TAPS / 2 >= (double)n)
        return;
    size_t i = (size_t)t;
    const float *w = a->weights[(size_t)((t - (double)i) * ARRIVALS_PHASES + 0.5)];
    h += i - (ARRIVALS_TAPS / 2 - 1);
    for (int k = 0; k < ARRIVALS_TAPS; k++)
        h[k] += amplitude * w[k];
}

/* The ways between each element of the array and each piece. */
struct paths {
    size_t n_pieces, room;
    double *delay; /* [n_elements][n_pieces], in the caller's unit */
    float *gain;   /* 1 / r; 0 of a piece that looks away, or that the wall does
                      not reach */
    float *cosine; /* of incidence; 1 where a piece has no front */
    float *rate;   /* how fast r grows while the elements move */
};

static void paths_clear(struct paths *l)
{
    free(l->delay);
    free(l->gain);
    free(l->cosine);
    free(l->rate);
    *l = (struct paths){.n_pieces = 0};
}

static int reserve(struct paths *l, size_t n)
{
    if (n <= l->room)
        return 0;
    paths_clear(l);
    l->delay = malloc(n * sizeof *l->delay);
    l->gain = malloc(n * sizeof *l->gain);
    l->cosine = malloc(n * sizeof *l->cosine);
    l->rate = malloc(n * sizeof *l->rate);
    if (!l->delay || !l->gain || !l->cosine || !l->rate) {
        paths_clear(l);
        return -ENOMEM;
    }
    l->room = n;
    return 0;
}

/* Fills in the ways to where sound enters (or, outward, leaves) the pieces; mirror: the
 * elements are images in it, NULL: they are there; velocity: of them all, NULL: the rate
 * is left alone.  Grows its arrays as needed.  0, -ENOMEM. */
static int paths_set(struct paths *l, const double (*elements)[3], size_t n_elements,
                     const struct scatter *s, bool outward, const struct mirror *mirror,
                     const double *velocity, double delay_per_m)
{
    if (reserve(l, n_elements * s->n) < 0)
        return -ENOMEM;
    l->n_pieces = s->n;
    for (size_t e = 0, k = 0; e < n_elements; e++)
        for (size_t i = 0; i < s->n; i++, k++) {
            const struct scatter_piece *p = &s->pieces[i];
            const double *at = outward ? p->out : p->in;
            double way[3];
            vector_add(elements[e], -1, at, way);
            double r = sqrt(vector_dot(way, way));
            bool front = p->normal[0] != 0 || p->normal[1] != 0 || p->normal[2] != 0;
            double cosine = front ? vector_dot(way, p->normal) / r : 1;
            l->delay[k] = r * delay_per_m;
            bool heard = cosine > 0 &&
                         (!mirror || mirror_reflects(mirror, elements[e], at));
            l->gain[k] = heard ? (float)(1 / r) : 0;
            l->cosine[k] = (float)cosine;
            if (velocity)
                l->rate[k] = (float)(vector_dot(way, velocity) / r);
        }
    return 0;
}

struct propagate {
    struct propagate_config cfg;
    size_t n_bins; /* n_samples / 2 + 1 */
    struct propagate_scene scene;
    const struct scatter *groups[GROUPS];
    struct paths in[GROUPS], out[GROUPS];
    struct arrivals *arrivals;
    float *impulses;         /* [n_terms][GRID * n_samples] */
    float complex *spectrum; /* [GRID * n_samples / 2 + 1] */
    float complex *sum;      /* [n_bins] */
    float complex
        *emissions;   /* [n_speakers][n_terms][n_bins], with the transforms' scale */
    float *responses; /* [n_microphones][n_bins] */
    float *heard;     /* [n_samples] */
    fftwf_plan forward, backward; /* impulses -> spectrum, sum -> heard */
};

#define TOP_TURNS 0.42 /* a sample: of the frequency that derivatives are scaled by */
#define REST      2e-3
#define MOST      24 /* terms */
#define MARGIN    64 /* samples beside a chirp, where its derivatives ring */

/* Half the chirp in radians of that frequency: what q is multiplied by. */
static double reach(size_t n_chirp)
{
    return M_PI * TOP_TURNS * (double)n_chirp;
}

size_t propagate_terms(double speed_m_s, double sound_speed_m_s, size_t n_chirp)
{
    double x = 2 * fabs(speed_m_s) / sound_speed_m_s * reach(n_chirp), rest = x;
    size_t n = 1;
    while (rest > REST && n < MOST)
        rest *= x / (double)++n;
    return n;
}

size_t propagate_length(size_t least)
{
    for (size_t n = least + (least & 1);; n += 2) {
        size_t rest = n;
        while (rest % 2 == 0)
            rest /= 2;
        while (rest % 3 == 0)
            rest /= 3;
        while (rest % 5 == 0)
            rest /= 5;
        if (rest == 1)
            return n;
    }
}

static int allocate(struct propagate *p)
{
    size_t n = p->cfg.n_samples, n_wide = GRID * n / 2 + 1;
    p->n_bins = n / 2 + 1;
    p->arrivals = arrivals_create();
    p->impulses = fftwf_malloc(p->cfg.n_terms * GRID * n * sizeof *p->impulses);
    p->spectrum = fftwf_malloc(n_wide * sizeof *p->spectrum);
    p->sum = fftwf_malloc(p->n_bins * sizeof *p->sum);
    p->emissions = fftwf_malloc(p->cfg.n_speakers * p->cfg.n_terms * p->n_bins *
                                sizeof *p->emissions);
    p->responses = malloc(p->cfg.n_microphones * p->n_bins * sizeof *p->responses);
    p->heard = fftwf_malloc(n * sizeof *p->heard);
    if (!p->arrivals || !p->impulses || !p->spectrum || !p->sum || !p->emissions ||
        !p->responses || !p->heard)
        return -ENOMEM;
    p->forward =
        fftwf_plan_dft_r2c_1d((int)(GRID * n), p->impulses, p->spectrum, FFTW_ESTIMATE);
    p->backward = fftwf_plan_dft_c2r_1d((int)n, p->sum, p->heard, FFTW_ESTIMATE);
    return p->forward && p->backward ? 0 : -ENOMEM;
}

/* From the chirp's spectrum to that of a term in p->spectrum: (u - m)^k / k! times the
 * k-th derivative, both over their scales. */
static void transform_term(struct propagate *p, const float complex *chirp, size_t term,
                           fftwf_plan forward)
{
    size_t n = p->cfg.n_samples, n_chirp = p->cfg.n_chirp;
    double half = 0.5 * (double)n_chirp;
    for (size_t k = 0; k < p->n_bins; k++) {
        double w = 2 * k < n ? (double)k / ((double)n * TOP_TURNS) : 0;
        p->sum[k] = chirp[k] / (float)n;
        for (size_t d = 0; d < term; d++)
            p->sum[k] *= (float)w * I;
    }
    fftwf_execute(p->backward);
    for (size_t i = 0; i < n; i++) {
        double u = i < n - MARGIN ? (double)i : (double)i - (double)n;
        double x = (u - half) / half, factor = u < (double)(n_chirp + MARGIN);
        for (size_t d = 1; d <= term; d++)
            factor *= x / (double)d;
        p->heard[i] *= (float)factor;
    }
    fftwf_execute(forward);
}

static int transform_emissions(struct propagate *p)
{
    size_t n = p->cfg.n_samples, n_chirp = p->cfg.n_chirp, n_terms = p->cfg.n_terms;
    fftwf_plan plan = fftwf_plan_dft_r2c_1d((int)n, p->heard, p->spectrum, FFTW_ESTIMATE);
    float complex *chirp = malloc(p->n_bins * sizeof *chirp);
    for (size_t j = 0; plan && chirp && j < p->cfg.n_speakers; j++) {
        float complex *out = p->emissions + j * n_terms * p->n_bins;
        memset(p->heard, 0, n * sizeof *p->heard);
        memcpy(p->heard, p->cfg.emissions + j * n_chirp, n_chirp * sizeof *p->heard);
        fftwf_execute(plan);
        memcpy(chirp, p->spectrum, p->n_bins * sizeof *chirp);
        for (size_t t = 0; t < n_terms; t++) {
            if (t)
                transform_term(p, chirp, t, plan);
            for (size_t k = 0; k < p->n_bins; k++)
                out[t * p->n_bins + k] = p->spectrum[k] / (float)n;
        }
    }
    int err = plan && chirp ? 0 : -ENOMEM;
    fftwf_destroy_plan(plan);
    free(chirp);
    return err;
}

int propagate_create(struct propagate **out, const struct propagate_config *cfg)
{
    *out = NULL;
    size_t margin = cfg->n_terms > 1 ? 2 * MARGIN : 0;
    if (!cfg->n_samples || cfg->n_samples % 2 || cfg->n_chirp + margin > cfg->n_samples)
        return -EINVAL;
    struct propagate *p = calloc(1, sizeof *p);
    if (!p)
        return -ENOMEM;
    p->cfg = *cfg;
    p->cfg.n_terms = cfg->n_terms > 1 ? cfg->n_terms : 1;
    int err = allocate(p);
    if (!err)
        err = transform_emissions(p);
    if (err) {
        propagate_destroy(p);
        return err;
    }
    memcpy(p->responses, cfg->responses,
           cfg->n_microphones * p->n_bins * sizeof *p->responses);
    *out = p;
    return 0;
}

int propagate_prepare(struct propagate *p, const struct propagate_scene *scene)
{
    double per_m = GRID * p->cfg.sample_rate_hz / scene->sound_speed_m_s;
    p->scene = *scene;
    p->groups[POINTS] = scene->points;
    p->groups[FACETS] = scene->facets;
    p->groups[CLUTTER] = scene->clutter;
    p->groups[MIRRORED] = scene->mirrored;
    for (int g = 0; g < GROUPS; g++) {
        bool direct = g == CLUTTER;
        const double *velocity = p->cfg.n_terms == 1 ? NULL
                                 : direct            ? scene->velocity_m_s
                                                     : scene->image_velocity_m_s;
        if (p->groups[g] && !p->groups[g]->n)
            p->groups[g] = NULL;
        if (!p->groups[g])
            continue;
        if (paths_set(&p->in[g], direct ? scene->speakers_m : scene->speaker_images_m,
                      p->cfg.n_speakers, p->groups[g], false,
                      direct ? NULL : scene->mirror, velocity, per_m) < 0 ||
            paths_set(&p->out[g],
                      direct ? scene->microphones_m : scene->microphone_images_m,
                      p->cfg.n_microphones, p->groups[g], true,
                      direct ? NULL : scene->mirror, velocity, per_m) < 0)
            return -ENOMEM;
    }
    return 0;
}

/* An impulse into each term's: the ways grow by in and out in a second, and the
 * microphone is where it has got to when the echo arrives. */
static void add_arrival(struct propagate *p, double delay, double in_m_s, double out_m_s,
                        float amplitude)
{
    size_t n = GRID * p->cfg.n_samples;
    double out = out_m_s / p->scene.sound_speed_m_s;
    double rate = (in_m_s / p->scene.sound_speed_m_s + out) * (1 + out);
    double at = GRID * p->scene.latency_samples + delay * (1 + out);
    float step = (float)(-rate / (1 + rate) * reach(p->cfg.n_chirp));
    for (size_t t = 0; t < p->cfg.n_terms; t++, amplitude *= step)
        arrivals_add(p->arrivals, p->impulses + t * n, n, at, amplitude);
}

static void add_group(struct propagate *p, int g, size_t speaker, size_t microphone,
                      double gain)
{
    if (!p->groups[g])
        return;
    size_t n = p->groups[g]->n;
    const struct scatter_piece *pieces = p->groups[g]->pieces;
    const struct paths *in = &p->in[g], *out = &p->out[g];
    size_t a = speaker * n, b = microphone * n;
    bool moves = p->cfg.n_terms > 1;
    for (size_t i = 0; i < n; i++, a++, b++) {
        float cosine = 0.5f * (in->cosine[a] + out->cosine[b]);
        float amplitude = (float)(gain * pieces[i].weight) * cosine * in->gain[a] *
                          out->gain[b];
        if (amplitude != 0)
            add_arrival(p, in->delay[a] + out->delay[b], moves ? in->rate[a] : 0,
                        moves ? out->rate[b] : 0, amplitude);
    }
}

/* Speaker (or its image, which moves otherwise) straight to the microphone. */
static void add_direct(struct propagate *p, const double from[3], const double v_from[3],
                       const double to[3], double gain)
{
    double way[3];
    if (gain == 0)
        return;
    vector_add(to, -1, from, way);
    double r = sqrt(vector_dot(way, way));
    double t = r / p->scene.sound_speed_m_s * p->cfg.sample_rate_hz;
    add_arrival(p, GRID * t, -vector_dot(way, v_from) / r,
                vector_dot(way, p->scene.velocity_m_s) / r, (float)(gain / r));
}

static void clear_impulses(struct propagate *p)
{
    memset(p->impulses, 0,
           p->cfg.n_terms * GRID * p->cfg.n_samples * sizeof *p->impulses);
}

/* The spectra of the impulses, each by its emission, onto the sum; those of facets times
 * (jk / 2 pi) = j f / c, which turns areas into amplitudes. */
static void hear_impulses(struct propagate *p, size_t speaker, bool facets)
{
    size_t n = p->cfg.n_samples;
    float per_bin = (float)(p->cfg.sample_rate_hz / (double)n / p->scene.sound_speed_m_s);
    for (size_t t = 0; t < p->cfg.n_terms; t++) {
        const float complex *emission = p->emissions +
                                        (speaker * p->cfg.n_terms + t) * p->n_bins;
        fftwf_execute_dft_r2c(p->forward, p->impulses + t * GRID * n, p->spectrum);
        for (size_t k = 0; k < p->n_bins; k++) {
            float complex x = p->spectrum[k] * emission[k];
            p->sum[k] += facets ? per_bin * (float)k * I * x : x;
        }
    }
}

const float *propagate_pair(struct propagate *p, size_t speaker, size_t microphone)
{
    const struct propagate_scene *s = &p->scene;
    const float *response = p->responses + microphone * p->n_bins;
    memset(p->sum, 0, p->n_bins * sizeof *p->sum);
    clear_impulses(p);
    add_group(p, POINTS, speaker, microphone, s->mirror_gain);
    add_group(p, CLUTTER, speaker, microphone, 1);
    add_group(p, MIRRORED, speaker, microphone, s->mirror_gain);
    add_direct(p, s->speakers_m[speaker], s->velocity_m_s, s->microphones_m[microphone],
               s->direct_gain);
    if (mirror_reflects(s->mirror, s->speaker_images_m[speaker],
                        s->microphones_m[microphone]))
        add_direct(p, s->speaker_images_m[speaker], s->image_velocity_m_s,
                   s->microphones_m[microphone], s->wall_echo_gain);
    hear_impulses(p, speaker, false);
    if (p->groups[FACETS]) {
        clear_impulses(p);
        add_group(p, FACETS, speaker, microphone, s->mirror_gain);
        hear_impulses(p, speaker, true);
    }
    for (size_t k = 0; k < p->n_bins; k++)
        p->sum[k] *= response[k];
    p->sum[0] = crealf(p->sum[0]);
    p->sum[p->n_bins - 1] = crealf(p->sum[p->n_bins - 1]);
    fftwf_execute(p->backward);
    return p->heard;
}

void propagate_destroy(struct propagate *p)
{
    if (!p)
        return;
    for (int g = 0; g < GROUPS; g++) {
        paths_clear(&p->in[g]);
        paths_clear(&p->out[g]);
    }
    fftwf_destroy_plan(p->forward);
    fftwf_destroy_plan(p->backward);
    free(p->arrivals);
    fftwf_free(p->impulses);
    fftwf_free(p->spectrum);
    fftwf_free(p->sum);
    fftwf_free(p->emissions);
    free(p->responses);
    fftwf_free(p->heard);
    free(p);
}
