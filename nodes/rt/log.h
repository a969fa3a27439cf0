/* nodes/rt/log.h -- what a process tells a person: lines "level text" on a descriptor,
 * each written whole so that lines of several processes do not mix. */
#ifndef ANLOS_NODES_RT_LOG_H
#define ANLOS_NODES_RT_LOG_H

#include <stdarg.h>

enum log_level { LOG_LEVEL_DEBUG, LOG_LEVEL_INFO, LOG_LEVEL_WARNING, LOG_LEVEL_ERROR };

struct log {
    int fd;
    enum log_level least; /* lines below it are left out */
};

const char *log_level_name(enum log_level level);

/* 0, or -EINVAL: no such level. */
int log_level_parse(enum log_level *out, const char *name);

/* Text over 1000 characters is cut; line ends inside it become blanks. */
void log_write(const struct log *l, enum log_level level, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
void log_vwrite(const struct log *l, enum log_level level, const char *format,
                va_list args) __attribute__((format(printf, 3, 0)));

#endif
