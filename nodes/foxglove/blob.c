#include "nodes/foxglove/blob.h"

#include <stdlib.h>
#include <string.h>

struct blob *blob_create(uint8_t *data, size_t size)
{
    struct blob *b = data ? malloc(sizeof *b) : NULL;

    if (!b) {
        free(data);
        return NULL;
    }
    atomic_init(&b->owners, 1);
    b->size = size;
    b->data = data;
    return b;
}

struct blob *blob_copy(const void *data, size_t size)
{
    uint8_t *copy = malloc(size ? size : 1);

    if (copy && size)
        memcpy(copy, data, size);
    return blob_create(copy, size);
}

struct blob *blob_hold(struct blob *b)
{
    atomic_fetch_add(&b->owners, 1);
    return b;
}

void blob_release(struct blob *b)
{
    if (!b || atomic_fetch_sub(&b->owners, 1) > 1)
        return;
    free(b->data);
    free(b);
}
