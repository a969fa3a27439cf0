#include "msgs/bag/check.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/bag/check_state.h"

void check_fault_at(struct bag_check *c, uint64_t offset, const char *what)
{
    c->n_faults++;
    if (c->watch && c->watch->fault)
        c->watch->fault(c->watch->context, offset, what);
}

void check_fault(struct bag_check *c, const char *format, ...)
{
    char text[256];
    va_list args;

    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    check_fault_at(c, c->offset, text);
}

/* "FILE: byte N: what" as a fault. */
static void fault_of(struct bag_check *c, const struct complaint *why)
{
    const char *at = strstr(why->text, ": byte ");
    const char *what = at ? strchr(at + 2, ':') : NULL;

    check_fault(c, "%s", what ? what + 2 : why->text);
}

int check_definition(struct bag_check *c, const struct bag_record *r)
{
    const struct bag_catalog *f = c->found;
    bool schema = r->opcode == BAG_SCHEMA;
    uint16_t id = schema ? r->schema.id : r->channel.id;
    uint32_t at = schema ? f->schema_at[id] : f->channel_at[id];
    struct bytes_buffer bytes = {0};

    if (!schema && r->channel.schema_id && !f->schema_at[r->channel.schema_id])
        check_fault(c, "channel %u has the schema %u, which is not defined before", id,
                    r->channel.schema_id);
    if (!at)
        return bag_catalog_define(c->found, r);
    const struct bag_kept *before = schema ? &f->schemas[at - 1] : &f->channels[at - 1];
    bag_record_put(&bytes, r);
    int err = bytes.failed ? -ENOMEM : 0;
    if (!err && !bytes_equal(bytes_in(&bytes), bytes_in(&before->copy)))
        check_fault(c, "%s %u is not what it was before", bag_opcode_name(r->opcode), id);
    bytes_free(&bytes);
    return err;
}

void check_message(struct bag_check *c, const struct bag_message *m)
{
    struct bag_catalog *f = c->found;

    if (!f->channel_at[m->channel_id])
        check_fault(c, "a message of channel %u, which is not defined before",
                    m->channel_id);
    bag_catalog_count(f, m);
}

static int take_chunk(struct bag_check *c, const struct bag_chunk *k)
{
    struct complaint why = {""};
    int err =
        bag_file_chunk(&c->found->file, c->offset, k, &c->allowance, &c->plain, &why);

    if (err == -ENOMEM)
        return err;
    c->chunk.unread = err != 0;
    if (err) { /* its messages cannot be told; its index still can */
        fault_of(c, &why);
        c->plain.size = 0;
    }
    return check_chunk_begin(c, k);
}

static int take_data(struct bag_check *c, const struct bag_record *r)
{
    struct bag_catalog *f = c->found;
    struct complaint why = {""};
    uint64_t length = c->next - c->offset;

    switch (r->opcode) {
    case BAG_SCHEMA:
    case BAG_CHANNEL:
        return check_definition(c, r);
    case BAG_MESSAGE:
        check_message(c, &r->message);
        return 0;
    case BAG_CHUNK:
        return take_chunk(c, &r->chunk);
    case BAG_MESSAGE_INDEX:
        return check_message_index(c, &r->message_index);
    case BAG_ATTACHMENT:
        if (bag_file_attachment(&f->file, c->offset, &r->attachment, &why))
            fault_of(c, &why);
        return bag_catalog_add_attachment(f, c->offset, length, &r->attachment);
    case BAG_METADATA:
        return bag_catalog_add_metadata(f, c->offset, length, &r->metadata);
    case BAG_DATA_END:
        if (r->data_end.data_section_crc && r->data_end.data_section_crc != c->crc)
            check_fault(c, "the data section does not have its checksum");
        return 0;
    default:
        return 0;
    }
}

static int take_record(struct bag_check *c, const struct bag_record *r)
{
    int err = 0;

    if (!bag_section_allows(c->section, r->opcode))
        check_fault(c, "a %s out of its place", bag_opcode_name(r->opcode));
    else if (r->opcode == BAG_FOOTER)
        check_footer(c, &r->footer);
    else if (c->section == BAG_IN_SUMMARY)
        err = check_summary_record(c, r);
    else
        err = take_data(c, r);
    c->crc = bag_crc(c->crc, bytes_in(&c->bytes));
    c->section = bag_section_after(c->section, r->opcode);
    if (r->opcode == BAG_DATA_END) {
        c->summary_start = c->next;
        c->crc = 0;
    }
    return err;
}

/* -ENODATA: nothing after it can be found. */
static int next_record(struct bag_check *c)
{
    struct complaint why = {""};
    struct bag_record r;

    c->offset = c->next;
    int err = bag_file_record(&c->found->file, c->offset, &c->bytes, &why);
    if (err == -EBADMSG || err == -EFBIG) {
        fault_of(c, &why);
        return -ENODATA;
    }
    if (err)
        return err;
    c->next = c->offset + c->bytes.size;
    struct bytes_cursor whole = {.left = bytes_in(&c->bytes)};
    err = bag_record_take(&whole, &r);
    if (!err && r.opcode != BAG_MESSAGE_INDEX)
        err = check_chunk_end(c);
    if (!err)
        return take_record(c, &r);
    c->crc = bag_crc(c->crc, bytes_in(&c->bytes));
    if (err == -EBADMSG)
        check_fault(c, "a record's lengths do not fit");
    return err == -ENOMEM ? err : 0;
}

static int check_end(struct bag_check *c)
{
    c->offset = c->next;
    int err = bag_file_read(&c->found->file, c->next, BAG_MAGIC_SIZE, &c->bytes, NULL);
    if (err && err != -EBADMSG) /* it is not known what is there */
        return err;
    if (err || memcmp(c->bytes.data, BAG_MAGIC, BAG_MAGIC_SIZE))
        check_fault(c, "no closing magic after the footer");
    else if (c->next + BAG_MAGIC_SIZE != c->found->file.size)
        check_fault(c, "something follows the closing magic");
    return 0;
}

static int walk(struct bag_check *c, struct complaint *why)
{
    int err = 0;

    c->next = BAG_MAGIC_SIZE;
    c->allowance = bag_file_allowance(&c->found->file);
    c->crc = bag_crc(0, (struct bytes){(const uint8_t *)BAG_MAGIC, BAG_MAGIC_SIZE});
    while (!err && c->section != BAG_AT_END) {
        if (c->watch && c->watch->stop && c->watch->stop())
            return complain(why, -EINTR, "interrupted");
        err = next_record(c);
    }
    if (!err)
        err = check_end(c);
    if (err && err != -ENODATA)
        return complain(why, err, "%s: %s", c->found->file.path, strerror(-err));
    return 0;
}

static void clear(struct bag_check *c)
{
    bag_catalog_close(c->found);
    bytes_free(&c->bytes);
    bytes_free(&c->plain);
    bytes_free(&c->chunk.offsets);
    bytes_free(&c->statistics.copy);
    free(c->chunk.entries);
    for (size_t i = 0; i < c->n_offsets; i++)
        bytes_free(&c->offsets[i].copy);
    free(c->offsets);
    for (size_t i = 0; i < sizeof c->seen / sizeof *c->seen; i++)
        free(c->seen[i]);
}

int bag_check(uint64_t *n_faults, const char *path, const struct bag_check_watch *watch,
              struct complaint *why)
{
    struct bag_check c = {.watch = watch, .found = calloc(1, sizeof *c.found)};

    if (!c.found)
        return complain(why, -ENOMEM, "%s: out of memory", path);
    c.found->file.fd = -1;
    int err = bag_file_open(&c.found->file, path, why);
    if (!err)
        err = walk(&c, why);
    *n_faults = c.n_faults;
    clear(&c);
    return err;
}
