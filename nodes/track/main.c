/* nodes/track/main.c: "survey", "volume" -> detection, the wall's mirror -> "detections"
 */
#include <errno.h>

#include "msgs/topics.h"
#include "nodes/rt/node.h"
#include "nodes/rt/objects.h"
#include "nodes/track/detector.h"

static int take_survey(struct node *node, struct detector *d, const Anlos__Survey *survey)
{
    struct complaint why = {""};
    int err = detector_survey(d, survey, &why);

    if (err) {
        node_state(node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
        return err;
    }
    if (!d->survey.has_wall)
        node_state(node, ANLOS__HEALTH__STATE__DEGRADED,
                   "no wall is known: positions are those of the mirror images");
    else
        node_state(node, ANLOS__HEALTH__STATE__READY, "ready");
    return 0;
}

struct listed { /* the volume that the newest list is of */
    bool any;
    uint32_t scan;
    int64_t capture_ns;
};

/* How many previews there are, and how often a volume is repeated, depends on the
 * machine.  The lists of a replay do not: there is one for each final image. */
static bool makes_list(const struct node *node, const struct listed *last,
                       const struct node_message *in)
{
    const Anlos__Volume *v = (const Anlos__Volume *)in->content;
    bool has_it = last->any && v->scan == last->scan &&
                  in->capture_ns == last->capture_ns;

    return !node_is_replayed(node) || !(v->preview || (v->repeated && has_it));
}

/* A volume that cannot be used is logged; recon repeats the last one of a scan. */
static void take_volume(struct node *node, struct detector *d, struct listed *last,
                        const struct node_message *in)
{
    const Anlos__Volume *v = (const Anlos__Volume *)in->content;
    Anlos__DetectionList *list = NULL;
    struct complaint why = {""};

    if (!makes_list(node, last, in))
        return;
    if (detector_volume(d, v, &list, &why)) {
        node_log(node, LOG_LEVEL_WARNING, "%s", why.text);
        return;
    }
    *last = (struct listed){true, v->scan, in->capture_ns};
    node_publish(node, topic_detections(), in->capture_ns, &list->base);
    objects_free(list);
}

static int run(struct node *node, struct detector *d)
{
    struct node_message in;
    struct listed last = {.any = false};
    int err = node_subscribe(node, topic_survey());

    if (!err)
        err = node_subscribe(node, topic_volume());
    node_state(node, ANLOS__HEALTH__STATE__STARTING, "waits for the survey");
    while (!err) {
        err = node_next(node, &in, -1);
        if (!err && in.topic == topic_survey())
            err = take_survey(node, d, (const Anlos__Survey *)in.content);
        else if (!err)
            take_volume(node, d, &last, &in);
    }
    return err;
}

int main(int argc, char **argv)
{
    struct node *node;
    struct detector d;
    int err =
        node_create(&node, "track", "Finds the hidden objects in the image.", argc, argv);

    if (err)
        return err - 1;
    const struct launchfile *l = node_launch(node);
    const struct detector_config cfg = {.threshold_db = l->track.threshold_db,
                                        .min_existence = l->track.min_existence};
    detector_init(&d, &cfg);
    err = run(node, &d);
    detector_clear(&d);
    return node_finish(node, err);
}
