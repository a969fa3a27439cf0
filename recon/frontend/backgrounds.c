/* SPDX-License-Identifier: MIT */
#include "recon/frontend/backgrounds.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/background.h"
#include "dsp/drift.h"
#include "dsp/trace_mean.h"

/* -- the air between two passes ---------------------------------------------------------
 */

#define LEAST_KELVIN              0.05  /* less is not worth a word */
#define SOUND_SPEED_SQUARED_PER_K 401.9 /* dry air: 1.4 * 8.314 / 0.02896 m2/s2/K */

void air_start(struct air *a, double sound_speed_m_s, size_t expected)
{
    *a = (struct air){.sound_speed_m_s = sound_speed_m_s, .expected = expected};
}

void air_add(struct air *a, double stretch, bool corrected)
{
    a->pings++;
    a->corrected += corrected;
    a->sum += stretch;
    if (fabs(stretch) > fabs(a->largest))
        a->largest = stretch;
}

void air_join(struct air *a, const struct air *other)
{
    a->pings += other->pings;
    a->corrected += other->corrected;
    a->sum += other->sum;
    if (fabs(other->largest) > fabs(a->largest))
        a->largest = other->largest;
}

double air_kelvin(const struct air *a, double stretch)
{
    double kelvin = a->sound_speed_m_s * a->sound_speed_m_s / SOUND_SPEED_SQUARED_PER_K;

    return -2.0 * kelvin * stretch;
}

bool air_is_distrusted(const struct air *a)
{
    return fabs(a->largest) >= AIR_DISTRUST;
}

void air_text(const struct air *a, char *out, size_t size)
{
    double mean = a->pings ? a->sum / (double)a->pings : 0.0;

    if (!size)
        return;
    out[0] = 0;
    if (a->corrected && fabs(air_kelvin(a, a->largest)) >= LEAST_KELVIN)
        snprintf(out, size,
                 "air %+.1f K (%.2f%%) since the background, at most %+.1f K (%.2f%%)",
                 air_kelvin(a, mean), 100.0 * fabs(mean), air_kelvin(a, a->largest),
                 100.0 * fabs(a->largest));
}

/* -- as it was recorded before ----------------------------------------------------------
 */

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

/* -- the mean of what was heard ---------------------------------------------------------
 */

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
