/* SPDX-License-Identifier: MIT */
/* msgs/bag/bytes.h -- little-endian bytes: a buffer that grows as it is written, and a
 * cursor that never reads past its end. */
#ifndef ANLOS_MSGS_BAG_BYTES_H
#define ANLOS_MSGS_BAG_BYTES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct bytes { /* borrowed; as text it has no zero at its end */
    const uint8_t *data;
    size_t size;
};

struct bytes bytes_of(const char *text);
bool bytes_equal(struct bytes a, struct bytes b);

/* Starts as {0}, or {.pages = true}: of the system's pages, not the heap's.  That is for
 * what is large, and comes and goes in a process that runs for hours: in the heap it
 * leaves holes, and glibc keeps twice the largest that was freed (nodes/rt/process.h).  A
 * put that finds no memory sets failed, and all after it do nothing. */
struct bytes_buffer {
    uint8_t *data;
    size_t size, capacity;
    bool failed;
    bool pages;
};

void bytes_put(struct bytes_buffer *b, struct bytes what);
void bytes_put_number(struct bytes_buffer *b, uint64_t value, size_t n_bytes);
void bytes_put_sized(struct bytes_buffer *b, struct bytes what, size_t n_bytes);

/* Overwrites n_bytes at an offset that was written before. */
void bytes_set_number(struct bytes_buffer *b, size_t offset, uint64_t value,
                      size_t n_bytes);

/* 0, -ENOMEM. */
int bytes_reserve(struct bytes_buffer *b, size_t capacity);
struct bytes bytes_in(const struct bytes_buffer *b);
void bytes_free(struct bytes_buffer *b);

/* What is left to read.  A read beyond the end sets failed and gives zeros. */
struct bytes_cursor {
    struct bytes left;
    bool failed;
};

uint64_t bytes_number(struct bytes_cursor *c, size_t n_bytes);
struct bytes bytes_take(struct bytes_cursor *c, uint64_t n);

/* A length of n_bytes, then as many bytes. */
struct bytes bytes_take_sized(struct bytes_cursor *c, size_t n_bytes);

#endif
