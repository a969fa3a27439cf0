/* SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <string.h>

#include "nodes/play/playback_state.h"

#define TAKEN_NS                                                                         \
    200000000LL /* a health message that comes so much later comes after it */

#define PATIENCE 4 /* timeouts: of who works on a long image, on a loaded machine */

#define LAST_LIST_NS 300000000LL
#define NEXT_LIST_NS 1000000000LL

static int64_t timeout_ns(const struct playback *p)
{
    return (int64_t)(1e9 * p->cfg.timeout_s);
}

/* Who works on a long image says nothing meanwhile; who says that it is well, long after
 * it was sent something, has had it. */
static bool have_turned(const struct playback *p, int64_t after_ns)
{
    return subscribers_heard(&p->subscribers, "dsp", after_ns) &&
           subscribers_heard(&p->subscribers, "recon", after_ns) &&
           subscribers_heard(&p->subscribers, "track", after_ns);
}

static void give_up_overdue(struct playback *p, int64_t now_ns)
{
    int64_t end_ns = p->sign_ns + timeout_ns(p);

    if (!p->account.n || now_ns < end_ns || !have_turned(p, end_ns))
        return;
    size_t n = account_give_up(&p->account);
    playback_notes(p, "%zu pings were played, and in %g s nobody said that they arrived",
                   n, p->cfg.timeout_s);
}

/* true: it is here, or will not come. */
static bool has_list(struct playback *p, int64_t now_ns)
{
    if (!p->list_since_ns)
        return true;
    int64_t end_ns = p->list_since_ns + timeout_ns(p);
    if (p->list_scan == p->scan) {
        p->list_since_ns = 0;
    } else if (now_ns >= end_ns && have_turned(p, end_ns)) {
        playback_notes(p,
                       "scan %u has ended, and in %g s there was no list of its objects",
                       p->scan, p->cfg.timeout_s);
        p->list_since_ns = 0;
    }
    return !p->list_since_ns;
}

/* How far all are; what went out before is under way no more. */
static int64_t used_up_to(struct playback *p, int64_t now_ns)
{
    int64_t used_ns;
    size_t n = 0;
    struct listener *last =
        subscribers_last(&p->subscribers, p->progress_round, &used_ns);

    if (used_ns != p->used_ns || !p->used_since_ns)
        p->used_since_ns = now_ns;
    p->used_ns = used_ns;
    while (n < p->n_under_way && p->under_way[n].publish_ns <= used_ns)
        n++;
    if (n)
        p->used_since_ns = now_ns;
    p->n_under_way -= n;
    memmove(p->under_way, p->under_way + n, p->n_under_way * sizeof *p->under_way);
    if (!p->n_under_way && used_ns != INT64_MIN)
        p->used_since_ns = now_ns; /* it waits for what comes */
    int64_t end_ns = p->used_since_ns + PATIENCE * timeout_ns(p);
    if (last && now_ns >= end_ns &&
        subscribers_heard(&p->subscribers, last->name, end_ns)) {
        last->given_up = true;
        p->stopped++;
        playback_notes(p,
                       "%s did not get on with the recording in %g s, and is waited "
                       "for no more",
                       last->name, PATIENCE * p->cfg.timeout_s);
        return used_up_to(p, now_ns);
    }
    return used_ns;
}

static void wait_for_last(struct playback *p)
{
    int64_t used_ns;
    const struct listener *last =
        subscribers_last(&p->subscribers, p->progress_round, &used_ns);

    snprintf(p->waits_for, sizeof p->waits_for, "waits for %s", last ? last->name : "");
}

bool playback_is_entered(struct playback *p, int64_t now_ns)
{
    if (used_up_to(p, now_ns) != INT64_MIN)
        return true;
    wait_for_last(p);
    return false;
}

static bool is_used_up(struct playback *p, int64_t now_ns)
{
    int64_t used_ns = used_up_to(p, now_ns);

    if (!p->n_under_way && used_ns != INT64_MIN)
        return true;
    wait_for_last(p);
    return false;
}

bool playback_is_settled(struct playback *p, int64_t now_ns)
{
    give_up_overdue(p, now_ns);
    if (!is_used_up(p, now_ns))
        return false;
    if (p->account.n)
        snprintf(p->waits_for, sizeof p->waits_for, "waits for %zu receipts",
                 p->account.n);
    else if (!has_list(p, now_ns))
        snprintf(p->waits_for, sizeof p->waits_for, "waits for the list of scan %u",
                 p->scan);
    else
        return true;
    return false;
}

bool playback_has_lists(struct playback *p, int64_t now_ns)
{
    if (!p->endless || !p->scene_used || !subscribers_has(&p->subscribers, "recon") ||
        !subscribers_has(&p->subscribers, "track"))
        return true;
    if (!p->quiet_since_ns || p->lists != p->lists_then) {
        p->quiet_since_ns = now_ns;
        p->lists_then = p->lists;
    }
    uint32_t frame = p->list_scan == p->scan ? p->list_frame : 0;
    int64_t wait_ns = frame >= p->used_frame       ? LAST_LIST_NS
                      : frame + 1 >= p->used_frame ? NEXT_LIST_NS /* it may be cut */
                                                   : timeout_ns(p);
    if (now_ns - p->quiet_since_ns < wait_ns) {
        snprintf(p->waits_for, sizeof p->waits_for, "waits for the last lists");
        return false;
    }
    if (frame + 1 < p->used_frame)
        playback_notes(p, "the newest list is of frame %u, the newest ping of frame %u",
                       frame, p->used_frame);
    p->quiet_since_ns = 0;
    return true;
}

static bool is_end(const struct playback_next *n)
{
    return n->m.part->topic == topic_scan_status() &&
           (n->state == ANLOS__SCAN_STATUS__STATE__DONE ||
            n->state == ANLOS__SCAN_STATUS__STATE__FAILED);
}

void playback_end_scan(struct playback *p, int64_t now_ns)
{
    if (p->scan_ended)
        return;
    p->scan_ended = true;
    if (p->scene_used && p->list_scan != p->scan &&
        subscribers_has(&p->subscribers, "recon") &&
        subscribers_has(&p->subscribers, "track"))
        p->list_since_ns = now_ns;
}

/* A recording that goes on with the next scan without an end of the one before. */
static bool is_other_scan(struct playback *p, int64_t now_ns)
{
    bool other = p->next.flow && p->scan && p->next.ping.scan != p->scan;

    if (other && !p->account.n && p->scene_used >= p->pings_of_scan)
        playback_end_scan(p, now_ns);
    return other;
}

/* What fits the consumers' queues, and gets there: traces are no larger than their ping.
 */
static size_t window_of(const struct playback *p, const struct playback_next *n)
{
    size_t sure = playback_publisher_window(p->playback_publisher, n->m.part->node,
                                            n->m.part->topic, n->m.payload.size);

    return sure < p->cfg.window ? sure : p->cfg.window;
}

/* Are all so far that no more is under way than they have room for? */
static bool is_kept_up_with(struct playback *p, int64_t now_ns)
{
    int64_t used_ns = used_up_to(p, now_ns);
    size_t pings = 0, most = window_of(p, &p->next);

    for (size_t i = 0; i < p->n_under_way; i++)
        pings += p->under_way[i].flow;
    if (p->next.ping.frame && most > FRAMES_AHEAD)
        most = FRAMES_AHEAD;
    bool fits = p->n_under_way < UNDER_WAY_MAX && (!p->next.flow || pings < most);
    p->crowded = !fits && p->under_way[0].publish_ns == p->next.m.envelope.publish_ns;
    if (used_ns != INT64_MIN && fits)
        return true;
    wait_for_last(p);
    return false;
}

bool playback_may_go(struct playback *p, int64_t now_ns)
{
    const struct topic *t = p->next.m.part->topic;

    if (!is_kept_up_with(p, now_ns)) {
        give_up_overdue(p, now_ns);
        return false;
    }

    if (p->next.flow && p->account.n >= window_of(p, &p->next)) {
        give_up_overdue(p, now_ns);
        snprintf(p->waits_for, sizeof p->waits_for, "waits for %zu receipts",
                 p->account.n);
        return p->account.n < window_of(p, &p->next);
    }
    if (p->next.flow && p->survey_new_ns) {
        snprintf(p->waits_for, sizeof p->waits_for, "another survey has to be taken");
        if (!have_turned(p, p->survey_new_ns + TAKEN_NS))
            return false;
        p->survey_new_ns = 0;
    }
    bool other_survey = t == topic_survey() && p->survey_id &&
                        p->next.survey_id != p->survey_id;
    if (p->list_since_ns || is_end(&p->next) || other_survey || is_other_scan(p, now_ns))
        return playback_is_settled(p, now_ns);
    return true;
}
