#include "dsp/complaint.h"

#include <stdarg.h>
#include <stdio.h>

int complain(struct complaint *c, int err, const char *format, ...)
{
    if (c) {
        va_list args;
        va_start(args, format);
        vsnprintf(c->text, sizeof c->text, format, args);
        va_end(args);
    }
    return err;
}
