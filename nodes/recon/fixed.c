/* SPDX-License-Identifier: MIT */
#include "nodes/recon/fixed.h"

#include <errno.h>

#include "msgs/scan.pb-c.h"
#include "msgs/topics.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/rt/loop.h"
#include "nodes/rt/pace.h"

#define PLAN_S 60.0 /* at most: of a fine volume */

struct fixed {
    struct node *node;
    struct steady *steady;
    bool planned, due;
    struct node_dropped dropped;
    int64_t taken_ns; /* when the newest ping came */
    struct pace pace; /* of images */
};

static size_t counts(void *ctx, struct device_count *out)
{
    const struct fixed *f = ctx;
    const struct static_array_counts *c = static_array_counts(steady_array(f->steady));

    out[0] = (struct device_count){"images", c->images};
    out[1] = (struct device_count){"images skipped", f->pace.skipped};
    out[2] = (struct device_count){"images of unknown motion", c->unknown};
    out[3] = (struct device_count){"traces unfit", c->unfit};
    out[4] = (struct device_count){"clock steps back", c->backwards};
    return 5 + node_dropped_count(&f->dropped, out + 5);
}

static int create(struct fixed *f)
{
    struct pipeline_config cfg;

    launchfile_pipeline(&cfg, node_launch(f->node));
    int err = steady_create(&f->steady, &cfg.array);

    if (!err)
        node_device(f->node, counts, f);
    return err;
}

static int take_survey(void *self, const struct node_message *in)
{
    struct fixed *f = self;
    struct error why = {""};

    if (!f->planned)
        node_busy(f->node, PLAN_S);
    int err = steady_survey(f->steady, (const Anlos__Survey *)in->content, &why);

    if (err)
        node_state(f->node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
    else if (!f->planned)
        node_state(f->node, ANLOS__HEALTH__STATE__READY, "ready");
    f->planned = !err;
    if (!err)
        node_dropped_say(f->node, &f->dropped);
    return err;
}

/* What is wrong with the images, the worst of it. */
static void say(struct fixed *f)
{
    const Anlos__Health__State degraded = ANLOS__HEALTH__STATE__DEGRADED;
    enum static_array_motion motion = static_array_motion(steady_array(f->steady));
    bool late = pace_is_late(&f->pace, node_machine_ns(f->node));

    if (motion == STATIC_ARRAY_UNKNOWN)
        node_state(f->node, degraded,
                   "the vehicle's motion is not known: images are made as if it stood");
    else if (motion == STATIC_ARRAY_NO_MOUNT)
        node_state(
            f->node, degraded,
            "the vehicle moves, but the survey has no mount: images are made as if "
            "it stood");
    else if (late)
        node_state(f->node, degraded,
                   "images are skipped, for they take longer than pings: use a coarser "
                   "volume, fewer pings, or every: frame");
    else
        node_state(f->node, ANLOS__HEALTH__STATE__READY, "ready");
}

static int publish(void *self)
{
    struct fixed *f = self;
    Anlos__Volume v;

    f->due = false;
    steady_image(f->steady, &v);
    f->pace.done++;
    v.imaging_s = 1e-9 * (double)(node_now_ns(f->node) - f->taken_ns);
    node_publish(f->node, topic_volume(), steady_capture_ns(f->steady), &v.base);
    say(f);
    return 0;
}

static int64_t image_due_ns(const void *self)
{
    return ((const struct fixed *)self)->due ? 0 : LOOP_NEVER;
}

/* A recording is played no faster than it is used. */
static void acknowledge(struct fixed *f, const Anlos__Traces *traces, int64_t capture_ns,
                        bool usable)
{
    Anlos__Receipt receipt = ANLOS__RECEIPT__INIT;

    receipt.scan = traces->scan;
    receipt.position = traces->position;
    receipt.speaker = traces->speaker;
    receipt.frame = traces->frame;
    receipt.usable = usable;
    node_publish(f->node, topic_receipt(), capture_ns, &receipt.base);
}

/* All that has come goes in before an image is made: whoever is late makes fewer of them,
 * and each of the newest pings.  A replay waits, and its images are the same each time.
 */
static int take_traces(void *self, const struct node_message *in)
{
    struct fixed *f = self;
    const Anlos__Traces *traces = (const Anlos__Traces *)in->content;
    char note[128];
    bool due = steady_traces(f->steady, traces, in->capture_ns, note, sizeof note);

    if (note[0])
        node_log(f->node, LOG_LEVEL_WARNING, "%s", note);
    if (node_is_replayed(f->node))
        acknowledge(f, traces, in->capture_ns, f->planned && !note[0]);
    f->dropped.n += !f->planned;
    if (!due)
        return 0;
    f->taken_ns = node_now_ns(f->node);
    f->pace.skipped += f->due;
    f->due = true;
    return node_is_replayed(f->node) ? publish(f) : 0;
}

static int take_walls(void *self, const struct node_message *in)
{
    struct fixed *f = self;
    struct error why = {""};

    if (steady_walls(f->steady, (const Anlos__WallList *)in->content, in->capture_ns,
                     &why))
        node_log(f->node, LOG_LEVEL_WARNING, "%s", why.text);
    return 0;
}

static int take_ego(void *self, const struct node_message *in)
{
    struct fixed *f = self;

    steady_ego(f->steady, (const Anlos__EgoMotion *)in->content, in->capture_ns);
    return 0;
}

static const struct loop_input inputs[] = {
    {.topic = topic_survey, .take = take_survey},
    {.topic = topic_traces, .take = take_traces},
    {.topic = topic_ego, .take = take_ego},
    {.topic = topic_wall, .take = take_walls},
    {.topic = NULL},
};

static const struct loop_timer timers[] = {
    {.due_ns = image_due_ns, .run = publish, .when = LOOP_LAST},
    {.run = NULL},
};

int fixed_run(struct node *node)
{
    struct fixed f = {.node = node, .dropped = {.count = "traces before the survey"}};
    int err = create(&f);

    const struct loop loop = {.inputs = inputs, .timers = timers};

    if (!err) {
        node_state(node, ANLOS__HEALTH__STATE__STARTING, "waits for the survey");
        err = loop_run(node, &loop, &f);
    }
    node_device(node, NULL, NULL);
    steady_destroy(f.steady);
    return err;
}
