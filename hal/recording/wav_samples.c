#include "hal/recording/wav_samples.h"

#include <math.h>
#include <string.h>

enum { BLOCK = 64, PCM_RUN = 3, FLOAT_RUN = 4 };
#define PCM_FULL_SCALE 0.9999f

/* In blocks, so that each cache line of either side is fetched once. */
void wav_samples_separate(const struct wav_samples *w, const float *restrict frames,
                          size_t first, size_t n, float *restrict samples)
{
    size_t n_channels = w->n_channels;
    for (size_t at = 0; at < n; at += BLOCK) {
        size_t end = at + BLOCK < n ? at + BLOCK : n;
        for (size_t c = 0; c < n_channels; c++) {
            float *restrict out = samples + c * w->n_frames + first;
            for (size_t i = at; i < end; i++)
                out[i] = frames[i * n_channels + c];
        }
    }
}

void wav_samples_finish(const struct wav_samples *w, size_t n, float *samples)
{
    for (size_t c = 0; c < w->n_channels; c++)
        memset(samples + c * w->n_frames + n, 0, (w->n_frames - n) * sizeof *samples);
}

/* The largest magnitude, or one that is not finite when there is such a sample: without
 * their sign, the bits of floats rise as the floats do, infinity and NaN above all. */
static float peak_of(const float *x, size_t n)
{
    int32_t peak = 0;
    float out;
    for (size_t i = 0; i < n; i++) {
        int32_t bits;
        memcpy(&bits, x + i, sizeof bits);
        bits &= INT32_MAX;
        peak = bits > peak ? bits : peak;
    }
    memcpy(&out, &peak, sizeof out);
    return out;
}

static size_t slot_of(const struct wav_samples *w, size_t i)
{
    size_t slot = i / w->slot_samples;
    return slot < w->n_slots ? slot : w->n_slots - 1;
}

static void clean(const struct wav_samples *w, float *x, size_t n, uint32_t *counts)
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(x[i])) {
            counts[slot_of(w, i) * w->n_channels]++;
            x[i] = 0;
        }
}

/* A run belongs to the slot in which it ends. */
static void count_runs(const struct wav_samples *w, const float *x, size_t n,
                       float threshold, uint32_t *counts)
{
    size_t run = 0, least = w->is_float ? FLOAT_RUN : PCM_RUN;
    for (size_t i = 0; i <= n; i++) {
        bool high = i < n && fabsf(x[i]) >= threshold;
        bool goes_on = high && run && (!w->is_float || x[i] == x[i - 1]);
        if (!goes_on) {
            if (run >= least)
                counts[slot_of(w, i - 1) * w->n_channels] += (uint32_t)run;
            run = 0;
        }
        run += high;
    }
}

void wav_samples_count(const struct wav_samples *w, float *samples, size_t n,
                       uint32_t *clipped, uint32_t *not_finite)
{
    memset(clipped, 0, w->n_slots * w->n_channels * sizeof *clipped);
    memset(not_finite, 0, w->n_slots * w->n_channels * sizeof *not_finite);
    for (size_t c = 0; c < w->n_channels; c++) {
        float *x = samples + c * w->n_frames;
        float peak = peak_of(x, n);
        if (!isfinite(peak)) {
            clean(w, x, n, not_finite + c);
            peak = peak_of(x, n);
        }
        float threshold = w->is_float ? 0.5f * peak : PCM_FULL_SCALE;
        if (peak > 0 && peak >= threshold)
            count_runs(w, x, n, threshold, clipped + c);
    }
}
