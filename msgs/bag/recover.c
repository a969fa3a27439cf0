/* SPDX-License-Identifier: MIT */
#include "msgs/bag/recover.h"

#include <errno.h>
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/bag/catalog.h"
#include "msgs/bag/compression.h"
#include "msgs/bag/copy.h"
#include "msgs/bag/file.h"
#include "msgs/bag/record.h"
#include "msgs/bag/writer.h"

/* Finds whole records in a file whose bytes cannot be trusted. */

struct bag_salvage {
    const struct bag_file *file;
    uint64_t work;      /* bytes that may still be looked at in vain */
    uint64_t allowance; /* bytes that chunks may still hold */
    bool out_of_memory; /* once: what seemed damaged since may be whole */
    struct bytes_buffer window;
    uint64_t window_offset;
    struct bytes_buffer record; /* the one looked at last */
    struct bytes_buffer plain;  /* its records, when it is a chunk */
};

#define WINDOW_SIZE   (1u << 20)
#define WORK_PER_BYTE 64 /* of the file: a hostile one ends the search */
#define CHUNK_NAME_AT (BAG_RECORD_HEAD_SIZE + 28) /* its compression */

/* Clear it with bag_salvage_free. */
static void bag_salvage_init(struct bag_salvage *s, const struct bag_file *file)
{
    *s = (struct bag_salvage){.file = file,
                              .work = WORK_PER_BYTE * file->size + WINDOW_SIZE,
                              .allowance = bag_file_allowance(file)};
}

static void bag_salvage_free(struct bag_salvage *s)
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

/* Whether a magic stands there. */
static bool bag_salvage_is_magic(struct bag_salvage *s, uint64_t offset)
{
    const uint8_t *at = look(s, offset, BAG_MAGIC_SIZE);

    return at && !memcmp(at, BAG_MAGIC, BAG_MAGIC_SIZE);
}

/* The opcode and the length of a record that may begin there, with its head, and may be
 * damaged inside; 0: none, or it would reach beyond the file. */
static uint64_t bag_salvage_length(struct bag_salvage *s, uint64_t offset,
                                   uint8_t *opcode)
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

/* Could the file go on there?
 *
 * The head of a record that the file's end may cut. */
static bool bag_salvage_goes_on(struct bag_salvage *s, uint64_t offset)
{
    const uint8_t *at = look(s, offset, BAG_RECORD_HEAD_SIZE);

    if (!at) /* the last bytes: they end a record that was checked, or were cut */
        return offset <= s->file->size;
    return bag_salvage_is_magic(s, offset) ||
           (bag_opcode_name(at[0]) && !at[6] && !at[7] && !at[8]);
}

/* A record that is whole, its checksums right, and that something sensible follows. *out
 * points into s. */
static bool bag_salvage_take(struct bag_salvage *s, uint64_t offset,
                             struct bag_record *out)
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

/* The next offset from `from` on where the file makes sense again; its size: none. */
static uint64_t bag_salvage_find(struct bag_salvage *s, uint64_t from)
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

/* What can be decompressed of a chunk that is damaged, or of which only n bytes are
 * there, into s->plain.  0, -EBADMSG (nothing), -EIO, -ENOMEM. */
static int bag_salvage_start(struct bag_salvage *s, uint64_t offset, uint64_t n)
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

#define CHUNK_SIZE (4u << 20) /* of the new bag */

struct recover {
    struct bag_catalog *catalog; /* the file, and what is defined in it */
    struct bag_writer *writer;   /* NULL: only look for definitions */
    struct bag_recovery count;
    struct bag_copy *copy; /* to the writer */
    bool doubtful;         /* under way is a chunk without its checksum */
    struct bag_salvage salvage;
    char profile[64]; /* of the header, if that is whole */
    struct bag_recover_watch watch;
};

bool bag_recovery_is_loss(const struct bag_recovery *r)
{
    return r->n_damages || r->n_unchecked || r->n_nameless || r->n_misplaced ||
           r->n_redefined || !r->ended || r->n_messages < bag_recovery_known(r);
}

uint64_t bag_recovery_known(const struct bag_recovery *r)
{
    return r->expected_messages > r->indexed_messages ? r->expected_messages
                                                      : r->indexed_messages;
}

static int save_message(struct recover *r, const struct bag_message *m, struct error *why)
{
    struct bag_message copy = *m;
    int err = bag_copy_channel(r->copy, 0, m->channel_id, &copy.channel_id, why);

    if (err)
        return err;
    if (!copy.channel_id) {
        r->count.n_nameless++;
        return 0;
    }
    r->count.n_messages++;
    return bag_writer_message(r->writer, &copy, why);
}

static void keep_profile(struct recover *r, struct bytes profile)
{
    if (profile.size < sizeof r->profile)
        snprintf(r->profile, sizeof r->profile, "%.*s", (int)profile.size,
                 (const char *)profile.data);
}

/* For what comes after it; at first, in looking for definitions, and in what has no
 * checksum one that is known stays. */
static int define(struct recover *r, const struct bag_record *record, struct error *why)
{
    int err = r->writer && !r->doubtful ? bag_catalog_redefine(r->catalog, record)
                                        : bag_catalog_define(r->catalog, record);

    if (err < 0)
        return error_say(why, err, "%s: out of memory", r->catalog->file.path);
    if (err) {
        r->count.n_redefined++;
        bag_copy_redefined(r->copy, 0, record);
    }
    return 0;
}

/* A record that is whole. */
static int save(struct recover *r, const struct bag_record *record, struct error *why)
{
    switch (record->opcode) {
    case BAG_HEADER:
        keep_profile(r, record->header.profile);
        return 0;
    case BAG_SCHEMA:
    case BAG_CHANNEL:
        return define(r, record, why);
    case BAG_STATISTICS:
        r->count.expected_messages = record->statistics.message_count;
        return 0;
    case BAG_MESSAGE_INDEX:
        r->count.indexed_messages += record->message_index.entries.size / 16;
        return 0;
    case BAG_MESSAGE:
        return r->writer ? save_message(r, &record->message, why) : 0;
    case BAG_ATTACHMENT:
        r->count.n_attachments++;
        return r->writer ? bag_writer_attachment(r->writer, &record->attachment, why) : 0;
    case BAG_METADATA:
        r->count.n_metadata++;
        return r->writer ? bag_writer_metadata(r->writer, &record->metadata, why) : 0;
    default:
        return 0;
    }
}

/* Every record of a chunk up to the end or to one that does not fit.  *left_out: bytes
 * from there on. */
static int save_all(struct recover *r, struct bytes records, size_t *left_out,
                    struct error *why)
{
    struct bytes_cursor left = {.left = records};
    struct bag_record record;
    int err = 0;

    for (*left_out = 0; !err && left.left.size;) {
        size_t before = left.left.size;
        err = bag_record_take(&left, &record);
        if (err == -EBADMSG) {
            *left_out = before;
            return 0;
        }
        if (err || !bag_chunk_allows(record.opcode)) {
            r->count.n_misplaced++;
            err = 0;
        } else {
            err = save(r, &record, why);
        }
    }
    return err;
}

/* A chunk that has its checksum, or none. */
static int save_chunk(struct recover *r, uint64_t offset, struct error *why)
{
    uint64_t end = offset + r->salvage.record.size;
    size_t left_out;
    char text[120];
    int err = save_all(r, bytes_in(&r->salvage.plain), &left_out, why);

    if (err || !left_out)
        return err;
    r->count.n_damages++;
    r->count.lost_bytes += left_out;
    snprintf(text, sizeof text,
             "a damaged record in a chunk: the last %zu of its %zu bytes are left out",
             left_out, r->salvage.plain.size);
    if (r->writer && r->watch.damaged)
        r->watch.damaged(r->watch.context, offset, end, text);
    return 0;
}

/* A chunk that is damaged, or cut by the file's end: n bytes of it are there.  What it
 * defines counts only where nothing that is whole does. */
static int save_start(struct recover *r, uint64_t offset, uint64_t n, struct error *why)
{
    uint64_t before = r->count.n_messages;
    size_t left_out;
    int err = r->writer ? bag_salvage_start(&r->salvage, offset, n) : -EBADMSG;

    if (err == -EBADMSG)
        return 0;
    if (err)
        return error_say(why, err, "%s: byte %" PRIu64 ": %s", r->catalog->file.path,
                         offset, strerror(-err));
    r->doubtful = true;
    err = save_all(r, bytes_in(&r->salvage.plain), &left_out, why);
    r->doubtful = false;
    r->count.n_unchecked += r->count.n_messages - before;
    return err;
}

/* A message that nothing sensible follows: what is whole of it cannot be told, as it has
 * no checksum, but nothing else begins within it.  *end: where it ends. */
static int save_last(struct recover *r, uint64_t offset, uint64_t next, uint64_t *end,
                     struct error *why)
{
    struct bag_record record;

    int err = bag_file_record(&r->catalog->file, offset, &r->salvage.record, NULL);
    if (err)
        return err == -ENOMEM
                   ? error_say(why, err, "%s: out of memory", r->catalog->file.path)
                   : 0;
    struct bytes_cursor whole = {.left = bytes_in(&r->salvage.record)};
    if (r->salvage.record.size > next - offset || bag_record_take(&whole, &record))
        return 0;
    *end = offset + r->salvage.record.size;
    r->count.n_unchecked++;
    return save(r, &record, why);
}

/* Nothing whole stands at the offset.  *next: where the file goes on. */
static int pass_damage(struct recover *r, uint64_t offset, uint64_t *next,
                       struct error *why)
{
    uint8_t opcode;
    uint64_t size = r->catalog->file.size, begin = offset;
    uint64_t length = bag_salvage_length(&r->salvage, offset, &opcode);
    const char *what = "no record";
    int err = 0;

    if (length && opcode == BAG_CHUNK &&
        bag_salvage_goes_on(&r->salvage, offset + length)) {
        *next = offset + length;
        what = "a damaged chunk";
    } else {
        *next = bag_salvage_find(&r->salvage, offset + 1);
        if (*next == size)
            what = "the file was cut";
    }
    if (opcode == BAG_CHUNK)
        err = save_start(r, offset, *next - offset, why);
    else if (length && opcode == BAG_MESSAGE)
        err = save_last(r, offset, *next, &begin, why);
    r->count.n_damages++;
    r->count.lost_bytes += *next - begin;
    if (r->writer && r->watch.damaged)
        r->watch.damaged(r->watch.context, begin, *next, what);
    return err;
}

static int walk(struct recover *r, struct error *why)
{
    uint64_t size = r->catalog->file.size, next;
    uint64_t offset = bag_salvage_is_magic(&r->salvage, 0) ? BAG_MAGIC_SIZE : 0;
    struct bag_record record;
    int err = 0;

    r->count = (struct bag_recovery){.n_damages = offset ? 0 : 1};
    for (; !err && offset < size; offset = next) {
        if (r->watch.stop && r->watch.stop())
            return error_say(why, -EINTR, "%s: interrupted after %.1f of %.1f MB",
                             r->catalog->file.path, 1e-6 * (double)offset,
                             1e-6 * (double)size);
        if (bag_salvage_take(&r->salvage, offset, &record)) {
            next = offset + r->salvage.record.size;
            r->count.ended |= record.opcode == BAG_FOOTER;
            err = record.opcode == BAG_CHUNK ? save_chunk(r, offset, why)
                                             : save(r, &record, why);
        } else if (size - offset == BAG_MAGIC_SIZE &&
                   bag_salvage_is_magic(&r->salvage, offset)) {
            next = size;
        } else {
            err = pass_damage(r, offset, &next, why);
        }
        if (!err && r->salvage.out_of_memory) /* what could not be read may be whole */
            err = error_say(why, -ENOMEM, "%s: out of memory", r->catalog->file.path);
    }
    return err;
}

static int run(struct recover *r, const char *from, const char *to, struct error *why)
{
    int err = bag_file_open_any(&r->catalog->file, from, why);

    if (err)
        return err;
    bag_salvage_init(&r->salvage, &r->catalog->file);
    err = walk(r, why); /* for the definitions, wherever they stand */
    if (err)
        return err;
    const struct bag_writer_config cfg = {.profile = r->profile,
                                          .library = "anlos " ANLOS_VERSION,
                                          .chunk_size = CHUNK_SIZE,
                                          .compression = BAG_ZSTD};
    err = bag_writer_create(&r->writer, to, &cfg, why);
    if (err)
        return err;
    bag_salvage_free(&r->salvage);
    bag_salvage_init(&r->salvage, &r->catalog->file);
    if (bag_copy_create(&r->copy, r->writer) || bag_copy_add(r->copy, r->catalog))
        err = error_say(why, -ENOMEM, "%s: out of memory", from);
    if (!err)
        err = walk(r, why);
    int closed = bag_writer_close(r->writer, err ? NULL : why);
    return err ? err : closed;
}

int bag_recover(struct bag_recovery *out, const char *from, const char *to,
                const struct bag_recover_watch *watch, struct error *why)
{
    struct recover *r = calloc(1, sizeof *r);
    int err = r ? 0 : error_say(why, -ENOMEM, "%s: out of memory", from);

    if (!err) {
        if (watch)
            r->watch = *watch;
        r->catalog = calloc(1, sizeof *r->catalog);
        err = r->catalog ? 0 : error_say(why, -ENOMEM, "%s: out of memory", from);
    }
    if (!err) {
        r->catalog->file.fd = -1;
        err = run(r, from, to, why);
        *out = r->count;
    }
    if (r) {
        bag_copy_destroy(r->copy);
        bag_catalog_close(r->catalog);
        bag_salvage_free(&r->salvage);
    }
    free(r);
    return err;
}
