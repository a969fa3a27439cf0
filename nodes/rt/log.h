/* SPDX-License-Identifier: MIT */
/* nodes/rt/log.h -- what a process tells a person: lines with stamp, level and node on a
 * descriptor, each written whole so that lines of several processes do not mix, and to
 * whoever else listens (nodes/rt/log_topic.h).  The same text within 10 s is counted, not
 * written; how often it came is said afterwards.  Any thread may write. */
#ifndef ANLOS_NODES_RT_LOG_H
#define ANLOS_NODES_RT_LOG_H

#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include "hal/clock.h"
#include "msgs/envelope.h"

enum log_level { LOG_LEVEL_DEBUG, LOG_LEVEL_INFO, LOG_LEVEL_WARNING, LOG_LEVEL_ERROR };
enum log_format { LOG_FORMAT_TEXT, LOG_FORMAT_JSON };

enum {
    LOG_TEXT_SIZE = 1001,                    /* with the zero */
    LOG_LINE_SIZE = 6 * LOG_TEXT_SIZE + 256, /* of a line, each character escaped */
    LOG_STAMP_SIZE = 25,
};

/* One line of it.  Written down it is
 *   2026-11-21T20:15:09.123Z recon   warning the text (37 times more in 10 s)
 * (UTC) or a JSON object with stamp, level, node, text, repeats, repeats_s,
 * repeats_ago_s.  A count comes out later than the last of what it counts: from a second
 * on it says how long ago that was. */
struct log_line {
    int64_t stamp_ns; /* Unix time */
    enum log_level level;
    char node[ENVELOPE_NODE_SIZE];
    char text[LOG_TEXT_SIZE];
    uint64_t repeats;     /* the text came so often again since it was written last */
    double repeats_s;     /* over this time */
    double repeats_ago_s; /* and so long ago for the last time */
};

/* NULL past the last of them. */
const char *log_level_name(enum log_level level);
const char *log_format_name(enum log_format format);

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

struct log;

struct log_config {
    int fd;
    enum log_level least; /* lines below it are not written to fd */
    enum log_format format;
    const char *node;
    const struct clock_source *clock; /* of stamps, Unix time */
};

/* 0, -ENOMEM. */
int log_create(struct log **out, const struct log_config *cfg);

/* From now on call gets each line from LOG_LEVEL_INFO on, one at a time, whatever is
 * written to fd, and at each log_tick one without text; NULL: none any more.  It must not
 * write to this log. */
void log_on_line(struct log *l, void (*call)(void *ctx, const struct log_line *line),
                 void *ctx);

/* Text over 1000 characters is cut; line ends inside it become blanks. */
void log_write(struct log *l, enum log_level level, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
void log_vwrite(struct log *l, enum log_level level, const char *format, va_list args)
    __attribute__((format(printf, 3, 0)));

/* Written however short ago the same was: for changes, of which each says what is now. */
void log_vwrite_each(struct log *l, enum log_level level, const char *format,
                     va_list args) __attribute__((format(printf, 3, 0)));

/* How many errors there were, also those that were only counted. */
uint64_t log_errors(struct log *l);

/* Says which texts were repeated, where it is time to.  To be called now and then. */
void log_tick(struct log *l);

/* The same at once, for all. */
void log_tell_repeats(struct log *l);

/* Says what is left to be said of repeats. */
void log_destroy(struct log *l);

#endif
