/* nodes/recon/survey_plan.h -- what imaging derives from a survey, and the messages at
 * its two ends: traces that fit it, volumes of it. */
#ifndef ANLOS_NODES_RECON_SURVEY_PLAN_H
#define ANLOS_NODES_RECON_SURVEY_PLAN_H

#include "msgs/survey.pb-c.h"
#include "recon/survey.h"
#include "msgs/tensor.h"
#include "msgs/traces.pb-c.h"
#include "msgs/volume.pb-c.h"
#include "recon/compressor.h"

struct survey_plan {
    struct survey survey;
    uint64_t survey_id; /* 0: none yet */
    struct processing processing;
    struct trace_format format; /* of dsp's traces, known before the first of them */
    struct tensor_view view;
    Anlos__Vec3 origin, step;
};

/* window and compression as dsp has them.  0, or a negative errno and a complaint (of the
 * survey, or of a volume over the topic's size, which would be imaged for nobody); then p
 * needs no survey_plan_clear. */
int survey_plan_create(struct survey_plan *p, const Anlos__Survey *survey,
                       enum compression compression, enum window window,
                       struct complaint *why);
void survey_plan_clear(struct survey_plan *p);

/* [n_microphones][format.n_samples] if they are such as were planned for, else NULL. */
const float complex *survey_plan_traces(const struct survey_plan *p,
                                        const Anlos__Traces *t);

/* A volume of the plan's grid that borrows intensity and the plan; the rest is as it is
 * initialised. */
void survey_plan_volume(struct survey_plan *p, const float *intensity,
                        Anlos__Volume *out);

#endif
