/* SPDX-License-Identifier: MIT */
#include "dsp/error.h"

#include <stdarg.h>
#include <stdio.h>

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
