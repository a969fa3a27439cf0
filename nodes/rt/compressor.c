#include "nodes/rt/compressor.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

struct compressor {
    struct pulse_compress *matched; /* one of the two */
    struct deramp *deramp;
};

static const char *const windows[] = {[WINDOW_RECTANGULAR] = "rectangular",
                                      [WINDOW_HANN] = "hann",
                                      [WINDOW_HAMMING] = "hamming"};
static const char *const compressions[] = {
    [COMPRESSION_MATCHED_FILTER] = "matched_filter", [COMPRESSION_DERAMP] = "deramp"};

int window_from_name(const char *name, enum window *out)
{
    for (unsigned i = 0; i < sizeof windows / sizeof *windows; i++) {
        if (strcmp(windows[i], name) != 0)
            continue;
        *out = (enum window)i;
        return 0;
    }
    return -EINVAL;
}

int compression_from_name(const char *name, enum compression *out)
{
    for (unsigned i = 0; i < sizeof compressions / sizeof *compressions; i++) {
        if (strcmp(compressions[i], name) != 0)
            continue;
        *out = (enum compression)i;
        return 0;
    }
    return -EINVAL;
}

const char *window_name(enum window window)
{
    return windows[window];
}

const char *compression_name(enum compression compression)
{
    return compressions[compression];
}

int compressor_create(struct compressor **out, const struct processing *p,
                      const struct survey *s, enum compression compression,
                      enum window window, struct complaint *why)
{
    struct compressor *c = calloc(1, sizeof *c);
    int err;

    if (!c)
        return complain(why, -ENOMEM, "out of memory");
    if (compression == COMPRESSION_DERAMP)
        err = processing_deramp(&c->deramp, p, s, window, why);
    else
        err = processing_compressor(&c->matched, p, s, window, why);
    if (err) {
        free(c);
        return err;
    }
    *out = c;
    return 0;
}

void compressor_format(const struct compressor *c, struct trace_format *out)
{
    if (c->deramp)
        deramp_format(c->deramp, out);
    else
        pulse_compress_format(c->matched, out);
}

void compressor_execute(struct compressor *c, const float *rx, size_t rx_stride,
                        float complex *restrict y)
{
    if (c->deramp)
        deramp_execute(c->deramp, rx, rx_stride, y);
    else
        pulse_compress_execute(c->matched, rx, rx_stride, y);
}

void compressor_destroy(struct compressor *c)
{
    if (!c)
        return;
    if (c->deramp)
        deramp_destroy(c->deramp);
    if (c->matched)
        pulse_compress_destroy(c->matched);
    free(c);
}
