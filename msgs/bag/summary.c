/* SPDX-License-Identifier: MIT */
#include "msgs/bag/summary.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#define MANY_BYTES (64 << 10) /* of chunk indexes in memory */

struct group {
    uint8_t opcode;
    const struct bytes_buffer *records;
};

static void list_groups(const struct bag_summary *s, struct group out[BAG_SUMMARY_GROUPS])
{
    out[0] = (struct group){BAG_SCHEMA, &s->schemas};
    out[1] = (struct group){BAG_CHANNEL, &s->channels};
    out[2] = (struct group){BAG_STATISTICS, &s->statistics};
    out[3] = (struct group){BAG_CHUNK_INDEX, &s->chunk_indexes};
    out[4] = (struct group){BAG_ATTACHMENT_INDEX, &s->attachment_indexes};
    out[5] = (struct group){BAG_METADATA_INDEX, &s->metadata_indexes};
}

void bag_summary_free(struct bag_summary *s)
{
    bytes_free(&s->schemas);
    bytes_free(&s->channels);
    bytes_free(&s->statistics);
    bytes_free(&s->chunk_indexes);
    bytes_free(&s->attachment_indexes);
    bytes_free(&s->metadata_indexes);
    if (s->is_open)
        close(s->fd);
    s->is_open = false;
}

static int open_nameless(const char *path)
{
    char name[PATH_MAX];

    if (snprintf(name, sizeof name, "%s.XXXXXX", path) >= (int)sizeof name)
        return -1;
    int fd = mkostemp(name, O_CLOEXEC);
    if (fd >= 0)
        unlink(name);
    return fd;
}

void bag_summary_lay_down(struct bag_summary *s, const char *path)
{
    struct bytes left = bytes_in(&s->chunk_indexes);
    uint64_t at = s->n_laid_down;

    if (left.size < MANY_BYTES || s->no_room || s->chunk_indexes.failed)
        return;
    if (!s->is_open) {
        s->fd = open_nameless(path);
        s->is_open = s->fd >= 0;
    }
    while (s->is_open && left.size) {
        ssize_t n = pwrite(s->fd, left.data, left.size, (off_t)at);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            break;
        left.data += n;
        left.size -= (size_t)n;
        at += (uint64_t)n;
    }
    s->no_room = left.size > 0;
    if (s->no_room)
        return;
    s->n_laid_down = at;
    s->chunk_indexes.size = 0;
}

/* Appends what was laid down. */
static int take_up(struct bytes_buffer *out, const struct bag_summary *s)
{
    uint64_t at = 0;

    if (bytes_reserve(out, out->size + s->n_laid_down))
        return 0;
    while (at < s->n_laid_down) {
        ssize_t n = pread(s->fd, out->data + out->size, s->n_laid_down - at, (off_t)at);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return n ? -errno : -EIO;
        out->size += (size_t)n;
        at += (uint64_t)n;
    }
    return 0;
}

uint64_t bag_summary_size(const struct bag_summary *s)
{
    struct group groups[BAG_SUMMARY_GROUPS];
    uint64_t size = 64 + BAG_MAGIC_SIZE + s->n_laid_down; /* end of data, footer */

    list_groups(s, groups);
    for (size_t i = 0; i < BAG_SUMMARY_GROUPS; i++)
        size += groups[i].records->size + 32; /* and its offset */
    return size;
}

static void put_data_end(struct bytes_buffer *out, uint32_t data_crc)
{
    struct bag_record end = {.opcode = BAG_DATA_END};

    end.data_end.data_section_crc = data_crc;
    bag_record_put(out, &end);
}

/* The checksum covers all of the footer before it. */
static void put_footer(struct bytes_buffer *out, size_t summary, uint64_t summary_start,
                       uint64_t offset_start)
{
    struct bag_record footer = {.opcode = BAG_FOOTER};

    footer.footer.summary_start = summary_start;
    footer.footer.summary_offset_start = offset_start;
    bag_record_put(out, &footer);
    if (out->failed)
        return;
    size_t at = out->size - 4;
    bytes_set_number(out, at,
                     bag_crc(0, (struct bytes){out->data + summary, at - summary}), 4);
}

int bag_summary_put(struct bytes_buffer *out, const struct bag_summary *s,
                    bool with_offsets, uint64_t start, uint32_t data_crc)
{
    struct group groups[BAG_SUMMARY_GROUPS];
    uint64_t lengths[BAG_SUMMARY_GROUPS];
    int err = 0;
    size_t begin = out->size;
    uint64_t offset_start = 0;

    list_groups(s, groups);
    put_data_end(out, data_crc);
    size_t summary = out->size, at = summary;
    for (size_t i = 0; i < BAG_SUMMARY_GROUPS && !err; i++) {
        size_t before = out->size;
        if (groups[i].opcode == BAG_CHUNK_INDEX)
            err = take_up(out, s);
        bytes_put(out, bytes_in(groups[i].records));
        out->failed |= groups[i].records->failed;
        lengths[i] = out->size - before;
    }
    if (err)
        return err;
    bool empty = out->size == summary;
    if (with_offsets && !empty)
        offset_start = start + (out->size - begin);
    for (size_t i = 0; with_offsets && i < BAG_SUMMARY_GROUPS; i++) {
        struct bag_record r = {.opcode = BAG_SUMMARY_OFFSET};
        r.summary_offset.group_opcode = groups[i].opcode;
        r.summary_offset.group_start = start + (at - begin);
        r.summary_offset.group_length = lengths[i];
        at += lengths[i];
        if (lengths[i])
            bag_record_put(out, &r);
    }
    put_footer(out, summary, empty ? 0 : start + (summary - begin), offset_start);
    bytes_put(out, (struct bytes){(const uint8_t *)BAG_MAGIC, BAG_MAGIC_SIZE});
    return 0;
}
