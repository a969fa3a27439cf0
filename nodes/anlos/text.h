/* SPDX-License-Identifier: MIT */
/* nodes/anlos/text.h -- numbers and foreign text in the room of a table's cell. */
#ifndef ANLOS_NODES_ANLOS_TEXT_H
#define ANLOS_NODES_ANLOS_TEXT_H

#include <stddef.h>
#include <stdint.h>

#include "nodes/anlos/collector.h"

#define TEXT_CELL_SIZE 512

/* Code points of UTF-8; each is taken for one column wide. */
size_t text_columns(const char *s);

/* Cuts s after so many columns. */
void text_cut(char *s, size_t columns);

/* Bytes of s that go into a line of so many columns, 1 or more: to its end, else to the
 * last blank that is followed by a word, else in the middle of one.  Blanks at its end
 * count. */
size_t text_line(const char *s, size_t columns);

/* What a process says, made fit for a terminal: control characters become blanks, what is
 * not UTF-8 becomes '?'. */
void text_clean(char *out, size_t size, const char *in);

/* Counts and bytes in five columns: "99999", "120k", "4.5M". */
void text_count(char *out, size_t size, uint64_t n);
void text_bytes(char *out, size_t size, double bytes);   /* NAN: "-" */
void text_percent(char *out, size_t size, double share); /* NAN: "-" */

/* "16.0/16", "0.3/-" when none is expected, "-/16" when it is not known. */
void text_rate(char *out, size_t size, double hz, double expected_hz);

/* Milliseconds, median and 99th percentile: "62/71"; "-" when there is none. */
void text_latency(char *out, size_t size, const struct table_latency *l);
void text_duration(char *out, size_t size, double s); /* "42s", "5m12s", "3h05m" */

#endif
