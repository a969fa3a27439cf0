#include <errno.h>
#include <string.h>

#include "msgs/bag/writer_state.h"

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

int writer_end_chunk(struct bag_writer *w, struct complaint *why)
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
        return complain(why, err, "%s: a chunk cannot be compressed: %s", w->sink.path,
                        strerror(-err));
    }
    put_chunk(w, bytes_in(as_it_is ? &w->chunk : &w->packed));
    err = writer_emit(w, why);
    if (err)
        w->summary.chunk_indexes.size = indexes;
    else
        bag_summary_lay_down(&w->summary, w->sink.path);
    settle_chunk(w, !err);
    return err;
}
