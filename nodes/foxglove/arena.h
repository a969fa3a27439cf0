/* nodes/foxglove/arena.h -- memory for the parts of one message, freed at once. */
#ifndef ANLOS_NODES_FOXGLOVE_ARENA_H
#define ANLOS_NODES_FOXGLOVE_ARENA_H

#include <stdbool.h>
#include <stddef.h>

#define ARENA_SPARE 512

struct arena { /* begins zeroed; clear with arena_clear */
    struct arena_block *newest;
    bool failed; /* there was no memory: what was made is not whole, and not to be used */
    _Alignas(max_align_t) unsigned char spare[ARENA_SPARE];
};

/* A part of up to ARENA_SPARE bytes, never NULL: without memory it is the spare one, so
 * that only the end of a conversion needs to look at failed. */
void *arena_one(struct arena *a, size_t size);

/* n zeroed elements.  NULL: no memory. */
void *arena_array(struct arena *a, size_t n, size_t size);

/* A text, of which 255 bytes are kept. */
char *arena_print(struct arena *a, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
void arena_clear(struct arena *a);

#endif
