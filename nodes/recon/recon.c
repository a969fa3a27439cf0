#include "nodes/recon/recon.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "msgs/survey.h"
#include "msgs/tensor.h"
#include "msgs/topics.h"

#define VOLUME_HEAD_SIZE 1024 /* of a volume message, without its voxels, at most */

struct recon {
    struct recon_config cfg;
    struct pool *pool;
    struct survey survey;
    uint64_t survey_id;
    struct processing processing;
    struct trace_format format;
    struct imager *imager; /* NULL: no survey yet */
    float *intensity;      /* [nz][ny][nx] */
    bool *masked;          /* [n_microphones], of the newest traces */
    bool *masked_ever;     /* [n_microphones] */
    uint32_t *in_position; /* [n_positions], pings that are in */
    uint32_t scan;
    bool new_position;
    uint64_t clipped;
    int64_t capture_ns, taken_ns;
    struct tensor_view view;
    Anlos__Vec3 origin, step;
};

int recon_create(struct recon **out, const struct recon_config *cfg)
{
    struct recon *r = calloc(1, sizeof *r);
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    size_t threads = cfg->threads ? cfg->threads : cores > 0 ? (size_t)cores : 1;

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
    survey_clear(&r->survey);
    *r = (struct recon){.cfg = r->cfg, .pool = r->pool};
}

/* The format that dsp's traces will have, known before the first of them. */
static int plan_format(struct recon *r, struct complaint *why)
{
    struct compressor *c = NULL;
    int err = compressor_create(&c, &r->processing, &r->survey, r->cfg.compression,
                                r->cfg.window, why);

    if (!err)
        compressor_format(c, &r->format);
    compressor_destroy(c);
    return err;
}

/* A volume that no message takes would be imaged, and waited for without end. */
static int check_message(const struct grid *grid, struct complaint *why)
{
    const size_t room = topic_volume()->max_size - VOLUME_HEAD_SIZE;

    if (grid_size(grid) <= room / sizeof(float))
        return 0;
    return complain(why, -EINVAL,
                    "volume: %zu voxels do not fit a message; expected at most %zu, use "
                    "larger steps",
                    grid_size(grid), room / sizeof(float));
}

static int allocate(struct recon *r, struct complaint *why)
{
    r->intensity = calloc(grid_size(&r->processing.grid), sizeof *r->intensity);
    r->masked = calloc(r->survey.n_microphones, sizeof *r->masked);
    r->masked_ever = calloc(r->survey.n_microphones, sizeof *r->masked_ever);
    r->in_position = calloc(r->survey.n_positions, sizeof *r->in_position);
    if (!r->intensity || !r->masked || !r->masked_ever || !r->in_position)
        return complain(why, -ENOMEM, "not enough memory for a volume of %zu voxels",
                        grid_size(&r->processing.grid));
    return 0;
}

int recon_survey(struct recon *r, const Anlos__Survey *survey, struct complaint *why)
{
    if (r->imager && r->survey_id == survey->id)
        return 0;
    clear(r);
    int err = survey_from_message(&r->survey, survey, why);
    if (!err)
        err = processing_plan(&r->processing, &r->survey, why);
    r->processing.imaging = r->cfg.options;
    if (!err)
        err = check_message(&r->processing.grid, why);
    if (!err)
        err = plan_format(r, why);
    if (!err)
        err = allocate(r, why);
    if (!err)
        err = processing_imager(&r->imager, &r->processing, r->cfg.method, &r->format,
                                r->pool, why);
    if (err)
        clear(r);
    else
        r->survey_id = survey->id;
    return err;
}

bool recon_is_planned(const struct recon *r)
{
    return r->imager != NULL;
}

/* Traces [n_microphones][n_samples] if they are such as were planned for, else NULL. */
static const float complex *check_traces(const struct recon *r, const Anlos__Traces *t)
{
    size_t extents[2];
    const float complex *y = t->samples ? tensor_c64(t->samples, 2, extents) : NULL;

    if (!r->imager || !y || t->survey_id != r->survey_id ||
        extents[0] != r->survey.n_microphones || extents[1] != r->format.n_samples ||
        t->n_masked != extents[0] || t->position >= r->survey.n_positions ||
        t->speaker >= r->survey.n_speakers || t->t0_s != r->format.t0_s ||
        t->rate_hz != r->format.rate_hz || t->carrier_hz != r->format.carrier_hz)
        return NULL;
    return y;
}

static void add(struct recon *r, const Anlos__Traces *t, const float complex *y)
{
    for (size_t m = 0; m < r->survey.n_microphones; m++)
        r->masked[m] = t->masked[m];
    if (!imager_add(r->imager, t->position, t->speaker, y, r->masked))
        return; /* it was in already */
    for (size_t m = 0; m < r->survey.n_microphones; m++)
        r->masked_ever[m] |= r->masked[m];
    r->clipped += t->clipped_samples;
    if (++r->in_position[t->position] == r->survey.n_speakers)
        r->new_position = true;
}

void recon_traces(struct recon *r, const Anlos__Traces *traces, int64_t capture_ns,
                  int64_t now_ns, Anlos__Receipt *receipt, char *note, size_t size)
{
    const float complex *y = check_traces(r, traces);

    note[0] = '\0';
    anlos__receipt__init(receipt);
    receipt->scan = traces->scan;
    receipt->pass = ANLOS__PASS__SCENE;
    receipt->position = traces->position;
    receipt->speaker = traces->speaker;
    receipt->usable = y != NULL;
    if (!y) {
        snprintf(note, size, "traces that do not fit the survey cannot be used");
        return;
    }
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
    return r->survey.n_positions * r->survey.n_speakers;
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

static void set_vec3(Anlos__Vec3 *out, const double v[3])
{
    anlos__vec3__init(out);
    out->x = v[0];
    out->y = v[1];
    out->z = v[2];
}

void recon_image(struct recon *r, bool preview, Anlos__Volume *out)
{
    const struct grid *grid = &r->processing.grid;

    imager_image(r->imager, r->intensity);
    r->new_position = false;
    anlos__volume__init(out);
    out->survey_id = r->survey_id;
    out->scan = r->scan;
    out->preview = preview;
    out->intensity =
        tensor_borrow_f32(&r->view, r->intensity, 3, grid->n[2], grid->n[1], grid->n[0]);
    set_vec3(&r->origin, grid->origin_m);
    set_vec3(&r->step, grid->step_m);
    out->origin_m = &r->origin;
    out->step_m = &r->step;
    out->method = (char *)r->cfg.method;
    out->pings_used = (uint32_t)imager_pings(r->imager);
    out->pings_expected = (uint32_t)recon_pings_expected(r);
    out->clipped_samples = r->clipped;
    for (size_t m = 0; m < r->survey.n_microphones; m++)
        out->microphones_masked += r->masked_ever[m];
    out->source = r->survey.source;
    out->sound_speed_m_s = r->survey.sound_speed_m_s;
}

void recon_reset(struct recon *r)
{
    if (!r->imager)
        return;
    imager_reset(r->imager);
    memset(r->in_position, 0, r->survey.n_positions * sizeof *r->in_position);
    memset(r->masked_ever, 0, r->survey.n_microphones * sizeof *r->masked_ever);
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
