/* SPDX-License-Identifier: MIT */
/* tests/optional.h -- tests of what may be absent, in programs of their own: cmocka's
 * exit code tells failures only, and a program of which a test was skipped has not
 * passed. */
#ifndef ANLOS_TESTS_OPTIONAL_H
#define ANLOS_TESTS_OPTIONAL_H

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <unistd.h>

#include <cmocka.h>

static bool optional_skipped;

static inline void optional_skip(const char *why, const char *what)
{
    print_message("skipped: %s%s\n", why, what);
    optional_skipped = true;
    skip();
}

static inline void optional_needs(const char *path)
{
    if (access(path, R_OK))
        optional_skip("there is no ", path);
}

/* Of main, given what cmocka counted: 77 is skipped to ctest. */
static inline int optional_code(int failed)
{
    return failed ? failed : optional_skipped ? 77 : 0;
}

#endif
