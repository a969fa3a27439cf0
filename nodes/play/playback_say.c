/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "msgs/survey.pb-c.h"
#include "nodes/play/playback_state.h"
#include "nodes/play/rewrite.h"

#define STATUS_PERIOD_NS 200000000LL /* as the scan node says it */

int playback_keep(struct kept *k, const char *node, struct bytes payload,
                  int64_t publish_ns, int64_t now_ns)
{
    k->payload.size = 0;
    bytes_put(&k->payload, payload);
    snprintf(k->node, sizeof k->node, "%s", node);
    k->publish_ns = publish_ns;
    k->sent_ns = now_ns;
    return k->payload.failed ? -ENOMEM : 0;
}

static int send_kept(struct playback *p, struct kept *k, const struct topic *t,
                     int64_t now_ns)
{
    k->sent_ns = now_ns;
    return playback_publisher_publish(p->playback_publisher, k->node, t, 0, k->publish_ns,
                                      k->payload.data, k->payload.size);
}

/* The survey goes first, wherever it stands in the bag: nobody can use anything before.
 */
int playback_find_survey(struct playback *p, int64_t now_ns, struct error *why)
{
    struct bag_iterator_message m;
    int err = bag_iterator_find_survey(p->bag_iterator, p->at_ns, &m, why);

    if (err == -ENODATA || (!err && !m.part->wanted))
        return 0;
    if (!err && rewrite(topic_survey(), 0, 0, &m.payload, &p->rewritten))
        return 0; /* a survey that is none is found out when its turn comes */
    Anlos__Survey *s = err ? NULL
                           : anlos__survey__unpack(NULL, m.payload.size, m.payload.data);
    if (!s)
        return err;
    if (p->survey_id && s->id != p->survey_id)
        p->survey_new_ns = now_ns;
    bool known = s->id == p->survey_id;
    p->survey_id = s->id;
    p->pings_of_scan = s->n_stage_positions_m * s->n_speakers_m;
    anlos__survey__free_unpacked(s, NULL);
    if (known)
        return 0;
    /* Whoever puts messages in order must not wait with it for its time. */
    int64_t publish_ns = m.envelope.publish_ns;
    publish_ns = publish_ns < p->at_ns ? publish_ns : p->at_ns - 1;
    err = playback_keep(&p->survey, m.part->node, m.payload, publish_ns, now_ns);
    return err ? err : send_kept(p, &p->survey, topic_survey(), now_ns);
}

int playback_repeat(struct playback *p, int64_t period_ns, int64_t now_ns)
{
    int err = 0;

    if (p->survey.payload.size && now_ns - p->survey.sent_ns >= period_ns)
        err = send_kept(p, &p->survey, topic_survey(), now_ns);
    if (!err && p->status.payload.size && now_ns - p->status.sent_ns >= period_ns)
        err = send_kept(p, &p->status, topic_scan_status(), now_ns);
    return err;
}

static int say_status(struct playback *p, Anlos__ScanStatus__State state,
                      const char *text, int64_t now_ns)
{
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;
    struct bytes_buffer *b = &p->rewritten;

    s.state = state;
    s.scan = p->scan;
    s.pass = p->pass;
    s.position = p->position;
    s.pings_done = (uint32_t)p->account.used;
    s.pings_lost = (uint32_t)(p->account.missing + p->account.unused);
    s.pings_expected =
        p->endless ? 0 : (uint32_t)(p->pings_of_scan * (p->background ? 2 : 1));
    s.text = (char *)text;
    if (bytes_reserve(b, anlos__scan_status__get_packed_size(&s) + 1))
        return -ENOMEM;
    b->size = anlos__scan_status__pack(&s, b->data);
    int err =
        playback_keep(&p->status, "scan", bytes_in(b), p->at_ns - !p->begun, now_ns);
    return err ? err : send_kept(p, &p->status, topic_scan_status(), now_ns);
}

/* Whoever still has a scan of another replay restarts with this. */
int playback_say_begin(struct playback *p, int64_t now_ns)
{
    return p->says_status ? say_status(p, ANLOS__SCAN_STATUS__STATE__WAITING,
                                       "the replay begins", now_ns)
                          : 0;
}

int playback_say_running(struct playback *p, int64_t now_ns)
{
    if (!p->says_status || p->has_status || now_ns < p->status_due_ns)
        return 0;
    p->status_due_ns = now_ns + STATUS_PERIOD_NS;
    return say_status(p, ANLOS__SCAN_STATUS__STATE__RUNNING, p->endless ? "replay" : "",
                      now_ns);
}

/* DONE, as it was recorded, of a scan whose pings are all of no use here: whoever waits
 * for the image would wait for ever. */
bool playback_is_hopeless(const struct playback *p)
{
    const struct playback_next *n = &p->next;

    return n->m.part->topic == topic_scan_status() &&
           n->state == ANLOS__SCAN_STATUS__STATE__DONE && p->says_status && p->scan &&
           n->scan == p->scan && !p->scene_used &&
           subscribers_has(&p->subscribers, "recon");
}

int playback_say_hopeless(struct playback *p, int64_t now_ns)
{
    p->scan_ended = true;
    return say_status(p, ANLOS__SCAN_STATUS__STATE__FAILED,
                      "not one ping of the scene could be used", now_ns);
}

/* Of a scan that the bag begins and does not end. */
int playback_say_end(struct playback *p, int64_t now_ns)
{
    int err = 0;

    if (p->says_status && !p->scan_ended && p->endless && p->scene_used)
        err = say_status(p, ANLOS__SCAN_STATUS__STATE__DONE, "the recording has ended",
                         now_ns);
    else if (p->says_status && !p->scan_ended && p->has_status)
        err = say_status(p, ANLOS__SCAN_STATUS__STATE__FAILED,
                         "the recording ends before the scan did", now_ns);
    else if (p->says_status && !p->scan_ended && p->scene_used)
        err = say_status(p, ANLOS__SCAN_STATUS__STATE__DONE, "done", now_ns);
    else if (p->says_status && !p->scan_ended)
        err = playback_say_hopeless(p, now_ns);
    playback_end_scan(p, now_ns);
    return err;
}
