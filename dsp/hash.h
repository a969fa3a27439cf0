/* SPDX-License-Identifier: MIT */
/* dsp/hash.h -- FNV-1a of 64 bits (Fowler, Noll and Vo): the same bytes give the same
 * number on every machine.  It tells what is another from what is the same, and keeps
 * nobody out. */
#ifndef ANLOS_DSP_HASH_H
#define ANLOS_DSP_HASH_H

#include <stddef.h>
#include <stdint.h>

#define HASH_BEGIN UINT64_C(0xcbf29ce484222325)

/* h: HASH_BEGIN, or what came of the bytes before. */
static inline uint64_t hash_add(uint64_t h, const void *data, size_t n)
{
    const uint8_t *bytes = data;
    for (size_t i = 0; i < n; i++)
        h = (h ^ bytes[i]) * UINT64_C(0x100000001b3);
    return h;
}

#endif
