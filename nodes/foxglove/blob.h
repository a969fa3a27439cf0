/* nodes/foxglove/blob.h -- bytes that several owners hold: what goes to many clients is
 * there once. */
#ifndef ANLOS_NODES_FOXGLOVE_BLOB_H
#define ANLOS_NODES_FOXGLOVE_BLOB_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

struct blob {
    atomic_size_t owners;
    size_t size;
    uint8_t *data; /* [size] */
};

/* Takes over data, which free() frees, also when it fails.  One owner.  NULL: no memory,
 * or no data. */
struct blob *blob_create(uint8_t *data, size_t size);
struct blob *blob_copy(const void *data, size_t size);

/* Another owner. */
struct blob *blob_hold(struct blob *b);

/* An owner less; the last one frees it.  NULL is fine. */
void blob_release(struct blob *b);

#endif
