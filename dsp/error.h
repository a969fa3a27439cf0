/* SPDX-License-Identifier: MIT */
/* dsp/error.h -- an error as a person reads it: what, where and what to do, e.g.
 * "corner.yaml:14: speaker_count 17 exceeds the 16 channels of hw:UMC1820"; the lists in
 * such a sentence, and what was probably meant by a word that is no name. */
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

#define NEAREST_HINT_SIZE 64

struct nearest {
    const char *best; /* NULL: none is near */
    const char *word; /* [n] */
    size_t n, least;  /* only what takes fewer changes than that is nearer */
};

/* Looks for what is at most `changes` letters put in, left out or changed away from
 * word[n], and no more than half of them: "nope" is no "jobs".  Keeps the pointer. */
struct nearest nearest_begin(const char *word, size_t n, size_t changes);

/* A name that it may be; the first of equally near ones stays. */
void nearest_try(struct nearest *s, const char *name);

/* Of a list as imager_methods(): "; did you mean NAME?", or "" when none is near. */
const char *nearest_hint(char out[NEAREST_HINT_SIZE], const char *word, const char *list);

#endif
