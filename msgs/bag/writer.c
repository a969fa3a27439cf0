/* SPDX-License-Identifier: MIT */
#include "msgs/bag/writer.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "dsp/error.h"
#include "dsp/list.h"
#include "msgs/bag/bytes.h"
#include "msgs/bag/file.h"
#include "msgs/bag/record.h"
#include "msgs/bag/summary.h"

/* The schemas and channels of a bag that is being written: what of them stands in the
 * file already, and how many messages each channel has.
 *
 * Each chunk names again what its messages need, so that it can be read when others are
 * damaged.  Without chunks the whole data section counts as one. */

struct bag_definition {
    struct bytes_buffer record;
    bool in_chunk; /* under way */
    bool in_file;
};

struct bag_definitions {
    size_t n_schemas, schemas_room, n_channels, channels_room;
    struct bag_definition *schemas; /* [n_schemas]; id - 1 */
    struct bag_defined_channel {
        struct bag_definition definition;
        uint16_t schema_id;
        uint64_t n_messages;         /* in the file */
        uint64_t n_in_chunk;         /* in the chunk under way */
        struct bytes_buffer entries; /* of its message index */
    } * channels;                    /* [n_channels]; id - 1 */
};

/* A file that only ever ends after a whole record: what cannot be written is taken back,
 * and space for the end of the file is held ready. */

struct bag_sink {
    char *path;
    int fd;
    uint64_t size; /* of what was written whole */
    uint32_t crc;  /* of all of it */
};

/* What the writer and its chunks share. */

struct writer_span { /* of log times */
    uint64_t n, start, end;
};

struct bag_writer {
    struct bag_writer_config cfg;
    struct bag_sink sink;
    struct bag_definitions definitions;
    struct bag_summary summary;
    struct bag_statistics statistics; /* counts */
    struct writer_span messages;      /* in the file */
    struct writer_span in_chunk;
    struct bytes_buffer chunk;       /* records of the chunk under way */
    struct bytes_buffer out, packed; /* scratch: what is written next, compressed */
    int error;                       /* of writing: nothing more is taken */
};

/* All of the record, or nothing of it is kept. */
static int put_record(struct bytes_buffer *into, const struct bag_record *r)
{
    bag_record_put(into, r);
    if (!into->failed)
        return 0;
    bytes_free(into);
    return -ENOMEM;
}

/* *id: from 1, what the record says it is.  0, -EINVAL (too many, or a channel of a
 * schema that is not there), -ENOMEM. */
static int bag_definitions_schema(struct bag_definitions *d,
                                  const struct bag_schema *schema, uint16_t *id)
{
    struct bag_record r = {.opcode = BAG_SCHEMA, .schema = *schema};
    struct bytes_buffer bytes = {0};

    if (d->n_schemas == UINT16_MAX)
        return -EINVAL;
    if (list_grow(&d->schemas, d->n_schemas, &d->schemas_room, sizeof *d->schemas))
        return -ENOMEM;
    r.schema.id = (uint16_t)(d->n_schemas + 1);
    if (put_record(&bytes, &r))
        return -ENOMEM;
    d->schemas[d->n_schemas++] = (struct bag_definition){.record = bytes};
    *id = r.schema.id;
    return 0;
}

static int bag_definitions_channel(struct bag_definitions *d,
                                   const struct bag_channel *channel, uint16_t *id)
{
    struct bag_record r = {.opcode = BAG_CHANNEL, .channel = *channel};
    struct bytes_buffer bytes = {0};

    if (d->n_channels == UINT16_MAX || channel->schema_id > d->n_schemas)
        return -EINVAL;
    if (list_grow(&d->channels, d->n_channels, &d->channels_room, sizeof *d->channels))
        return -ENOMEM;
    r.channel.id = (uint16_t)(d->n_channels + 1);
    if (put_record(&bytes, &r))
        return -ENOMEM;
    d->channels[d->n_channels++] = (struct bag_defined_channel){
        .schema_id = channel->schema_id, .definition.record = bytes};
    *id = r.channel.id;
    return 0;
}

static void put(struct bag_definition *d, struct bytes_buffer *chunk)
{
    if (!d->in_chunk)
        bytes_put(chunk, bytes_in(&d->record));
    d->in_chunk = true;
}

/* Appends what a message of that channel needs and the chunk does not have. */
static void bag_definitions_put(struct bag_definitions *d, uint16_t channel_id,
                                struct bytes_buffer *chunk)
{
    struct bag_defined_channel *h = &d->channels[channel_id - 1];

    if (h->schema_id)
        put(&d->schemas[h->schema_id - 1], chunk);
    put(&h->definition, chunk);
}

/* Appends what stands nowhere in the file. */
static void bag_definitions_put_rest(struct bag_definitions *d, struct bytes_buffer *out)
{
    for (size_t i = 0; i < d->n_schemas; i++)
        if (!d->schemas[i].in_file)
            put(&d->schemas[i], out);
    for (size_t i = 0; i < d->n_channels; i++)
        if (!d->channels[i].definition.in_file)
            put(&d->channels[i].definition, out);
}

/* A message of the chunk, at an offset in it. */
static void bag_definitions_count(struct bag_definitions *d, uint16_t channel_id,
                                  uint64_t log_time, uint64_t offset)
{
    struct bag_defined_channel *h = &d->channels[channel_id - 1];

    h->n_in_chunk++;
    bytes_put_number(&h->entries, log_time, 8);
    bytes_put_number(&h->entries, offset, 8);
}

/* Appends the chunk's message indexes; origin: where out will stand in the file.
 * offsets: the map for the chunk's index. */
static void bag_definitions_put_indexes(const struct bag_definitions *d, uint64_t origin,
                                        struct bytes_buffer *out,
                                        struct bytes_buffer *offsets)
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

/* The chunk has ended: it stands in the file, or is lost. */
static void bag_definitions_settle(struct bag_definitions *d, bool written)
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

/* For the summary: all records, and the counts of channels that have messages. */
static void bag_definitions_summarize(const struct bag_definitions *d,
                                      struct bytes_buffer *schemas,
                                      struct bytes_buffer *channels,
                                      struct bytes_buffer *counts)
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

static void bag_definitions_free(struct bag_definitions *d)
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

/* Makes the file, which must not be there.  0, -EEXIST, other errno, -ENOMEM. */
static int bag_sink_create(struct bag_sink *s, const char *path, struct error *why)
{
    *s = (struct bag_sink){.path = strdup(path), .fd = -1};
    if (!s->path)
        return error_say(why, -ENOMEM, "out of memory");
    s->fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (s->fd >= 0)
        return 0;
    int err = error_say(why, -errno, "%s: %s", path, strerror(errno));
    free(s->path);
    s->path = NULL;
    return err;
}

/* A file may not grow beyond the process's limit, nor can space be held there. */
static bool exceeds_limit(uint64_t end)
{
    struct rlimit limit;

    return !getrlimit(RLIMIT_FSIZE, &limit) && limit.rlim_cur != RLIM_INFINITY &&
           end > limit.rlim_cur;
}

/* 0, or a disk that is full; a file system that cannot hold space ready is let be. */
static int hold(const struct bag_sink *s, uint64_t n)
{
    int err;

    if (exceeds_limit(s->size + n))
        return -EFBIG;
    do
        err = fallocate(s->fd, FALLOC_FL_KEEP_SIZE, (off_t)s->size, (off_t)n) ? errno : 0;
    while (err == EINTR);
    return err == ENOSPC || err == EDQUOT ? -err : 0;
}

static int write_all(const struct bag_sink *s, struct bytes what)
{
    uint64_t at = s->size;

    while (what.size) {
        ssize_t n = pwrite(s->fd, what.data, what.size, (off_t)at);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return n ? -errno : -EIO;
        what.data += n;
        what.size -= (size_t)n;
        at += (uint64_t)n;
    }
    return 0;
}

/* Writes all or nothing.  reserve: bytes that must still fit after it.  0 or a negative
 * errno. */
static int bag_sink_write(struct bag_sink *s, struct bytes what, uint64_t reserve,
                          struct error *why)
{
    if (!what.size)
        return 0;
    int err = hold(s, what.size + reserve);
    if (err)
        return error_say(why, err, "%s: %s", s->path, strerror(-err));
    err = write_all(s, what);
    /* Should taking it back fail too, the size still tells where the next record goes. */
    if (err)
        return error_say(why, err, "%s: %s%s", s->path, strerror(-err),
                         ftruncate(s->fd, (off_t)s->size) ? "; its end is damaged" : "");
    s->size += what.size;
    s->crc = bag_crc(s->crc, what);
    return 0;
}

/* Brings what was written to the disk.  0 or a negative errno. */
static int bag_sink_sync(struct bag_sink *s, struct error *why)
{
    return fdatasync(s->fd) ? error_say(why, -errno, "%s: %s", s->path, strerror(errno))
                            : 0;
}

/* Gives what was held ready back, and closes.  0 or a negative errno. */
static int bag_sink_close(struct bag_sink *s, struct error *why)
{
    int err = 0;

    if (s->fd < 0)
        return 0;
    if (ftruncate(s->fd, (off_t)s->size) || fsync(s->fd))
        err = -errno;
    if (close(s->fd) && !err)
        err = -errno;
    if (err)
        error_say(why, err, "%s: %s", s->path, strerror(-err));
    free(s->path);
    *s = (struct bag_sink){.fd = -1};
    return err;
}

/* More messages of those times; n 0: none. */
static void writer_span_add(struct writer_span *s, uint64_t start, uint64_t end,
                            uint64_t n)
{
    if (!n)
        return;
    if (!s->n || start < s->start)
        s->start = start;
    if (!s->n || end > s->end)
        s->end = end;
    s->n += n;
}

static void settle_chunk(struct bag_writer *w, bool written)
{
    bag_definitions_settle(&w->definitions, written);
    if (written) {
        w->statistics.chunk_count++;
        writer_span_add(&w->messages, w->in_chunk.start, w->in_chunk.end, w->in_chunk.n);
    }
    w->in_chunk = (struct writer_span){0};
    w->chunk.size = 0;
}

/* Puts chunk and message indexes into w->out, its own index into the summary.  packed:
 * the chunk's records as they go into the file. */
static void put_chunk(struct bag_writer *w, struct bytes packed)
{
    struct bytes_buffer offsets = {0};
    struct bytes plain = bytes_in(&w->chunk);
    struct bag_record chunk = {.opcode = BAG_CHUNK}, index = {.opcode = BAG_CHUNK_INDEX};

    chunk.chunk = (struct bag_chunk){
        .message_start_time = w->in_chunk.start,
        .message_end_time = w->in_chunk.end,
        .uncompressed_size = plain.size,
        .uncompressed_crc = bag_crc(0, plain),
        .compression = bytes_of(bag_compression_name(w->cfg.compression)),
        .records = packed,
    };
    bag_record_put(&w->out, &chunk);
    index.chunk_index = (struct bag_chunk_index){
        .message_start_time = w->in_chunk.start,
        .message_end_time = w->in_chunk.end,
        .chunk_start_offset = w->sink.size,
        .chunk_length = w->out.size,
        .compression = chunk.chunk.compression,
        .compressed_size = packed.size,
        .uncompressed_size = plain.size,
    };
    if (!w->cfg.without_message_index)
        bag_definitions_put_indexes(&w->definitions, w->sink.size, &w->out, &offsets);
    index.chunk_index.message_index_length = w->out.size - index.chunk_index.chunk_length;
    index.chunk_index.message_index_offsets = bytes_in(&offsets);
    if (!w->cfg.without_chunk_index)
        bag_record_put(&w->summary.chunk_indexes, &index);
    w->out.failed |= offsets.failed;
    bytes_free(&offsets);
}

/* Ends all writing: -ENOMEM now, and the error of before. */
static int writer_out_of_memory(struct bag_writer *w, struct error *why)
{
    w->error = -ENOMEM;
    return error_say(why, -ENOMEM, "%s: out of memory", w->sink.path);
}

static int writer_after_error(const struct bag_writer *w, struct error *why)
{
    return error_say(why, w->error, "%s: nothing more is written after an error",
                     w->sink.path);
}

static int writer_emit(struct bag_writer *w, struct error *why);

/* Writes w->out together with its entry in an index of the summary, which had `before`
 * bytes: both or neither. */
static int writer_emit_indexed(struct bag_writer *w, struct bytes_buffer *index,
                               size_t before, struct error *why)
{
    w->out.failed |= index->failed;
    int err = writer_emit(w, why);

    if (err) {
        index->size = before;
        index->failed = false;
    }
    return err;
}

/* Writes the chunk under way, if there is one, with its indexes. */
static int writer_end_chunk(struct bag_writer *w, struct error *why)
{
    size_t indexes = w->summary.chunk_indexes.size;

    if (w->error)
        return writer_after_error(w, why);
    if (!w->chunk.size)
        return 0;
    if (w->chunk.failed)
        return writer_out_of_memory(w, why);
    bool as_it_is = w->cfg.compression == BAG_NONE;
    int err = as_it_is ? 0
                       : bag_compress(&w->packed, w->cfg.compression, w->cfg.level,
                                      bytes_in(&w->chunk));
    if (err) {
        w->error = err;
        return error_say(why, err, "%s: a chunk cannot be compressed: %s", w->sink.path,
                         strerror(-err));
    }
    put_chunk(w, bytes_in(as_it_is ? &w->chunk : &w->packed));
    err = writer_emit_indexed(w, &w->summary.chunk_indexes, indexes, why);
    if (!err)
        bag_summary_lay_down(&w->summary, w->sink.path);
    settle_chunk(w, !err);
    return err;
}

#define SPARE_SIZE    (64 << 10) /* held on the disk beside what is known of the end */
#define BARE_END_SIZE 64 /* held in memory: end of data, footer and closing magic */
#define LARGEST_DATA  (BAG_MAX_SIZE - ((uint64_t)1 << 20)) /* leaves room for the rest */

static int too_large(const struct bag_writer *w, size_t size, struct error *why)
{
    return error_say(why, -EMSGSIZE, "%s: %zu bytes in one piece; a bag takes %" PRIu64,
                     w->sink.path, size, LARGEST_DATA);
}

/* Writes w->out, and empties it.  Errors of writing.
 *
 * The end of the file must fit after it, with all the
 * definitions again. */
static int writer_emit(struct bag_writer *w, struct error *why)
{
    uint64_t reserve = bag_summary_size(&w->summary) + SPARE_SIZE;

    for (size_t i = 0; i < w->definitions.n_schemas; i++)
        reserve += 2 * w->definitions.schemas[i].record.size;
    for (size_t i = 0; i < w->definitions.n_channels; i++)
        reserve += 2 * w->definitions.channels[i].definition.record.size + 10;
    int err = w->out.failed ? writer_out_of_memory(w, why)
                            : bag_sink_write(&w->sink, bytes_in(&w->out), reserve, why);
    w->out.size = 0;
    w->out.failed = false;
    w->error = err;
    return err;
}

int bag_writer_create(struct bag_writer **out, const char *path,
                      const struct bag_writer_config *cfg, struct error *why)
{
    struct bag_record header = {.opcode = BAG_HEADER};
    struct bag_writer *w = calloc(1, sizeof *w);
    if (!w)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    w->cfg = *cfg;
    w->chunk.pages = w->out.pages = w->packed.pages = true;
    int err = bag_sink_create(&w->sink, path, why);
    if (err) {
        free(w);
        return err;
    }
    header.header.profile = bytes_of(cfg->profile);
    header.header.library = bytes_of(cfg->library);
    bytes_reserve(&w->out, BARE_END_SIZE);
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
                      struct error *why)
{
    int err = bag_definitions_schema(&w->definitions, schema, id);

    return err ? error_say(why, err, "%s: a schema: %s", w->sink.path, strerror(-err))
               : 0;
}

int bag_writer_channel(struct bag_writer *w, const struct bag_channel *channel,
                       uint16_t *id, struct error *why)
{
    int err = bag_definitions_channel(&w->definitions, channel, id);

    return err ? error_say(why, err, "%s: a channel: %s", w->sink.path, strerror(-err))
               : 0;
}

/* Without chunks: each record by itself. */
static int write_message(struct bag_writer *w, const struct bag_record *r,
                         struct error *why)
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
                       struct error *why)
{
    const struct bag_record r = {.opcode = BAG_MESSAGE, .message = *m};

    if (w->error)
        return writer_after_error(w, why);
    if (!m->channel_id || m->channel_id > w->definitions.n_channels)
        return error_say(why, -EINVAL, "%s: a message of no channel", w->sink.path);
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
                          struct error *why)
{
    const struct bag_record r = {.opcode = BAG_ATTACHMENT, .attachment = *a};
    struct bag_record index = {.opcode = BAG_ATTACHMENT_INDEX};
    size_t before = w->summary.attachment_indexes.size;

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
    if (!w->cfg.without_attachment_index)
        bag_record_put(&w->summary.attachment_indexes, &index);
    int err = writer_emit_indexed(w, &w->summary.attachment_indexes, before, why);
    w->statistics.attachment_count += !err;
    return err;
}

int bag_writer_metadata(struct bag_writer *w, const struct bag_metadata *m,
                        struct error *why)
{
    const struct bag_record r = {.opcode = BAG_METADATA, .metadata = *m};
    struct bag_record index = {.opcode = BAG_METADATA_INDEX};
    size_t before = w->summary.metadata_indexes.size;

    if (w->error)
        return writer_after_error(w, why);
    bag_record_put(&w->out, &r);
    index.metadata_index = (struct bag_metadata_index){
        .offset = w->sink.size, .length = w->out.size, .name = m->name};
    if (!w->cfg.without_metadata_index)
        bag_record_put(&w->summary.metadata_indexes, &index);
    int err = writer_emit_indexed(w, &w->summary.metadata_indexes, before, why);
    w->statistics.metadata_count += !err;
    return err;
}

int bag_writer_flush(struct bag_writer *w, struct error *why)
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

/* Puts the end of the file into w->out.  0, -ENOMEM, errno of reading the index back. */
static int put_end(struct bag_writer *w)
{
    bag_definitions_put_rest(&w->definitions, &w->out);
    uint32_t crc = bag_crc(w->sink.crc, bytes_in(&w->out));
    summarize(w);
    int err = bag_summary_put(&w->out, &w->summary, !w->cfg.without_summary_offsets,
                              w->sink.size + w->out.size, crc);

    return err ? err : w->out.failed ? -ENOMEM : 0;
}

/* The end of a bag without an index, for which there is room from the start. */
static void put_bare_end(struct bag_writer *w)
{
    const struct bag_summary nothing = {.fd = -1};

    w->out.size = 0;
    w->out.failed = false;
    bag_summary_put(&w->out, &nothing, false, w->sink.size, w->sink.crc);
}

/* Goes on after an error of writing: what is whole gets its end. */
static int write_end(struct bag_writer *w, struct error *why)
{
    int err = put_end(w);

    if (err) {
        error_say(why, err, "%s: written without its index: %s", w->sink.path,
                  err == -ENOMEM ? "out of memory" : strerror(-err));
        put_bare_end(w);
    }
    int written = bag_sink_write(&w->sink, bytes_in(&w->out), 0, err ? NULL : why);
    return err ? err : written;
}

int bag_writer_close(struct bag_writer *w, struct error *why)
{
    if (!w)
        return 0;
    int err = writer_end_chunk(w, why);
    if (err) /* what it defines is defined at the end */
        settle_chunk(w, false);
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
