/* SPDX-License-Identifier: MIT */
#include "recon/frontend/compressor.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/window.h"

struct compressor {
    struct pulse_compress *matched[2]; /* up, down; these or those */
    struct deramp *deramp[2];
    size_t n_channels, n_samples, head, tail; /* of a ping, and what is tapered of it */
    float *tapered;                           /* [n_channels][n_samples]; NULL: nothing */
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
    return window < sizeof windows / sizeof *windows ? windows[window] : NULL;
}

const char *compression_name(enum compression compression)
{
    return compression < sizeof compressions / sizeof *compressions
               ? compressions[compression]
               : NULL;
}

/* Nothing of what the gate holds: from its near end to where the chirp from its far end
 * is over. */
static int plan_taper(struct compressor *c, const struct processing *p,
                      const struct survey *s)
{
    double rate_hz = s->sample_rate_hz;
    double first = s->latency_samples + p->gate_s[0] * rate_hz;
    double last = s->latency_samples + (p->gate_s[1] + s->chirp_duration_s) * rate_hz;

    c->n_channels = s->n_microphones;
    c->n_samples = p->ping_samples;
    c->head = first < (double)p->ping_samples ? (size_t)first : 0;
    c->tail = last < (double)p->ping_samples ? (size_t)((double)p->ping_samples - last)
                                             : 0;
    c->tapered = calloc(c->n_channels * c->n_samples, sizeof *c->tapered);
    return c->tapered ? 0 : -ENOMEM;
}

int compressor_create(struct compressor **out, const struct processing *p,
                      const struct survey *s, enum compression compression,
                      enum window window, struct error *why)
{
    struct compressor *c = calloc(1, sizeof *c);
    struct survey turned = *s; /* borrows */
    int err = 0;

    if (!c)
        return error_say(why, -ENOMEM, "out of memory");
    for (int down = 0; !err && down <= s->chirp_alternates; down++) {
        turned.chirp_start_hz = down ? s->chirp_stop_hz : s->chirp_start_hz;
        turned.chirp_stop_hz = down ? s->chirp_start_hz : s->chirp_stop_hz;
        if (compression == COMPRESSION_DERAMP)
            err = processing_deramp(&c->deramp[down], p, &turned, window, why);
        else
            err = processing_compressor(&c->matched[down], p, &turned, window, why);
    }
    if (!err && survey_overlaps(s) && plan_taper(c, p, s))
        err = error_say(why, -ENOMEM, "out of memory");
    if (err)
        compressor_destroy(c);
    else
        *out = c;
    return err;
}

void compressor_format(const struct compressor *c, struct trace_format *out)
{
    if (c->deramp[0])
        deramp_format(c->deramp[0], out);
    else
        pulse_compress_format(c->matched[0], out);
}

int compressor_format_of(struct trace_format *out, const struct processing *p,
                         const struct survey *s, enum compression compression,
                         struct error *why)
{
    return compression == COMPRESSION_DERAMP
               ? processing_deramp_format(out, p, s, why)
               : processing_compressor_format(out, p, s, why);
}

void compressor_whole(const struct compressor *c, struct trace_format *out, size_t *first)
{
    *first = 0;
    if (c->deramp[0])
        deramp_format(c->deramp[0], out);
    else
        pulse_compress_whole(c->matched[0], out, first);
}

void compressor_execute(struct compressor *c, bool down, const float *rx,
                        size_t rx_stride, float complex *restrict y)
{
    for (size_t i = 0; c->tapered && i < c->n_channels; i++)
        taper_ends(rx + i * rx_stride, c->n_samples, c->head, c->tail,
                   c->tapered + i * c->n_samples);
    if (c->tapered) {
        rx = c->tapered;
        rx_stride = c->n_samples;
    }
    if (c->deramp[0])
        deramp_execute(c->deramp[down], rx, rx_stride, y);
    else
        pulse_compress_execute(c->matched[down], rx, rx_stride, y);
}

void compressor_destroy(struct compressor *c)
{
    if (!c)
        return;
    for (int down = 0; down < 2; down++) {
        if (c->deramp[down])
            deramp_destroy(c->deramp[down]);
        if (c->matched[down])
            pulse_compress_destroy(c->matched[down]);
    }
    free(c->tapered);
    free(c);
}
