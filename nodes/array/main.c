/* SPDX-License-Identifier: MIT */
/* nodes/array/main.c: "array/fire", "stage/state", "scan/status", "ambient" -> the
 * speakers and microphones -> "ping", "survey" */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "msgs/convert.h"
#include "msgs/stage.pb-c.h"
#include "msgs/topics.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "nodes/array/acquisition.h"
#include "nodes/array/ambient.h"
#include "nodes/array/config.h"
#include "nodes/rt/node.h"
#include "recon/frontend/self_test.h"

#define SURVEY_PERIOD_NS 1000000000LL
#define MAX_COVERED      64 /* elements that are named */
#define MAX_FAILURES     5  /* in a row: then start the device anew */

struct run {
    struct node *node;
    struct array *array;
    struct acquisition *acquisition;
    struct self_test *self_test; /* NULL: of a recording, or it cannot be told */
    Anlos__Sensing sensing;
    uint32_t covered_microphones[MAX_COVERED], covered_speakers[MAX_COVERED];
    bool limited;
    struct survey survey; /* the array's, in the air as it is */
    struct ambient ambient;
    bool heard; /* the scan */
    int64_t survey_due_ns;
    unsigned failures;
};

static int publish_survey(struct run *r)
{
    int64_t now = node_now_ns(r->node);

    if (now < r->survey_due_ns)
        return 0;
    r->survey_due_ns = now + SURVEY_PERIOD_NS;
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

static size_t list_covered(const struct self_test *t, size_t n,
                           bool (*is_covered)(const struct self_test *t, size_t i),
                           uint32_t out[MAX_COVERED])
{
    size_t n_covered = 0;

    for (size_t i = 0; i < n && n_covered < MAX_COVERED; i++)
        if (is_covered(t, i))
            out[n_covered++] = (uint32_t)i + 1;
    return n_covered;
}

static void tell_range(struct run *r, const struct self_test_levels *l)
{
    if (l->limited == r->limited)
        return;
    r->limited = l->limited;
    if (l->limited && l->range_m == 0.0)
        node_log(r->node, LOG_LEVEL_WARNING,
                 "noise of %.0f dB, the wall %.0f dB over it: nobody is found",
                 l->noise_db, l->echo_db);
    else if (l->limited)
        node_log(r->node, LOG_LEVEL_WARNING,
                 "noise of %.0f dB, the wall %.0f dB over it: a person is found up to "
                 "%.1f m, not %.1f",
                 l->noise_db, l->echo_db, l->range_m, l->gate_m);
    else
        node_log(r->node, LOG_LEVEL_INFO, "a person is found up to %.1f m again",
                 l->gate_m);
}

static void sense(struct run *r)
{
    const struct survey *s = array_survey(r->array);
    struct self_test_levels l;

    self_test_levels(r->self_test, &l);
    r->sensing.noise_db = l.noise_db;
    r->sensing.direct_db = l.direct_db;
    r->sensing.echo_db = l.echo_db;
    r->sensing.range_m = l.range_m;
    r->sensing.gate_m = l.gate_m;
    r->sensing.n_covered_microphones = list_covered(r->self_test, s->n_microphones,
                                                    self_test_covers_microphone,
                                                    r->covered_microphones);
    r->sensing.n_covered_speakers = list_covered(
        r->self_test, s->n_speakers, self_test_covers_speaker, r->covered_speakers);
    node_fault(r->node, NODE_FAULT_RANGE_REDUCED, l.limited, 1);
    tell_range(r, &l);
}

static void judge(struct run *r, const Anlos__Ping *message)
{
    struct self_test_faults f;
    struct ping ping;
    char note[512] = "";

    if (!r->self_test)
        return;
    ping_from_message(&ping, message, 0);
    self_test_ping(r->self_test, &ping, &f, note, sizeof note);
    sense(r);
    node_fault(r->node, NODE_FAULT_CHANNELS_SILENT, f.deaf, f.of_microphones);
    node_fault(r->node, NODE_FAULT_SPEAKERS_MUTE, f.mute, f.of_speakers);
    node_fault(r->node, NODE_FAULT_MICROPHONES_COVERED, f.covered_microphones,
               f.of_microphones);
    node_fault(r->node, NODE_FAULT_SPEAKERS_COVERED, f.covered_speakers, f.of_speakers);
    if (note[0])
        node_log(r->node, LOG_LEVEL_WARNING, "%s", note);
}

static int publish_ping(struct run *r)
{
    Anlos__Ping ping;
    int64_t t0_ns;
    struct error why = {""};
    int err = acquisition_next(r->acquisition, &ping, &t0_ns, &why);

    if (!err) {
        r->failures = 0;
        /* A ping that cannot be sent is one that the scan retakes. */
        node_publish(r->node, topic_ping(), t0_ns, &ping.base);
        judge(r, &ping);
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

static void take(struct run *r, const struct node_message *in)
{
    struct error why = {""};

    if (in->topic == topic_stage_state()) {
        const Anlos__StageState *stage = (const Anlos__StageState *)in->content;
        acquisition_displaced(r->acquisition,
                              stage->held ||
                                  stage->state == ANLOS__STAGE_STATE__STATE__FAULT);
        return;
    }
    if (in->topic == topic_ambient()) {
        breathe(r, (const Anlos__Ambient *)in->content);
        return;
    }
    if (in->topic == topic_wall()) {
        struct walls walls;
        if (r->self_test &&
            !walls_from_message(&walls, (const Anlos__WallList *)in->content, &why))
            self_test_walls(r->self_test, &walls);
        return;
    }
    r->heard = true;
    if (in->topic != topic_fire())
        return;
    if (acquisition_fire(r->acquisition, (const Anlos__FireCommand *)in->content,
                         in->epoch_ns, &why))
        node_log(r->node, LOG_LEVEL_WARNING, "%s", why.text);
}

/* In steps of 0.2 m: each change is told at once. */
static void tell_well(struct run *r)
{
    size_t covered = r->sensing.n_covered_microphones + r->sensing.n_covered_speakers;

    if (covered)
        node_state(r->node, ANLOS__HEALTH__STATE__READY,
                   "ready, but %zu speakers or microphones are covered", covered);
    else if (r->limited && r->sensing.range_m == 0.0)
        node_state(r->node, ANLOS__HEALTH__STATE__READY,
                   "ready, in noise that hides everybody");
    else if (r->limited)
        node_state(r->node, ANLOS__HEALTH__STATE__READY,
                   "ready, in noise: a person is found up to %.1f m",
                   0.2 * floor(5.0 * r->sensing.range_m));
    else
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "ready");
}

/* Not ready while the device is away: the scan waits, and gives no ping up. */
static void look_at_device(struct run *r)
{
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
        tell_well(r);
    else
        node_state(r->node, ANLOS__HEALTH__STATE__STARTING, "waits for scan");
}

static size_t counts(void *device, struct device_count *out)
{
    return array_counts(device, out);
}

static int run(struct run *r)
{
    struct node_message in;
    int err = node_subscribe(r->node, topic_fire());

    /* Hearing the scan's status proves that its commands will come through. */
    if (!err)
        err = node_subscribe(r->node, topic_scan_status());
    if (!err)
        err = node_subscribe(r->node, topic_stage_state());
    if (!err)
        err = node_subscribe(r->node, topic_ambient());
    if (!err && launchfile_has_node(node_launch(r->node), "wall"))
        err = node_subscribe(r->node, topic_wall());
    while (!err) {
        look_at_device(r);
        err = publish_survey(r);
        if (!err)
            err = node_next(r->node, &in, acquisition_busy(r->acquisition) ? 0 : 100);
        if (!err)
            take(r, &in);
        else if (err == -ETIMEDOUT)
            err = acquisition_busy(r->acquisition) ? publish_ping(r) : 0;
    }
    return err;
}

/* A recording was judged when it was made, and may begin after the direct sound. */
static void create_self_test(struct run *r)
{
    const struct survey *s = array_survey(r->array);
    struct error why = {""};
    struct range_config cfg;

    if (s->source == SURVEY_REPLAY)
        return;
    array_config_range(&cfg, node_launch(r->node), s);
    anlos__sensing__init(&r->sensing);
    r->sensing.covered_microphones = r->covered_microphones;
    r->sensing.covered_speakers = r->covered_speakers;
    if (!self_test_create(&r->self_test, &cfg, s, &why))
        node_sensing(r->node, &r->sensing);
    else
        node_log(r->node, LOG_LEVEL_WARNING,
                 "whether microphones hear the speakers is not known: %s", why.text);
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
        create_self_test(&r);
        node_device(r.node, counts, r.array);
        err = run(&r);
    }
    node_device(r.node, NULL, NULL);
    self_test_destroy(r.self_test);
    survey_clear(&r.survey);
    acquisition_destroy(r.acquisition);
    array_close(r.array);
    return node_finish(r.node, err);
}
