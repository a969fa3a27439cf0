#include "msgs/bag/definitions.h"

#include <errno.h>
#include <stdlib.h>

/* All of the record, or nothing of it is kept. */
static int put_record(struct bytes_buffer *into, const struct bag_record *r)
{
    bag_record_put(into, r);
    if (!into->failed)
        return 0;
    bytes_free(into);
    return -ENOMEM;
}

int bag_definitions_schema(struct bag_definitions *d, const struct bag_schema *schema,
                           uint16_t *id)
{
    struct bag_record r = {.opcode = BAG_SCHEMA, .schema = *schema};
    struct bytes_buffer bytes = {0};

    if (d->n_schemas == UINT16_MAX)
        return -EINVAL;
    struct bag_definition *grown =
        realloc(d->schemas, (d->n_schemas + 1) * sizeof *grown);
    if (!grown)
        return -ENOMEM;
    d->schemas = grown;
    r.schema.id = (uint16_t)(d->n_schemas + 1);
    if (put_record(&bytes, &r))
        return -ENOMEM;
    grown[d->n_schemas++] = (struct bag_definition){.record = bytes};
    *id = r.schema.id;
    return 0;
}

int bag_definitions_channel(struct bag_definitions *d, const struct bag_channel *channel,
                            uint16_t *id)
{
    struct bag_record r = {.opcode = BAG_CHANNEL, .channel = *channel};
    struct bytes_buffer bytes = {0};

    if (d->n_channels == UINT16_MAX || channel->schema_id > d->n_schemas)
        return -EINVAL;
    struct bag_defined_channel *grown =
        realloc(d->channels, (d->n_channels + 1) * sizeof *grown);
    if (!grown)
        return -ENOMEM;
    d->channels = grown;
    r.channel.id = (uint16_t)(d->n_channels + 1);
    if (put_record(&bytes, &r))
        return -ENOMEM;
    grown[d->n_channels++] = (struct bag_defined_channel){.schema_id = channel->schema_id,
                                                          .definition.record = bytes};
    *id = r.channel.id;
    return 0;
}

static void put(struct bag_definition *d, struct bytes_buffer *chunk)
{
    if (!d->in_chunk)
        bytes_put(chunk, bytes_in(&d->record));
    d->in_chunk = true;
}

void bag_definitions_put(struct bag_definitions *d, uint16_t channel_id,
                         struct bytes_buffer *chunk)
{
    struct bag_defined_channel *h = &d->channels[channel_id - 1];

    if (h->schema_id)
        put(&d->schemas[h->schema_id - 1], chunk);
    put(&h->definition, chunk);
}

void bag_definitions_put_rest(struct bag_definitions *d, struct bytes_buffer *out)
{
    for (size_t i = 0; i < d->n_schemas; i++)
        if (!d->schemas[i].in_file)
            put(&d->schemas[i], out);
    for (size_t i = 0; i < d->n_channels; i++)
        if (!d->channels[i].definition.in_file)
            put(&d->channels[i].definition, out);
}

void bag_definitions_count(struct bag_definitions *d, uint16_t channel_id,
                           uint64_t log_time, uint64_t offset)
{
    struct bag_defined_channel *h = &d->channels[channel_id - 1];

    h->n_in_chunk++;
    bytes_put_number(&h->entries, log_time, 8);
    bytes_put_number(&h->entries, offset, 8);
}

void bag_definitions_put_indexes(const struct bag_definitions *d, uint64_t origin,
                                 struct bytes_buffer *out, struct bytes_buffer *offsets)
{
    for (size_t i = 0; i < d->n_channels; i++) {
        struct bag_record r = {.opcode = BAG_MESSAGE_INDEX};
        if (!d->channels[i].n_in_chunk)
            continue;
        bytes_put_number(offsets, i + 1, 2);
        bytes_put_number(offsets, origin + out->size, 8);
        r.message_index.channel_id = (uint16_t)(i + 1);
        r.message_index.entries = bytes_in(&d->channels[i].entries);
        bag_record_put(out, &r);
        out->failed |= d->channels[i].entries.failed;
    }
}

static void settle(struct bag_definition *d, bool written)
{
    d->in_file |= written && d->in_chunk;
    d->in_chunk = false;
}

void bag_definitions_settle(struct bag_definitions *d, bool written)
{
    for (size_t i = 0; i < d->n_schemas; i++)
        settle(&d->schemas[i], written);
    for (size_t i = 0; i < d->n_channels; i++) {
        struct bag_defined_channel *h = &d->channels[i];
        settle(&h->definition, written);
        if (written)
            h->n_messages += h->n_in_chunk;
        h->n_in_chunk = 0;
        h->entries.size = 0;
    }
}

void bag_definitions_summarize(const struct bag_definitions *d,
                               struct bytes_buffer *schemas,
                               struct bytes_buffer *channels, struct bytes_buffer *counts)
{
    for (size_t i = 0; i < d->n_schemas; i++)
        bytes_put(schemas, bytes_in(&d->schemas[i].record));
    for (size_t i = 0; i < d->n_channels; i++) {
        bytes_put(channels, bytes_in(&d->channels[i].definition.record));
        if (!d->channels[i].n_messages)
            continue;
        bytes_put_number(counts, i + 1, 2);
        bytes_put_number(counts, d->channels[i].n_messages, 8);
    }
}

void bag_definitions_free(struct bag_definitions *d)
{
    for (size_t i = 0; i < d->n_schemas; i++)
        bytes_free(&d->schemas[i].record);
    for (size_t i = 0; i < d->n_channels; i++) {
        bytes_free(&d->channels[i].definition.record);
        bytes_free(&d->channels[i].entries);
    }
    free(d->schemas);
    free(d->channels);
    *d = (struct bag_definitions){0};
}
