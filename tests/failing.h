/* SPDX-License-Identifier: MIT */
/* tests/failing.h -- fault injection: of all calls of a piece of work for memory and to
 * the system one fails, the first, then in another run the second, and so on, until a run
 * is over before its turn comes.  Each run ends with an error and a sentence, or with
 * what it was to make; it leaves no memory and no descriptor behind.
 *
 * The linker puts these in the place of the real ones (--wrap), for what is linked into
 * the test.  What libraries take of malloc on our behalf fails as well (the C library's,
 * protobuf-c, libyaml, zstd, lz4 ...), but with AddressSanitizer, whose it is then; not
 * that of nanomsg and ZeroMQ, which end the process when there is none. */
#ifndef ANLOS_TESTS_FAILING_H
#define ANLOS_TESTS_FAILING_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"

struct failing_work {
    const char *name;
    /* 0, or a negative errno and a sentence. */
    int (*run)(void *context, struct error *why);
    /* Then, with nothing failing: is what was made as it is to be, which is so if err is
     * 0?  Puts things back as they were; may be NULL. */
    void (*check)(void *context, int err);
    void *context;
    bool wordless; /* its errors are numbers: -ENOMEM alone */
};

/* Fails the test if a run does not end so, or one before them in which nothing fails.
 * Returns how many calls there were. */
size_t failing_each(const struct failing_work *work);

#endif
