/* SPDX-License-Identifier: MIT */
/* nodes/rt/json_whole.h -- JSON is built by many calls, of which one may fail for want of
 * memory: then a key is missing, which no one who reads it can tell.  Instead of asking
 * after each call, who writes a text asks once whether there was always memory. */
#ifndef ANLOS_NODES_RT_JSON_WHOLE_H
#define ANLOS_NODES_RT_JSON_WHOLE_H

#include <jansson.h>
#include <stdbool.h>

/* Is it one (not NULL), and did every call of jansson's for memory succeed in this thread
 * since this was asked last?  After one that was given up without asking the next one may
 * be called not whole, too. */
bool json_whole(const json_t *value);

#endif
