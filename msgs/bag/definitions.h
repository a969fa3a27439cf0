/* msgs/bag/definitions.h -- the schemas and channels of a bag that is being written: what
 * of them stands in the file already, and how many messages each channel has.
 *
 * Each chunk names again what its messages need, so that it can be read when others are
 * damaged.  Without chunks the whole data section counts as one. */
#ifndef ANLOS_MSGS_BAG_DEFINITIONS_H
#define ANLOS_MSGS_BAG_DEFINITIONS_H

#include "msgs/bag/record.h"

struct bag_definition {
    struct bytes_buffer record;
    bool in_chunk; /* under way */
    bool in_file;
};

struct bag_definitions {
    size_t n_schemas, n_channels;
    struct bag_definition *schemas; /* [n_schemas]; id - 1 */
    struct bag_defined_channel {
        struct bag_definition definition;
        uint16_t schema_id;
        uint64_t n_messages;         /* in the file */
        uint64_t n_in_chunk;         /* in the chunk under way */
        struct bytes_buffer entries; /* of its message index */
    } * channels;                    /* [n_channels]; id - 1 */
};

/* *id: from 1, what the record says it is.  0, -EINVAL (too many, or a channel of a
 * schema that is not there), -ENOMEM. */
int bag_definitions_schema(struct bag_definitions *d, const struct bag_schema *schema,
                           uint16_t *id);
int bag_definitions_channel(struct bag_definitions *d, const struct bag_channel *channel,
                            uint16_t *id);

/* Appends what a message of that channel needs and the chunk does not have. */
void bag_definitions_put(struct bag_definitions *d, uint16_t channel_id,
                         struct bytes_buffer *chunk);

/* Appends what stands nowhere in the file. */
void bag_definitions_put_rest(struct bag_definitions *d, struct bytes_buffer *out);

/* A message of the chunk, at an offset in it. */
void bag_definitions_count(struct bag_definitions *d, uint16_t channel_id,
                           uint64_t log_time, uint64_t offset);

/* Appends the chunk's message indexes; origin: where out will stand in the file.
 * offsets: the map for the chunk's index. */
void bag_definitions_put_indexes(const struct bag_definitions *d, uint64_t origin,
                                 struct bytes_buffer *out, struct bytes_buffer *offsets);

/* The chunk has ended: it stands in the file, or is lost. */
void bag_definitions_settle(struct bag_definitions *d, bool written);

/* For the summary: all records, and the counts of channels that have messages. */
void bag_definitions_summarize(const struct bag_definitions *d,
                               struct bytes_buffer *schemas,
                               struct bytes_buffer *channels,
                               struct bytes_buffer *counts);
void bag_definitions_free(struct bag_definitions *d);

#endif
