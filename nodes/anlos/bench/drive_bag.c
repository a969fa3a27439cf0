#include "nodes/anlos/bench/drive_bag.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/topics.h"
#include "nodes/anlos/bag/stream.h"
#include "nodes/anlos/bench/drive_bag_world.h"
#include "nodes/anlos/bench/drive_score.h"

struct reading {
    const char *bag;
    struct drive_bag_world world;
    struct drive_truth truth;
    struct drive_score score;
    struct drive_outcome *out;
    bool begun;
    size_t n_untracked;
};

static int add_list(struct reading *r, const Anlos__DetectionList *list,
                    const struct envelope *e)
{
    struct drive_moment moment;

    if (!list->tracked) {
        r->n_untracked++;
        return 0;
    }
    if (!list->in_vehicle_frame)
        return complain(&r->out->why, -EINVAL,
                        "%s: lists in the array frame: the survey has no mount", r->bag);
    if (!r->begun) {
        r->world.begin_ns = e->capture_ns;
        drive_score_init(&r->score, &r->truth, &r->world.survey, 0.0);
    }
    r->begun = true;
    drive_score_list(&r->score, drive_bag_world_s(&r->world, e->capture_ns),
                     drive_bag_world_s(&r->world, e->publish_ns), list, NULL, &moment);
    return drive_moments_add(&r->out->moments, &moment)
               ? complain(&r->out->why, -ENOMEM, "out of memory")
               : 0;
}

static int take(struct reading *r, const struct stream_message *m,
                const ProtobufCMessage *content)
{
    const struct envelope *e = &m->envelope;

    if (m->topic == topic_survey())
        return drive_bag_world_survey(&r->world, (const Anlos__Survey *)content,
                                      &r->out->why);
    if (m->topic == topic_ego())
        return drive_bag_world_ego(&r->world, (const Anlos__EgoMotion *)content,
                                   e->capture_ns, &r->out->why);
    if (m->topic == topic_wall())
        return drive_bag_world_walls(&r->world, (const Anlos__WallList *)content,
                                     e->capture_ns, &r->out->why);
    return add_list(r, (const Anlos__DetectionList *)content, e);
}

static int take_next(struct reading *r, struct stream *s)
{
    struct stream_message m;
    int err = stream_next(s, &m, &r->out->why);

    if (err)
        return err;
    ProtobufCMessage *content = stream_unpack(&m);
    if (!content)
        return complain(&r->out->why, -EBADMSG, "%s: a message of \"%.*s\" is none",
                        r->bag, (int)m.channel->topic.size,
                        (const char *)m.channel->topic.data);
    err = take(r, &m, content);
    protobuf_c_message_free_unpacked(content, NULL);
    return err;
}

/* The survey first: a bag that was cut may have it later. */
static int read_bag(struct reading *r, struct stream *s)
{
    stream_select(s, topic_survey()->name);
    int err = take_next(r, s);

    if (err == -ENODATA)
        return complain(&r->out->why, -EINVAL, "%s: no survey", r->bag);
    stream_select(s, "survey,ego,wall,detections");
    stream_rewind(s);
    while (!err)
        err = take_next(r, s);
    if (err == -ENODATA && !r->begun)
        return complain(&r->out->why, -EINVAL, "%s: no lists of tracks%s", r->bag,
                        r->n_untracked ? ", only of single images" : "");
    return err == -ENODATA ? 0 : err;
}

void drive_bag(const char *bag, const struct room *scene, const struct truth_file *truth,
               struct drive_outcome *out)
{
    struct reading *r = calloc(1, sizeof *r);
    struct stream *s = NULL;

    *out = (struct drive_outcome){.err = -ENOMEM};
    if (!r) {
        complain(&out->why, -ENOMEM, "out of memory");
        return;
    }
    *r = (struct reading){.bag = bag, .out = out};
    r->world.scene = scene;
    r->world.truth = truth;
    r->truth = drive_bag_world_truth(&r->world);
    out->err = stream_open(&s, bag, &out->why);
    if (!out->err)
        out->err = read_bag(r, s);
    if (r->begun) {
        drive_score_end(&r->score);
        out->result = r->score.result;
    }
    stream_close(s);
    drive_bag_world_clear(&r->world);
    free(r);
}
