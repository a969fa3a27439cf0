/* SPDX-License-Identifier: MIT */
#include <errno.h>

#include "msgs/array.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/unpack.h"
#include "nodes/play/playback_state.h"
#include "nodes/play/rewrite.h"

#define MAX_SKIPPED 256 /* in one step: a bag full of what is none must not hold it */

/* What the player has to know of the message.  -EPROTO: it is none;
 * -ENOMEM. */
static int look_into(struct playback *p, struct playback_next *n)
{
    const struct topic *t = n->m.part->topic;

    n->flow = p->flow && t == p->flow;
    if (!n->flow && t != topic_survey() && t != topic_scan_status())
        return 0;
    ProtobufCMessage *m = message_unpack(t->schema, n->m.payload.size, n->m.payload.data);
    if (!m)
        return errno == ENOMEM ? -ENOMEM : -EPROTO;
    if (t == topic_survey()) {
        n->survey_id = ((const Anlos__Survey *)m)->id;
    } else if (t == topic_scan_status()) {
        n->state = ((const Anlos__ScanStatus *)m)->state;
        n->scan = ((const Anlos__ScanStatus *)m)->scan;
    } else {
        const Anlos__Ping *ping = t == topic_ping() ? (const Anlos__Ping *)m : NULL;
        n->ping = (struct account_ping){
            .scan = (uint32_t)rewrite_peek(m, "scan"),
            .position = (uint32_t)rewrite_peek(m, "position"),
            .speaker = (uint32_t)rewrite_peek(m, "speaker"),
            .frame = (uint32_t)rewrite_peek(m, "frame"),
            .pass = ping ? ping->pass : ANLOS__PASS__SCENE,
            .valid = !ping || ping->valid,
        };
    }
    protobuf_c_message_free_unpacked(m, NULL);
    return 0;
}

/* A scan node that was started again while this was recorded counts from 1 again; the
 * nodes that hear it would take it for the scan that they have. */
static void follow_scan(struct playback *p, const struct bag_iterator_message *m)
{
    if (m->part->topic != topic_scan_status())
        return;
    if (p->scan_epoch_ns && m->envelope.epoch_ns != p->scan_epoch_ns)
        p->scan_base = p->newest_scan;
    p->scan_epoch_ns = m->envelope.epoch_ns;
}

/* Are those that the launch file runs the ones for this recording? */
static int check_mode(const struct playback *p, struct error *why)
{
    bool fixed = p->next.ping.frame > 0;

    if (!p->next.flow || p->cfg.alone || p->cfg.fixed == fixed)
        return 0;
    return error_say(why, -EINVAL,
                     fixed ? "%s: of an array that stands; expected a launch file with "
                             "scan.mode: fixed, such as launch/play-drive.yaml"
                           : "%s: of an array on a stage; expected a launch file without "
                             "scan.mode: fixed, such as launch/play.yaml",
                     p->cfg.bag_iterator.bag);
}

int playback_load(struct playback *p, struct error *why)
{
    for (unsigned i = 0; i < MAX_SKIPPED; i++) {
        struct playback_next *n = &p->next;
        *n = (struct playback_next){.is = false};
        int err = bag_iterator_next(p->bag_iterator, &n->m, why);
        if (err)
            return err;
        follow_scan(p, &n->m);
        err = rewrite(n->m.part->topic, p->scan_base, p->survey_id, &n->m.payload,
                      &p->rewritten);
        if (!err)
            err = look_into(p, n);
        if (!err && n->m.payload.size > n->m.part->topic->max_size)
            err = -EPROTO;
        n->is = !err;
        if (err == -ENOMEM)
            return error_say(why, err, "out of memory");
        if (err != -EPROTO)
            return err ? err : check_mode(p, why);
        if (!p->malformed++)
            playback_notes(p,
                           "%s: a message at %.3f s is no %s; it and others are left out",
                           p->cfg.bag_iterator.bag,
                           1e-9 * (double)(n->m.envelope.publish_ns -
                                           bag_iterator_start_ns(p->bag_iterator)),
                           n->m.part->topic->name);
    }
    return -EAGAIN;
}

static int after_ping(struct playback *p, const struct account_ping *ping, int64_t now_ns)
{
    if (!p->account.n)
        p->sign_ns = now_ns;
    if (ping->scan != p->scan) {
        p->scene_used = 0;
        p->scan_ended = false;
    }
    if (ping->pass != p->pass)
        p->status_due_ns = now_ns;
    p->scan = ping->scan;
    p->pass = ping->pass;
    p->position = ping->position;
    p->endless = ping->frame > 0;
    p->background |= ping->pass == ANLOS__PASS__BACKGROUND;
    if (ping->scan > p->newest_scan)
        p->newest_scan = ping->scan;
    account_play(&p->account, ping);
    return playback_say_running(p, now_ns);
}

int playback_went(struct playback *p, const struct playback_next *n, int64_t now_ns)
{
    const struct topic *t = n->m.part->topic;
    int64_t publish_ns = n->m.envelope.publish_ns;

    if (n->flow)
        return after_ping(p, &n->ping, now_ns);
    if (t == topic_survey()) {
        if (p->survey_id && n->survey_id != p->survey_id)
            p->survey_new_ns = now_ns;
        p->survey_id = n->survey_id;
        return playback_keep(&p->survey, n->m.part->node, n->m.payload, publish_ns,
                             now_ns);
    }
    if (t != topic_scan_status())
        return 0;
    if (n->scan > p->newest_scan)
        p->newest_scan = n->scan;
    if ((n->state == ANLOS__SCAN_STATUS__STATE__DONE ||
         n->state == ANLOS__SCAN_STATUS__STATE__FAILED) &&
        n->scan == p->scan)
        playback_end_scan(p, now_ns);
    return playback_keep(&p->status, n->m.part->node, n->m.payload, publish_ns, now_ns);
}
