/* Blocks, attachments and metadata that share bytes would let a small file stand for an
 * endless one. */
#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>

#include "msgs/bag/catalog_build.h"

struct span {
    uint64_t offset, length;
};

static int compare_spans(const void *a, const void *b)
{
    const struct span *x = a, *y = b;

    return x->offset < y->offset ? -1 : x->offset > y->offset;
}

static size_t list_spans(const struct bag_catalog *c, struct span *out)
{
    size_t n = 0;

    for (size_t i = 0; i < c->n_blocks; i++)
        out[n++] = (struct span){c->blocks[i].offset, c->blocks[i].length};
    for (size_t i = 0; i < c->n_attachments; i++) {
        const struct bag_attachment_index *a = &c->attachments[i].record.attachment_index;
        out[n++] = (struct span){a->offset, a->length};
    }
    for (size_t i = 0; i < c->n_metadata; i++) {
        const struct bag_metadata_index *m = &c->metadata[i].record.metadata_index;
        out[n++] = (struct span){m->offset, m->length};
    }
    qsort(out, n, sizeof *out, compare_spans);
    return n;
}

int bag_catalog_check_spans(const struct bag_catalog *c, struct complaint *why)
{
    size_t room = c->n_blocks + c->n_attachments + c->n_metadata;
    struct span *spans = malloc((room + 1) * sizeof *spans);
    uint64_t end = BAG_MAGIC_SIZE;
    int err = 0;

    if (!spans)
        return -ENOMEM;
    size_t n = list_spans(c, spans);
    for (size_t i = 0; i < n && !err; i++) {
        const struct span *s = &spans[i];
        if (s->offset < end || s->offset > c->file.size ||
            s->length > c->file.size - s->offset)
            err = complain(why, -EBADMSG,
                           "%s: byte %" PRIu64 ": the indexes name two things that "
                           "overlap, or one that reaches beyond the file",
                           c->file.path, s->offset);
        end = s->offset + s->length;
    }
    free(spans);
    return err;
}
