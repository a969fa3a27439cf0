/* SPDX-License-Identifier: MIT */
#include "hal/room/emitter.h"

#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <fftw3.h>

#include "hal/room/vector.h"

enum {
    FINE = 4,    /* points for each sample */
    TERMS = 8,   /* of the series around each */
    MARGIN = 64, /* samples around the emission, where its ends ring */
    BLOCK = 64,  /* samples on a straight axis */
    LANES = 16   /* samples at once: so many more may be read */
};

struct wave {
    size_t n;      /* samples of the emission */
    size_t n_row;  /* of a row of the table */
    float *series; /* [FINE][TERMS][n_row]: of points FINE apart, term by term */
};

/* The spectrum's derivative'th derivative by the sample, and of that a term of the series
 * by the point, at FINE points a sample. */
static void transform(const fftwf_complex *spectrum, size_t n, int derivative, int term,
                      fftwf_plan plan, fftwf_complex *fine)
{
    memset(fine, 0, (FINE * n / 2 + 1) * sizeof *fine);
    for (size_t k = 0; k < n / 2; k++) {
        double omega = 2 * M_PI * (double)k / (double)n;
        double complex x = spectrum[k] / (double)n;
        for (int d = 0; d < derivative; d++)
            x *= I * omega;
        for (int d = 1; d <= term; d++)
            x *= I * omega / (FINE * d);
        fine[k] = (float complex)x;
    }
    fftwf_execute(plan);
}

static int tabulate(struct wave *w, const float *samples, int derivative)
{
    size_t n = w->n + 2 * MARGIN + (w->n & 1), n_fine = FINE * n;
    int err = -ENOMEM;
    float *y = fftwf_alloc_real(n_fine);
    fftwf_complex *spectrum = fftwf_alloc_complex(n / 2 + 1);
    fftwf_complex *fine = fftwf_alloc_complex(n_fine / 2 + 1);
    fftwf_plan forward = NULL, backward = NULL;
    if (!y || !spectrum || !fine)
        goto out;
    forward = fftwf_plan_dft_r2c_1d((int)n, y, spectrum, FFTW_ESTIMATE);
    backward = fftwf_plan_dft_c2r_1d((int)n_fine, fine, y, FFTW_ESTIMATE);
    if (!forward || !backward)
        goto out;
    memset(y, 0, n * sizeof *y);
    memcpy(y + MARGIN, samples, w->n * sizeof *y);
    fftwf_execute(forward);
    for (size_t term = 0; term < TERMS; term++) {
        transform(spectrum, n, derivative, (int)term, backward, fine);
        for (size_t i = 0; i < n_fine; i++)
            w->series[(i % FINE * TERMS + term) * w->n_row + i / FINE] = y[i];
    }
    err = 0;
out:
    fftwf_destroy_plan(forward);
    fftwf_destroy_plan(backward);
    fftwf_free(y);
    fftwf_free(spectrum);
    fftwf_free(fine);
    return err;
}

int wave_create(struct wave **out, const float *samples, size_t n, int derivative)
{
    *out = NULL;
    if (!n || derivative < 0)
        return -EINVAL;
    struct wave *w = calloc(1, sizeof *w);
    if (!w)
        return -ENOMEM;
    w->n = n;
    w->n_row = n + (n & 1) + 2 * MARGIN + LANES;
    w->series = calloc(FINE * TERMS * w->n_row, sizeof *w->series);
    int err = w->series ? tabulate(w, samples, derivative) : -ENOMEM;
    if (err) {
        wave_destroy(w);
        return err;
    }
    *out = w;
    return 0;
}

void wave_destroy(struct wave *w)
{
    if (!w)
        return;
    free(w->series);
    free(w);
}

/* The place in the table at sample t, in points. */
static double place(const struct wave *w, const struct wave_axis *axis, double t)
{
    double u = (t - axis->start) / axis->length;
    return FINE * (MARGIN + (double)w->n * (u + axis->bend * u * (1 - u)));
}

/* y[n], and up to LANES beyond, of one point's row: its series at part, part + stride...
 */
static void sum_series(const float *restrict row, size_t n_row, float part, float stride,
                       float *restrict y, size_t n)
{
    for (size_t i = 0; i < n; i += LANES) {
        float sum[LANES], x[LANES];
        for (size_t k = 0; k < LANES; k++) {
            x[k] = part + stride * (float)(int)(i + k);
            sum[k] = row[(TERMS - 1) * n_row + i + k];
        }
        for (size_t term = TERMS - 1; term-- > 0;)
            for (size_t k = 0; k < LANES; k++)
                sum[k] = row[term * n_row + i + k] + x[k] * sum[k];
        memcpy(y + i, sum, sizeof sum);
    }
}

/* y[n] from a place on, a step for each sample.  As long as an axis is not far from the
 * recording's pace, samples in a row are near points FINE apart: on while the part that
 * is left is within 1. */
static void read_block(const struct wave *w, double at, double step, float *restrict y,
                       size_t n)
{
    double stride = step - FINE, each = stride == 0 ? 0 : 1 / stride;
    for (size_t i = 0, run; i < n; i += run) {
        double here = at + step * (double)i;
        size_t point = (size_t)here + (stride > 0);
        double part = here - (double)point;
        double length = each == 0 ? (double)n : ((stride > 0 ? 1 : -1) - part) * each;
        run = length < (double)(n - i) ? (size_t)length + 1 : n - i;
        run = run < n - i ? run : n - i;
        sum_series(w->series + point % FINE * TERMS * w->n_row + point / FINE, w->n_row,
                   (float)part, (float)stride, y + i, run);
    }
}

static void add_scaled(const float *restrict x, float amplitude, float *restrict y,
                       size_t n)
{
    for (size_t i = 0; i < n; i++)
        y[i] += amplitude * x[i];
}

void wave_add(const struct wave *w, const struct wave_axis *axis, float amplitude,
              float *restrict y, size_t n)
{
    double ring = MARGIN - 4;
    double first = ceil(axis->start - ring),
           last = floor(axis->start + axis->length + ring);
    if (!(last >= 0) || !(first < (double)n))
        return;
    size_t i = first > 0 ? (size_t)first : 0;
    size_t end = last + 1 < (double)n ? (size_t)last + 1 : n;
    double limit = FINE * (double)(w->n + 2 * MARGIN) - 1, a, b;
    b = place(w, axis, (double)i);
    while (i < end) {
        float block[BLOCK + LANES];
        size_t m = end - i < BLOCK ? end - i : BLOCK;
        a = b;
        b = place(w, axis, (double)(i + m));
        if (a >= 1 && b > a && b < limit) {
            read_block(w, a, (b - a) / (double)m, block, m);
            add_scaled(block, amplitude, y + i, m);
        }
        i += m;
    }
}

/* -- what is heard of it ----------------------------------------------------------------
 */

enum { POINT, FACET, WAVES };

struct emitter {
    struct emitter_config cfg;
    size_t n_bins;
    struct wave **waves; /* [up, down][n_speakers][WAVES] */
    float *responses;    /* [n_microphones][n_bins], with the transforms' scale */
    float *samples;      /* [n_samples] */
    fftwf_complex *spectrum;
    fftwf_plan forward, backward;
};

static struct wave **wave_of(const struct emitter *e, bool down, size_t speaker, int kind)
{
    return &e->waves[(down * e->cfg.n_speakers + speaker) * WAVES + (size_t)kind];
}

static int create_waves(struct emitter *e)
{
    const struct emitter_config *cfg = &e->cfg;
    int err = 0;
    for (int down = 0; down < 2 && cfg->emissions[down]; down++)
        for (size_t s = 0; s < cfg->n_speakers && !err; s++) {
            const float *x = cfg->emissions[down] + s * cfg->n_chirp;
            err = wave_create(wave_of(e, down, s, POINT), x, cfg->n_chirp, 0);
            if (!err && cfg->facets)
                err = wave_create(wave_of(e, down, s, FACET), x, cfg->n_chirp, 1);
        }
    return err;
}

int emitter_create(struct emitter **out, const struct emitter_config *cfg)
{
    *out = NULL;
    if (!cfg->n_samples || cfg->n_samples % 2 || cfg->n_chirp > cfg->n_samples)
        return -EINVAL;
    struct emitter *e = calloc(1, sizeof *e);
    if (!e)
        return -ENOMEM;
    size_t n = cfg->n_samples;
    int err = -ENOMEM;
    e->cfg = *cfg;
    e->n_bins = n / 2 + 1;
    e->waves = calloc(2 * cfg->n_speakers * WAVES, sizeof(struct wave *));
    e->responses = malloc(cfg->n_microphones * e->n_bins * sizeof *e->responses);
    e->samples = fftwf_alloc_real(n);
    e->spectrum = fftwf_alloc_complex(e->n_bins);
    if (!e->waves || !e->responses || !e->samples || !e->spectrum)
        goto fail;
    e->forward = fftwf_plan_dft_r2c_1d((int)n, e->samples, e->spectrum, FFTW_ESTIMATE);
    e->backward = fftwf_plan_dft_c2r_1d((int)n, e->spectrum, e->samples, FFTW_ESTIMATE);
    if (!e->forward || !e->backward)
        goto fail;
    for (size_t i = 0; i < cfg->n_microphones * e->n_bins; i++)
        e->responses[i] = cfg->responses[i] / (float)n;
    err = create_waves(e);
    if (err)
        goto fail;
    *out = e;
    return 0;
fail:
    emitter_destroy(e);
    return err;
}

void emitter_destroy(struct emitter *e)
{
    if (!e)
        return;
    for (size_t i = 0; e->waves && i < 2 * e->cfg.n_speakers * WAVES; i++)
        wave_destroy(e->waves[i]);
    fftwf_destroy_plan(e->forward);
    fftwf_destroy_plan(e->backward);
    fftwf_free(e->samples);
    fftwf_free(e->spectrum);
    free(e->responses);
    free(e->waves);
    free(e);
}

static void doppler_place(const struct doppler_point *p, double t_s, double out[3])
{
    vector_add(p->at_m, t_s, p->velocity_m_s, out);
}

void doppler_mirror(const double normal[3], double distance_m,
                    const struct doppler_point *p, struct doppler_point *out)
{
    vector_mirror(normal, distance_m, p->at_m, out->at_m);
    vector_mirror(normal, 0, p->velocity_m_s, out->velocity_m_s);
}

/* Sound leaves `from` at t_s and gets to `to` so much later, exactly, of things in
 * straight motion through air at rest and slower than sound: the root of |to(t + way) -
 * from(t)| = c way. */
static double doppler_way_s(const struct doppler_point *from, double t_s,
                            const struct doppler_point *to, double sound_speed_m_s)
{
    double a[3], b[3], c2 = sound_speed_m_s * sound_speed_m_s;
    doppler_place(from, t_s, a);
    doppler_place(to, t_s, b);
    vector_add(b, -1, a, b);
    double along = vector_dot(b, to->velocity_m_s);
    double slack = c2 - vector_dot(to->velocity_m_s, to->velocity_m_s);
    return (along + sqrt(along * along + slack * vector_dot(b, b))) / slack;
}

/* The time axis of an echo whose emission's beginning, middle and end arrive at samples
 * at[3]: a parabola through the three.  For a reflector that recedes from a standing
 * array at v the emission gets longer by (1 + v/c) / (1 - v/c). */
static void doppler_axis(const double at[3], struct wave_axis *out)
{
    double length = at[2] - at[0], middle = (at[1] - at[0]) / length;
    *out = (struct wave_axis){.start = at[0],
                              .length = length,
                              .bend = (0.5 - middle) / (middle * (1 - middle))};
}

/* A piece as it is met by the beginning, middle and end of the chirp. */
struct meeting {
    double t_s[3]; /* when */
    double gain;   /* 1 / r of the way in; 0: there is none */
    double cosine; /* of incidence; 1 where it has no front, 0 or less from behind */
};

static double cosine_to(const struct emitter_piece *p, const double at[3],
                        const double element[3])
{
    double way[3];
    if (p->normal[0] == 0 && p->normal[1] == 0 && p->normal[2] == 0)
        return 1;
    vector_add(element, -1, at, way);
    vector_normalize(way);
    return vector_dot(way, p->normal);
}

static double chirp_s(const struct emitter *e, int third)
{
    return 0.5 * third * (double)e->cfg.n_chirp / e->cfg.sample_rate_hz;
}

/* mirror: the source is an image in it, or NULL. */
static void meet(const struct emitter *e, const struct emitter_scene *s,
                 const struct mirror *mirror, const struct doppler_point *source,
                 const struct emitter_piece *p, struct meeting *out)
{
    double at[3], from[3];
    for (int k = 0; k < 3; k++) {
        double t_s = chirp_s(e, k);
        out->t_s[k] = t_s + doppler_way_s(source, t_s, &p->in, s->sound_speed_m_s);
    }
    out->gain = 1 / (s->sound_speed_m_s * (out->t_s[1] - chirp_s(e, 1)));
    doppler_place(&p->in, out->t_s[1], at);
    doppler_place(source, chirp_s(e, 1), from);
    out->cosine = cosine_to(p, at, from);
    if (mirror && !mirror_reflects(mirror, from, at))
        out->gain = 0;
}

static double to_samples(const struct emitter *e, const struct emitter_scene *s,
                         double t_s)
{
    return s->latency_samples + t_s * e->cfg.sample_rate_hz;
}

/* From the piece to a microphone or its image. */
static void add_echo(struct emitter *e, const struct emitter_scene *s,
                     const struct mirror *mirror, const struct emitter_piece *p,
                     const struct meeting *met, const struct doppler_point *microphone,
                     double gain, float *heard)
{
    struct wave_axis axis;
    double samples[3], way_s[3], at[3], to[3];
    for (int k = 0; k < 3; k++) {
        way_s[k] = doppler_way_s(&p->out, met->t_s[k], microphone, s->sound_speed_m_s);
        samples[k] = to_samples(e, s, met->t_s[k] + way_s[k]);
    }
    doppler_place(&p->out, met->t_s[1], at);
    doppler_place(microphone, met->t_s[1] + way_s[1], to);
    double cosine = cosine_to(p, at, to);
    if (!(cosine > 0) || (mirror && !mirror_reflects(mirror, to, at)))
        return;
    double amplitude = gain * p->weight * met->gain * (met->cosine + cosine) / 2 /
                       (s->sound_speed_m_s * way_s[1]);
    if (p->facet) /* jk / 2 pi is the derivative in time over 2 pi c */
        amplitude *= e->cfg.sample_rate_hz / (2 * M_PI * s->sound_speed_m_s);
    doppler_axis(samples, &axis);
    wave_add(*wave_of(e, s->down, s->speaker, p->facet), &axis, (float)amplitude, heard,
             e->cfg.n_samples);
}

/* Does another part of its body stand between a piece's place and an element? */
static bool is_hidden(const struct emitter_piece *pieces, size_t n, size_t self,
                      double t_s, const double at[3], const double element[3])
{
    double centre[3];
    for (size_t i = 0; i < n; i++) {
        const struct emitter_piece *p = &pieces[i];
        if (i == self || p->body != pieces[self].body || !glint_is_whole(&p->part))
            continue;
        doppler_place(&p->in, t_s, centre);
        if (glint_hides(&p->part, centre, at, element))
            return true;
    }
    return false;
}

/* As a point where a part glints in the middle of the chirp; false: it does not. */
static bool find_glint(const struct emitter *e, const struct emitter_scene *s,
                       const struct emitter_piece *pieces, size_t n, size_t self,
                       const struct doppler_point *source,
                       const struct doppler_point *microphone, struct emitter_piece *out)
{
    const struct emitter_piece *p = &pieces[self];
    double from[3], to[3], centre[3], at[3], length_m, t_s = chirp_s(e, 1);
    doppler_place(source, t_s, from);
    t_s += doppler_way_s(source, t_s, &p->in, s->sound_speed_m_s);
    doppler_place(&p->in, t_s, centre);
    doppler_place(microphone,
                  t_s + doppler_way_s(&p->in, t_s, microphone, s->sound_speed_m_s), to);
    if (!glint_find(&p->part, centre, from, to, at, &length_m) ||
        is_hidden(pieces, n, self, t_s, at, from) ||
        is_hidden(pieces, n, self, t_s, at, to))
        return false;
    *out = (struct emitter_piece){
        .in = p->in, .out = p->out, .weight = p->weight * length_m};
    for (int k = 0; k < 3; k++) {
        out->in.at_m[k] += at[k] - centre[k];
        out->out.at_m[k] += at[k] - centre[k];
    }
    return true;
}

/* A part is somewhere else for each microphone. */
static void add_part(struct emitter *e, const struct emitter_scene *s,
                     const struct mirror *mirror, const struct doppler_point *source,
                     const struct emitter_piece *pieces, size_t n, size_t self,
                     const struct doppler_point *microphones, double gain, float *heard)
{
    for (size_t m = 0; m < e->cfg.n_microphones; m++) {
        struct emitter_piece glint;
        struct meeting met;
        if (!find_glint(e, s, pieces, n, self, source, &microphones[m], &glint))
            continue;
        meet(e, s, mirror, source, &glint, &met);
        if (met.gain > 0)
            add_echo(e, s, mirror, &glint, &met, &microphones[m], gain,
                     heard + m * e->cfg.n_samples);
    }
}

/* By way of the wall, or without. */
static void add_pieces(struct emitter *e, const struct emitter_scene *s, bool by_wall,
                       const struct emitter_piece *pieces, size_t n, float *heard)
{
    const struct mirror *mirror = by_wall ? s->mirror : NULL;
    const struct doppler_point *microphones = by_wall ? s->microphone_images
                                                      : s->microphones;
    const struct doppler_point *source = by_wall ? &s->source_image : &s->source;
    double gain = by_wall ? s->mirror_gain : 1;
    for (size_t i = 0; i < n; i++) {
        struct meeting met;
        if (glint_is_part(&pieces[i].part)) {
            add_part(e, s, mirror, source, pieces, n, i, microphones, gain, heard);
            continue;
        }
        meet(e, s, mirror, source, &pieces[i], &met);
        for (size_t m = 0; m < e->cfg.n_microphones && met.cosine > 0 && met.gain > 0;
             m++)
            add_echo(e, s, mirror, &pieces[i], &met, &microphones[m], gain,
                     heard + m * e->cfg.n_samples);
    }
}

/* The speaker, or its image in a mirror, straight to the microphone. */
static void add_direct(struct emitter *e, const struct emitter_scene *s,
                       const struct mirror *mirror, const struct doppler_point *source,
                       const struct doppler_point *microphone, double gain, float *heard)
{
    struct wave_axis axis;
    double samples[3], way_s[3];
    if (gain == 0)
        return;
    for (int k = 0; k < 3; k++) {
        double t_s = chirp_s(e, k);
        way_s[k] = doppler_way_s(source, t_s, microphone, s->sound_speed_m_s);
        samples[k] = to_samples(e, s, t_s + way_s[k]);
    }
    if (mirror) {
        double from[3], to[3];
        doppler_place(source, chirp_s(e, 1), from);
        doppler_place(microphone, chirp_s(e, 1) + way_s[1], to);
        if (!mirror_reflects(mirror, from, to))
            return;
    }
    doppler_axis(samples, &axis);
    wave_add(*wave_of(e, s->down, s->speaker, POINT), &axis,
             (float)(gain / (s->sound_speed_m_s * way_s[1])), heard, e->cfg.n_samples);
}

static void respond(struct emitter *e, size_t microphone, float *heard)
{
    const float *response = e->responses + microphone * e->n_bins;
    size_t size = e->cfg.n_samples * sizeof *heard;
    memcpy(e->samples, heard, size);
    fftwf_execute(e->forward);
    for (size_t k = 0; k < e->n_bins; k++)
        e->spectrum[k] *= response[k];
    fftwf_execute(e->backward);
    memcpy(heard, e->samples, size);
}

void emitter_execute(struct emitter *e, const struct emitter_scene *s, float *heard)
{
    size_t n = e->cfg.n_samples;
    memset(heard, 0, e->cfg.n_microphones * n * sizeof *heard);
    add_pieces(e, s, true, s->hidden, s->n_hidden, heard);
    add_pieces(e, s, false, s->clutter, s->n_clutter, heard);
    add_pieces(e, s, true, s->mirrored, s->n_mirrored, heard);
    for (size_t m = 0; m < e->cfg.n_microphones; m++) {
        add_direct(e, s, NULL, &s->source, &s->microphones[m], s->direct_gain,
                   heard + m * n);
        add_direct(e, s, s->mirror, &s->source_image, &s->microphones[m],
                   s->wall_echo_gain, heard + m * n);
        respond(e, m, heard + m * n);
    }
}
