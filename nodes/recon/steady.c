/* SPDX-License-Identifier: MIT */
#include "nodes/recon/steady.h"

#include <errno.h>
#include <stdlib.h>

#include "msgs/convert.h"
#include "msgs/scan.pb-c.h"
#include "msgs/topics.h"
#include "nodes/recon/volume_room.h"
#include "nodes/rt/health.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/rt/process.h"

#define PLAN_S 60.0 /* at most: of a fine volume */

struct steady {
    struct node *node;
    struct static_array *array;
    struct traces_room traces;
    struct volume_view view;
    int64_t capture_ns; /* of the newest image */
    bool planned, due;
    struct node_dropped dropped;
    int64_t taken_ns; /* when the newest ping came */
    struct pace pace; /* of images */
};

int steady_create(struct steady **out, struct node *node,
                  const struct static_array_config *asked)
{
    struct static_array_config cfg = *asked;
    struct steady *s = calloc(1, sizeof *s);

    if (!s)
        return -ENOMEM;
    s->node = node;
    s->dropped.count = "traces before the survey";
    cfg.threads = cfg.threads ? cfg.threads : processors_usable();
    int err = static_array_create(&s->array, &cfg);
    if (err)
        free(s);
    else
        *out = s;
    return err;
}

static size_t counts(void *self, struct device_count *out)
{
    const struct steady *s = self;
    const struct static_array_counts *c = static_array_counts(s->array);

    out[0] = (struct device_count){"images", c->images};
    out[1] = (struct device_count){"images skipped", s->pace.skipped};
    out[2] = (struct device_count){"images of unknown motion", c->unknown};
    out[3] = (struct device_count){"traces unfit", c->unfit};
    out[4] = (struct device_count){"clock steps back", c->backwards};
    return 5 + node_dropped_count(&s->dropped, out + 5);
}

int steady_survey(struct steady *s, const Anlos__Survey *message, struct error *why)
{
    struct survey survey;

    if (message->id && static_array_survey_id(s->array) == message->id)
        return 0;
    static_array_forget(s->array);
    int err = survey_from_message(&survey, message, why);
    if (err)
        return err;
    err = volume_room_check(&survey, why);
    if (!err)
        err = static_array_survey(s->array, &survey, why);
    survey_clear(&survey);
    return launchfile_name_key(why, err);
}

static int take_survey(void *self, const struct node_message *in)
{
    struct steady *s = self;
    struct error why = {""};

    if (!s->planned)
        node_busy(s->node, PLAN_S);
    int err = steady_survey(s, (const Anlos__Survey *)in->content, &why);

    if (err)
        node_state(s->node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
    else if (!s->planned)
        node_state(s->node, ANLOS__HEALTH__STATE__READY, "ready");
    s->planned = !err;
    if (!err)
        node_dropped_say(s->node, &s->dropped);
    return err;
}

void steady_ego(struct steady *s, const Anlos__EgoMotion *ego, int64_t capture_ns)
{
    struct ego_motion motion;

    static_array_ego(s->array, ego_from_message(&motion, ego), capture_ns);
}

static int take_ego(void *self, const struct node_message *in)
{
    steady_ego(self, (const Anlos__EgoMotion *)in->content, in->capture_ns);
    return 0;
}

int steady_walls(struct steady *s, const Anlos__WallList *message, int64_t capture_ns,
                 struct error *why)
{
    struct walls walls;
    int err = walls_from_message(&walls, message, why);

    if (!err)
        static_array_walls(s->array, &walls, capture_ns);
    return err;
}

static int take_walls(void *self, const struct node_message *in)
{
    struct steady *s = self;
    struct error why = {""};

    if (steady_walls(s, (const Anlos__WallList *)in->content, in->capture_ns, &why))
        node_log(s->node, LOG_LEVEL_WARNING, "%s", why.text);
    return 0;
}

void steady_image(struct steady *s, Anlos__Volume *out)
{
    struct volume volume;

    static_array_image(s->array, &volume);
    s->capture_ns = volume.capture_ns;
    volume_to_message(&volume, &s->view, out);
}

int64_t steady_capture_ns(const struct steady *s)
{
    return s->capture_ns;
}

const struct static_array *steady_array(const struct steady *s)
{
    return s->array;
}

/* What is wrong with the images, the worst of it. */
static void say(struct steady *s)
{
    const Anlos__Health__State degraded = ANLOS__HEALTH__STATE__DEGRADED;
    enum static_array_motion motion = static_array_motion(s->array);
    bool late = pace_is_late(&s->pace, node_machine_ns(s->node));

    if (motion == STATIC_ARRAY_UNKNOWN)
        node_state(s->node, degraded,
                   "the vehicle's motion is not known: images are made as if it stood");
    else if (motion == STATIC_ARRAY_NO_MOUNT)
        node_state(
            s->node, degraded,
            "the vehicle moves, but the survey has no mount: images are made as if "
            "it stood");
    else if (late)
        node_state(s->node, degraded,
                   "images are skipped, for they take longer than pings: use a coarser "
                   "volume, fewer pings, or every: frame");
    else
        node_state(s->node, ANLOS__HEALTH__STATE__READY, "ready");
}

static int publish(void *self)
{
    struct steady *s = self;
    Anlos__Volume v;

    s->due = false;
    steady_image(s, &v);
    s->pace.done++;
    v.imaging_s = 1e-9 * (double)(node_now_ns(s->node) - s->taken_ns);
    node_publish(s->node, topic_volume(), steady_capture_ns(s), &v.base);
    say(s);
    return 0;
}

static int64_t image_due_ns(const void *self)
{
    return ((const struct steady *)self)->due ? 0 : LOOP_NEVER;
}

bool steady_traces(struct steady *s, const Anlos__Traces *message, int64_t capture_ns,
                   char *note, size_t size)
{
    struct traces traces;

    traces_from_message(&traces, &s->traces, message, capture_ns);
    return static_array_traces(s->array, &traces, note, size);
}

/* A recording is played no faster than it is used. */
static void acknowledge(struct steady *s, const Anlos__Traces *traces, int64_t capture_ns,
                        bool usable)
{
    Anlos__Receipt receipt = ANLOS__RECEIPT__INIT;

    receipt.scan = traces->scan;
    receipt.position = traces->position;
    receipt.speaker = traces->speaker;
    receipt.frame = traces->frame;
    receipt.usable = usable;
    node_publish(s->node, topic_receipt(), capture_ns, &receipt.base);
}

/* All that has come goes in before an image is made: whoever is late makes fewer of them,
 * and each of the newest pings.  A replay waits, and its images are the same each time.
 */
static int take_traces(void *self, const struct node_message *in)
{
    struct steady *s = self;
    const Anlos__Traces *traces = (const Anlos__Traces *)in->content;
    char note[128];
    bool due = steady_traces(s, traces, in->capture_ns, note, sizeof note);

    if (note[0])
        node_log(s->node, LOG_LEVEL_WARNING, "%s", note);
    if (node_is_replayed(s->node))
        acknowledge(s, traces, in->capture_ns, s->planned && !note[0]);
    s->dropped.n += !s->planned;
    if (!due)
        return 0;
    s->taken_ns = node_now_ns(s->node);
    s->pace.skipped += s->due;
    s->due = true;
    return node_is_replayed(s->node) ? publish(s) : 0;
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

static void destroy(void *self)
{
    steady_destroy(self);
}

const struct loop steady_loop = {.inputs = inputs,
                                 .timers = timers,
                                 .waits_for = "the survey",
                                 .counts = counts,
                                 .close = destroy};

void steady_destroy(struct steady *s)
{
    if (!s)
        return;
    static_array_destroy(s->array);
    free(s);
}
