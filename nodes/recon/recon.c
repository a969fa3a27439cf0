#include "nodes/recon/recon.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/recon/survey_plan.h"
#include "nodes/rt/processors.h"

struct recon {
    struct recon_config cfg;
    struct pool *pool;
    struct survey_plan plan;
    struct imager *imager; /* NULL: no survey yet */
    float *intensity;      /* [nz][ny][nx] */
    bool *masked;          /* [n_microphones], of the newest traces */
    bool *masked_ever;     /* [n_microphones] */
    uint32_t *in_position; /* [n_positions], pings that are in */
    uint32_t scan;
    bool new_position;
    uint64_t clipped;
    int64_t capture_ns, taken_ns;
};

int recon_create(struct recon **out, const struct recon_config *cfg)
{
    struct recon *r = calloc(1, sizeof *r);
    size_t threads = cfg->threads ? cfg->threads : processors_usable();

    if (!r)
        return -ENOMEM;
    r->cfg = *cfg;
    int err = pool_create(&r->pool, threads);
    if (err) {
        free(r);
        return err;
    }
    *out = r;
    return 0;
}

static void clear(struct recon *r)
{
    imager_destroy(r->imager);
    free(r->intensity);
    free(r->masked);
    free(r->masked_ever);
    free(r->in_position);
    survey_plan_clear(&r->plan);
    *r = (struct recon){.cfg = r->cfg, .pool = r->pool};
}

static int allocate(struct recon *r, struct complaint *why)
{
    r->intensity = calloc(grid_size(&r->plan.processing.grid), sizeof *r->intensity);
    r->masked = calloc(r->plan.survey.n_microphones, sizeof *r->masked);
    r->masked_ever = calloc(r->plan.survey.n_microphones, sizeof *r->masked_ever);
    r->in_position = calloc(r->plan.survey.n_positions, sizeof *r->in_position);
    if (!r->intensity || !r->masked || !r->masked_ever || !r->in_position)
        return complain(why, -ENOMEM, "not enough memory for a volume of %zu voxels",
                        grid_size(&r->plan.processing.grid));
    return 0;
}

int recon_survey(struct recon *r, const Anlos__Survey *survey, struct complaint *why)
{
    if (r->imager && r->plan.survey_id == survey->id)
        return 0;
    clear(r);
    int err =
        survey_plan_create(&r->plan, survey, r->cfg.compression, r->cfg.window, why);
    r->plan.processing.imaging = r->cfg.options;
    if (!err)
        err = allocate(r, why);
    if (!err)
        err = processing_imager(&r->imager, &r->plan.processing, r->cfg.method,
                                &r->plan.format, r->pool, why);
    if (err)
        clear(r);
    return err;
}

bool recon_is_planned(const struct recon *r)
{
    return r->imager != NULL;
}

static void add(struct recon *r, const Anlos__Traces *t, const float complex *y)
{
    for (size_t m = 0; m < r->plan.survey.n_microphones; m++)
        r->masked[m] = t->masked[m];
    if (!imager_add(r->imager, t->position, t->speaker, y, r->masked))
        return; /* it was in already */
    for (size_t m = 0; m < r->plan.survey.n_microphones; m++)
        r->masked_ever[m] |= r->masked[m];
    r->clipped += t->clipped_samples;
    if (++r->in_position[t->position] == r->plan.survey.n_speakers)
        r->new_position = true;
}

void recon_traces(struct recon *r, const Anlos__Traces *traces, int64_t capture_ns,
                  int64_t now_ns, Anlos__Receipt *receipt, char *note, size_t size)
{
    const float complex *y = r->imager ? survey_plan_traces(&r->plan, traces) : NULL;

    note[0] = '\0';
    anlos__receipt__init(receipt);
    receipt->scan = traces->scan;
    receipt->pass = ANLOS__PASS__SCENE;
    receipt->position = traces->position;
    receipt->speaker = traces->speaker;
    receipt->usable = y != NULL;
    if (!y && r->imager)
        snprintf(note, size, "traces that do not fit the survey cannot be used");
    if (!y)
        return;
    if (traces->scan != r->scan)
        recon_reset(r);
    r->scan = traces->scan;
    r->capture_ns = capture_ns;
    r->taken_ns = now_ns;
    add(r, traces, y);
}

size_t recon_pings(const struct recon *r)
{
    return r->imager ? imager_pings(r->imager) : 0;
}

size_t recon_pings_expected(const struct recon *r)
{
    return r->plan.survey.n_positions * r->plan.survey.n_speakers;
}

bool recon_is_complete(const struct recon *r)
{
    return r->imager && imager_pings(r->imager) == recon_pings_expected(r);
}

int64_t recon_capture_ns(const struct recon *r)
{
    return r->capture_ns;
}

int64_t recon_taken_ns(const struct recon *r)
{
    return r->taken_ns;
}

bool recon_has_new_position(const struct recon *r)
{
    return r->new_position;
}

void recon_image(struct recon *r, bool preview, Anlos__Volume *out)
{
    imager_image(r->imager, r->intensity);
    r->new_position = false;
    survey_plan_volume(&r->plan, r->intensity, out);
    out->scan = r->scan;
    out->preview = preview;
    out->method = (char *)r->cfg.method;
    out->pings_used = (uint32_t)imager_pings(r->imager);
    out->pings_expected = (uint32_t)recon_pings_expected(r);
    out->clipped_samples = r->clipped;
    for (size_t m = 0; m < r->plan.survey.n_microphones; m++)
        out->microphones_masked += r->masked_ever[m];
}

void recon_reset(struct recon *r)
{
    if (!r->imager)
        return;
    imager_reset(r->imager);
    memset(r->in_position, 0, r->plan.survey.n_positions * sizeof *r->in_position);
    memset(r->masked_ever, 0, r->plan.survey.n_microphones * sizeof *r->masked_ever);
    r->new_position = false;
    r->clipped = 0;
}

void recon_destroy(struct recon *r)
{
    if (!r)
        return;
    clear(r);
    pool_destroy(r->pool);
    free(r);
}
