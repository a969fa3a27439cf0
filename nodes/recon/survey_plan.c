#include "nodes/recon/survey_plan.h"

#include <errno.h>

#include "msgs/convert.h"
#include "msgs/topics.h"

#define VOLUME_HEAD_SIZE 1024 /* of a volume message, without its voxels, at most */

static int plan_format(struct survey_plan *p, enum compression compression,
                       enum window window, struct complaint *why)
{
    struct compressor *c = NULL;
    int err = compressor_create(&c, &p->processing, &p->survey, compression, window, why);

    if (!err)
        compressor_format(c, &p->format);
    compressor_destroy(c);
    return err;
}

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

int survey_plan_create(struct survey_plan *p, const Anlos__Survey *survey,
                       enum compression compression, enum window window,
                       struct complaint *why)
{
    *p = (struct survey_plan){.survey_id = 0};
    int err = survey_from_message(&p->survey, survey, why);

    if (err)
        return err;
    err = processing_plan(&p->processing, &p->survey, why);
    if (!err)
        err = check_message(&p->processing.grid, why);
    if (!err)
        err = plan_format(p, compression, window, why);
    if (err)
        survey_plan_clear(p);
    else
        p->survey_id = survey->id;
    return err;
}

void survey_plan_clear(struct survey_plan *p)
{
    survey_clear(&p->survey);
    *p = (struct survey_plan){.survey_id = 0};
}

const float complex *survey_plan_traces(const struct survey_plan *p,
                                        const Anlos__Traces *t)
{
    size_t extents[2];
    const float complex *y = t->samples ? tensor_c64(t->samples, 2, extents) : NULL;

    if (!p->survey_id || !y || t->survey_id != p->survey_id ||
        extents[0] != p->survey.n_microphones || extents[1] != p->format.n_samples ||
        t->n_masked != extents[0] || t->position >= p->survey.n_positions ||
        t->speaker >= p->survey.n_speakers || t->t0_s != p->format.t0_s ||
        t->rate_hz != p->format.rate_hz || t->carrier_hz != p->format.carrier_hz)
        return NULL;
    return y;
}

static void set_vec3(Anlos__Vec3 *out, const double v[3])
{
    anlos__vec3__init(out);
    out->x = v[0];
    out->y = v[1];
    out->z = v[2];
}

void survey_plan_volume(struct survey_plan *p, const float *intensity, Anlos__Volume *out)
{
    const struct grid *grid = &p->processing.grid;

    anlos__volume__init(out);
    out->survey_id = p->survey_id;
    out->intensity =
        tensor_borrow_f32(&p->view, intensity, 3, grid->n[2], grid->n[1], grid->n[0]);
    set_vec3(&p->origin, grid->origin_m);
    set_vec3(&p->step, grid->step_m);
    out->origin_m = &p->origin;
    out->step_m = &p->step;
    out->source = (Anlos__Source)p->survey.source;
    out->sound_speed_m_s = p->survey.sound_speed_m_s;
}
