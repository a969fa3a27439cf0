/* SPDX-License-Identifier: MIT */
#include "dsp/error.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

int error_say(struct error *e, int err, const char *format, ...)
{
    if (e) {
        va_list args;
        va_start(args, format);
        vsnprintf(e->text, sizeof e->text, format, args);
        va_end(args);
    }
    return err;
}

void text_add(char *text, size_t size, const char *separator, const char *format, ...)
{
    size_t used = strlen(text);
    va_list args;

    used += (size_t)snprintf(text + used, size - used, "%s", used ? separator : "");
    va_start(args, format);
    if (used < size)
        vsnprintf(text + used, size - used, format, args);
    va_end(args);
}
