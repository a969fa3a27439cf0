/* SPDX-License-Identifier: MIT */
/* nodes/rt/choice.h -- an option whose value is one of some names: what the parser takes,
 * what an error says is expected, and what the completion of a shell offers
 * (--help=OPTION) come from the one function that has them. */
#ifndef ANLOS_NODES_RT_CHOICE_H
#define ANLOS_NODES_RT_CHOICE_H

#include <stddef.h>
#include <stdio.h>

/* The i-th of them; NULL after the last. */
typedef const char *choice_names(size_t i);

/* Where it stands among them; their number: nowhere. */
size_t choice_index(choice_names *names, const char *name);

/* "zstd, lz4 or none", cut where there is no more room. */
void choice_list(choice_names *names, char *text, size_t size);

/* Each on a line. */
void choice_print(choice_names *names, FILE *to);

#endif
