/* SPDX-License-Identifier: MIT */
#include "msgs/bag/bytes.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

struct bytes bytes_of(const char *text)
{
    return (struct bytes){(const uint8_t *)text, strlen(text)};
}

bool bytes_equal(struct bytes a, struct bytes b)
{
    return a.size == b.size && (!a.size || !memcmp(a.data, b.data, a.size));
}

/* To *capacity bytes, of which it makes whole pages.  NULL: no memory, b is as before. */
static uint8_t *grow_pages(const struct bytes_buffer *b, size_t *capacity)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);

    *capacity += (page - *capacity % page) % page;
    void *data = b->data ? mremap(b->data, b->capacity, *capacity, MREMAP_MAYMOVE)
                         : mmap(NULL, *capacity, PROT_READ | PROT_WRITE,
                                MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    return data == MAP_FAILED ? NULL : data;
}

int bytes_reserve(struct bytes_buffer *b, size_t capacity)
{
    if (b->failed || capacity <= b->capacity)
        return b->failed ? -ENOMEM : 0;
    size_t grown = b->capacity + b->capacity / 2;
    size_t wanted = capacity > grown ? capacity : grown;
    uint8_t *data = b->pages ? grow_pages(b, &wanted) : realloc(b->data, wanted);
    if (!data) {
        b->failed = true;
        return -ENOMEM;
    }
    b->data = data;
    b->capacity = wanted;
    return 0;
}

void bytes_put(struct bytes_buffer *b, struct bytes what)
{
    if (!what.size || bytes_reserve(b, b->size + what.size))
        return;
    memcpy(b->data + b->size, what.data, what.size);
    b->size += what.size;
}

static void write_number(uint8_t *to, uint64_t value, size_t n_bytes)
{
    for (size_t i = 0; i < n_bytes && i < sizeof value; i++)
        to[i] = (uint8_t)(value >> 8 * i);
}

void bytes_put_number(struct bytes_buffer *b, uint64_t value, size_t n_bytes)
{
    uint8_t raw[8];

    write_number(raw, value, n_bytes);
    bytes_put(b, (struct bytes){raw, n_bytes});
}

void bytes_put_sized(struct bytes_buffer *b, struct bytes what, size_t n_bytes)
{
    bytes_put_number(b, what.size, n_bytes);
    bytes_put(b, what);
}

void bytes_set_number(struct bytes_buffer *b, size_t offset, uint64_t value,
                      size_t n_bytes)
{
    if (!b->failed)
        write_number(b->data + offset, value, n_bytes);
}

struct bytes bytes_in(const struct bytes_buffer *b)
{
    return (struct bytes){b->data, b->size};
}

void bytes_free(struct bytes_buffer *b)
{
    if (!b->pages)
        free(b->data);
    else if (b->data)
        munmap(b->data, b->capacity);
    *b = (struct bytes_buffer){.pages = b->pages};
}

struct bytes bytes_take(struct bytes_cursor *c, uint64_t n)
{
    struct bytes taken = {c->left.data, 0};

    if (c->failed || n > c->left.size) {
        c->failed = true;
        return taken;
    }
    taken.size = (size_t)n;
    if (n)
        c->left.data += n;
    c->left.size -= (size_t)n;
    return taken;
}

uint64_t bytes_number(struct bytes_cursor *c, size_t n_bytes)
{
    struct bytes raw = bytes_take(c, n_bytes);
    uint64_t value = 0;

    for (size_t i = 0; i < raw.size; i++)
        value |= (uint64_t)raw.data[i] << 8 * i;
    return value;
}

struct bytes bytes_take_sized(struct bytes_cursor *c, size_t n_bytes)
{
    return bytes_take(c, bytes_number(c, n_bytes));
}
