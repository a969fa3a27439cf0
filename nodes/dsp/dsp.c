/* SPDX-License-Identifier: MIT */
#include "nodes/dsp/dsp.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "msgs/topics.h"
#include "nodes/rt/launchfile_pipeline.h"

#define MAX_COVERED 64 /* elements that are named */
#define MAX_MOVED   8
#define PLACES_NS   1000000000LL

struct dsp {
    struct node *node;
    struct frontend *frontend;
    bool judges; /* the array, by what it hears of the walls */
    struct tensor_view view;
    struct returns_room returns;
    protobuf_c_boolean *masked; /* [n_microphones] of the survey */
    size_t silent, of;          /* microphones, by their level; by what they hear: */
    struct self_test_faults heard;
    Anlos__Sensing sensing;
    uint32_t covered_microphones[MAX_COVERED], covered_speakers[MAX_COVERED];
    Anlos__MovedElement moved[MAX_MOVED], *moved_list[MAX_MOVED];
    char moved_text[128]; /* empty: none has */
    int64_t places_ns;    /* that the array was told of them last */
    bool limited;
    struct node_dropped dropped;
    uint64_t blanked;       /* pings */
    bool interfered;        /* another array is heard */
    struct tone_found tone; /* as it was told */
    char tone_text[64];     /* empty: none */
};

int dsp_create(struct dsp **out, struct node *node, const struct frontend_config *cfg)
{
    struct dsp *d = calloc(1, sizeof *d);

    if (!d)
        return -ENOMEM;
    d->node = node;
    d->judges = cfg->judges_array;
    d->dropped.count = "pings before the survey";
    anlos__sensing__init(&d->sensing);
    d->sensing.covered_microphones = d->covered_microphones;
    d->sensing.covered_speakers = d->covered_speakers;
    d->sensing.moved = d->moved_list;
    int err = frontend_create(&d->frontend, cfg);
    if (err)
        free(d);
    else
        *out = d;
    return err;
}

static size_t counts(void *self, struct device_count *out)
{
    const struct dsp *d = self;
    struct interference_levels l;

    frontend_interference(d->frontend, &l);
    out[0] = (struct device_count){"pings blanked", d->blanked};
    out[1] = (struct device_count){"pings interfered", l.pings};
    return 2 + node_dropped_count(&d->dropped, out + 2);
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

/* Said once for an array. */
static void take_self_test(struct dsp *d)
{
    const char *why;
    bool judges = frontend_self_test(d->frontend, &why) != NULL;

    node_sensing(d->node, judges ? &d->sensing : NULL);
    if (!judges && why[0])
        node_log(d->node, LOG_LEVEL_WARNING,
                 "whether microphones hear the speakers is not known: %s", why);
}

static int take_survey(void *self, const struct node_message *in)
{
    struct dsp *d = self;
    const Anlos__Survey *survey = (const Anlos__Survey *)in->content;
    struct error why = {""};
    bool known = frontend_survey_id(d->frontend) == survey->id;
    int err = dsp_survey(d, survey, &why);

    if (!known)
        take_self_test(d);
    if (err) {
        node_state(d->node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
    } else {
        if (!known)
            node_state(d->node, ANLOS__HEALTH__STATE__READY, "ready");
        node_dropped_say(d->node, &d->dropped);
    }
    return err;
}

void dsp_ego(struct dsp *d, const Anlos__EgoMotion *ego, int64_t capture_ns)
{
    struct ego_motion motion;

    frontend_ego(d->frontend, ego_from_message(&motion, ego), capture_ns);
}

static int take_ego(void *self, const struct node_message *in)
{
    dsp_ego(self, (const Anlos__EgoMotion *)in->content, in->capture_ns);
    return 0;
}

void dsp_ambient(struct dsp *d, const Anlos__Ambient *ambient)
{
    frontend_temperature(d->frontend, ambient->temperature_c);
}

static int take_ambient(void *self, const struct node_message *in)
{
    dsp_ambient(self, (const Anlos__Ambient *)in->content);
    return 0;
}

/* The self-test takes its reference of them. */
static int take_walls(void *self, const struct node_message *in)
{
    const struct dsp *d = self;
    struct error why;
    const char *none;
    struct self_test *t = frontend_self_test(d->frontend, &none);
    struct walls walls;

    if (t && !walls_from_message(&walls, (const Anlos__WallList *)in->content, &why))
        self_test_walls(t, &walls);
    return 0;
}

static void tell_interference(struct dsp *d)
{
    struct interference_levels l;

    frontend_interference(d->frontend, &l);
    node_fault(d->node, NODE_FAULT_INTERFERENCE, l.present, 1);
    if (l.present == d->interfered)
        return;
    d->interfered = l.present;
    if (l.present)
        node_log(
            d->node, LOG_LEVEL_WARNING,
            "the array of another vehicle is heard in %.0f %% of the pings: its chirps "
            "are taken out of them, and only what moves by itself is told",
            100.0 * l.share);
    else
        node_log(d->node, LOG_LEVEL_INFO, "no other array is heard any more");
}

/* A frequency may wander, and is told anew by a twentieth. */
static bool is_as_told(const struct tone_found *now, const struct tone_found *told)
{
    return now->kind == told->kind &&
           fabs(now->frequency_hz - told->frequency_hz) <= 0.05 * told->frequency_hz;
}

static void tell_tones(struct dsp *d)
{
    struct tone_found t;

    frontend_tones(d->frontend, &t);
    node_fault(d->node, NODE_FAULT_TONE, t.kind != TONE_NONE, 1);
    d->sensing.tone_hz = t.frequency_hz;
    d->sensing.tone_rms = t.rms;
    d->sensing.tone_lines = (uint32_t)t.n_lines;
    if (is_as_told(&t, &d->tone))
        return;
    d->tone = t;
    tone_found_text(&t, d->tone_text, sizeof d->tone_text);
    if (d->tone_text[0])
        node_log(d->node, LOG_LEVEL_WARNING,
                 "%s is heard, %.0f dB re full scale: electrical noise, or a sound from "
                 "outside.  What all microphones have of it alike is taken out",
                 d->tone_text, 20.0 * log10(t.rms));
    else
        node_log(d->node, LOG_LEVEL_INFO, "no steady tone is heard any more");
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

const struct air *dsp_air(const struct dsp *d)
{
    return frontend_air(d->frontend);
}

/* In steps of 0.2 m: each change is told at once. */
static void tell_well(struct dsp *d)
{
    size_t covered = d->heard.covered_microphones + d->heard.covered_speakers;

    if (covered)
        node_state(d->node, ANLOS__HEALTH__STATE__READY,
                   "ready, but %zu speakers or microphones are covered", covered);
    else if (d->interfered)
        node_state(d->node, ANLOS__HEALTH__STATE__READY,
                   "ready, but another array is heard");
    else if (d->tone_text[0])
        node_state(d->node, ANLOS__HEALTH__STATE__READY, "ready, but %s is heard",
                   d->tone_text);
    else if (d->moved_text[0])
        node_state(d->node, ANLOS__HEALTH__STATE__READY, "ready, but %s", d->moved_text);
    else if (d->limited && d->sensing.range_m == 0.0)
        node_state(d->node, ANLOS__HEALTH__STATE__READY,
                   "ready, in noise that hides everybody");
    else if (d->limited)
        node_state(d->node, ANLOS__HEALTH__STATE__READY,
                   "ready, in noise: a person is found up to %.1f m",
                   0.2 * floor(5.0 * d->sensing.range_m));
    else
        node_state(d->node, ANLOS__HEALTH__STATE__READY, "ready");
}

/* Said when the text changes, which is in tenths of a kelvin. */
static void show_air(struct dsp *d, const struct air *air)
{
    char text[160];

    air_text(air, text, sizeof text);
    if (air_is_distrusted(air))
        node_state(d->node, ANLOS__HEALTH__STATE__DEGRADED,
                   "%s: too much to subtract it well; record it again", text);
    else if (text[0])
        node_state(d->node, ANLOS__HEALTH__STATE__READY, "%s", text);
    else
        tell_well(d);
    if (text[0] && air->pings == air->expected)
        node_log(d->node, LOG_LEVEL_INFO, "%zu of %zu backgrounds corrected: %s",
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

static void add_moved(struct dsp *d, bool speaker, size_t i,
                      const struct displacement_of *of)
{
    size_t n = d->sensing.n_moved;

    if (!of->moved || n == MAX_MOVED)
        return;
    Anlos__MovedElement *m = d->moved_list[n] = &d->moved[n];
    anlos__moved_element__init(m);
    m->speaker = speaker;
    m->element = (uint32_t)i + 1;
    m->x_m = of->by_m[0];
    m->y_m = of->by_m[1];
    m->z_m = of->by_m[2];
    m->across_m = of->across_m;
    m->size_m = of->size_m;
    m->sigma_m = of->sigma_m;
    m->placed = of->placed;
    d->sensing.n_moved++;
    text_add(d->moved_text, sizeof d->moved_text, ", ", "%s%s %zu",
             d->moved_text[0] ? "" : "moved: ", speaker ? "speaker" : "microphone",
             i + 1);
}

static void list_moved(struct dsp *d, const struct self_test *t)
{
    d->sensing.n_moved = 0;
    d->moved_text[0] = '\0';
    for (size_t i = 0; i < d->heard.of_microphones; i++)
        add_moved(d, false, i, self_test_moved_microphone(t, i));
    for (size_t i = 0; i < d->heard.speakers; i++)
        add_moved(d, true, i, self_test_moved_speaker(t, i));
}

static void tell_range(struct dsp *d, const struct self_test_levels *l)
{
    if (l->limited == d->limited)
        return;
    d->limited = l->limited;
    if (l->limited && l->range_m == 0.0)
        node_log(d->node, LOG_LEVEL_WARNING,
                 "noise of %.0f dB, the wall %.0f dB over it: nobody is found",
                 l->noise_db, l->echo_db);
    else if (l->limited)
        node_log(d->node, LOG_LEVEL_WARNING,
                 "noise of %.0f dB, the wall %.0f dB over it: a person is found up to "
                 "%.1f m, not %.1f",
                 l->noise_db, l->echo_db, l->range_m, l->gate_m);
    else
        node_log(d->node, LOG_LEVEL_INFO, "a person is found up to %.1f m again",
                 l->gate_m);
}

static void sense(struct dsp *d, const struct self_test *t)
{
    struct self_test_levels l;

    self_test_levels(t, &l);
    d->sensing.noise_db = l.noise_db;
    d->sensing.direct_db = l.direct_db;
    d->sensing.echo_db = l.echo_db;
    d->sensing.range_m = l.range_m;
    d->sensing.gate_m = l.gate_m;
    d->sensing.n_covered_microphones = list_covered(
        t, d->heard.of_microphones, self_test_covers_microphone, d->covered_microphones);
    d->sensing.n_covered_speakers =
        list_covered(t, d->heard.speakers, self_test_covers_speaker, d->covered_speakers);
    list_moved(d, t);
    node_fault(d->node, NODE_FAULT_RANGE_REDUCED, l.limited, 1);
    tell_range(d, &l);
}

/* Again and again, until the survey has it. */
static void tell_places(struct dsp *d, int64_t capture_ns)
{
    Anlos__ElementPlaces places = ANLOS__ELEMENT_PLACES__INIT;
    Anlos__MovedElement *placed[MAX_MOVED];

    for (size_t i = 0; i < d->sensing.n_moved; i++)
        if (d->moved[i].placed)
            placed[places.n_moved++] = &d->moved[i];
    if (!places.n_moved ||
        (capture_ns - d->places_ns < PLACES_NS && capture_ns >= d->places_ns))
        return;
    d->places_ns = capture_ns;
    places.survey_id = frontend_survey_id(d->frontend);
    places.moved = placed;
    node_publish(d->node, topic_places(), capture_ns, &places.base);
}

/* Once the image has what it needs of it. */
static void judge(struct dsp *d, const struct node_message *in)
{
    struct ping ping;
    const char *why;
    char note[512] = "";

    ping_from_message(&ping, (const Anlos__Ping *)in->content, in->capture_ns);
    if (!frontend_judge(d->frontend, &ping, &d->heard, note, sizeof note))
        return;
    sense(d, frontend_self_test(d->frontend, &why));
    node_fault(d->node, NODE_FAULT_SPEAKERS_MUTE, d->heard.mute, d->heard.of_speakers);
    node_fault(d->node, NODE_FAULT_MICROPHONES_COVERED, d->heard.covered_microphones,
               d->heard.of_microphones);
    node_fault(d->node, NODE_FAULT_SPEAKERS_COVERED, d->heard.covered_speakers,
               d->heard.of_speakers);
    node_fault(d->node, NODE_FAULT_MICROPHONES_MOVED, d->heard.moved_microphones,
               d->heard.of_microphones);
    node_fault(d->node, NODE_FAULT_SPEAKERS_MOVED, d->heard.moved_speakers,
               d->heard.of_speakers);
    if (note[0])
        node_log(d->node, LOG_LEVEL_WARNING, "%s", note);
    tell_places(d, in->capture_ns);
}

/* A microphone may be known by its level, by what it hears, or by both. */
static void tell_faults(struct dsp *d, const struct frontend_faults *c)
{
    if (c->n) {
        d->silent = c->silent;
        d->of = c->n;
        node_fault(d->node, NODE_FAULT_ELEMENTS_DAMAGED, c->damaged, c->n);
        node_fault(d->node, NODE_FAULT_CHANNELS_CLIPPED, c->clipped, c->n);
    }
    if (d->heard.deaf > d->silent)
        node_fault(d->node, NODE_FAULT_CHANNELS_SILENT, d->heard.deaf,
                   d->heard.of_microphones);
    else if (d->of)
        node_fault(d->node, NODE_FAULT_CHANNELS_SILENT, d->silent, d->of);
}

/* A recording is played no faster than it is used: of an array that stands, too, each
 * ping is answered then. */
static void acknowledge_replayed(struct node *node, const struct node_message *in)
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
    struct dsp *d = self;
    struct node *node = d->node;
    struct dsp_output out;

    d->dropped.n += !dsp_is_planned(d);
    dsp_ping(d, (const Anlos__Ping *)in->content, in->capture_ns, &out);
    d->blanked += out.has_traces && out.traces.blanked;
    if (out.has_traces)
        node_publish(node, topic_traces(), in->capture_ns, &out.traces.base);
    if (out.has_echoes)
        node_publish(node, topic_echoes(), in->capture_ns, &out.echoes.base);
    if (out.has_receipt)
        node_publish(node, topic_receipt(), in->capture_ns, &out.receipt.base);
    else if (!out.has_traces && node_is_replayed(node))
        acknowledge_replayed(node, in);
    if (out.note[0])
        node_log(node, LOG_LEVEL_WARNING, "%s", out.note);
    judge(d, in);
    if (out.has_traces && out.traces.frame) {
        tell_interference(d);
        tell_tones(d);
    }
    if (out.has_traces)
        show_air(d, dsp_air(d));
    tell_faults(d, &out.faults);
    return 0;
}

static bool hears_walls(const void *self)
{
    const struct dsp *d = self;

    return d->judges && launchfile_has_node(node_launch(d->node), "wall");
}

static const struct loop_input inputs[] = {
    {.topic = topic_survey, .take = take_survey},
    {.topic = topic_ping, .take = take_ping},
    {.topic = topic_ego, .take = take_ego},
    {.topic = topic_ambient, .take = take_ambient},
    {.topic = topic_wall, .take = take_walls, .wanted = hears_walls},
    {.topic = NULL},
};

static void destroy(void *self)
{
    dsp_destroy(self);
}

const struct loop dsp_loop = {
    .inputs = inputs, .waits_for = "the survey", .counts = counts, .close = destroy};

void dsp_destroy(struct dsp *d)
{
    if (!d)
        return;
    frontend_destroy(d->frontend);
    returns_room_clear(&d->returns);
    free(d->masked);
    free(d);
}
