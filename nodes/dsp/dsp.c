/* SPDX-License-Identifier: MIT */
#include "nodes/dsp/dsp.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "nodes/rt/launchfile_pipeline.h"

struct dsp {
    struct frontend *frontend;
    struct tensor_view view;
    struct returns_room returns;
    protobuf_c_boolean *masked; /* [n_microphones] of the survey */
};

int dsp_create(struct dsp **out, const struct frontend_config *cfg)
{
    struct dsp *d = calloc(1, sizeof *d);

    if (!d)
        return -ENOMEM;
    int err = frontend_create(&d->frontend, cfg);
    if (err)
        free(d);
    else
        *out = d;
    return err;
}

static int plan(struct dsp *d, const struct survey *survey, struct error *why)
{
    protobuf_c_boolean *masked = calloc(survey->n_microphones, sizeof *masked);

    if (!masked) {
        frontend_forget(d->frontend);
        return error_say(why, -ENOMEM, "survey: %s", strerror(ENOMEM));
    }
    free(d->masked);
    d->masked = masked;
    return frontend_survey(d->frontend, survey, why);
}

int dsp_survey(struct dsp *d, const Anlos__Survey *message, struct error *why)
{
    struct survey survey;

    if (dsp_is_planned(d) && frontend_survey_id(d->frontend) == message->id)
        return 0;
    int err = survey_from_message(&survey, message, why);
    if (err) {
        frontend_forget(d->frontend);
        return err;
    }
    err = plan(d, &survey, why);
    survey_clear(&survey);
    return launchfile_name_key(why, err);
}

bool dsp_is_planned(const struct dsp *d)
{
    return frontend_survey_id(d->frontend) != 0;
}

uint64_t dsp_survey_id(const struct dsp *d)
{
    return frontend_survey_id(d->frontend);
}

void dsp_ego(struct dsp *d, const Anlos__EgoMotion *ego, int64_t capture_ns)
{
    struct ego_motion motion;

    frontend_ego(d->frontend, ego_from_message(&motion, ego), capture_ns);
}

void dsp_ambient(struct dsp *d, const Anlos__Ambient *ambient)
{
    frontend_temperature(d->frontend, ambient->temperature_c);
}

/* A scan takes again what was of no use; a static array goes on. */
static void acknowledge(const Anlos__Ping *ping, enum frontend_outcome outcome,
                        struct dsp_output *out)
{
    out->has_receipt = outcome != FRONTEND_TRACES && !ping->frame;
    out->receipt.scan = ping->scan;
    out->receipt.pass = outcome == FRONTEND_REFUSED ? ping->pass
                                                    : ANLOS__PASS__BACKGROUND;
    out->receipt.position = ping->position;
    out->receipt.speaker = ping->speaker;
    out->receipt.frame = ping->frame;
    out->receipt.usable = outcome == FRONTEND_KEPT;
}

void dsp_ping(struct dsp *d, const Anlos__Ping *message, int64_t capture_ns,
              struct dsp_output *out)
{
    struct frontend_output front;
    struct ping ping;

    *out = (struct dsp_output){0};
    anlos__traces__init(&out->traces);
    anlos__receipt__init(&out->receipt);
    anlos__echoes__init(&out->echoes);
    ping_from_message(&ping, message, capture_ns);
    frontend_ping(d->frontend, &ping, &front);
    memcpy(out->note, front.note, sizeof out->note);
    out->faults = front.faults;
    acknowledge(message, front.outcome, out);
    out->has_echoes = front.has_returns &&
                      !returns_to_message(&front.returns, &d->returns, &out->echoes);
    out->has_traces = front.outcome == FRONTEND_TRACES;
    if (out->has_traces)
        traces_to_message(&front.traces, d->masked, &d->view, &out->traces);
}

bool dsp_judge(struct dsp *d, const Anlos__Ping *message, int64_t capture_ns,
               struct self_test_faults *out, char *note, size_t note_size)
{
    struct ping ping;

    ping_from_message(&ping, message, capture_ns);
    return frontend_judge(d->frontend, &ping, out, note, note_size);
}

struct self_test *dsp_self_test(const struct dsp *d, const char **why)
{
    return frontend_self_test(d->frontend, why);
}

void dsp_walls(struct dsp *d, const Anlos__WallList *list)
{
    struct error why;
    const char *none;
    struct self_test *t = dsp_self_test(d, &none);
    struct walls walls;

    if (t && !walls_from_message(&walls, list, &why))
        self_test_walls(t, &walls);
}

const struct air *dsp_air(const struct dsp *d)
{
    return frontend_air(d->frontend);
}

void dsp_destroy(struct dsp *d)
{
    if (!d)
        return;
    frontend_destroy(d->frontend);
    returns_room_clear(&d->returns);
    free(d->masked);
    free(d);
}
