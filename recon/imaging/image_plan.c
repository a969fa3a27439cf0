/* SPDX-License-Identifier: MIT */
#include "recon/imaging/image_plan.h"

#include <string.h>

int image_plan_create(struct image_plan *p, const struct survey *survey,
                      enum compression compression, bool beyond, struct error *why)
{
    *p = (struct image_plan){.survey_id = 0};
    int err = survey_copy(&p->survey, survey);

    if (err)
        error_say(why, err, "survey: %s", strerror(-err));
    else
        err = processing_plan(&p->processing, &p->survey, why);
    if (!err)
        err = compressor_format_of(&p->format, &p->processing, &p->survey, compression,
                                   why);
    p->gate_samples = p->format.n_samples;
    if (!err && beyond && compression == COMPRESSION_MATCHED_FILTER) {
        processing_listen_beyond(&p->processing, &p->survey);
        err = compressor_format_of(&p->format, &p->processing, &p->survey, compression,
                                   why);
    }
    if (err)
        image_plan_clear(p);
    else
        p->survey_id = survey_id(survey);
    return err;
}

void image_plan_clear(struct image_plan *p)
{
    survey_clear(&p->survey);
    *p = (struct image_plan){.survey_id = 0};
}

bool image_plan_fits(const struct image_plan *p, const struct traces *t)
{
    const struct trace_format *f = &p->format;

    return p->survey_id && t->samples && t->survey_id == p->survey_id &&
           t->n_microphones == p->survey.n_microphones &&
           (t->format.n_samples == f->n_samples ||
            t->format.n_samples == p->gate_samples) &&
           t->format.t0_s == f->t0_s && t->format.rate_hz == f->rate_hz &&
           t->format.carrier_hz == f->carrier_hz && t->position < p->survey.n_positions &&
           t->speaker < p->survey.n_speakers;
}

void image_plan_volume(const struct image_plan *p, const float *intensity,
                       struct volume *out)
{
    *out = (struct volume){.survey_id = p->survey_id,
                           .grid = p->processing.grid,
                           .intensity = intensity,
                           .source = p->survey.source,
                           .sound_speed_m_s = p->survey.sound_speed_m_s};
}
