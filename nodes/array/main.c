/* SPDX-License-Identifier: MIT */
/* nodes/array/main.c: "array/fire", "stage/state", "scan/status", "ambient" -> the
 * speakers and microphones -> "ping", "survey" */
#include <errno.h>
#include <string.h>

#include "msgs/stage.pb-c.h"
#include "msgs/topics.h"
#include "msgs/vehicle.pb-c.h"
#include "nodes/array/acquisition.h"
#include "nodes/array/ambient.h"
#include "nodes/rt/loop.h"

#define SURVEY_PERIOD_NS 1000000000LL
#define LOOK_NS          100000000LL /* at the device */
#define MAX_FAILURES     5           /* in a row: then start the device anew */

struct run {
    struct node *node;
    struct array *array;
    struct acquisition *acquisition;
    struct survey survey; /* the array's, in the air as it is */
    struct ambient ambient;
    bool heard; /* the scan */
    int64_t survey_due_ns;
    int64_t look_due_ns; /* 0: at once */
    unsigned failures;
};

static int64_t survey_due_ns(const void *self)
{
    return ((const struct run *)self)->survey_due_ns;
}

static int publish_survey(void *self)
{
    struct run *r = self;

    r->survey_due_ns = node_machine_ns(r->node) + SURVEY_PERIOD_NS;
    return node_publish(r->node, topic_survey(), 0,
                        &acquisition_survey(r->acquisition)->base);
}

/* Of an array that goes round without end: a scan is one of one air, and what was
 * recorded had its own. */
static void breathe(struct run *r, const Anlos__Ambient *said)
{
    const struct survey *measured = array_survey(r->array);
    double was_m_s = r->survey.sound_speed_m_s;

    if (measured->source == SURVEY_REPLAY || !acquisition_is_endless(r->acquisition) ||
        !ambient_take(&r->ambient, measured, &r->survey, said, node_now_ns(r->node)))
        return;
    int err = acquisition_take_survey(r->acquisition, &r->survey);
    if (err)
        node_log(r->node, LOG_LEVEL_WARNING,
                 "the vehicle's air has %.1f C, with which the survey does not work: %s",
                 said->temperature_c, strerror(-err));
    else
        node_log(
            r->node, LOG_LEVEL_INFO,
            "the vehicle's air has %.1f C: sound goes at %.1f m/s, not %.1f; imaging "
            "restarts",
            said->temperature_c, r->survey.sound_speed_m_s, was_m_s);
    r->survey_due_ns = 0;
}

static int64_t ping_due_ns(const void *self)
{
    return acquisition_busy(((const struct run *)self)->acquisition) ? 0 : LOOP_NEVER;
}

static int publish_ping(void *self)
{
    struct run *r = self;
    Anlos__Ping ping;
    int64_t t0_ns;
    struct error why = {""};
    int err = acquisition_next(r->acquisition, &ping, &t0_ns, &why);

    r->look_due_ns = 0;
    if (!err) {
        r->failures = 0;
        /* A ping that cannot be sent is one that the scan retakes. */
        node_publish(r->node, topic_ping(), t0_ns, &ping.base);
        return 0;
    }
    /* While the device is away the shot waits for it. */
    if (err == -EINTR || err == -ENODATA || err == -EAGAIN)
        return 0;
    node_log(r->node, LOG_LEVEL_WARNING, "%s", why.text[0] ? why.text : strerror(-err));
    if (err == -EINVAL)
        return err;
    return ++r->failures < MAX_FAILURES ? 0 : -EIO;
}

static int take_stage(void *self, const struct node_message *in)
{
    struct run *r = self;
    const Anlos__StageState *stage = (const Anlos__StageState *)in->content;

    acquisition_displaced(
        r->acquisition, stage->held || stage->state == ANLOS__STAGE_STATE__STATE__FAULT);
    return 0;
}

static int take_ambient(void *self, const struct node_message *in)
{
    breathe(self, (const Anlos__Ambient *)in->content);
    return 0;
}

static int take_status(void *self, const struct node_message *in)
{
    struct run *r = self;

    (void)in;
    r->heard = true;
    return 0;
}

static int take_fire(void *self, const struct node_message *in)
{
    struct run *r = self;
    struct error why = {""};

    if (acquisition_fire(r->acquisition, (const Anlos__FireCommand *)in->content,
                         in->epoch_ns, &why))
        node_log(r->node, LOG_LEVEL_WARNING, "%s", why.text);
    return take_status(self, in);
}

/* Not ready while the device is away: the scan waits, and gives no ping up. */
static int look_at_device(void *self)
{
    struct run *r = self;
    struct error why;

    while (array_notice(r->array, &why))
        node_log(r->node, LOG_LEVEL_WARNING, "%s", why.text);
    int err = array_condition(r->array, &why);
    node_ended(r->node, acquisition_has_ended(r->acquisition));
    node_fault(r->node, NODE_FAULT_ARRAY_AWAY, err != 0, 1);
    if (err)
        node_state(r->node, ANLOS__HEALTH__STATE__STARTING, "%s", why.text);
    else if (acquisition_has_ended(r->acquisition))
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "the recording has ended");
    else if (r->heard)
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "ready");
    else
        node_state(r->node, ANLOS__HEALTH__STATE__STARTING, "waits for scan");
    r->look_due_ns = node_machine_ns(r->node) + LOOK_NS;
    return 0;
}

static int64_t look_due_ns(const void *self)
{
    return ((const struct run *)self)->look_due_ns;
}

static size_t counts(void *device, struct device_count *out)
{
    return array_counts(device, out);
}

/* Hearing the scan's status proves that its commands will come through. */
static const struct loop_input inputs[] = {
    {.topic = topic_fire, .take = take_fire},
    {.topic = topic_scan_status, .take = take_status},
    {.topic = topic_stage_state, .take = take_stage},
    {.topic = topic_ambient, .take = take_ambient},
    {.topic = NULL},
};

static const struct loop_timer timers[] = {
    {.due_ns = look_due_ns, .run = look_at_device, .when = LOOP_EACH},
    {.due_ns = survey_due_ns, .run = publish_survey},
    {.due_ns = ping_due_ns, .run = publish_ping, .when = LOOP_LAST},
    {.run = NULL},
};

/* A recording was judged when it was made. */
static void check_judge(const struct run *r)
{
    if (array_survey(r->array)->source != SURVEY_REPLAY &&
        !launchfile_has_node(node_launch(r->node), "dsp"))
        node_log(
            r->node, LOG_LEVEL_WARNING,
            "node dsp judges microphones and speakers, and the launch file has none: "
            "what is deaf, mute or covered will not be told; add it to nodes");
}

int main(int argc, char **argv)
{
    struct run r = {0};
    struct error why = {""};
    int err = node_create(&r.node, "array",
                          "Fires the speakers, records every microphone.", argc, argv);

    if (!r.node)
        return err;
    err = array_open(&r.array, node_launch(r.node)->array.uri, node_clock(r.node), &why);
    if (err)
        node_log(r.node, LOG_LEVEL_ERROR, "%s", why.text);
    if (!err)
        err = acquisition_create(&r.acquisition, r.array);
    if (!err)
        err = survey_copy(&r.survey, array_survey(r.array));
    if (!err) {
        check_judge(&r);
        node_device(r.node, counts, r.array);
        const struct loop loop = {.inputs = inputs, .timers = timers};
        err = loop_run(r.node, &loop, &r);
    }
    node_device(r.node, NULL, NULL);
    survey_clear(&r.survey);
    acquisition_destroy(r.acquisition);
    array_close(r.array);
    return node_finish(r.node, err);
}
