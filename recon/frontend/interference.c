/* SPDX-License-Identifier: MIT */
#include "recon/frontend/interference.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/async_pulse.h"

#define PULSES 2.0 /* widths of a pulse, 1 / bandwidth, on either side of its peak */

struct before { /* a ping that the next ones are held against */
    size_t speaker;
    int64_t capture_ns;
};

struct interference {
    size_t n_speakers;
    double (*speakers_m)[3]; /* [n_speakers] */
    double samples_per_m;    /* of way */
    struct async_pulse *pulses;
    bool any, subtracted;                    /* the newest */
    struct before before[ASYNC_PULSE_PINGS]; /* the newest first */
    uint8_t *foreign;                        /* [n_microphones][n_samples] */
    bool hit[INTERFERENCE_PINGS];            /* ring */
    size_t newest, n_hit;
    double slot_s;
    uint16_t looks;       /* a bit for each that is hit, the newest the lowest */
    bool often, at_looks; /* present by either rule */
    uint64_t pings;
};

int interference_create(struct interference **out, const struct survey *s,
                        const struct trace_format *format, size_t until)
{
    struct interference *i = calloc(1, sizeof *i);
    double band_hz = fabs(s->chirp_stop_hz - s->chirp_start_hz);

    *out = NULL;
    if (!i)
        return -ENOMEM;
    i->n_speakers = s->n_speakers;
    i->samples_per_m = format->rate_hz / s->sound_speed_m_s;
    i->slot_s = (double)s->slot_samples / s->sample_rate_hz;
    i->speakers_m = calloc(s->n_speakers, sizeof *i->speakers_m);
    i->foreign = calloc(s->n_microphones * format->n_samples, sizeof *i->foreign);
    int err = i->speakers_m && i->foreign ? 0 : -ENOMEM;
    if (!err)
        err = async_pulse_create(
            &i->pulses, &(struct async_pulse_config){
                            .n_channels = s->n_microphones,
                            .n_samples = format->n_samples,
                            .until = until,
                            .guard = (size_t)ceil(PULSES * format->rate_hz / band_hz)});
    if (err) {
        interference_destroy(i);
        return err;
    }
    memcpy(i->speakers_m, s->speakers_m, s->n_speakers * sizeof *i->speakers_m);
    *out = i;
    return 0;
}

void interference_destroy(struct interference *i)
{
    if (!i)
        return;
    async_pulse_destroy(i->pulses);
    free(i->speakers_m);
    free(i->foreign);
    free(i);
}

void interference_break(struct interference *i)
{
    async_pulse_reset(i->pulses);
    i->any = false;
}

/* By how much the way to anything and back may have changed. */
static size_t reach_of(const struct interference *i, const struct before *from,
                       const struct ping *to, double speed_m_s)
{
    const double *a = i->speakers_m[from->speaker], *b = i->speakers_m[to->speaker];
    double apart_m =
        sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
    double since_s = 1e-9 * (double)(to->capture_ns - from->capture_ns);
    double moved_m = 2 * (INTERFERENCE_SPEED_M_S + fabs(speed_m_s)) * fabs(since_s);

    return 1 + (size_t)((apart_m + moved_m) * i->samples_per_m);
}

static void count(struct interference *i, bool hit)
{
    i->newest = (i->newest + 1) % INTERFERENCE_PINGS;
    i->n_hit += hit - (size_t)i->hit[i->newest];
    i->hit[i->newest] = hit;
    i->pings += hit;
    if (i->n_hit >= INTERFERENCE_SOME)
        i->often = true;
    else if (i->n_hit < INTERFERENCE_FEW)
        i->often = false;
}

/* It follows a longer slot, and not one that is missing. */
static bool is_look(const struct interference *i, const struct ping *ping)
{
    double since_s = 1e-9 * (double)(ping->capture_ns - i->before[0].capture_ns);

    return i->any && since_s > (1.0 + INTERFERENCE_LONGER) * i->slot_s &&
           since_s < 1.5 * i->slot_s;
}

static void count_look(struct interference *i, bool hit)
{
    i->looks = (uint16_t)(i->looks << 1 | hit);
    if (__builtin_popcount(i->looks & 0xff) >= INTERFERENCE_LOOKS_SOME)
        i->at_looks = true;
    else if (__builtin_popcount(i->looks) < INTERFERENCE_LOOKS_FEW)
        i->at_looks = false;
}

static bool is_present(const struct interference *i)
{
    return i->often || i->at_looks;
}

const uint8_t *interference_ping(struct interference *i,
                                 const struct interference_ping *in)
{
    const struct ping *ping = in->ping;
    size_t reach[ASYNC_PULSE_PINGS];

    if (i->any && i->subtracted != in->subtracted)
        interference_break(i);
    for (size_t k = 0; k < ASYNC_PULSE_PINGS; k++)
        reach[k] = reach_of(i, &i->before[k], ping, in->speed_m_s);
    bool hit = async_pulse_execute(i->pulses, in->traces, in->masked, reach, i->foreign);
    bool look = is_look(i, ping);
    memmove(i->before + 1, i->before, (ASYNC_PULSE_PINGS - 1) * sizeof *i->before);
    i->before[0] = (struct before){ping->speaker, ping->capture_ns};
    i->any = true;
    i->subtracted = in->subtracted;
    count(i, hit);
    if (look)
        count_look(i, hit);
    return hit && is_present(i) ? i->foreign : NULL;
}

void interference_levels(const struct interference *i, struct interference_levels *out)
{
    *out = (struct interference_levels){.present = is_present(i),
                                        .pings = i->pings,
                                        .share = (double)i->n_hit / INTERFERENCE_PINGS};
}
