/* SPDX-License-Identifier: MIT */
#include "recon/imaging/scan_imager.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/imaging/image_plan.h"

/* From so many positions on, what lies around is imaged without the last of them: it
 * looks the same, and is there when the last ping comes. */
#define POSITIONS 8

struct scan_imager {
    struct scan_imager_config cfg;
    struct pool *pool;
    struct image_plan plan;
    struct imager *imager;                  /* NULL: no survey yet */
    float *intensity;                       /* [nz][ny][nx] */
    struct surroundings *around;            /* NULL: they cannot be imaged */
    const struct surroundings_view *looked; /* NULL: not yet */
    bool *masked_ever;                      /* [n_microphones] */
    uint32_t *in_position;                  /* [n_positions], pings that are in */
    uint32_t scan;
    bool new_position;
    uint64_t clipped;
    int64_t capture_ns;
};

int scan_imager_create(struct scan_imager **out, const struct scan_imager_config *cfg)
{
    struct scan_imager *r = calloc(1, sizeof *r);

    if (!r)
        return -ENOMEM;
    r->cfg = *cfg;
    int err = pool_create(&r->pool, cfg->threads);
    if (err) {
        free(r);
        return err;
    }
    *out = r;
    return 0;
}

static void begin(struct scan_imager *r)
{
    pool_stop_by(r->pool, r->cfg.stop, r->cfg.stop_ctx);
}

void scan_imager_forget(struct scan_imager *r)
{
    imager_destroy(r->imager);
    surroundings_destroy(r->around);
    free(r->intensity);
    free(r->masked_ever);
    free(r->in_position);
    image_plan_clear(&r->plan);
    *r = (struct scan_imager){.cfg = r->cfg, .pool = r->pool};
}

static int allocate(struct scan_imager *r, struct error *why)
{
    r->intensity = calloc(grid_size(&r->plan.processing.grid), sizeof *r->intensity);
    r->masked_ever = calloc(r->plan.survey.n_microphones, sizeof *r->masked_ever);
    r->in_position = calloc(r->plan.survey.n_positions, sizeof *r->in_position);
    if (!r->intensity || !r->masked_ever || !r->in_position)
        return error_say(why, -ENOMEM, "not enough memory for a volume of %zu voxels",
                         grid_size(&r->plan.processing.grid));
    return 0;
}

/* Where they cannot be imaged nothing is known of what lies beyond the volume. */
static int look_around(struct scan_imager *r, struct error *why)
{
    int err = processing_surroundings(&r->around, &r->plan.processing, &r->plan.format,
                                      r->pool);

    if (!err || err == -ENOTSUP || err == -EINVAL)
        return 0;
    return error_say(why, err, "what lies around the volume: %s", strerror(-err));
}

int scan_imager_survey(struct scan_imager *r, const struct survey *survey,
                       struct error *why)
{
    scan_imager_forget(r);
    begin(r);
    int err = image_plan_create(&r->plan, survey, r->cfg.compression, false, why);
    r->plan.processing.imaging = r->cfg.options;
    if (!err)
        err = allocate(r, why);
    if (!err)
        err = processing_imager(&r->imager, &r->plan.processing, r->cfg.method,
                                &r->plan.format, r->pool, why);
    if (!err)
        err = look_around(r, why);
    if (err)
        scan_imager_forget(r);
    return err;
}

uint64_t scan_imager_survey_id(const struct scan_imager *r)
{
    return r->plan.survey_id;
}

static void look(struct scan_imager *r, const struct traces *t)
{
    const struct survey *s = &r->plan.survey;
    struct imager *im = surroundings_imager(r->around);
    size_t early = (s->n_positions - 1) * s->n_speakers;

    pool_stop_by(r->pool, NULL, NULL); /* it is not made again */
    imager_add(im, t->position, t->speaker, t->samples, t->masked);
    if (s->n_positions >= POSITIONS && imager_pings(im) == early)
        r->looked = surroundings_image(r->around);
}

int scan_imager_traces(struct scan_imager *r, const struct traces *t)
{
    if (!r->imager)
        return -EAGAIN;
    if (!image_plan_fits(&r->plan, t))
        return -EINVAL;
    if (t->scan != r->scan)
        scan_imager_reset(r);
    r->scan = t->scan;
    r->capture_ns = t->capture_ns;
    if (!imager_add(r->imager, t->position, t->speaker, t->samples, t->masked))
        return 0; /* it was in already */
    if (r->around)
        look(r, t);
    for (size_t m = 0; m < t->n_microphones; m++)
        r->masked_ever[m] |= t->masked[m];
    r->clipped += t->clipped_samples;
    if (++r->in_position[t->position] == r->plan.survey.n_speakers)
        r->new_position = true;
    return 0;
}

size_t scan_imager_pings(const struct scan_imager *r)
{
    return r->imager ? imager_pings(r->imager) : 0;
}

size_t scan_imager_pings_expected(const struct scan_imager *r)
{
    return r->plan.survey.n_positions * r->plan.survey.n_speakers;
}

bool scan_imager_is_complete(const struct scan_imager *r)
{
    return r->imager && imager_pings(r->imager) == scan_imager_pings_expected(r);
}

int64_t scan_imager_capture_ns(const struct scan_imager *r)
{
    return r->capture_ns;
}

bool scan_imager_has_new_position(const struct scan_imager *r)
{
    return r->new_position;
}

int scan_imager_image(struct scan_imager *r, bool preview, struct volume *out)
{
    const struct surroundings_view *around = r->looked;

    begin(r);
    int err = imager_image(r->imager, r->intensity);
    if (!err && r->around && !preview && !around) {
        around = surroundings_image(r->around);
        err = around ? 0 : -ECANCELED;
    }
    if (err)
        return err;
    r->new_position = false;
    image_plan_volume(&r->plan, r->intensity, out);
    if (r->around && !preview)
        out->around = *around;
    out->capture_ns = r->capture_ns;
    out->scan = r->scan;
    out->preview = preview;
    out->method = r->cfg.method;
    out->pings_used = imager_pings(r->imager);
    out->pings_expected = scan_imager_pings_expected(r);
    out->clipped_samples = r->clipped;
    for (size_t m = 0; m < r->plan.survey.n_microphones; m++)
        out->microphones_masked += r->masked_ever[m];
    return 0;
}

void scan_imager_reset(struct scan_imager *r)
{
    if (!r->imager)
        return;
    imager_reset(r->imager);
    if (r->around)
        imager_reset(surroundings_imager(r->around));
    r->looked = NULL;
    memset(r->in_position, 0, r->plan.survey.n_positions * sizeof *r->in_position);
    memset(r->masked_ever, 0, r->plan.survey.n_microphones * sizeof *r->masked_ever);
    r->new_position = false;
    r->clipped = 0;
}

void scan_imager_destroy(struct scan_imager *r)
{
    if (!r)
        return;
    scan_imager_forget(r);
    pool_destroy(r->pool);
    free(r);
}
