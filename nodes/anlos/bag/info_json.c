#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>

#include "nodes/anlos/bag/info_print.h"

/* What is not UTF-8 becomes null. */
static json_t *text_json(struct bytes text)
{
    json_t *j = json_stringn(text.size ? (const char *)text.data : "", text.size);

    return j ? j : json_null();
}

/* Times are ns since 1970: more than a double holds, so as text. */
static json_t *time_json(uint64_t ns)
{
    return json_sprintf("%" PRIu64, ns);
}

static json_t *topics_json(const struct contents *c)
{
    json_t *array = json_array();

    for (size_t i = 0; i < c->n; i++) {
        const struct topic_contents *t = &c->topics[i];
        json_array_append_new(array,
                              json_pack("{so, so, sI, sf, sI, so, so, ss}", "topic",
                                        text_json(t->name), "type", text_json(t->type),
                                        "messages", (json_int_t)t->n_messages, "rate_hz",
                                        topic_rate_hz(t), "bytes", (json_int_t)t->n_bytes,
                                        "first_ns", time_json(t->first_time), "last_ns",
                                        time_json(t->last_time), "from", t->from));
    }
    return array;
}

static json_t *attachments_json(const struct bag_catalog *bag)
{
    json_t *array = json_array();

    for (size_t i = 0; i < bag->n_attachments; i++) {
        const struct bag_attachment_index *a =
            &bag->attachments[i].record.attachment_index;
        json_array_append_new(array, json_pack("{so, so, sI}", "name", text_json(a->name),
                                               "media_type", text_json(a->media_type),
                                               "bytes", (json_int_t)a->data_size));
    }
    return array;
}

static int metadata_json(const struct bag_catalog *bag, json_t *array,
                         struct complaint *why)
{
    struct bytes_buffer bytes = {0};
    struct bag_record r;
    int err = 0;

    for (size_t i = 0; i < bag->n_metadata && !err; i++) {
        struct bytes map, key, value;
        err = bag_catalog_read(bag, &bag->metadata[i].record, &bytes, &r, why);
        if (err)
            break;
        json_t *pairs = json_object();
        for (map = r.metadata.metadata; bag_map_next(&map, &key, &value);)
            json_object_setn_new(pairs, key.size ? (const char *)key.data : "", key.size,
                                 text_json(value));
        json_array_append_new(
            array,
            json_pack("{so, so}", "name", text_json(r.metadata.name), "values", pairs));
    }
    bytes_free(&bytes);
    return err;
}

int info_print_json(const struct bag_catalog *bag, const struct contents *c,
                    struct complaint *why)
{
    json_t *metadata = json_array();
    int err = metadata_json(bag, metadata, why);

    if (err) {
        json_decref(metadata);
        return err;
    }
    json_t *o = json_pack(
        "{ss, sI, so, sI, so, so, sf, sI, so, sf, sb, so, so, so}", "file",
        bag->file.path, "bytes", (json_int_t)bag->file.size, "library",
        text_json(bag->header.record.header.library), "messages",
        (json_int_t)bag->n_messages, "start_ns", time_json(bag->start_time), "end_ns",
        time_json(bag->end_time), "duration_s", contents_duration_s(bag), "chunks",
        (json_int_t)bag->n_chunks, "compression", text_json(c->compression),
        "compression_ratio", contents_ratio(c), "summary", !bag->scanned, "topics",
        topics_json(c), "attachments", attachments_json(bag), "metadata", metadata);
    err = !o || json_dumpf(o, stdout, JSON_INDENT(2)) || putchar('\n') == EOF
              ? complain(why, -EIO, "stdout: cannot write")
              : 0;
    json_decref(o);
    return err || !fflush(stdout) ? err : complain(why, -EIO, "stdout: cannot write");
}
