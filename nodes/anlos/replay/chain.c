/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/replay/chain.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "msgs/convert.h"
#include "nodes/recon/volume_room.h"
#include "nodes/rt/launchfile_pipeline.h"

#define MAX_NOTES (sizeof((struct chain *)0)->notes / sizeof(struct chain_note))

/* The stages follow each other without a gap. */
static void did(void *ctx, enum pipeline_stage stage)
{
    static const enum recon_stage as[] = {[PIPELINE_COMPRESS] = RECON_COMPRESS,
                                          [PIPELINE_STACK] = RECON_STACK,
                                          [PIPELINE_IMAGE] = RECON_IMAGE,
                                          [PIPELINE_DETECT] = RECON_DETECT};
    struct chain *c = ctx;

    stopwatch_lap(&c->stages[as[stage]], &c->now, false);
}

int chain_create(struct chain *c, const struct chain_config *cfg,
                 struct stopwatch stages[RECON_STAGES])
{
    *c = (struct chain){.cfg = *cfg, .stages = stages};
    c->cfg.pipeline.did = did;
    c->cfg.pipeline.ctx = c;
    sender_init(&c->sender, &cfg->sender);
    watch_init(&c->watch, &(struct watch_config){.replayed = true});
    return pipeline_create(&c->pipeline, &c->cfg.pipeline);
}

static void note(struct chain *c, const char *text)
{
    if (!text[0])
        return;
    for (size_t i = 0; i < c->n_notes; i++) {
        if (!strcmp(c->notes[i].text, text)) {
            c->notes[i].times++;
            return;
        }
    }
    if (c->n_notes == MAX_NOTES) {
        c->n_more_notes++;
        return;
    }
    struct chain_note *n = &c->notes[c->n_notes++];
    snprintf(n->text, sizeof n->text, "%s", text);
    n->times = 1;
}

/* One whose image would be too large to be published is refused, as the nodes do. */
static int plan(struct chain *c, const Anlos__Survey *message, struct error *why)
{
    struct survey survey;
    int err = survey_from_message(&survey, message, why);

    if (err)
        return err;
    err = volume_room_check(&survey, why);
    if (!err)
        err = pipeline_survey(c->pipeline, &survey, why);
    survey_clear(&survey);
    return launchfile_name_key(why, err);
}

int chain_survey(struct chain *c, const Anlos__Survey *survey, struct error *why)
{
    struct stopwatch now = stopwatch_now(false);
    int err = pipeline_survey_id(c->pipeline) == survey->id ? 0 : plan(c, survey, why);

    if (!err)
        sender_survey(&c->sender, survey);
    stopwatch_lap(&c->stages[RECON_PLAN], &now, false);
    return err;
}

/* What the can node's outbox does on a bus that takes everything at once. */
static int send_list(struct chain *c, int64_t capture_ns, int64_t now_ns,
                     struct error *why)
{
    struct sender_list list;
    int err = 0;

    sender_list(&c->sender, c->detections, capture_ns, &list);
    if (list.note)
        note(c, list.note);
    sender_finalize(&c->sender, &list, now_ns, c->list_ns);
    c->list_ns = now_ns;
    for (size_t i = 0; !err && i < list.n_frames; i++)
        err = sender_send(&c->sender, c->cfg.can, &list.frames[i], now_ns);
    if (!err)
        err = canbus_flush(c->cfg.can);
    if (!err)
        sender_sent(&c->sender, &list);
    return err ? error_say(why, err, "CAN frames: %s", strerror(-err)) : 0;
}

/* What came of a ping, or of a scan's end. */
static int take_image(struct chain *c, const struct pipeline_output *out, int err,
                      struct error *why)
{
    note(c, out->note);
    launchfile_name_key(why, err);
    if (!out->image)
        return err;
    c->volume = *out->image;
    c->n_images++;
    detections_free(c->detections);
    c->detections = NULL;
    if (err)
        return err;
    struct stopwatch now = stopwatch_now(false);
    err = detections_from_objects(&c->detections, out->objects);
    if (err)
        error_say(why, err, "not enough memory to list objects");
    else
        err = send_list(c, out->image->capture_ns, out->taken_ns, why);
    stopwatch_lap(&c->stages[RECON_DETECT], &now, false);
    return err;
}

static void follow_scan(struct chain *c, uint32_t scan)
{
    if (scan > c->newest_scan)
        c->newest_scan = scan;
}

static bool is_usable(const struct frontend_output *front)
{
    return front->outcome == FRONTEND_TRACES || front->outcome == FRONTEND_KEPT;
}

/* For people, also where the stages say nothing by themselves.  A static array goes on
 * without a ping that is of no use, and does not count it. */
static void note_ping(struct chain *c, const struct ping *ping,
                      const struct pipeline_output *out)
{
    bool lost = !is_usable(out->front) && !ping->frame;

    note(c, out->front->note);
    c->n_unusable += lost || out->unfit;
    if (lost && !out->front->note[0])
        note(c, !ping->valid ? "a ping was marked as spoilt when it was taken"
                             : "a ping has no background to be subtracted from it");
    if (out->front->outcome == FRONTEND_TRACES && out->front->traces.blanked)
        note(c, "a sound from outside drowned a ping, which is blanked");
}

static void count_ping(struct chain *c, const struct ping *ping)
{
    follow_scan(c, ping->scan);
    if (ping->pass == PASS_SCENE)
        c->n_scene_pings++;
    else
        c->n_background_pings++;
    for (size_t m = 0; m < ping->n_microphones; m++)
        c->clipped += ping->clipped[m];
}

int chain_ping(struct chain *c, const Anlos__Ping *recorded, int64_t capture_ns,
               int64_t publish_ns, struct error *why)
{
    struct pipeline_output out;
    struct ping ping;

    ping_from_message(&ping, recorded, capture_ns);
    ping.scan += c->scan_base;
    count_ping(c, &ping);
    c->now = stopwatch_now(false);
    int err = pipeline_ping(c->pipeline, &ping, publish_ns, &out, why);
    note_ping(c, &ping, &out);
    return take_image(c, &out, err, why);
}

void chain_ego(struct chain *c, const Anlos__EgoMotion *ego, int64_t capture_ns,
               int64_t publish_ns)
{
    struct ego_motion motion;
    struct error why = {""};

    if (pipeline_ego(c->pipeline, ego_from_message(&motion, ego), capture_ns, publish_ns,
                     &why))
        note(c, why.text);
}

void chain_ambient(struct chain *c, const Anlos__Ambient *ambient)
{
    pipeline_temperature(c->pipeline, ambient->temperature_c);
}

void chain_walls(struct chain *c, const Anlos__WallList *message, int64_t capture_ns)
{
    struct walls walls;
    struct error why = {""};

    if (c->cfg.pipeline.finds_walls)
        return;
    if (walls_from_message(&walls, message, &why) ||
        pipeline_walls(c->pipeline, &walls, capture_ns, &why))
        note(c, why.text);
}

void chain_given(struct chain *c, const Anlos__WallList *message, int64_t capture_ns,
                 int64_t publish_ns)
{
    const struct pipeline_config *cfg = &c->cfg.pipeline;
    struct walls given;
    struct error why = {""};

    if (!cfg->finds_walls || cfg->walls.map.from != WALL_FROM_TOPIC)
        return;
    if (walls_from_message(&given, message, &why) ||
        pipeline_given(c->pipeline, &given, capture_ns, publish_ns, &why))
        note(c, why.text);
}

int chain_end(struct chain *c, struct error *why)
{
    struct pipeline_output out;

    c->now = stopwatch_now(false);
    int err = pipeline_finish(c->pipeline, &out, why);
    return take_image(c, &out, err, why);
}

int chain_status(struct chain *c, const Anlos__ScanStatus *status, int64_t epoch_ns,
                 struct error *why)
{
    /* A scan node that was started again counts from 1 again. */
    if (c->scan_epoch_ns && epoch_ns != c->scan_epoch_ns)
        c->scan_base = c->newest_scan;
    c->scan_epoch_ns = epoch_ns;
    follow_scan(c, status->scan + c->scan_base);
    watch_scan(&c->watch, status);
    sender_let_objects(&c->sender, watch_lets_objects(&c->watch));
    return status->state == ANLOS__SCAN_STATUS__STATE__DONE ||
                   status->state == ANLOS__SCAN_STATUS__STATE__FAILED
               ? chain_end(c, why)
               : 0;
}

void chain_clear(struct chain *c)
{
    detections_free(c->detections);
    pipeline_destroy(c->pipeline);
}
