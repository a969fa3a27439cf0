/* SPDX-License-Identifier: MIT */
/* nodes/rt/log_line.h -- one line of a log, and how it is written down:
 *   2026-11-21T20:15:09.123Z recon   warning the text (37 times more in 10 s)
 * (UTC) or as a JSON object with stamp, level, node, text, repeats, repeats_s,
 * repeats_ago_s.  A count comes out later than the last of what it counts: from a second
 * on it says how long ago that was. */
#ifndef ANLOS_NODES_RT_LOG_LINE_H
#define ANLOS_NODES_RT_LOG_LINE_H

#include <stddef.h>
#include <stdint.h>

#include "msgs/envelope.h"

enum log_level { LOG_LEVEL_DEBUG, LOG_LEVEL_INFO, LOG_LEVEL_WARNING, LOG_LEVEL_ERROR };
enum log_format { LOG_FORMAT_TEXT, LOG_FORMAT_JSON };

enum {
    LOG_TEXT_SIZE = 1001,                    /* with the zero */
    LOG_LINE_SIZE = 6 * LOG_TEXT_SIZE + 256, /* of a line, each character escaped */
    LOG_STAMP_SIZE = 25,
};

struct log_line {
    int64_t stamp_ns; /* Unix time */
    enum log_level level;
    char node[ENVELOPE_NODE_SIZE];
    char text[LOG_TEXT_SIZE];
    uint64_t repeats;     /* the text came so often again since it was written last */
    double repeats_s;     /* over this time */
    double repeats_ago_s; /* and so long ago for the last time */
};

const char *log_level_name(enum log_level level);

/* 0, or -EINVAL: no such level or format. */
int log_level_parse(enum log_level *out, const char *name);
int log_format_parse(enum log_format *out, const char *name);

/* The text with what is said of repeats. */
void log_line_text(const struct log_line *l, char *out, size_t size);

/* The line with its end; returns its length. */
size_t log_line_write(const struct log_line *l, enum log_format format,
                      char out[LOG_LINE_SIZE]);

/* Reads what log_line_write wrote as text; of repeats nothing but the text.  0, or
 * -EINVAL: it is something else. */
int log_line_read(struct log_line *out, const char *line);

/* Makes one printable line of UTF-8 of a text: controls become blanks, bytes that are no
 * UTF-8 question marks. */
void log_text_clean(char *text);

#endif
