#include "nodes/anlos/replay/chain.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "msgs/convert.h"

#define MAX_NOTES (sizeof((struct chain *)0)->notes / sizeof(struct chain_note))

int chain_create(struct chain *c, const struct chain_config *cfg,
                 struct stopwatch stages[RECON_STAGES])
{
    *c = (struct chain){.cfg = *cfg, .stages = stages};
    sender_init(&c->sender, &cfg->sender);
    watch_init(&c->watch, &(struct watch_config){.replayed = true});
    struct wall_finder_config walls;
    int err = tracking_create(&c->tracking, &cfg->track);
    if (!err && cfg->walls) {
        finding_config(&walls, cfg->walls);
        err = finding_create(&c->finding, &walls);
    }
    if (!err)
        err = dsp_create(&c->dsp, &cfg->dsp);
    if (err)
        return err;
    return cfg->fixed ? steady_create(&c->steady, &cfg->steady)
                      : recon_create(&c->recon, &cfg->recon);
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

static void take_walls(struct chain *c, const Anlos__WallList *walls, int64_t capture_ns)
{
    struct error why = {""};

    if (tracking_walls(c->tracking, walls, capture_ns, &why) ||
        (c->steady && steady_walls(c->steady, walls, capture_ns, &why)))
        note(c, why.text);
}

/* Of one instant sound comes before the walls that were heard in it
 * (nodes/rt/replay_order.h). */
static void find_walls(struct chain *c, int64_t now_ns)
{
    int64_t stamp_ns;
    const Anlos__WallList *list = c->finding ? finding_list(c->finding, now_ns, &stamp_ns)
                                             : NULL;

    if (list)
        take_walls(c, list, stamp_ns);
}

int chain_survey(struct chain *c, const Anlos__Survey *survey, struct error *why)
{
    struct stopwatch now = stopwatch_now(false);
    int err = dsp_survey(c->dsp, survey, why);

    if (!err)
        err = c->steady ? steady_survey(c->steady, survey, why)
                        : recon_survey(c->recon, survey, why);
    if (!err)
        err = tracking_survey(c->tracking, survey, why);
    if (!err && c->finding)
        err = finding_survey(c->finding, survey, why);
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
    sender_date(&c->sender, &list, now_ns, c->list_ns);
    c->list_ns = now_ns;
    for (size_t i = 0; !err && i < list.n_frames; i++)
        err = sender_send(&c->sender, c->cfg.can, &list.frames[i], now_ns);
    if (!err)
        err = canbus_flush(c->cfg.can);
    if (!err)
        sender_told(&c->sender, &list);
    return err ? error_say(why, err, "CAN frames: %s", strerror(-err)) : 0;
}

/* Of the newest image. */
static int make_list(struct chain *c, int64_t capture_ns, int64_t taken_ns,
                     struct error *why)
{
    struct stopwatch now = stopwatch_now(false);

    c->n_images++;
    detections_free(c->detections);
    c->detections = NULL;
    int err = tracking_volume(c->tracking, &c->volume, capture_ns, &c->detections, why);
    if (!err)
        err = send_list(c, capture_ns, taken_ns, why);
    stopwatch_lap(&c->stages[RECON_DETECT], &now, false);
    return err;
}

static int make_image(struct chain *c, struct error *why)
{
    struct stopwatch now = stopwatch_now(false);
    int64_t capture_ns = recon_capture_ns(c->recon), taken_ns = recon_taken_ns(c->recon);

    recon_image(c->recon, false, &c->volume);
    stopwatch_lap(&c->stages[RECON_IMAGE], &now, false);
    c->has_image = true;
    return make_list(c, capture_ns, taken_ns, why);
}

static int take_traces(struct chain *c, const Anlos__Traces *traces, int64_t capture_ns,
                       int64_t publish_ns, struct error *why)
{
    Anlos__Receipt receipt;
    char text[128];
    struct stopwatch now = stopwatch_now(false);

    recon_traces(c->recon, traces, capture_ns, publish_ns, &receipt, text, sizeof text);
    stopwatch_lap(&c->stages[RECON_STACK], &now, false);
    c->n_unusable += !receipt.usable;
    note(c, text);
    if (!recon_is_complete(c->recon)) {
        c->has_image = false;
        return 0;
    }
    return c->has_image ? 0 : make_image(c, why);
}

/* The same of an array that stands. */
static int take_steady_traces(struct chain *c, const Anlos__Traces *traces,
                              int64_t capture_ns, int64_t publish_ns, struct error *why)
{
    char text[128];
    struct stopwatch now = stopwatch_now(false);
    bool due = steady_traces(c->steady, traces, capture_ns, text, sizeof text);

    stopwatch_lap(&c->stages[RECON_STACK], &now, false);
    note(c, text);
    if (!due)
        return 0;
    steady_image(c->steady, &c->volume);
    stopwatch_lap(&c->stages[RECON_IMAGE], &now, false);
    int64_t stamp_ns = steady_capture_ns(c->steady);
    return make_list(c, stamp_ns, publish_ns, why);
}

static void follow_scan(struct chain *c, uint32_t scan)
{
    if (scan > c->newest_scan)
        c->newest_scan = scan;
}

/* For people, where the steps say nothing by themselves. */
static void note_unusable(struct chain *c, const Anlos__Ping *ping,
                          const struct dsp_output *out)
{
    if (out->note[0])
        return;
    note(c, !ping->valid ? "a ping was marked as spoilt when it was taken"
                         : "a ping has no background to be subtracted from it");
}

static int take_ping(struct chain *c, const Anlos__Ping *ping, int64_t capture_ns,
                     int64_t publish_ns, struct error *why)
{
    struct dsp_output out;
    struct stopwatch now = stopwatch_now(false);

    follow_scan(c, ping->scan);
    if (ping->pass == ANLOS__PASS__SCENE)
        c->n_scene_pings++;
    else
        c->n_background_pings++;
    for (size_t m = 0; m < ping->n_clipped; m++)
        c->clipped += ping->clipped[m];
    dsp_ping(c->dsp, ping, capture_ns, &out);
    stopwatch_lap(&c->stages[RECON_COMPRESS], &now, false);
    note(c, out.note);
    if (out.has_receipt && !out.receipt.usable) {
        c->n_unusable++;
        note_unusable(c, ping, &out);
    }
    if (!out.has_traces)
        return 0;
    if (out.traces.blanked)
        note(c, "a sound from outside drowned a ping, which is blanked");
    return c->steady ? take_steady_traces(c, &out.traces, capture_ns, publish_ns, why)
                     : take_traces(c, &out.traces, capture_ns, publish_ns, why);
}

int chain_ping(struct chain *c, const Anlos__Ping *recorded, int64_t capture_ns,
               int64_t publish_ns, struct error *why)
{
    Anlos__Ping ping = *recorded;

    ping.scan += c->scan_base;
    int err = take_ping(c, &ping, capture_ns, publish_ns, why);
    if (c->finding)
        finding_ping(c->finding, &ping, capture_ns, publish_ns);
    find_walls(c, publish_ns);
    return err;
}

void chain_ego(struct chain *c, const Anlos__EgoMotion *ego, int64_t capture_ns,
               int64_t publish_ns)
{
    dsp_ego(c->dsp, ego, capture_ns);
    if (c->steady)
        steady_ego(c->steady, ego, capture_ns);
    tracking_ego(c->tracking, ego, capture_ns);
    if (c->finding)
        finding_ego(c->finding, ego, capture_ns);
    find_walls(c, publish_ns);
}

void chain_ambient(struct chain *c, const Anlos__Ambient *ambient)
{
    dsp_ambient(c->dsp, ambient);
}

void chain_walls(struct chain *c, const Anlos__WallList *walls, int64_t capture_ns)
{
    if (!c->cfg.walls)
        take_walls(c, walls, capture_ns);
}

void chain_given(struct chain *c, const Anlos__WallList *given, int64_t capture_ns,
                 int64_t publish_ns)
{
    struct error why = {""};

    if (!c->cfg.walls || c->cfg.walls->wall.from != WALL_FROM_TOPIC)
        return;
    if (finding_given(c->finding, given, capture_ns, &why))
        note(c, why.text);
    find_walls(c, publish_ns);
}

int chain_end(struct chain *c, struct error *why)
{
    if (c->steady)
        return 0;
    return !c->has_image && recon_pings(c->recon) ? make_image(c, why) : 0;
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
    finding_destroy(c->finding);
    tracking_destroy(c->tracking);
    steady_destroy(c->steady);
    recon_destroy(c->recon);
    dsp_destroy(c->dsp);
}
