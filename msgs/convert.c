/* SPDX-License-Identifier: MIT */
#include "msgs/convert.h"

#include <float.h>
#include <math.h>

/* Beyond these it is no image of sound, and what draws axes would never come to an end.
 */
#define FARTHEST_M 1e4
#define FINEST_M   1e-6

void ping_from_message(struct ping *p, const Anlos__Ping *m, int64_t capture_ns)
{
    size_t extents[2] = {0};
    const float *samples = m->samples ? tensor_f32(m->samples, 2, extents) : NULL;

    *p = (struct ping){.survey_id = m->survey_id,
                       .capture_ns = capture_ns,
                       .scan = m->scan,
                       .frame = m->frame,
                       .pass = (enum pass)m->pass,
                       .position = m->position,
                       .speaker = m->speaker,
                       .stage_m = m->stage_m,
                       .temperature_c = m->temperature_c,
                       .down = m->down,
                       .valid = m->valid};
    if (!samples || m->n_clipped != extents[0] || m->n_not_finite != extents[0])
        return;
    p->n_microphones = extents[0];
    p->n_samples = extents[1];
    p->samples = samples;
    p->clipped = m->clipped;
    p->not_finite = m->not_finite;
}

void traces_to_message(const struct traces *t, protobuf_c_boolean *masked,
                       struct tensor_view *view, Anlos__Traces *m)
{
    anlos__traces__init(m);
    m->survey_id = t->survey_id;
    m->scan = t->scan;
    m->frame = t->frame;
    m->position = t->position;
    m->stage_m = t->stage_m;
    m->speaker = t->speaker;
    m->samples =
        tensor_borrow_c64(view, t->samples, 2, t->n_microphones, t->format.n_samples);
    m->t0_s = t->format.t0_s;
    m->rate_hz = t->format.rate_hz;
    m->carrier_hz = t->format.carrier_hz;
    for (size_t i = 0; i < t->n_microphones; i++)
        masked[i] = t->masked[i];
    m->n_masked = t->n_microphones;
    m->masked = masked;
    m->background_subtracted = t->background_subtracted;
    m->blanked = t->blanked;
    m->clipped_samples = t->clipped_samples;
    m->temperature_c = t->temperature_c;
    m->down = t->down;
}

const struct ego_motion *ego_from_message(struct ego_motion *out,
                                          const Anlos__EgoMotion *m)
{
    *out = (struct ego_motion){m->standstill ? 0.0 : m->speed_m_s,
                               m->standstill ? 0.0 : m->yaw_rate_rad_s};
    return m->valid ? out : NULL;
}

void traces_from_message(struct traces *t, struct traces_room *room,
                         const Anlos__Traces *m, int64_t capture_ns)
{
    size_t extents[2] = {0};
    const float complex *samples = m->samples ? tensor_c64(m->samples, 2, extents) : NULL;

    *t = (struct traces){.survey_id = m->survey_id,
                         .capture_ns = capture_ns,
                         .scan = m->scan,
                         .frame = m->frame,
                         .position = m->position,
                         .speaker = m->speaker,
                         .stage_m = m->stage_m,
                         .temperature_c = m->temperature_c,
                         .down = m->down,
                         .background_subtracted = m->background_subtracted,
                         .blanked = m->blanked,
                         .clipped_samples = m->clipped_samples,
                         .format = {.n_samples = extents[1],
                                    .t0_s = m->t0_s,
                                    .rate_hz = m->rate_hz,
                                    .carrier_hz = m->carrier_hz}};
    if (!samples || m->n_masked != extents[0] || extents[0] > SURVEY_MAX_ELEMENTS)
        return;
    for (size_t i = 0; i < extents[0]; i++)
        room->masked[i] = m->masked[i];
    t->n_microphones = extents[0];
    t->samples = samples;
    t->masked = room->masked;
}

static Anlos__Vec3 *set_vec3(Anlos__Vec3 *out, const double v[3])
{
    anlos__vec3__init(out);
    out->x = v[0];
    out->y = v[1];
    out->z = v[2];
    return out;
}

void volume_to_message(const struct volume *v, struct volume_view *view, Anlos__Volume *m)
{
    const struct grid *g = &v->grid;

    anlos__volume__init(m);
    m->survey_id = v->survey_id;
    m->scan = v->scan;
    m->frame = v->frame;
    m->preview = v->preview;
    m->intensity =
        tensor_borrow_f32(&view->intensity, v->intensity, 3, g->n[2], g->n[1], g->n[0]);
    m->origin_m = set_vec3(&view->origin, g->origin_m);
    m->step_m = set_vec3(&view->step, g->step_m);
    m->method = (char *)(uintptr_t)v->method; /* packing only reads */
    m->pings_used = (uint32_t)v->pings_used;
    m->age_s = v->age_s;
    m->pings_expected = (uint32_t)v->pings_expected;
    m->pings_blanked = (uint32_t)v->pings_blanked;
    m->microphones_masked = (uint32_t)v->microphones_masked;
    m->clipped_samples = v->clipped_samples;
    m->source = (Anlos__Source)v->source;
    m->sound_speed_m_s = v->sound_speed_m_s;
    m->standing_left = v->standing_left;
    m->standing_taken = v->standing_taken;
    if (v->newest) {
        const struct grid *b = &v->blocks;
        m->newest =
            tensor_borrow_f32(&view->newest, v->newest, 3, b->n[2], b->n[1], b->n[0]);
        m->newest_origin_m = set_vec3(&view->newest_origin, b->origin_m);
        m->newest_step_m = set_vec3(&view->newest_step, b->step_m);
    }
    if (v->around.intensity) {
        const struct surroundings_view *a = &v->around;
        const struct grid *c = &a->grid;
        m->coarse =
            tensor_borrow_f32(&view->coarse, a->intensity, 3, c->n[2], c->n[1], c->n[0]);
        m->coarse_origin_m = set_vec3(&view->coarse_origin, c->origin_m);
        m->coarse_step_m = set_vec3(&view->coarse_step, c->step_m);
        if (a->n_spots)
            m->beyond =
                tensor_borrow_f32(&view->beyond, a->spots[0], 2, a->n_spots, (size_t)4);
    }
}

static int read_vec3(const Anlos__Vec3 *v, double out[3])
{
    if (!v || !isfinite(v->x) || !isfinite(v->y) || !isfinite(v->z))
        return -1;
    out[0] = v->x;
    out[1] = v->y;
    out[2] = v->z;
    return 0;
}

static const float *image_grid(const Anlos__Tensor *image, const Anlos__Vec3 *origin_m,
                               const Anlos__Vec3 *step_m, struct grid *out)
{
    size_t extents[3];
    const float *x = image ? tensor_f32(image, 3, extents) : NULL;

    if (!x || read_vec3(origin_m, out->origin_m) || read_vec3(step_m, out->step_m))
        return NULL;
    for (int i = 0; i < 3; i++) {
        out->n[i] = extents[2 - i];
        if (!(fabs(out->origin_m[i]) <= FARTHEST_M && out->step_m[i] >= FINEST_M &&
              (double)out->n[i] * out->step_m[i] <= FARTHEST_M))
            return NULL;
    }
    return x;
}

const float *volume_grid(const Anlos__Volume *v, struct grid *out)
{
    return image_grid(v->intensity, v->origin_m, v->step_m, out);
}

static void around_from_message(struct surroundings_view *a, const Anlos__Volume *m)
{
    size_t extents[2] = {0, 4};
    const float *spots = m->beyond ? tensor_f32(m->beyond, 2, extents) : NULL;

    if ((m->beyond && !spots) || extents[1] != 4 || extents[0] > SURROUNDINGS_SPOTS)
        return;
    for (size_t i = 0; i < 4 * extents[0]; i++)
        if (!(fabsf(spots[i]) <= (i % 4 < 3 ? FARTHEST_M : FLT_MAX)) ||
            (i % 4 == 3 && spots[i] < 0.0f))
            return;
    a->intensity = image_grid(m->coarse, m->coarse_origin_m, m->coarse_step_m, &a->grid);
    a->n_spots = extents[0];
    a->spots = (const float(*)[4])spots;
}

void volume_from_message(struct volume *v, const Anlos__Volume *m, int64_t capture_ns)
{
    *v = (struct volume){.survey_id = m->survey_id,
                         .capture_ns = capture_ns,
                         .scan = m->scan,
                         .frame = m->frame,
                         .method = m->method,
                         .source = (enum survey_source)m->source,
                         .sound_speed_m_s = m->sound_speed_m_s,
                         .preview = m->preview,
                         .pings_used = m->pings_used,
                         .age_s = m->age_s,
                         .pings_expected = m->pings_expected,
                         .pings_blanked = m->pings_blanked,
                         .microphones_masked = m->microphones_masked,
                         .clipped_samples = m->clipped_samples,
                         .standing_left = m->standing_left,
                         .standing_taken = m->standing_taken};
    v->intensity = volume_grid(m, &v->grid);
    v->newest = image_grid(m->newest, m->newest_origin_m, m->newest_step_m, &v->blocks);
    if (v->newest && v->intensity && grid_size(&v->blocks) > grid_size(&v->grid))
        v->newest = NULL;
    if (m->coarse)
        around_from_message(&v->around, m);
}
