/* recon/fast.c -- `--method fast`: every pair's trace is moved out to its midpoint with
 * its phase (recon/nmo), stacked with equal weight for each midpoint (fold), and the
 * co-located traces are migrated (recon/fk).  Good while dip moveout is small: targets
 * farther than about four times the longest half-offset. */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "recon/fk.h"
#include "recon/method.h"
#include "recon/midpoint.h"
#include "recon/nmo.h"

#define RATE_MARGIN 1.2 /* sampling rate of co-located traces over the band's width */

struct fast {
    size_t n_speakers, n_microphones;
    size_t n_in, n_out; /* samples of traces, of co-located traces */
    struct midpoints *midpoints;
    struct nmo *nmo;
    struct fk *fk;
    pthread_mutex_t *locks; /* [nx]: a line of midpoints */
    float complex *gather;  /* [nx][ny][n_out] */
    float *fold;            /* [nx][ny] pairs in the stack */
    float *weight;          /* [nx][ny] 1 / fold */
};

static size_t cells(const struct fast *f)
{
    return f->midpoints->nx * f->midpoints->ny;
}

/* Co-located traces span the gate from its mute to the farthest voxel of the image. */
static void colocated_format(struct trace_format *out, const struct imager_config *cfg,
                             const struct midpoints *m)
{
    double delays_s[2], c = cfg->geometry->sound_speed_m_s;
    grid_delays(&cfg->grid, cfg->geometry, delays_s);
    double band_hz = cfg->band_hz[1] - cfg->band_hz[0];
    double longest_m = m->half_offset_m[m->n_offsets - 1];
    double end_s = cfg->format.t0_s + (double)cfg->format.n_samples / cfg->format.rate_hz;
    double last_s =
        fmin(delays_s[1], sqrt(fmax(end_s * end_s - pow(2.0 * longest_m / c, 2.0), 0.0)));
    double first_s = fmax(2.0 * cfg->gate_m[0] / c, delays_s[0] - 16.0 / band_hz);
    out->rate_hz = fmin(RATE_MARGIN * band_hz, cfg->format.rate_hz);
    out->carrier_hz = cfg->format.carrier_hz;
    out->t0_s = first_s;
    out->n_samples = (size_t)fmax(ceil((last_s - first_s) * out->rate_hz), 0.0);
}

static int create_stages(struct fast *f, const struct imager_config *cfg,
                         const char **why)
{
    struct midpoints *m = f->midpoints;
    struct trace_format colocated;
    colocated_format(&colocated, cfg, m);
    f->n_out = colocated.n_samples;
    if (f->n_out < FK_MIN_SAMPLES) {
        *why = "a gate that overlaps the volume";
        return -ENOTSUP;
    }
    struct nmo_config nmo = {
        .sound_speed_m_s = cfg->geometry->sound_speed_m_s,
        .in = cfg->format,
        .out = colocated,
        .mute_s = 2.0 * cfg->gate_m[0] / cfg->geometry->sound_speed_m_s,
        .band_hz = cfg->band_hz[1] - cfg->band_hz[0],
        .n_offsets = m->n_offsets,
        .half_offset_m = m->half_offset_m,
    };
    int err = nmo_create(&f->nmo, &nmo);
    if (err)
        return err;
    struct fk_config fk = {
        .sound_speed_m_s = cfg->geometry->sound_speed_m_s,
        .nx = m->nx,
        .ny = m->ny,
        .x_m = m->x_m,
        .y_m = m->y_m,
        .plane_z_m = m->plane_z_m,
        .trace = colocated,
        .band_hz = {cfg->band_hz[0], cfg->band_hz[1]},
        .grid = cfg->grid,
        .pool = cfg->pool,
    };
    err = fk_create(&f->fk, &fk);
    if (err == -EINVAL)
        *why = "a volume wholly before the array (z_m beyond the elements)";
    return err == -EINVAL ? -ENOTSUP : err;
}

static int allocate(struct fast *f)
{
    f->gather = calloc(cells(f) * f->n_out, sizeof *f->gather);
    f->fold = calloc(cells(f), sizeof *f->fold);
    f->weight = calloc(cells(f), sizeof *f->weight);
    f->locks = malloc(f->midpoints->nx * sizeof *f->locks);
    for (size_t x = 0; f->locks && x < f->midpoints->nx; x++)
        pthread_mutex_init(&f->locks[x], NULL);
    return f->gather && f->fold && f->weight && f->locks ? 0 : -ENOMEM;
}

static void fast_destroy(void *state)
{
    struct fast *f = state;
    if (!f)
        return;
    for (size_t x = 0; f->locks && x < f->midpoints->nx; x++)
        pthread_mutex_destroy(&f->locks[x]);
    free(f->locks);
    free(f->gather);
    free(f->fold);
    free(f->weight);
    fk_destroy(f->fk);
    nmo_destroy(f->nmo);
    midpoints_destroy(f->midpoints);
    free(f);
}

static int fast_create(void **state, const struct imager_config *cfg, const char **why)
{
    struct fast *f = calloc(1, sizeof *f);
    if (!f)
        return -ENOMEM;
    f->n_speakers = cfg->geometry->n_speakers;
    f->n_microphones = cfg->geometry->n_microphones;
    f->n_in = cfg->format.n_samples;
    int err = midpoints_create(&f->midpoints, cfg->geometry, why);
    if (!err)
        err = create_stages(f, cfg, why);
    if (!err)
        err = allocate(f);
    if (err) {
        fast_destroy(f);
        return err;
    }
    *state = f;
    return 0;
}

static void fast_add(void *state, size_t position, size_t speaker,
                     const float complex *traces, const bool *masked)
{
    struct fast *f = state;
    const struct midpoints *m = f->midpoints;
    for (size_t i = 0; i < f->n_microphones; i++) {
        if (masked && masked[i])
            continue;
        size_t pair = speaker * f->n_microphones + i;
        size_t x = m->ix[position * m->n_pairs + pair];
        size_t cell = x * m->ny + m->iy[position * m->n_pairs + pair];
        pthread_mutex_lock(&f->locks[x]);
        nmo_stack(f->nmo, m->offset[pair], traces + i * f->n_in,
                  f->gather + cell * f->n_out);
        f->fold[cell] += 1.0f;
        pthread_mutex_unlock(&f->locks[x]);
    }
}

static void fast_image(void *state, float *intensity)
{
    struct fast *f = state;
    for (size_t q = 0; q < cells(f); q++)
        f->weight[q] = f->fold[q] > 0.0f ? 1.0f / f->fold[q] : 0.0f;
    fk_migrate(f->fk, f->gather, f->weight, intensity);
}

static void fast_reset(void *state)
{
    struct fast *f = state;
    memset(f->gather, 0, cells(f) * f->n_out * sizeof *f->gather);
    memset(f->fold, 0, cells(f) * sizeof *f->fold);
}

const struct imager_method method_fast = {
    .name = "fast",
    .create = fast_create,
    .add = fast_add,
    .image = fast_image,
    .reset = fast_reset,
    .destroy = fast_destroy,
};
