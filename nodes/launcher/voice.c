#include "nodes/launcher/voice.h"

#include <stdio.h>

#include "nodes/rt/node.h"
#include "nodes/rt/vitals.h"

#define PERIOD_NS 1000000000LL

void voice_open(struct voice *v, struct bus *bus, int64_t epoch_ns)
{
    *v =
        (struct voice){.bus = bus,
                       .log = {.bus = bus, .room = LOG_TOPIC_BURST, .start_ns = epoch_ns},
                       .epoch_ns = epoch_ns};
}

void voice_close(struct voice *v)
{
    if (v->bus)
        log_topic_flush(&v->log);
    v->bus = NULL;
}

void voice_log(struct voice *v, const struct log_line *line)
{
    if (v->bus && line->level >= LOG_LEVEL_INFO)
        log_topic_send(&v->log, line);
}

void voice_health(struct voice *v, int64_t now_ns, const struct crew *crew,
                  const struct supervisor *supervisor)
{
    const unsigned n_running = crew_count(crew, CHILD_RUNNING), n_nodes = crew->n,
                   n_ended = crew_count(crew, CHILD_ENDED), n_lost = crew_lost(crew);
    const struct log_line tick = {
        .stamp_ns = now_ns, .level = LOG_LEVEL_INFO, .node = "launcher"};
    struct vitals vitals;
    char name[] = "launcher", text[64], ended[32] = "";
    const struct vitals_fault lost = {NODE_FAULT_NODES_LOST, n_lost, n_nodes};
    struct vitals_faults faults;
    struct device_count counts[DEVICE_MAX_COUNTS];

    if (!v->bus ||
        (now_ns < v->due_ns && n_running == v->n_running && n_lost == v->n_lost))
        return;
    v->n_running = n_running;
    v->n_lost = n_lost;
    v->due_ns = now_ns + PERIOD_NS;
    voice_log(v, &tick);
    vitals_take(&vitals, v->bus, name, 0);
    vitals.message.state = n_running + n_ended == n_nodes
                               ? ANLOS__HEALTH__STATE__READY
                               : ANLOS__HEALTH__STATE__DEGRADED;
    if (n_ended)
        snprintf(ended, sizeof ended, ", %u ended", n_ended);
    snprintf(text, sizeof text, "%u of %u nodes run%s", n_running, n_nodes, ended);
    vitals.message.text = text;
    vitals_device(&vitals, counts, supervisor_counts(supervisor, counts));
    vitals_faults(&vitals.message, &faults, &lost, n_lost > 0);
    vitals.message.uptime_s = 1e-9 * (double)(now_ns - v->epoch_ns);
    bus_publish_message(v->bus, topic_health(), 0, now_ns, &vitals.message.base);
}
