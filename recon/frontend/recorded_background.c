/* SPDX-License-Identifier: MIT */
#include "recon/frontend/recorded_background.h"

#include <errno.h>
#include <stdlib.h>

#include "dsp/background.h"
#include "dsp/drift.h"

struct recorded_background {
    size_t n_speakers, n_pings, n_microphones;
    double sound_speed_m_s;
    struct background *traces;
    bool *masked; /* [n_pings][n_microphones] */
    struct drift *drift;
    struct drift_track track;
    struct air air;
    uint32_t scan; /* that track and air belong to */
};

int recorded_background_create(struct recorded_background **out, const struct survey *s,
                               const struct processing *p,
                               const struct trace_format *format)
{
    const struct drift_config cfg = {.format = *format,
                                     .band_hz = {p->band_hz[0], p->band_hz[1]},
                                     .n_channels = s->n_microphones};
    struct recorded_background *b = calloc(1, sizeof *b);

    if (!b)
        return -ENOMEM;
    b->n_speakers = s->n_speakers;
    b->n_pings = s->n_positions * s->n_speakers;
    b->n_microphones = s->n_microphones;
    b->sound_speed_m_s = s->sound_speed_m_s;
    b->masked = calloc(b->n_pings * b->n_microphones, sizeof *b->masked);
    int err = b->masked ? drift_create(&b->drift, &cfg) : -ENOMEM;
    if (!err)
        err = background_create(&b->traces, b->n_pings, b->n_microphones,
                                format->n_samples);
    if (err)
        recorded_background_destroy(b);
    else
        *out = b;
    return err;
}

static size_t index_of(const struct recorded_background *b, const struct ping *ping)
{
    return ping->position * b->n_speakers + ping->speaker;
}

void recorded_background_keep(struct recorded_background *b, const struct ping *ping,
                              const bool *masked, const float complex *traces)
{
    bool *kept = b->masked + index_of(b, ping) * b->n_microphones;

    for (size_t m = 0; m < b->n_microphones; m++)
        kept[m] = masked[m] || (ping->frame > 1 && kept[m]);
    background_store(b->traces, index_of(b, ping), traces);
}

bool recorded_background_is_kept(const struct recorded_background *b,
                                 const struct ping *ping)
{
    return background_traces(b->traces, index_of(b, ping)) != NULL;
}

static void follow_scan(struct recorded_background *b, const struct ping *ping)
{
    if (b->air.sound_speed_m_s > 0.0 && ping->scan == b->scan)
        return;
    b->scan = ping->scan;
    drift_track_start(&b->track);
    air_start(&b->air, b->sound_speed_m_s, b->n_pings);
}

bool recorded_background_subtract(struct recorded_background *b, const struct ping *ping,
                                  bool *masked, float complex *traces)
{
    size_t index = index_of(b, ping);
    const float complex *background = background_traces(b->traces, index);
    struct drift_measurement now;

    follow_scan(b, ping);
    if (!background)
        return false;
    for (size_t m = 0; m < b->n_microphones; m++)
        masked[m] = masked[m] || b->masked[index * b->n_microphones + m];
    drift_measure(b->drift, background, traces, masked, &now);
    double stretch = drift_track_update(&b->track, &now);
    air_add(&b->air, stretch, drift_subtract(b->drift, stretch, background, traces));
    return true;
}

const struct air *recorded_background_air(const struct recorded_background *b)
{
    return &b->air;
}

void recorded_background_destroy(struct recorded_background *b)
{
    if (!b)
        return;
    background_destroy(b->traces);
    drift_destroy(b->drift);
    free(b->masked);
    free(b);
}
