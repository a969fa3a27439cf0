/* SPDX-License-Identifier: MIT */
/* anlos/error.h -- what went wrong: a code for the program and a sentence for a person,
 * which says what, where and what to do. */
#ifndef ANLOS_ERROR_H
#define ANLOS_ERROR_H

#include <anlos/version.h>

/* Functions return 0 (or what they say) or one of these. */
enum anlos_code {
    ANLOS_OK = 0,
    ANLOS_INVALID = -1, /* an argument: NULL, out of range, NaN, of another shape */
    ANLOS_VERSION_MISMATCH = -2, /* headers and library do not go together */
    ANLOS_NO_MEMORY = -3,
    ANLOS_UNSUPPORTED = -4, /* the method cannot do this survey */
    ANLOS_NOT_READY = -5,   /* something has to come before */
    ANLOS_STALE = -6,       /* older than what is there already */
    ANLOS_NO_THREADS = -7,  /* the system has none left */
    ANLOS_FAILED = -8,      /* anything else */
    ANLOS_CANCELED = -9     /* stop of the configuration said so */
};

/* Is the caller's; it never grows. */
struct anlos_error {
    int code;        /* enum anlos_code */
    char text[1020]; /* empty: nothing is wrong */
};

ANLOS_BEGIN
/* "invalid argument": a code in a few words, for who has no sentence. */
ANLOS_API const char *anlos_code_text(int code);
ANLOS_END

/* In all functions of this library: `why` may be NULL; it is written when something goes
 * wrong, and else left alone. */

#endif
