/* SPDX-License-Identifier: MIT */
/* tests/msgs/memory_limit.h -- an end to the memory that a test may take. */
#ifndef ANLOS_TESTS_MSGS_MEMORY_LIMIT_H
#define ANLOS_TESTS_MSGS_MEMORY_LIMIT_H

#include <stddef.h>
#include <sys/resource.h>

#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define MEMORY_LIMIT_NONE 1
#endif
#endif
#ifdef __SANITIZE_ADDRESS__
#define MEMORY_LIMIT_NONE 1
#endif

/* In bytes, of all addresses; nothing under AddressSanitizer, which takes terabytes.  0,
 * or -1 and errno. */
static inline int memory_limit(size_t bytes)
{
#ifdef MEMORY_LIMIT_NONE
    (void)bytes;
    return 0;
#else
    return setrlimit(RLIMIT_AS, &(struct rlimit){bytes, bytes});
#endif
}

#endif
