/* SPDX-License-Identifier: MIT */
#include "msgs/bag/reader.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/bag/file.h"

struct bag_reader {
    struct bag_file file;
    enum bag_section section;
    uint64_t offset, next;     /* of the record that came last, of the one to come */
    uint64_t summary_start;    /* where the summary section began */
    uint32_t crc;              /* of the section up to next */
    struct bytes_buffer bytes; /* of the record that came last */
    struct bytes_buffer chunk; /* records of the chunk under way */
    struct bytes_cursor left;  /* of the chunk */
    uint64_t allowance;        /* bytes that chunks may still hold */
    int failed;                /* 0, or the negative errno of: */
    struct error error;
};

int bag_reader_open(struct bag_reader **out, const char *path, struct error *why)
{
    struct bag_reader *r = calloc(1, sizeof *r);
    if (!r)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    int err = bag_file_open(&r->file, path, why);
    if (err) {
        free(r);
        return err;
    }
    r->next = BAG_MAGIC_SIZE;
    r->allowance = bag_file_allowance(&r->file);
    r->crc = bag_crc(0, (struct bytes){(const uint8_t *)BAG_MAGIC, BAG_MAGIC_SIZE});
    *out = r;
    return 0;
}

void bag_reader_close(struct bag_reader *r)
{
    if (!r)
        return;
    bag_file_close(&r->file);
    bytes_free(&r->bytes);
    bytes_free(&r->chunk);
    free(r);
}

static int damaged(const struct bag_reader *r, const char *what, struct error *why)
{
    return error_say(why, -EBADMSG, "%s: byte %" PRIu64 ": %s", r->file.path, r->offset,
                     what);
}

/* The closing magic, and nothing after it. */
static int read_end(struct bag_reader *r, struct error *why)
{
    int err = bag_file_read(&r->file, r->next, BAG_MAGIC_SIZE, &r->bytes, why);
    if (err)
        return err;
    if (memcmp(r->bytes.data, BAG_MAGIC, BAG_MAGIC_SIZE))
        return damaged(r, "no closing magic after the footer", why);
    if (r->next + BAG_MAGIC_SIZE != r->file.size)
        return damaged(r, "something follows the closing magic", why);
    return -ENODATA;
}

/* The summary's checksum covers the footer up to itself. */
static int check_footer(const struct bag_reader *r, const struct bag_footer *f,
                        struct error *why)
{
    struct bytes head = {r->bytes.data, BAG_RECORD_HEAD_SIZE + 16};

    if (f->summary_start && f->summary_start != r->summary_start)
        return damaged(r, "the footer names another beginning of the summary", why);
    if (f->summary_crc && bag_crc(r->crc, head) != f->summary_crc)
        return damaged(r, "the summary does not have its checksum", why);
    return 0;
}

/* Checks the record in its place, and goes on to the section after it. */
static int enter(struct bag_reader *r, const struct bag_record *record, struct error *why)
{
    int err = 0;

    if (!bag_section_allows(r->section, record->opcode))
        return error_say(why, -EBADMSG, "%s: byte %" PRIu64 ": a %s out of its place",
                         r->file.path, r->offset, bag_opcode_name(record->opcode));
    if (record->opcode == BAG_DATA_END && record->data_end.data_section_crc &&
        record->data_end.data_section_crc != r->crc)
        err = damaged(r, "the data section does not have its checksum", why);
    else if (record->opcode == BAG_FOOTER)
        err = check_footer(r, &record->footer, why);
    else if (record->opcode == BAG_ATTACHMENT)
        err = bag_file_attachment(&r->file, r->offset, &record->attachment, why);
    else if (record->opcode == BAG_CHUNK)
        err = bag_file_chunk(&r->file, r->offset, &record->chunk, &r->allowance,
                             &r->chunk, why);
    if (err)
        return err;
    if (record->opcode == BAG_CHUNK)
        r->left = (struct bytes_cursor){.left = bytes_in(&r->chunk)};
    r->crc = bag_crc(r->crc, bytes_in(&r->bytes));
    r->section = bag_section_after(r->section, record->opcode);
    if (record->opcode == BAG_DATA_END) {
        r->summary_start = r->next;
        r->crc = 0;
    }
    return 0;
}

static int read_outer(struct bag_reader *r, struct bag_record *out, struct error *why)
{
    if (r->section == BAG_AT_END)
        return read_end(r, why);
    r->offset = r->next;
    int err = bag_file_record(&r->file, r->offset, &r->bytes, why);
    if (err)
        return err;
    r->next = r->offset + r->bytes.size;
    struct bytes_cursor whole = {.left = bytes_in(&r->bytes)};
    err = bag_record_take(&whole, out);
    if (err == -EBADMSG)
        return damaged(r, "a record's lengths do not fit", why);
    if (err) {
        r->crc = bag_crc(r->crc, bytes_in(&r->bytes));
        return err;
    }
    return enter(r, out, why);
}

static int read_inner(struct bag_reader *r, struct bag_record *out, struct error *why)
{
    int err = bag_record_take(&r->left, out);

    if (err == -EBADMSG)
        return damaged(r, "a record in the chunk does not fit", why);
    if (!err && !bag_chunk_allows(out->opcode))
        return damaged(r, "a chunk holds what no chunk may hold", why);
    return err;
}

int bag_reader_next(struct bag_reader *r, struct bag_record *out, struct error *why)
{
    int err = r->failed;

    while (!err) {
        err = r->left.left.size ? read_inner(r, out, &r->error)
                                : read_outer(r, out, &r->error);
        if (!err && out->opcode != BAG_CHUNK)
            return 0;
        if (err == -ENOTSUP && !r->error.text[0])
            err = 0; /* an opcode that is not known */
    }
    r->failed = err;
    return err == -ENODATA ? err : error_say(why, err, "%s", r->error.text);
}
