/* SPDX-License-Identifier: MIT */
/* dsp/nearest.h -- which of some names was probably meant by a word that is none. */
#ifndef ANLOS_DSP_NEAREST_H
#define ANLOS_DSP_NEAREST_H

#include <stddef.h>

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
