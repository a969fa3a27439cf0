/* SPDX-License-Identifier: MIT */
/* dsp/list.h -- arrays that become longer one by one. */
#ifndef ANLOS_DSP_LIST_H
#define ANLOS_DSP_LIST_H

#include <stddef.h>

/* Room for one more behind n elements of so many bytes.  list: the address of the pointer
 * to the first of *room, which realloc moves when there is none; NULL and 0 at first.
 * Doubles, so that n of them take n steps.  0, -ENOMEM: all is as it was. */
int list_grow(void *list, size_t n, size_t *room, size_t element_size);

#endif
