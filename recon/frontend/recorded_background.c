/* SPDX-License-Identifier: MIT */
#include "recon/frontend/recorded_background.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/background.h"
#include "dsp/drift.h"

#define LOUDER_DB 1.0 /* what is hidden adds to what was there before */

struct recorded_background {
    size_t n_speakers, n_pings, n_microphones, n_samples;
    double sound_speed_m_s;
    struct background *traces;
    bool *masked; /* [n_pings][n_microphones] */
    struct drift *drift;
    struct drift_track track;
    struct air air;
    uint32_t scan; /* that what follows belongs to, and track and air */
    size_t n_compared, n_same;
    double scene, background; /* energy */
    bool judged;
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
    b->n_samples = format->n_samples;
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
    b->n_compared = b->n_same = 0;
    b->scene = b->background = 0.0;
    b->judged = false;
}

static double energy(const float complex *x, size_t n)
{
    double sum = 0.0;

    for (size_t i = 0; i < n; i++)
        sum += (double)(crealf(x[i]) * crealf(x[i]) + cimagf(x[i]) * cimagf(x[i]));
    return sum;
}

static void compare(struct recorded_background *b, const bool *masked,
                    const float complex *background, const float complex *scene)
{
    size_t n = b->n_samples;
    bool same = true;

    for (size_t m = 0; m < b->n_microphones; m++) {
        if (masked[m])
            continue;
        b->scene += energy(scene + m * n, n);
        b->background += energy(background + m * n, n);
        same = same && !memcmp(scene + m * n, background + m * n, n * sizeof *scene);
    }
    b->n_compared++;
    b->n_same += same;
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
    compare(b, masked, background, traces);
    drift_measure(b->drift, background, traces, masked, &now);
    double stretch = drift_track_update(&b->track, &now);
    air_add(&b->air, stretch, drift_subtract(b->drift, stretch, background, traces));
    return true;
}

void recorded_background_judge(struct recorded_background *b, char *note, size_t size)
{
    *note = '\0';
    if (b->judged || 2 * b->n_compared < b->n_pings)
        return;
    b->judged = true;
    double louder_db = 10.0 * log10(b->background / b->scene);
    if (b->n_same == b->n_compared)
        snprintf(
            note, size,
            "the background is the same sound as the scan, of which nothing is left; "
            "expected the room without what is hidden");
    else if (louder_db > LOUDER_DB)
        snprintf(note, size,
                 "the background is %.1f dB louder than the scan: have the two been "
                 "swapped?",
                 louder_db);
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
