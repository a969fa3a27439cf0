/* SPDX-License-Identifier: MIT */
#include "nodes/rt/log_topic.h"

#include "msgs/log.pb-c.h"

_Static_assert((int)LOG_LEVEL_DEBUG == (int)ANLOS__LOG__LEVEL__DEBUG &&
                   (int)LOG_LEVEL_ERROR == (int)ANLOS__LOG__LEVEL__ERROR,
               "levels have the same numbers on the bus");

void log_topic_start(struct log_topic *t, struct log *log, struct bus *bus,
                     int64_t now_ns)
{
    *t = (struct log_topic){.bus = bus, .room = LOG_TOPIC_BURST, .start_ns = now_ns};
    log_on_line(log, log_topic_send, t);
}

void log_topic_stop(struct log_topic *t, struct log *log)
{
    log_on_line(log, NULL, NULL);
    log_topic_flush(t);
}

static bool has_room(struct log_topic *t, int64_t now_ns)
{
    if (t->at_ns && now_ns > t->at_ns)
        t->room += LOG_TOPIC_RATE_HZ * 1e-9 * (double)(now_ns - t->at_ns);
    if (t->room > LOG_TOPIC_BURST)
        t->room = LOG_TOPIC_BURST;
    t->at_ns = now_ns;
    if (t->room < 1.0)
        return false;
    t->room -= 1.0;
    return true;
}

static void send_now(struct log_topic *t, const struct log_line *line)
{
    Anlos__Log m = ANLOS__LOG__INIT;
    bool tick = !line->text[0];

    if (tick && !t->left_out)
        return;
    if (!has_room(t, line->stamp_ns)) {
        t->left_out += !tick;
        return;
    }
    m.stamp_ns = line->stamp_ns;
    m.level = (Anlos__Log__Level)line->level;
    m.node = (char *)line->node;
    m.text = tick ? (char *)"lines before this were left out" : (char *)line->text;
    m.repeats = line->repeats;
    m.repeats_s = line->repeats_s;
    m.repeats_ago_s = line->repeats_ago_s;
    m.left_out = t->left_out;
    if (bus_publish_message(t->bus, topic_log(), 0, line->stamp_ns, &m.base))
        t->left_out += !tick;
    else
        t->left_out = 0;
}

void log_topic_flush(struct log_topic *t)
{
    for (size_t i = 0; i < t->n_held; i++)
        send_now(t, &t->held[i]);
    t->n_held = 0;
}

void log_topic_send(void *ctx, const struct log_line *line)
{
    struct log_topic *t = ctx;
    bool early = line->stamp_ns < t->start_ns + LOG_TOPIC_HOLD_NS;

    if (early && !line->text[0])
        return;
    if (early && t->n_held < LOG_TOPIC_HELD) {
        t->held[t->n_held++] = *line;
        return;
    }
    log_topic_flush(t);
    send_now(t, line);
}
