/* SPDX-License-Identifier: MIT */
/* nodes/dsp/main.c: "survey", "ping", "ego", "ambient" -> pulse compression -> "traces",
 * "receipt"; where walls are from echoes, "echoes".  With "wall" the array's self-test,
 * to health: of a live array. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "msgs/topics.h"
#include "nodes/dsp/dsp.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/rt/loop.h"

#define MAX_COVERED 64 /* elements that are named */
#define MAX_MOVED   8

struct run {
    struct node *node;
    struct dsp *dsp;
    size_t silent, of; /* microphones, by their level; by what they hear: */
    struct self_test_faults heard;
    Anlos__Sensing sensing;
    uint32_t covered_microphones[MAX_COVERED], covered_speakers[MAX_COVERED];
    Anlos__MovedElement moved[MAX_MOVED], *moved_list[MAX_MOVED];
    char moved_text[128]; /* empty: none has */
    bool judges, limited;
    struct node_dropped dropped;
    uint64_t blanked; /* pings */
};

static size_t counts(void *ctx, struct device_count *out)
{
    const struct run *r = ctx;

    out[0] = (struct device_count){"pings blanked", r->blanked};
    return 1 + node_dropped_count(&r->dropped, out + 1);
}

/* Said once for an array. */
static void take_self_test(struct run *r)
{
    const char *why;
    bool judges = dsp_self_test(r->dsp, &why) != NULL;

    node_sensing(r->node, judges ? &r->sensing : NULL);
    if (!judges && why[0])
        node_log(r->node, LOG_LEVEL_WARNING,
                 "whether microphones hear the speakers is not known: %s", why);
}

static int take_survey(void *self, const struct node_message *in)
{
    struct run *r = self;
    const Anlos__Survey *survey = (const Anlos__Survey *)in->content;
    struct error why = {""};
    bool known = dsp_survey_id(r->dsp) == survey->id;
    int err = dsp_survey(r->dsp, survey, &why);

    if (!known)
        take_self_test(r);
    if (err) {
        node_state(r->node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
    } else {
        if (!known)
            node_state(r->node, ANLOS__HEALTH__STATE__READY, "ready");
        node_dropped_say(r->node, &r->dropped);
    }
    return err;
}

/* In steps of 0.2 m: each change is told at once. */
static void tell_well(struct run *r)
{
    size_t covered = r->heard.covered_microphones + r->heard.covered_speakers;

    if (covered)
        node_state(r->node, ANLOS__HEALTH__STATE__READY,
                   "ready, but %zu speakers or microphones are covered", covered);
    else if (r->moved_text[0])
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "ready, but %s", r->moved_text);
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

/* Said when the text changes, which is in tenths of a kelvin. */
static void show_air(struct run *r, const struct air *air)
{
    char text[160];

    air_text(air, text, sizeof text);
    if (air_is_distrusted(air))
        node_state(r->node, ANLOS__HEALTH__STATE__DEGRADED,
                   "%s: too much to subtract it well; record it again", text);
    else if (text[0])
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "%s", text);
    else
        tell_well(r);
    if (text[0] && air->pings == air->expected)
        node_log(r->node, LOG_LEVEL_INFO, "%zu of %zu backgrounds corrected: %s",
                 air->corrected, air->pings, text);
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

static void add_moved(struct run *r, bool speaker, size_t i,
                      const struct displacement_of *of)
{
    size_t n = r->sensing.n_moved, used = strlen(r->moved_text);

    if (!of->moved || n == MAX_MOVED)
        return;
    Anlos__MovedElement *m = r->moved_list[n] = &r->moved[n];
    anlos__moved_element__init(m);
    m->speaker = speaker;
    m->element = (uint32_t)i + 1;
    m->x_m = of->by_m[0];
    m->y_m = of->by_m[1];
    m->z_m = of->by_m[2];
    m->across_m = of->across_m;
    m->size_m = of->size_m;
    m->sigma_m = of->sigma_m;
    r->sensing.n_moved++;
    snprintf(r->moved_text + used, sizeof r->moved_text - used, "%s%s %zu",
             used ? ", " : "moved: ", speaker ? "speaker" : "microphone", i + 1);
}

static void list_moved(struct run *r, const struct self_test *t)
{
    r->sensing.n_moved = 0;
    r->moved_text[0] = '\0';
    for (size_t i = 0; i < r->heard.of_microphones; i++)
        add_moved(r, false, i, self_test_moved_microphone(t, i));
    for (size_t i = 0; i < r->heard.speakers; i++)
        add_moved(r, true, i, self_test_moved_speaker(t, i));
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

static void sense(struct run *r, const struct self_test *t)
{
    struct self_test_levels l;

    self_test_levels(t, &l);
    r->sensing.noise_db = l.noise_db;
    r->sensing.direct_db = l.direct_db;
    r->sensing.echo_db = l.echo_db;
    r->sensing.range_m = l.range_m;
    r->sensing.gate_m = l.gate_m;
    r->sensing.n_covered_microphones = list_covered(
        t, r->heard.of_microphones, self_test_covers_microphone, r->covered_microphones);
    r->sensing.n_covered_speakers =
        list_covered(t, r->heard.speakers, self_test_covers_speaker, r->covered_speakers);
    list_moved(r, t);
    node_fault(r->node, NODE_FAULT_RANGE_REDUCED, l.limited, 1);
    tell_range(r, &l);
}

/* Once the image has what it needs of it. */
static void judge(struct run *r, const struct node_message *in)
{
    const Anlos__Ping *ping = (const Anlos__Ping *)in->content;
    const char *why;
    char note[512] = "";

    if (!dsp_judge(r->dsp, ping, in->capture_ns, &r->heard, note, sizeof note))
        return;
    sense(r, dsp_self_test(r->dsp, &why));
    node_fault(r->node, NODE_FAULT_SPEAKERS_MUTE, r->heard.mute, r->heard.of_speakers);
    node_fault(r->node, NODE_FAULT_MICROPHONES_COVERED, r->heard.covered_microphones,
               r->heard.of_microphones);
    node_fault(r->node, NODE_FAULT_SPEAKERS_COVERED, r->heard.covered_speakers,
               r->heard.of_speakers);
    node_fault(r->node, NODE_FAULT_MICROPHONES_MOVED, r->heard.moved_microphones,
               r->heard.of_microphones);
    node_fault(r->node, NODE_FAULT_SPEAKERS_MOVED, r->heard.moved_speakers,
               r->heard.of_speakers);
    if (note[0])
        node_log(r->node, LOG_LEVEL_WARNING, "%s", note);
}

/* A microphone may be known by its level, by what it hears, or by both. */
static void tell_faults(struct run *r, const struct frontend_faults *c)
{
    if (c->n) {
        r->silent = c->silent;
        r->of = c->n;
        node_fault(r->node, NODE_FAULT_ELEMENTS_DAMAGED, c->damaged, c->n);
        node_fault(r->node, NODE_FAULT_CHANNELS_CLIPPED, c->clipped, c->n);
    }
    if (r->heard.deaf > r->silent)
        node_fault(r->node, NODE_FAULT_CHANNELS_SILENT, r->heard.deaf,
                   r->heard.of_microphones);
    else if (r->of)
        node_fault(r->node, NODE_FAULT_CHANNELS_SILENT, r->silent, r->of);
}

/* A recording is played no faster than it is used: of an array that stands, too, each
 * ping is answered then. */
static void acknowledge(struct node *node, const struct node_message *in)
{
    const Anlos__Ping *ping = (const Anlos__Ping *)in->content;
    Anlos__Receipt receipt = ANLOS__RECEIPT__INIT;

    receipt.scan = ping->scan;
    receipt.pass = ping->pass;
    receipt.position = ping->position;
    receipt.speaker = ping->speaker;
    receipt.frame = ping->frame;
    receipt.usable = ping->pass == ANLOS__PASS__BACKGROUND;
    node_publish(node, topic_receipt(), in->capture_ns, &receipt.base);
}

/* What cannot be sent is logged by node_publish, and retaken by the scan. */
static int take_ping(void *self, const struct node_message *in)
{
    struct run *r = self;
    struct node *node = r->node;
    struct dsp *dsp = r->dsp;
    struct dsp_output out;

    r->dropped.n += !dsp_is_planned(dsp);
    dsp_ping(dsp, (const Anlos__Ping *)in->content, in->capture_ns, &out);
    r->blanked += out.has_traces && out.traces.blanked;
    if (out.has_traces)
        node_publish(node, topic_traces(), in->capture_ns, &out.traces.base);
    if (out.has_echoes)
        node_publish(node, topic_echoes(), in->capture_ns, &out.echoes.base);
    if (out.has_receipt)
        node_publish(node, topic_receipt(), in->capture_ns, &out.receipt.base);
    else if (!out.has_traces && node_is_replayed(node))
        acknowledge(node, in);
    if (out.note[0])
        node_log(node, LOG_LEVEL_WARNING, "%s", out.note);
    judge(r, in);
    if (out.has_traces)
        show_air(r, dsp_air(dsp));
    tell_faults(r, &out.faults);
    return 0;
}

static int take_ego(void *self, const struct node_message *in)
{
    struct run *r = self;

    dsp_ego(r->dsp, (const Anlos__EgoMotion *)in->content, in->capture_ns);
    return 0;
}

static int take_ambient(void *self, const struct node_message *in)
{
    struct run *r = self;

    dsp_ambient(r->dsp, (const Anlos__Ambient *)in->content);
    return 0;
}

static int take_walls(void *self, const struct node_message *in)
{
    struct run *r = self;

    dsp_walls(r->dsp, (const Anlos__WallList *)in->content);
    return 0;
}

static bool judges(const void *self)
{
    const struct run *r = self;

    return r->judges && launchfile_has_node(node_launch(r->node), "wall");
}

static const struct loop_input inputs[] = {
    {.topic = topic_survey, .take = take_survey},
    {.topic = topic_ping, .take = take_ping},
    {.topic = topic_ego, .take = take_ego},
    {.topic = topic_ambient, .take = take_ambient},
    {.topic = topic_wall, .take = take_walls, .wanted = judges},
    {.topic = NULL},
};

static int run(struct run *r)
{
    const struct loop loop = {.inputs = inputs};

    node_device(r->node, counts, r);
    node_state(r->node, ANLOS__HEALTH__STATE__STARTING, "waits for the survey");
    int err = loop_run(r->node, &loop, r);
    node_device(r->node, NULL, NULL);
    node_sensing(r->node, NULL);
    return err;
}

int main(int argc, char **argv)
{
    struct run r = {.dropped = {.count = "pings before the survey"}};
    struct pipeline_config cfg;
    int err = node_create(&r.node, "dsp",
                          "Compresses pulses and subtracts the background.", argc, argv);

    if (!r.node)
        return err;
    launchfile_pipeline(&cfg, node_launch(r.node));
    r.judges = cfg.frontend.judges_array = !node_is_replayed(r.node);
    anlos__sensing__init(&r.sensing);
    r.sensing.covered_microphones = r.covered_microphones;
    r.sensing.covered_speakers = r.covered_speakers;
    r.sensing.moved = r.moved_list;
    err = dsp_create(&r.dsp, &cfg.frontend);
    if (!err)
        err = run(&r);
    dsp_destroy(r.dsp);
    return node_finish(r.node, err);
}
