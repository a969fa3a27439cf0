#include "msgs/convert.h"

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
