#include "nodes/dsp/mean_background.h"

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
    if (!err && !b->newest_ns)
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
    b->is_empty = true;
}

const float complex *mean_background_record(struct mean_background *b,
                                            const Anlos__Ping *ping,
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

bool mean_background_subtract(struct mean_background *b, size_t speaker,
                              int64_t capture_ns, const protobuf_c_boolean *masked,
                              float complex *traces)
{
    double since_s = 1e-9 * (double)(capture_ns - b->newest_ns[speaker]);
    double share = since_s > 0.0 ? -expm1(-since_s / b->time_constant_s) : 0.0;
    bool any = false;

    b->newest_ns[speaker] = capture_ns;
    b->is_empty = false;
    for (size_t m = 0; m < b->n_microphones; m++)
        if (!masked[m])
            any |= trace_mean_take(b->mean, speaker, m, share, UINT32_MAX,
                                   traces + m * b->n_samples) > 0;
    return any;
}

void mean_background_destroy(struct mean_background *b)
{
    if (!b)
        return;
    trace_mean_destroy(b->mean);
    free(b->newest_ns);
    free(b);
}
