/* SPDX-License-Identifier: MIT */
/* Messages into the steps of all nodes, whoever they are for: the first survey is
 * planned for (after that of its content it may be anything that is not large). */
#include <stdlib.h>

#include "msgs/unpack.h"
#include "nodes/can/diagnosis.h"
#include "nodes/can/sender.h"
#include "nodes/dsp/dsp.h"
#include "nodes/recon/recon.h"
#include "nodes/report/report.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/track/tracking.h"
#include "recon/processing.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/messages.h"

#define MOST_SAMPLES                                                                     \
    100000 /* of a scan: more is slow with sanitizers, and finds no more */
#define MOST_VOXELS 20000

struct system {
    struct dsp *dsp;
    struct recon *recon;
    struct tracking *tracking;
    struct sender sender;
    struct watch watch;
    struct diagnosis diagnosis;
    struct report report;
    bool has_survey;
    int64_t now_ns;
};

static void start(struct system *s)
{
    const struct frontend_config dsp = {.window = WINDOW_HANN};
    const struct scan_imager_config recon = {.method = "backprojection", .threads = 1};
    struct pipeline_config cfg;
    const struct watch_config watch = {.fixed = true, .ego = true, .wall = true};
    struct sender_config sender;

    *s = (struct system){.now_ns = 1};
    FUZZ_REQUIRE(!dsp_create(&s->dsp, NULL, &dsp));
    FUZZ_REQUIRE(!recon_create(&s->recon, NULL, &recon));
    launchfile_pipeline(&cfg, NULL);
    FUZZ_REQUIRE(!tracking_create(&s->tracking, NULL, &cfg.tracker));
    sender_config_set(&sender, NULL);
    sender_init(&s->sender, &sender);
    watch_init(&s->watch, &watch);
    diagnosis_init(&s->diagnosis, 1);
    report_init(&s->report);
}

static void stop(struct system *s)
{
    dsp_destroy(s->dsp);
    recon_destroy(s->recon);
    tracking_destroy(s->tracking);
    report_clear(&s->report);
}

/* Sets the id right; is it a survey to plan for, or none at all? */
static bool is_small(Anlos__Survey *m)
{
    struct error why = {""};
    struct processing p;
    struct survey s;

    if (messages_survey(&s, m))
        return true;
    bool small = s.n_positions * s.n_speakers * s.n_microphones * s.slot_samples <
                     MOST_SAMPLES &&
                 (processing_plan(&p, &s, &why) || grid_size(&p.grid) < MOST_VOXELS);
    survey_clear(&s);
    return small;
}

static void take_survey(struct system *s, Anlos__Survey *m)
{
    struct error why = {""};

    if (s->has_survey || !is_small(m))
        return;
    FUZZ_REQUIRE(!dsp_survey(s->dsp, m, &why) == dsp_is_planned(s->dsp));
    FUZZ_REQUIRE(!recon_survey(s->recon, m, &why) == recon_is_planned(s->recon));
    tracking_survey(s->tracking, m, &why);
    sender_survey(&s->sender, m);
    report_survey(&s->report, m);
    s->has_survey = dsp_is_planned(s->dsp);
}

static void take_detections(struct system *s, const Anlos__DetectionList *m)
{
    struct sender_list *list = malloc(sizeof *list);

    FUZZ_REQUIRE(list);
    int64_t capture_ns = m->counter % 2 ? INT64_MIN : m->counter;
    watch_list(&s->watch, m, capture_ns, s->now_ns);
    diagnosis_list(&s->diagnosis, m);
    sender_list(&s->sender, m, capture_ns, list);
    sender_finalize(&s->sender, list, s->now_ns, 0);
    FUZZ_REQUIRE(list->n_frames <= SENDER_MAX_FRAMES);
    free(list);
    report_detections(&s->report, m, capture_ns);
}

static void take_volume(struct system *s, const Anlos__Volume *m)
{
    Anlos__DetectionList *list;
    struct error why = {""};

    int64_t capture_ns = m->scan % 2 ? INT64_MIN : (int64_t)m->scan * 1000000;
    if (!tracking_volume(s->tracking, m, capture_ns, &list, &why)) {
        take_detections(s, list);
        anlos__detection_list__free_unpacked(list, NULL);
    }
    report_volume(&s->report, m, m->scan % 2 ? INT64_MIN : 0, s->now_ns);
}

static void take_traces(struct system *s, const Anlos__Traces *m)
{
    Anlos__Receipt receipt;
    char note[256];

    recon_traces(s->recon, m, m->scan, s->now_ns, &receipt, note, sizeof note);
    FUZZ_REQUIRE(receipt.usable == (!note[0] && recon_is_planned(s->recon)));
}

static void take_ping(struct system *s, Anlos__Ping *m)
{
    struct dsp_output out;

    dsp_ping(s->dsp, m, 0, &out);
    /* Of an array that stands there are no receipts. */
    FUZZ_REQUIRE(out.has_traces || out.has_receipt || m->frame);
    if (out.has_traces)
        take_traces(s, &out.traces);
}

static void take_health(struct system *s, const Anlos__Health *m)
{
    report_health(&s->report, m, s->now_ns);
    watch_health(&s->watch, m, s->now_ns);
    diagnosis_health(&s->diagnosis, m, s->now_ns);
}

static void take_status(struct system *s, const Anlos__ScanStatus *m)
{
    report_status(&s->report, m, s->now_ns);
    watch_scan(&s->watch, m);
    diagnosis_scan(&s->diagnosis, m);
}

static void take_walls(struct system *s, const Anlos__WallList *m)
{
    struct error why = {""};

    watch_walls(&s->watch, m, s->now_ns);
    tracking_walls(s->tracking, m, m->n_walls % 2 ? INT64_MAX : s->now_ns, &why);
}

static void take(struct system *s, const struct topic *t, ProtobufCMessage *m)
{
    if (t == topic_survey())
        take_survey(s, (Anlos__Survey *)m);
    else if (t == topic_ping())
        take_ping(s, (Anlos__Ping *)m);
    else if (t == topic_traces())
        take_traces(s, (const Anlos__Traces *)m);
    else if (t == topic_volume())
        take_volume(s, (const Anlos__Volume *)m);
    else if (t == topic_detections())
        take_detections(s, (const Anlos__DetectionList *)m);
    else if (t == topic_health())
        take_health(s, (const Anlos__Health *)m);
    else if (t == topic_scan_status())
        take_status(s, (const Anlos__ScanStatus *)m);
    else if (t == topic_wall())
        take_walls(s, (const Anlos__WallList *)m);
    else if (t == topic_ego())
        tracking_ego(s->tracking, (const Anlos__EgoMotion *)m, s->now_ns);
    watch_step(&s->watch, s->now_ns);
}

static void end(struct system *s)
{
    struct can_frame_data frame;
    Anlos__Volume volume;

    if (recon_pings(s->recon)) {
        recon_image(s->recon, false, &volume);
        take_volume(s, &volume);
    }
    diagnosis_next(&s->diagnosis, &s->watch, s->now_ns, &s->sender.diagnosis);
    sender_status(&s->sender, &frame);
    sender_diagnosis(&s->sender, &frame);
    if (report_is_complete(&s->report, s->now_ns))
        json_decref(report_json(&s->report));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct bytes input = {data, size}, payload;
    const struct topic *topic;
    struct system s;

    start(&s);
    while (messages_next(&input, &topic, &payload)) {
        ProtobufCMessage *m = message_unpack(topic->schema, payload.size, payload.data);
        s.now_ns++;
        if (m)
            take(&s, topic, m);
        if (m)
            protobuf_c_message_free_unpacked(m, NULL);
    }
    end(&s);
    stop(&s);
    return 0;
}
