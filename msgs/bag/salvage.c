#include "msgs/bag/salvage.h"

#include <errno.h>
#include <string.h>

#include "msgs/bag/compression.h"

#define WINDOW_SIZE   (1u << 20)
#define WORK_PER_BYTE 64 /* of the file: a hostile one ends the search */
#define CHUNK_NAME_AT (BAG_RECORD_HEAD_SIZE + 28) /* its compression */

void bag_salvage_init(struct bag_salvage *s, const struct bag_file *file)
{
    *s = (struct bag_salvage){.file = file,
                              .work = WORK_PER_BYTE * file->size + WINDOW_SIZE,
                              .allowance = bag_file_allowance(file)};
}

void bag_salvage_free(struct bag_salvage *s)
{
    bytes_free(&s->window);
    bytes_free(&s->record);
    bytes_free(&s->plain);
}

/* Only what was read can be damaged.  A bad place of a disk is: it is lost. */
static bool is_read(struct bag_salvage *s, int err)
{
    s->out_of_memory |= err == -ENOMEM;
    return !err;
}

/* n bytes at the offset; NULL: they are not there. */
static const uint8_t *look(struct bag_salvage *s, uint64_t offset, size_t n)
{
    if (offset > s->file->size || n > s->file->size - offset)
        return NULL;
    if (offset < s->window_offset || offset + n > s->window_offset + s->window.size) {
        uint64_t left = s->file->size - offset;
        s->window_offset = offset;
        if (!is_read(s, bag_file_read(s->file, offset,
                                      left < WINDOW_SIZE ? left : WINDOW_SIZE, &s->window,
                                      NULL))) {
            s->window.size = 0;
            return NULL;
        }
    }
    return s->window.data + (offset - s->window_offset);
}

bool bag_salvage_is_magic(struct bag_salvage *s, uint64_t offset)
{
    const uint8_t *at = look(s, offset, BAG_MAGIC_SIZE);

    return at && !memcmp(at, BAG_MAGIC, BAG_MAGIC_SIZE);
}

uint64_t bag_salvage_length(struct bag_salvage *s, uint64_t offset, uint8_t *opcode)
{
    const uint8_t *at = look(s, offset, BAG_RECORD_HEAD_SIZE);
    struct bytes_cursor c = {.left = {at, at ? BAG_RECORD_HEAD_SIZE : 0}};

    *opcode = (uint8_t)bytes_number(&c, 1);
    uint64_t length = bytes_number(&c, 8);
    if (c.failed || !bag_opcode_name(*opcode) ||
        length > s->file->size - offset - BAG_RECORD_HEAD_SIZE)
        return 0;
    return BAG_RECORD_HEAD_SIZE + length;
}

/* The head of a record that the file's end may cut. */
bool bag_salvage_goes_on(struct bag_salvage *s, uint64_t offset)
{
    const uint8_t *at = look(s, offset, BAG_RECORD_HEAD_SIZE);

    if (!at) /* the last bytes: they end a record that was checked, or were cut */
        return offset <= s->file->size;
    return bag_salvage_is_magic(s, offset) ||
           (bag_opcode_name(at[0]) && !at[6] && !at[7] && !at[8]);
}

bool bag_salvage_take(struct bag_salvage *s, uint64_t offset, struct bag_record *out)
{
    uint8_t opcode;
    uint64_t length = bag_salvage_length(s, offset, &opcode);

    if (!length || !bag_salvage_goes_on(s, offset + length) ||
        !is_read(s, bag_file_record(s->file, offset, &s->record, NULL)))
        return false;
    struct bytes_cursor whole = {.left = bytes_in(&s->record)};
    if (bag_record_take(&whole, out))
        return false;
    if (opcode == BAG_ATTACHMENT)
        return !bag_file_attachment(s->file, offset, &out->attachment, NULL);
    return opcode != BAG_CHUNK ||
           is_read(s, bag_file_chunk(s->file, offset, &out->chunk, &s->allowance,
                                     &s->plain, NULL));
}

uint64_t bag_salvage_find(struct bag_salvage *s, uint64_t from)
{
    uint64_t size = s->file->size;
    struct bag_record record;
    uint8_t opcode;

    for (uint64_t offset = from; offset < size; offset++) {
        uint64_t length = bag_salvage_length(s, offset, &opcode);
        if (size - offset == BAG_MAGIC_SIZE && bag_salvage_is_magic(s, offset))
            return offset;
        if (!length || !bag_salvage_goes_on(s, offset + length))
            continue;
        if (length > s->work)
            return size;
        if (bag_salvage_take(s, offset, &record))
            return offset;
        s->work -= length;
    }
    return size;
}

int bag_salvage_start(struct bag_salvage *s, uint64_t offset, uint64_t n)
{
    enum bag_compression compression;
    struct bag_record record;
    int err = bag_file_read(s->file, offset, n, &s->record, NULL);

    if (err)
        return err == -EFBIG ? -EBADMSG : err;
    struct bytes_cursor c = {.left = bytes_in(&s->record)};
    bytes_take(&c, CHUNK_NAME_AT);
    struct bytes name = bytes_take_sized(&c, 4);
    bytes_take(&c, 8);
    if (c.failed || bag_compression_find(&compression, name))
        return -EBADMSG;
    /* It says how much there should be; from here on, how much there is. */
    bytes_set_number(&s->record, (size_t)(c.left.data - s->record.data) - 8, c.left.size,
                     8);
    c = (struct bytes_cursor){.left = bytes_in(&s->record)};
    bytes_take(&c, BAG_RECORD_HEAD_SIZE);
    if (bag_record_parse(&record, BAG_CHUNK, c.left) ||
        record.chunk.uncompressed_size > BAG_MAX_SIZE ||
        record.chunk.uncompressed_size > s->allowance)
        return -EBADMSG;
    s->allowance -= record.chunk.uncompressed_size;
    return bag_decompress_start(&s->plain, compression, record.chunk.records,
                                record.chunk.uncompressed_size);
}
