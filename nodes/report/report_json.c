#include "nodes/report/report_json.h"

#include <math.h>

#include "nodes/rt/export.h"

/* At the end: what still ran then, an array that stands, was stopped. */
static const char *scan_state_name(Anlos__ScanStatus__State state)
{
    switch (state) {
    case ANLOS__SCAN_STATUS__STATE__WAITING:
        return "waiting";
    case ANLOS__SCAN_STATUS__STATE__RUNNING:
        return "stopped";
    case ANLOS__SCAN_STATUS__STATE__DONE:
        return "done";
    case ANLOS__SCAN_STATUS__STATE__PAUSED:
        return "paused";
    default:
        return "failed";
    }
}

static const char *health_state_name(Anlos__Health__State state)
{
    switch (state) {
    case ANLOS__HEALTH__STATE__STARTING:
        return "starting";
    case ANLOS__HEALTH__STATE__READY:
        return "ready";
    case ANLOS__HEALTH__STATE__DEGRADED:
        return "degraded";
    default:
        return "fault";
    }
}

static json_t *integer(uint64_t value)
{
    return json_integer((json_int_t)value);
}

/* Modulo 2^64 ns: a stamp is whatever its sender wrote. */
static double elapsed_s(int64_t from_ns, int64_t to_ns)
{
    return 1e-9 * (double)(int64_t)((uint64_t)to_ns - (uint64_t)from_ns);
}

/* Seconds between two stamps, null when one is missing. */
static json_t *seconds(int64_t from_ns, int64_t to_ns)
{
    return from_ns && to_ns ? export_real(elapsed_s(from_ns, to_ns)) : json_null();
}

/* An array that stands may be stopped before its scan says anything. */
static const Anlos__ScanStatus *status_of(const struct report *r)
{
    static const Anlos__ScanStatus none = ANLOS__SCAN_STATUS__INIT;

    return r->status ? r->status : &none;
}

static json_t *pings(const struct report *r)
{
    const Anlos__ScanStatus *s = status_of(r);
    json_t *o = json_object();

    json_object_set_new(o, "expected", /* 0: there was no end */
                        s->pings_expected ? integer(s->pings_expected) : json_null());
    json_object_set_new(o, "done", integer(s->pings_done));
    json_object_set_new(o, "retaken", integer(s->pings_retaken));
    json_object_set_new(o, "lost", integer(s->pings_lost));
    if (r->volume) {
        json_object_set_new(o, "imaged", integer(r->volume->pings_used));
        json_object_set_new(o, "imaged_of", integer(r->volume->pings_expected));
    }
    return o;
}

/* The host that runs a node. */
static const char *host_of(const struct hosts *map, const char *node)
{
    for (size_t i = 0; i < map->n; i++)
        if (hosts_may_run(map, i, node))
            return map->list[i].name;
    return "";
}

/* How far the clock that stamps volumes is ahead of the one that stamps sound. */
static double clock_ahead_s(const struct report *r)
{
    return r->map ? report_hosts_ahead_s(&r->hosts, host_of(r->map, "recon"),
                                         host_of(r->map, "array"))
                  : 0.0;
}

/* The capture stamp is that of a ping's first sample: it has been heard ping_s later. */
static json_t *times(const struct report *r)
{
    json_t *o = json_object();

    json_object_set_new(o, "scan_s", seconds(r->running_ns, r->ended_ns));
    if (r->volume) {
        double after = elapsed_s(r->volume_capture_ns, r->volume_publish_ns) -
                       clock_ahead_s(r);
        json_object_set_new(o, "imaging_s", export_real(r->volume->imaging_s));
        /* A simulation that runs fast stamps sound that was never waited for. */
        json_object_set_new(o, "last_ping_to_volume_s",
                            export_real(fmax(after - r->ping_s, r->volume->imaging_s)));
    }
    return o;
}

static json_t *topic_count(const Anlos__TopicCount *c)
{
    json_t *o = json_object();

    json_object_set_new(o, "topic", json_string(c->topic));
    json_object_set_new(o, "direction", json_string(c->published ? "out" : "in"));
    json_object_set_new(o, "messages", integer(c->messages));
    json_object_set_new(o, "bytes", integer(c->bytes));
    json_object_set_new(o, "gaps", integer(c->gaps));
    json_object_set_new(o, "dropped", integer(c->dropped));
    return o;
}

static json_t *node(const struct report_node *n)
{
    const Anlos__Health *h = n->health;
    json_t *o = json_object(), *topics = json_array(), *device = json_object();

    json_object_set_new(o, "node", json_string(h->node));
    json_object_set_new(o, "state", json_string(health_state_name(h->state)));
    json_object_set_new(o, "text", json_string(h->text));
    json_object_set_new(o, "priority", json_string(h->priority));
    json_object_set_new(o, "restarts", integer(n->restarts));
    json_object_set_new(o, "uptime_s", export_real(h->uptime_s));
    json_object_set_new(o, "cpu_s", export_real(h->cpu_s));
    json_object_set_new(o, "rss_bytes", integer(h->rss_bytes));
    json_object_set_new(o, "refused", integer(h->refused));
    json_object_set_new(o, "refused_connections", integer(h->refused_connections));
    for (size_t i = 0; i < h->n_topics; i++)
        json_array_append_new(topics, topic_count(h->topics[i]));
    json_object_set_new(o, "topics", topics);
    for (size_t i = 0; i < h->n_device; i++)
        json_object_set_new(device, h->device[i]->name, integer(h->device[i]->value));
    json_object_set_new(o, "device", device);
    return o;
}

static json_t *messages(const struct report *r)
{
    uint64_t gaps = 0, dropped = 0, refused = 0, connections = 0;
    json_t *o = json_object();

    for (size_t i = 0; i < r->n_nodes; i++) {
        const Anlos__Health *h = r->nodes[i].health;
        refused += h->refused;
        connections += h->refused_connections;
        for (size_t k = 0; k < h->n_topics; k++) {
            gaps += h->topics[k]->gaps;
            dropped += h->topics[k]->dropped;
        }
    }
    json_object_set_new(o, "gaps", integer(gaps));
    json_object_set_new(o, "dropped", integer(dropped));
    json_object_set_new(o, "refused", integer(refused));
    json_object_set_new(o, "refused_connections", integer(connections));
    return o;
}

json_t *report_json(const struct report *r)
{
    json_t *o = json_object(), *nodes = json_array();

    json_object_set_new(o, "state", json_string(scan_state_name(status_of(r)->state)));
    json_object_set_new(o, "text", json_string(status_of(r)->text));
    if (r->volume) {
        json_object_set_new(o, "method", json_string(r->volume->method));
        json_object_set_new(o, "clipped_samples", integer(r->volume->clipped_samples));
        json_object_set_new(o, "microphones_masked",
                            integer(r->volume->microphones_masked));
    }
    json_object_set_new(o, "pings", pings(r));
    json_object_set_new(o, "times", times(r));
    json_object_set_new(o, "messages_lost", messages(r));
    json_t *drive = logbook_json(&r->logbook);
    if (drive)
        json_object_set_new(o, "drive", drive);
    if (r->map)
        json_object_set_new(o, "hosts", report_hosts_json(&r->hosts));
    for (size_t i = 0; i < r->n_nodes; i++)
        json_array_append_new(nodes, node(&r->nodes[i]));
    json_object_set_new(o, "nodes", nodes);
    return o;
}
