#include "nodes/foxglove/arena.h"

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define BLOCK_SIZE 4096u
#define TEXT_SIZE  256

struct arena_block {
    struct arena_block *older;
    size_t used, size;
    _Alignas(max_align_t) unsigned char data[];
};

static struct arena_block *add_block(struct arena *a, size_t size)
{
    struct arena_block *b = calloc(1, sizeof *b + size);

    if (!b)
        return NULL;
    b->older = a->newest;
    b->size = size;
    return a->newest = b;
}

void *arena_array(struct arena *a, size_t n, size_t size)
{
    const size_t unit = _Alignof(max_align_t);
    struct arena_block *b = a->newest;
    size_t bytes;

    if (__builtin_mul_overflow(n, size, &bytes) || bytes > SIZE_MAX / 2) {
        a->failed = true;
        return NULL;
    }
    bytes = bytes ? (bytes + unit - 1) / unit * unit : unit;
    if (!b || b->size - b->used < bytes)
        b = add_block(a, bytes > BLOCK_SIZE ? bytes : BLOCK_SIZE);
    if (!b) {
        a->failed = true;
        return NULL;
    }
    b->used += bytes;
    return b->data + (b->used - bytes);
}

void *arena_one(struct arena *a, size_t size)
{
    void *part = arena_array(a, 1, size);

    return part ? part : memset(a->spare, 0, sizeof a->spare);
}

char *arena_print(struct arena *a, const char *format, ...)
{
    char text[TEXT_SIZE];
    va_list args;

    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    char *copy = arena_one(a, strlen(text) + 1);
    return memcpy(copy, text, strlen(text) + 1);
}

void arena_clear(struct arena *a)
{
    while (a->newest) {
        struct arena_block *b = a->newest;
        a->newest = b->older;
        free(b);
    }
    a->failed = false;
}
