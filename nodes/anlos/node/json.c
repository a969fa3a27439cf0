#include "nodes/anlos/node/node.h"
#include "nodes/rt/export.h"

static json_t *link_json(const struct table_link *l)
{
    json_t *o =
        json_pack("{ss, sb, sI, sI, so, so, so}", "topic", l->topic->name, "published",
                  l->published, "messages", (json_int_t)l->messages, "bytes",
                  (json_int_t)l->bytes, "rate_hz", export_real(l->rate_hz), "expected_hz",
                  export_real(l->topic->rate_hz), "bytes_s", export_real(l->bytes_s));

    if (!l->published) {
        json_object_set_new(o, "gaps", json_integer((json_int_t)l->gaps));
        json_object_set_new(o, "dropped", json_integer((json_int_t)l->dropped));
        json_object_set_new(o, "queued", json_integer(l->queued));
        json_object_set_new(o, "depth", json_integer((json_int_t)l->topic->depth));
    }
    if (l->latency.n) {
        json_object_set_new(o, "age_median_s", export_real(l->latency.median_s));
        json_object_set_new(o, "age_p99_s", export_real(l->latency.p99_s));
    }
    return o;
}

static void add_details(json_t *o, const struct table_node *row)
{
    json_t *topics = json_array(), *device = json_object();

    for (size_t i = 0; i < row->n_links; i++)
        json_array_append_new(topics, link_json(&row->links[i]));
    for (size_t i = 0; i < row->n_device; i++)
        json_object_set_new(device, row->device[i].name,
                            json_integer((json_int_t)row->device[i].value));
    json_object_set_new(o, "topics", topics);
    json_object_set_new(o, "device", device);
}

json_t *node_json(const struct census_node *n, bool all)
{
    json_t *o =
        json_pack("{ss, ss}", "node", n->name, "process", census_life_name(n->life));
    const struct table_node *row = n->row;

    if (n->pid)
        json_object_set_new(o, "pid", json_integer(n->pid));
    if (!row)
        return o;
    json_t *text = json_string(row->text);
    json_object_set_new(o, "state", json_string(table_node_state_name(row->state)));
    json_object_set_new(o, "text", text ? text : json_null());
    json_object_set_new(o, "uptime_s", export_real(row->uptime_s));
    json_object_set_new(o, "cpu", export_real(row->cpu));
    json_object_set_new(o, "memory_bytes", json_integer((json_int_t)row->rss_bytes));
    json_object_set_new(o, "refused", json_integer((json_int_t)row->refused));
    json_object_set_new(o, "refused_connections",
                        json_integer((json_int_t)row->refused_connections));
    json_object_set_new(o, "gaps", json_integer((json_int_t)row->gaps));
    json_object_set_new(o, "dropped", json_integer((json_int_t)row->dropped));
    if (all)
        add_details(o, row);
    return o;
}
