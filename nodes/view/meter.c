/* SPDX-License-Identifier: MIT */
#include "nodes/view/meter.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"
#include "msgs/tensor.h"
#include "nodes/rt/export.h"

#define DEAD_POWER_RATIO  1e-6
#define FAINT_POWER_RATIO 1e-2
#define CLIPPED_SHARE     0.01

static const char *const state_names[] = {
    [METER_UNHEARD] = "not heard yet", [METER_OK] = "ok",
    [METER_CLIPPED] = "clipped",       [METER_DEAD] = "dead",
    [METER_DAMAGED] = "damaged",       [METER_FAINT] = "faint"};

void meter_init(struct meter *m)
{
    *m = (struct meter){.temperature_c = NAN};
}

void meter_clear(struct meter *m)
{
    free(m->microphones);
    free(m->speakers);
    meter_init(m);
}

static int grow(struct meter_channel **channels, size_t *n, size_t wanted)
{
    if (wanted > METER_MAX_CHANNELS)
        return -EINVAL;
    if (wanted <= *n)
        return 0;
    struct meter_channel *grown = realloc(*channels, wanted * sizeof *grown);
    if (!grown)
        return -ENOMEM;
    memset(grown + *n, 0, (wanted - *n) * sizeof *grown);
    *channels = grown;
    *n = wanted;
    return 0;
}

#define LANES 8

/* The rms is without the mean: an offset is no sound.  Sums in lanes, so that the
 * compiler may use vectors; a ping is short enough for float. */
static void measure(struct meter_channel *c, const float *x, size_t n)
{
    float peaks[LANES] = {0.0f}, sums[LANES] = {0.0f}, squares[LANES] = {0.0f};
    double sum = 0.0, square = 0.0, peak = 0.0;

    for (size_t i = 0; i + LANES <= n; i += LANES) {
        for (size_t k = 0; k < LANES; k++) {
            float v = x[i + k], size = fabsf(v), off = v - x[0];
            peaks[k] = size > peaks[k] ? size : peaks[k];
            sums[k] += off;
            squares[k] += off * off;
        }
    }
    for (size_t i = n / LANES * LANES; i < n; i++) {
        peaks[0] = fmaxf(peaks[0], fabsf(x[i]));
        sums[0] += x[i] - x[0];
        squares[0] += (x[i] - x[0]) * (x[i] - x[0]);
    }
    for (size_t k = 0; k < LANES; k++) {
        peak = fmax(peak, (double)peaks[k]);
        sum += (double)sums[k];
        square += (double)squares[k];
    }
    double mean = sum / (double)n, power = square / (double)n - mean * mean;
    c->peak = peak;
    c->rms = power > 1e-12 * mean * mean ? sqrt(power) : 0.0;
}

static double median_rms(const struct meter_channel *c, size_t n)
{
    double sorted[METER_MAX_CHANNELS];
    size_t heard = 0;

    for (size_t i = 0; i < n; i++)
        if (c[i].state != METER_UNHEARD)
            sorted[heard++] = c[i].rms;
    return heard ? rank_double(sorted, heard, heard / 2 + 1) : 0.0;
}

static void judge_microphones(struct meter *m, const Anlos__Ping *ping, size_t n_samples)
{
    double median = median_rms(m->microphones, m->n_microphones);

    for (size_t i = 0; i < m->n_microphones; i++) {
        struct meter_channel *c = &m->microphones[i];
        bool bad = i < ping->n_not_finite && ping->not_finite[i];
        double clipped = i < ping->n_clipped ? (double)ping->clipped[i] : 0.0;
        c->state = bad                                                     ? METER_DAMAGED
                   : c->rms * c->rms <= DEAD_POWER_RATIO * median * median ? METER_DEAD
                   : clipped > CLIPPED_SHARE * (double)n_samples           ? METER_CLIPPED
                                                                           : METER_OK;
    }
}

/* All of them: what is faint shows when the others have been heard. */
static void judge_speakers(struct meter *m)
{
    double median = median_rms(m->speakers, m->n_speakers);

    for (size_t i = 0; i < m->n_speakers; i++) {
        struct meter_channel *c = &m->speakers[i];
        if (c->state != METER_UNHEARD)
            c->state = c->rms * c->rms <= FAINT_POWER_RATIO * median * median
                           ? METER_FAINT
                           : METER_OK;
    }
}

static void start_scan(struct meter *m, uint32_t scan)
{
    for (size_t i = 0; i < m->n_microphones; i++)
        m->microphones[i].clipped = m->microphones[i].not_finite = 0;
    m->pings = m->invalid = 0;
    m->scan = scan;
}

int meter_ping(struct meter *m, const Anlos__Ping *ping, bool samples)
{
    size_t extents[2];
    const float *x = ping->samples ? tensor_f32(ping->samples, 2, extents) : NULL;

    if (!x || ping->speaker >= METER_MAX_CHANNELS)
        return -EINVAL;
    int err = grow(&m->microphones, &m->n_microphones, extents[0]);
    if (!err)
        err = grow(&m->speakers, &m->n_speakers, ping->speaker + 1);
    if (err)
        return err;
    m->n_microphones = extents[0]; /* another array may have fewer */
    if (ping->scan != m->scan)
        start_scan(m, ping->scan);
    m->pings++;
    m->invalid += !ping->valid;
    m->temperature_c = ping->temperature_c;
    m->speaker = ping->speaker;
    for (size_t i = 0; i < extents[0]; i++) {
        m->microphones[i].clipped += i < ping->n_clipped ? ping->clipped[i] : 0;
        m->microphones[i].not_finite += i < ping->n_not_finite ? ping->not_finite[i] : 0;
    }
    if (!samples)
        return 0;
    for (size_t i = 0; i < extents[0]; i++) {
        measure(&m->microphones[i], x + i * extents[1], extents[1]);
        m->microphones[i].state = METER_OK;
    }
    judge_microphones(m, ping, extents[1]);
    m->speakers[ping->speaker].rms = median_rms(m->microphones, m->n_microphones);
    m->speakers[ping->speaker].state = METER_OK;
    judge_speakers(m);
    return 0;
}

static json_t *decibels(double amplitude)
{
    return export_real(amplitude > 0.0 ? 20.0 * log10(amplitude) : NAN);
}

json_t *meter_json(const struct meter *m)
{
    json_t *microphones = json_array(), *speakers = json_array();

    for (size_t i = 0; i < m->n_microphones; i++) {
        const struct meter_channel *c = &m->microphones[i];
        json_array_append_new(microphones,
                              json_pack("[oosII]", decibels(c->peak), decibels(c->rms),
                                        state_names[c->state], (json_int_t)c->clipped,
                                        (json_int_t)c->not_finite));
    }
    for (size_t i = 0; i < m->n_speakers; i++)
        json_array_append_new(speakers, json_pack("[os]", decibels(m->speakers[i].rms),
                                                  state_names[m->speakers[i].state]));
    return json_pack("{ss so so sI sI si so}", "type", "levels", "microphones",
                     microphones, "speakers", speakers, "pings", (json_int_t)m->pings,
                     "invalid", (json_int_t)m->invalid, "speaker", (int)m->speaker,
                     "temperature_c", export_real(m->temperature_c));
}
