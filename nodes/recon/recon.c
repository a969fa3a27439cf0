/* SPDX-License-Identifier: MIT */
#include "nodes/recon/recon.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "msgs/convert.h"
#include "msgs/topics.h"
#include "nodes/recon/volume_room.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/rt/process.h"
#include "nodes/rt/stop.h"

#define REPEAT_NS         2000000000LL /* the last volume, for whoever missed it */
#define PLAN_S            60.0         /* at most: of a fine volume */
#define IMAGE_S           600.0        /* of a sharpened one */
#define PREVIEW_PAUSE     4 /* times what a preview took: most time is for pings */
#define PREVIEW_PAUSE_MIN 100000000LL

struct recon {
    struct node *node;
    struct scan_imager *imager;
    struct traces_room traces;
    struct volume_view view;
    int64_t taken_ns; /* when the newest traces came */
    struct node_dropped dropped;
    int64_t scan_epoch_ns;
    int64_t preview_due_ns, repeat_due_ns;
    bool has_final; /* of what is in: */
    Anlos__Volume final;
};

/* A fine or sharpened image takes longer than a launcher waits. */
static bool stops(void *unused)
{
    (void)unused;
    return stop_requested();
}

int recon_create(struct recon **out, struct node *node,
                 const struct scan_imager_config *asked)
{
    struct scan_imager_config cfg = *asked;
    struct recon *r = calloc(1, sizeof *r);

    if (!r)
        return -ENOMEM;
    r->node = node;
    r->dropped.count = "traces before the survey";
    cfg.threads = cfg.threads ? cfg.threads : processors_usable();
    if (node)
        cfg.stop = stops;
    int err = scan_imager_create(&r->imager, &cfg);
    if (err)
        free(r);
    else
        *out = r;
    return err;
}

static size_t counts(void *self, struct device_count *out)
{
    return node_dropped_count(&((const struct recon *)self)->dropped, out);
}

int recon_survey(struct recon *r, const Anlos__Survey *message, struct error *why)
{
    struct survey survey;

    if (recon_is_planned(r) && scan_imager_survey_id(r->imager) == message->id)
        return 0;
    scan_imager_forget(r->imager);
    int err = survey_from_message(&survey, message, why);
    if (err)
        return err;
    err = volume_room_check(&survey, why);
    if (!err)
        err = scan_imager_survey(r->imager, &survey, why);
    survey_clear(&survey);
    return launchfile_name_key(why, err);
}

bool recon_is_planned(const struct recon *r)
{
    return scan_imager_survey_id(r->imager) != 0;
}

static int take_survey(void *self, const struct node_message *in)
{
    struct recon *r = self;
    struct error why = {""};

    if (!recon_is_planned(r))
        node_busy(r->node, PLAN_S);
    int err = recon_survey(r, (const Anlos__Survey *)in->content, &why);

    if (err) {
        node_state(r->node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
    } else {
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "ready");
        node_dropped_say(r->node, &r->dropped);
    }
    return err;
}

size_t recon_pings(const struct recon *r)
{
    return scan_imager_pings(r->imager);
}

bool recon_is_complete(const struct recon *r)
{
    return scan_imager_is_complete(r->imager);
}

int64_t recon_capture_ns(const struct recon *r)
{
    return scan_imager_capture_ns(r->imager);
}

bool recon_has_new_position(const struct recon *r)
{
    return scan_imager_has_new_position(r->imager);
}

int recon_image(struct recon *r, bool preview, Anlos__Volume *out)
{
    struct volume volume;
    int err = scan_imager_image(r->imager, preview, &volume);

    if (err)
        return err;
    volume_room_fit(&volume);
    volume_to_message(&volume, &r->view, out);
    return 0;
}

int64_t recon_taken_ns(const struct recon *r)
{
    return r->taken_ns;
}

static void publish_volume(struct recon *r, Anlos__Volume *v)
{
    v->imaging_s = 1e-9 * (double)(node_now_ns(r->node) - r->taken_ns);
    node_publish(r->node, topic_volume(), recon_capture_ns(r), &v->base);
}

static void publish_final(struct recon *r)
{
    node_busy(r->node, IMAGE_S);
    if (recon_image(r, false, &r->final))
        return;
    publish_volume(r, &r->final);
    r->has_final = true;
    r->repeat_due_ns = node_machine_ns(r->node) + REPEAT_NS;
    node_log(r->node, LOG_LEVEL_DEBUG, "volume of %zu pings, %.1f ms after the last",
             recon_pings(r), 1e3 * r->final.imaging_s);
}

static int publish_preview(void *self)
{
    struct recon *r = self;
    Anlos__Volume v;
    int64_t start = node_machine_ns(r->node);

    node_busy(r->node, IMAGE_S);
    if (recon_image(r, true, &v))
        return 0;
    publish_volume(r, &v);
    int64_t now = node_machine_ns(r->node);
    int64_t pause = PREVIEW_PAUSE * (now - start);
    r->preview_due_ns = now + (pause > PREVIEW_PAUSE_MIN ? pause : PREVIEW_PAUSE_MIN);
    return 0;
}

void recon_traces(struct recon *r, const Anlos__Traces *message, int64_t capture_ns,
                  int64_t now_ns, Anlos__Receipt *receipt, char *note, size_t size)
{
    struct traces traces;

    note[0] = '\0';
    traces_from_message(&traces, &r->traces, message, capture_ns);
    int err = scan_imager_traces(r->imager, &traces);
    anlos__receipt__init(receipt);
    receipt->scan = message->scan;
    receipt->pass = ANLOS__PASS__SCENE;
    receipt->position = message->position;
    receipt->speaker = message->speaker;
    receipt->usable = !err;
    if (!err)
        r->taken_ns = now_ns;
    if (err == -EINVAL)
        snprintf(note, size, "traces that do not fit the survey cannot be used");
}

static int take_traces(void *self, const struct node_message *in)
{
    struct recon *r = self;
    Anlos__Receipt receipt;
    char note[128];

    r->dropped.n += !recon_is_planned(r);
    recon_traces(r, (const Anlos__Traces *)in->content, in->capture_ns,
                 node_now_ns(r->node), &receipt, note, sizeof note);
    node_publish(r->node, topic_receipt(), in->capture_ns, &receipt.base);
    if (note[0])
        node_log(r->node, LOG_LEVEL_WARNING, "%s", note);
    if (!recon_is_complete(r))
        r->has_final = false;
    else if (!r->has_final)
        publish_final(r);
    return 0;
}

void recon_reset(struct recon *r)
{
    scan_imager_reset(r->imager);
}

static int take_status(void *self, const struct node_message *in)
{
    struct recon *r = self;
    const Anlos__ScanStatus *status = (const Anlos__ScanStatus *)in->content;

    /* A scan was restarted, and so must the image be. */
    if (r->scan_epoch_ns && in->epoch_ns != r->scan_epoch_ns) {
        recon_reset(r);
        r->has_final = false;
    }
    r->scan_epoch_ns = in->epoch_ns;
    if ((status->state == ANLOS__SCAN_STATUS__STATE__DONE ||
         status->state == ANLOS__SCAN_STATUS__STATE__FAILED) &&
        !r->has_final && recon_pings(r))
        publish_final(r);
    return 0;
}

static int64_t preview_due_ns(const void *self)
{
    const struct recon *r = self;
    bool wanted = node_launch(r->node)->recon.preview && recon_has_new_position(r) &&
                  !recon_is_complete(r);

    return wanted ? r->preview_due_ns : LOOP_NEVER;
}

static int64_t repeat_due_ns(const void *self)
{
    const struct recon *r = self;

    return r->has_final ? r->repeat_due_ns : LOOP_NEVER;
}

static int repeat_final(void *self)
{
    struct recon *r = self;

    r->final.repeated = true;
    node_publish(r->node, topic_volume(), recon_capture_ns(r), &r->final.base);
    r->repeat_due_ns = node_machine_ns(r->node) + REPEAT_NS;
    return 0;
}

static const struct loop_input inputs[] = {
    {.topic = topic_survey, .take = take_survey},
    {.topic = topic_traces, .take = take_traces},
    {.topic = topic_scan_status, .take = take_status},
    {.topic = NULL},
};

/* Of all pings that are there. */
static const struct loop_timer timers[] = {
    {.due_ns = preview_due_ns, .run = publish_preview, .when = LOOP_LAST},
    {.due_ns = repeat_due_ns, .run = repeat_final, .when = LOOP_LAST},
    {.run = NULL},
};

static void destroy(void *self)
{
    recon_destroy(self);
}

const struct loop recon_loop = {.inputs = inputs,
                                .timers = timers,
                                .waits_for = "the survey",
                                .counts = counts,
                                .close = destroy};

void recon_destroy(struct recon *r)
{
    if (!r)
        return;
    scan_imager_destroy(r->imager);
    free(r);
}
