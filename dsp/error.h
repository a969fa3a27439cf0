/* SPDX-License-Identifier: MIT */
/* dsp/error.h -- an error as a person reads it: what, where and what to do, e.g.
 * "corner.yaml:14: speaker_count 17 exceeds the 16 channels of hw:UMC1820"; and the lists
 * in such a sentence. */
#ifndef ANLOS_DSP_ERROR_H
#define ANLOS_DSP_ERROR_H

#include <stddef.h>

struct error {
    char text[1024]; /* empty: nothing is wrong */
};

/* Writes the text (e may be NULL) and returns err, a negative errno, so that a failing
 * function can `return error_say(why, -EINVAL, "...", ...)`. */
int error_say(struct error *e, int err, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Puts one more behind those in text[size], a string, with a separator between them; what
 * there is no room for is cut. */
void text_add(char *text, size_t size, const char *separator, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

#endif
