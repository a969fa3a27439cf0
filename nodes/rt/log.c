#include "nodes/rt/log.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define LOG_TEXT_SIZE 1001

static const char *const level_names[] = {"debug", "info", "warning", "error"};

const char *log_level_name(enum log_level level)
{
    return level_names[level];
}

int log_level_parse(enum log_level *out, const char *name)
{
    for (int i = LOG_LEVEL_DEBUG; i <= LOG_LEVEL_ERROR; i++) {
        if (!strcmp(name, level_names[i])) {
            *out = (enum log_level)i;
            return 0;
        }
    }
    return -EINVAL;
}

void log_vwrite(const struct log *l, enum log_level level, const char *format,
                va_list args)
{
    char text[LOG_TEXT_SIZE];
    char line[LOG_TEXT_SIZE + 16];

    if (level < l->least)
        return;
    vsnprintf(text, sizeof text, format, args);
    for (char *p = text; *p; p++)
        if (*p == '\n' || *p == '\r')
            *p = ' ';
    int n = snprintf(line, sizeof line, "%s %s\n", level_names[level], text);
    /* Whoever reads the log may be gone; there is nobody left to tell. */
    ssize_t written = write(l->fd, line, (size_t)n);
    (void)written;
}

void log_write(const struct log *l, enum log_level level, const char *format, ...)
{
    va_list args;

    va_start(args, format);
    log_vwrite(l, level, format, args);
    va_end(args);
}
