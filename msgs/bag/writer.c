#include "msgs/bag/writer.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "msgs/bag/file.h"
#include "msgs/bag/writer_state.h"

#define SPARE_SIZE   (64 << 10) /* held on the disk beside what is known of the end */
#define LARGEST_DATA (BAG_MAX_SIZE - ((uint64_t)1 << 20)) /* leaves room for the rest */

void writer_span_add(struct writer_span *s, uint64_t start, uint64_t end, uint64_t n)
{
    if (!n)
        return;
    if (!s->n || start < s->start)
        s->start = start;
    if (!s->n || end > s->end)
        s->end = end;
    s->n += n;
}

int writer_out_of_memory(struct bag_writer *w, struct complaint *why)
{
    w->error = -ENOMEM;
    return complain(why, -ENOMEM, "%s: out of memory", w->sink.path);
}

int writer_after_error(const struct bag_writer *w, struct complaint *why)
{
    return complain(why, w->error, "%s: nothing more is written after an error",
                    w->sink.path);
}

static int too_large(const struct bag_writer *w, size_t size, struct complaint *why)
{
    return complain(why, -EMSGSIZE, "%s: %zu bytes in one piece; a bag takes %" PRIu64,
                    w->sink.path, size, LARGEST_DATA);
}

/* The end of the file must fit after it, with all the
 * definitions again. */
int writer_emit(struct bag_writer *w, struct complaint *why)
{
    uint64_t reserve = bag_summary_size(&w->summary) + SPARE_SIZE;

    for (size_t i = 0; i < w->definitions.n_schemas; i++)
        reserve += 2 * w->definitions.schemas[i].record.size;
    for (size_t i = 0; i < w->definitions.n_channels; i++)
        reserve += 2 * w->definitions.channels[i].definition.record.size + 10;
    int err = w->out.failed ? writer_out_of_memory(w, why)
                            : bag_sink_write(&w->sink, bytes_in(&w->out), reserve, why);
    w->out.size = 0;
    w->error = err;
    return err;
}

int bag_writer_create(struct bag_writer **out, const char *path,
                      const struct bag_writer_config *cfg, struct complaint *why)
{
    struct bag_record header = {.opcode = BAG_HEADER};
    struct bag_writer *w = calloc(1, sizeof *w);
    if (!w)
        return complain(why, -ENOMEM, "%s: out of memory", path);
    w->cfg = *cfg;
    int err = bag_sink_create(&w->sink, path, why);
    if (err) {
        free(w);
        return err;
    }
    header.header.profile = bytes_of(cfg->profile);
    header.header.library = bytes_of(cfg->library);
    bytes_put(&w->out, (struct bytes){(const uint8_t *)BAG_MAGIC, BAG_MAGIC_SIZE});
    bag_record_put(&w->out, &header);
    err = writer_emit(w, why);
    if (err) {
        bag_writer_close(w, NULL);
        unlink(path);
    } else {
        *out = w;
    }
    return err;
}

int bag_writer_schema(struct bag_writer *w, const struct bag_schema *schema, uint16_t *id,
                      struct complaint *why)
{
    int err = bag_definitions_schema(&w->definitions, schema, id);

    return err ? complain(why, err, "%s: a schema: %s", w->sink.path, strerror(-err)) : 0;
}

int bag_writer_channel(struct bag_writer *w, const struct bag_channel *channel,
                       uint16_t *id, struct complaint *why)
{
    int err = bag_definitions_channel(&w->definitions, channel, id);

    return err ? complain(why, err, "%s: a channel: %s", w->sink.path, strerror(-err))
               : 0;
}

/* Without chunks: each record by itself. */
static int write_message(struct bag_writer *w, const struct bag_record *r,
                         struct complaint *why)
{
    uint16_t channel = r->message.channel_id;

    bag_definitions_put(&w->definitions, channel, &w->out);
    bag_record_put(&w->out, r);
    int err = writer_emit(w, why);
    if (err)
        return err;
    w->definitions.channels[channel - 1].n_messages++;
    writer_span_add(&w->messages, r->message.log_time, r->message.log_time, 1);
    return 0;
}

int bag_writer_message(struct bag_writer *w, const struct bag_message *m,
                       struct complaint *why)
{
    const struct bag_record r = {.opcode = BAG_MESSAGE, .message = *m};

    if (w->error)
        return writer_after_error(w, why);
    if (!m->channel_id || m->channel_id > w->definitions.n_channels)
        return complain(why, -EINVAL, "%s: a message of no channel", w->sink.path);
    if (m->data.size > LARGEST_DATA)
        return too_large(w, m->data.size, why);
    if (!w->cfg.chunk_size)
        return write_message(w, &r, why);
    int err = w->chunk.size + m->data.size > LARGEST_DATA ? writer_end_chunk(w, why) : 0;
    if (err)
        return err;
    bag_definitions_put(&w->definitions, m->channel_id, &w->chunk);
    bag_definitions_count(&w->definitions, m->channel_id, m->log_time, w->chunk.size);
    bag_record_put(&w->chunk, &r);
    writer_span_add(&w->in_chunk, m->log_time, m->log_time, 1);
    if (w->chunk.failed)
        return writer_out_of_memory(w, why);
    return w->chunk.size >= w->cfg.chunk_size ? writer_end_chunk(w, why) : 0;
}

int bag_writer_attachment(struct bag_writer *w, const struct bag_attachment *a,
                          struct complaint *why)
{
    const struct bag_record r = {.opcode = BAG_ATTACHMENT, .attachment = *a};
    struct bag_record index = {.opcode = BAG_ATTACHMENT_INDEX};

    if (w->error)
        return writer_after_error(w, why);
    if (a->data.size > LARGEST_DATA)
        return too_large(w, a->data.size, why);
    bag_record_put(&w->out, &r);
    index.attachment_index = (struct bag_attachment_index){
        .offset = w->sink.size,
        .length = w->out.size,
        .log_time = a->log_time,
        .create_time = a->create_time,
        .data_size = a->data.size,
        .name = a->name,
        .media_type = a->media_type,
    };
    int err = writer_emit(w, why);
    if (err)
        return err;
    w->statistics.attachment_count++;
    if (!w->cfg.without_attachment_index)
        bag_record_put(&w->summary.attachment_indexes, &index);
    return 0;
}

int bag_writer_metadata(struct bag_writer *w, const struct bag_metadata *m,
                        struct complaint *why)
{
    const struct bag_record r = {.opcode = BAG_METADATA, .metadata = *m};
    struct bag_record index = {.opcode = BAG_METADATA_INDEX};

    if (w->error)
        return writer_after_error(w, why);
    bag_record_put(&w->out, &r);
    index.metadata_index = (struct bag_metadata_index){
        .offset = w->sink.size, .length = w->out.size, .name = m->name};
    int err = writer_emit(w, why);
    if (err)
        return err;
    w->statistics.metadata_count++;
    if (!w->cfg.without_metadata_index)
        bag_record_put(&w->summary.metadata_indexes, &index);
    return 0;
}

int bag_writer_flush(struct bag_writer *w, struct complaint *why)
{
    int err = writer_end_chunk(w, why);

    return err ? err : bag_sink_sync(&w->sink, why);
}

uint64_t bag_writer_size(const struct bag_writer *w)
{
    return w->sink.size + w->chunk.size;
}

uint64_t bag_writer_messages(const struct bag_writer *w)
{
    return w->messages.n;
}

static void summarize(struct bag_writer *w)
{
    struct bag_record r = {.opcode = BAG_STATISTICS, .statistics = w->statistics};
    struct bytes_buffer counts = {0}, schemas = {0}, channels = {0};

    bag_definitions_summarize(&w->definitions, &schemas, &channels, &counts);
    if (!w->cfg.without_schemas)
        bytes_put(&w->summary.schemas, bytes_in(&schemas));
    if (!w->cfg.without_channels)
        bytes_put(&w->summary.channels, bytes_in(&channels));
    r.statistics.message_count = w->messages.n;
    r.statistics.message_start_time = w->messages.start;
    r.statistics.message_end_time = w->messages.end;
    r.statistics.schema_count = (uint16_t)w->definitions.n_schemas;
    r.statistics.channel_count = (uint32_t)w->definitions.n_channels;
    r.statistics.channel_message_counts = bytes_in(&counts);
    if (!w->cfg.without_statistics)
        bag_record_put(&w->summary.statistics, &r);
    w->out.failed |= schemas.failed || channels.failed || counts.failed;
    bytes_free(&counts);
    bytes_free(&schemas);
    bytes_free(&channels);
}

/* Goes on after an error of writing: what is whole gets its end. */
static int write_end(struct bag_writer *w, struct complaint *why)
{
    uint32_t crc;

    bag_definitions_put_rest(&w->definitions, &w->out);
    crc = bag_crc(w->sink.crc, bytes_in(&w->out));
    summarize(w);
    int err = bag_summary_put(&w->out, &w->summary, !w->cfg.without_summary_offsets,
                              w->sink.size + w->out.size, crc);
    if (err)
        return complain(why, err, "%s: its index cannot be read back: %s", w->sink.path,
                        strerror(-err));
    return w->out.failed ? writer_out_of_memory(w, why)
                         : bag_sink_write(&w->sink, bytes_in(&w->out), 0, why);
}

int bag_writer_close(struct bag_writer *w, struct complaint *why)
{
    if (!w)
        return 0;
    int err = writer_end_chunk(w, why);
    if (w->sink.size) {
        int end = write_end(w, err ? NULL : why);
        err = err ? err : end;
    }
    int closed = bag_sink_close(&w->sink, err ? NULL : why);
    bag_definitions_free(&w->definitions);
    bag_summary_free(&w->summary);
    bytes_free(&w->chunk);
    bytes_free(&w->out);
    bytes_free(&w->packed);
    free(w);
    return err ? err : closed;
}
