/* SPDX-License-Identifier: MIT */
/* nodes/rt/log.h -- what a process tells a person: lines with stamp, level and node on a
 * descriptor, each written whole so that lines of several processes do not mix, and to
 * whoever else listens (nodes/rt/log_topic.h).  The same text within 10 s is counted, not
 * written; how often it came is said afterwards.  Any thread may write. */
#ifndef ANLOS_NODES_RT_LOG_H
#define ANLOS_NODES_RT_LOG_H

#include <stdarg.h>

#include "hal/clock.h"
#include "nodes/rt/log_line.h"

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

/* Says which texts were repeated, where it is time to.  To be called now and then. */
void log_tick(struct log *l);

/* The same at once, for all. */
void log_tell_repeats(struct log *l);

/* Says what is left to be said of repeats. */
void log_destroy(struct log *l);

#endif
