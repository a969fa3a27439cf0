/* SPDX-License-Identifier: MIT */
#include "recon/frontend/mean_background.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/trace_mean.h"

struct mean_background {
    size_t n_speakers, n_microphones, n_samples;
    double time_constant_s;
    struct trace_mean *mean;
    int64_t *newest_ns; /* [n_speakers] */
    bool is_empty;
    struct { /* the newest, which do not count yet */
        bool any;
        size_t speaker;
        int64_t capture_ns;
        bool *masked;          /* [n_microphones] */
        float complex *traces; /* [n_microphones][n_samples] */
    } waiting;
    uint32_t scan, frame; /* that are recorded, the newest */
};

int mean_background_create(struct mean_background **out, size_t n_speakers,
                           size_t n_microphones, size_t n_samples, double time_constant_s)
{
    struct mean_background *b = calloc(1, sizeof *b);
    int err;

    if (!b)
        return -ENOMEM;
    *b = (struct mean_background){.n_speakers = n_speakers,
                                  .n_microphones = n_microphones,
                                  .n_samples = n_samples,
                                  .time_constant_s = time_constant_s,
                                  .is_empty = true};
    err = trace_mean_create(&b->mean, n_speakers, n_microphones, n_samples);
    b->newest_ns = calloc(n_speakers, sizeof *b->newest_ns);
    if (!err) {
        b->waiting.masked = calloc(n_microphones, sizeof *b->waiting.masked);
        b->waiting.traces = calloc(n_microphones * n_samples, sizeof(float complex));
    }
    if (!err && (!b->newest_ns || !b->waiting.masked || !b->waiting.traces))
        err = -ENOMEM;
    if (err)
        mean_background_destroy(b);
    else
        *out = b;
    return err;
}

void mean_background_reset(struct mean_background *b)
{
    if (!b->is_empty)
        trace_mean_reset(b->mean);
    memset(b->newest_ns, 0, b->n_speakers * sizeof *b->newest_ns);
    b->is_empty = true;
    b->waiting.any = false;
}

void mean_background_drop(struct mean_background *b)
{
    b->waiting.any = false;
}

void mean_background_excise(struct mean_background *b, const uint8_t *foreign)
{
    const float complex *mean = trace_mean_of(b->mean, b->waiting.speaker);

    for (size_t k = 0; b->waiting.any && k < b->n_microphones * b->n_samples; k++)
        if (foreign[k])
            b->waiting.traces[k] = mean[k];
}

const float complex *mean_background_record(struct mean_background *b,
                                            const struct ping *ping,
                                            float complex *traces)
{
    if (ping->scan != b->scan || ping->frame < b->frame)
        mean_background_reset(b);
    b->scan = ping->scan;
    b->frame = ping->frame;
    b->is_empty = false;
    for (size_t m = 0; m < b->n_microphones; m++)
        trace_mean_take(b->mean, ping->speaker, m, 0.0, 0, traces + m * b->n_samples);
    return trace_mean_of(b->mean, ping->speaker);
}

const float complex *mean_background_of(const struct mean_background *b, size_t speaker)
{
    return b->newest_ns[speaker] ? trace_mean_of(b->mean, speaker) : NULL;
}

static void count_waiting(struct mean_background *b)
{
    size_t speaker = b->waiting.speaker;
    double since_s = 1e-9 * (double)(b->waiting.capture_ns - b->newest_ns[speaker]);
    double share = since_s > 0.0 ? -expm1(-since_s / b->time_constant_s) : 0.0;

    if (!b->waiting.any)
        return;
    b->waiting.any = false;
    b->newest_ns[speaker] = b->waiting.capture_ns;
    for (size_t m = 0; m < b->n_microphones; m++)
        if (!b->waiting.masked[m])
            trace_mean_take(b->mean, speaker, m, share, UINT32_MAX,
                            b->waiting.traces + m * b->n_samples);
}

bool mean_background_subtract(struct mean_background *b, size_t speaker,
                              int64_t capture_ns, const bool *masked,
                              float complex *traces)
{
    bool any = false;

    count_waiting(b);
    b->waiting.any = true;
    b->waiting.speaker = speaker;
    b->waiting.capture_ns = capture_ns;
    memcpy(b->waiting.traces, traces, b->n_microphones * b->n_samples * sizeof *traces);
    b->is_empty = false;
    for (size_t m = 0; m < b->n_microphones; m++) {
        b->waiting.masked[m] = masked[m];
        if (!masked[m])
            any |= trace_mean_subtract(b->mean, speaker, m, UINT32_MAX,
                                       traces + m * b->n_samples) > 0;
    }
    return any;
}

void mean_background_destroy(struct mean_background *b)
{
    if (!b)
        return;
    trace_mean_destroy(b->mean);
    free(b->newest_ns);
    free(b->waiting.masked);
    free(b->waiting.traces);
    free(b);
}
