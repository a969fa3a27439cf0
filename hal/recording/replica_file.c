/* SPDX-License-Identifier: MIT */
#include "hal/recording/replica_file.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"
#include "hal/recording/riff.h"

#define PIECE    256  /* samples that are transformed at once */
#define FAINTEST 0.01 /* of the largest power density is sound at all */
#define EDGE     0.1  /* of the median of what is: there the band ends */
#define MIN_BINS 4    /* one tone fills three */

static int read_file(float **out, size_t *n, SNDFILE *f, const SF_INFO *info,
                     const char *path, double sample_rate_hz, struct error *why)
{
    if (info->channels != 1)
        return error_say(why, -EINVAL, "%s: %d channels, expected one", path,
                         info->channels);
    if (info->samplerate != (int)(sample_rate_hz + 0.5))
        return error_say(why, -EINVAL, "%s: %d Hz, but the survey's sample_rate_hz is %g",
                         path, info->samplerate, sample_rate_hz);
    if (info->frames < 2 || (size_t)info->frames > REPLICA_MAX_SAMPLES)
        return error_say(why, -EINVAL, "%s: %lld samples, expected 2 to %zu", path,
                         (long long)info->frames, REPLICA_MAX_SAMPLES);
    size_t frames = (size_t)info->frames;
    float *x = malloc(frames * sizeof *x);
    if (!x)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    if (sf_readf_float(f, x, info->frames) != info->frames) {
        free(x);
        return error_say(why, -EIO, "%s: broken off", path);
    }
    while (frames > 2 && x[frames - 1] == 0.0f)
        frames--;
    *out = x;
    *n = frames;
    return 0;
}

int replica_load(float **out, size_t *n, const char *path, double sample_rate_hz,
                 struct error *why)
{
    SF_INFO info;
    SNDFILE *f;
    int err = wav_open(&f, &info, path, why);
    if (err)
        return err;
    err = read_file(out, n, f, &info, path, sample_rate_hz, why);
    sf_close(f);
    return err;
}

int replica_save(const float *x, size_t n, const char *path, double sample_rate_hz)
{
    SF_INFO info = {.samplerate = (int)lround(sample_rate_hz),
                    .channels = 1,
                    .format = SF_FORMAT_WAV | SF_FORMAT_FLOAT};
    char *name;
    if (asprintf(&name, "%s-replica.wav", path) < 0)
        return -ENOMEM;
    SNDFILE *f = sf_open(name, SFM_WRITE, &info);
    if (f) /* it would hold the time of now: the same survey is to be the same file */
        sf_command(f, SFC_SET_ADD_PEAK_CHUNK, NULL, SF_FALSE);
    int err = f && sf_writef_float(f, x, (sf_count_t)n) == (sf_count_t)n ? 0 : -EIO;
    if (f && sf_close(f))
        err = -EIO;
    free(name);
    return err;
}

/* Adds the power of one windowed piece; power[PIECE / 2 + 1].  A plain sum: replicas are
 * read once. */
static void add_piece(const float *x, const double *wave, double *power)
{
    double piece[PIECE];
    for (size_t i = 0; i < PIECE; i++)
        piece[i] = (double)x[i] * 0.5 * (1.0 - wave[i]); /* Hann */
    for (size_t b = 0; b <= PIECE / 2; b++) {
        double re = 0.0, im = 0.0;
        for (size_t i = 0; i < PIECE; i++) {
            re += piece[i] * wave[b * i % PIECE];
            im += piece[i] * wave[(b * i + PIECE - PIECE / 4) % PIECE];
        }
        power[b] += re * re + im * im;
    }
}

/* The power density at the band's edges, from power[1..PIECE / 2 - 1]. */
static double edge_power(const double *power)
{
    double sound[PIECE / 2], most = 0.0;
    size_t n = 0;
    for (size_t b = 1; b < PIECE / 2; b++)
        most = fmax(most, power[b]);
    for (size_t b = 1; b < PIECE / 2; b++)
        if (power[b] > FAINTEST * most)
            sound[n++] = power[b];
    return n ? EDGE * rank_double(sound, n, n / 2 + 1) : 0.0;
}

int replica_band(const float *x, size_t n, double sample_rate_hz, double band_hz[2])
{
    double wave[PIECE], power[PIECE / 2 + 1] = {0};
    float padded[PIECE];
    for (size_t i = 0; i < PIECE; i++)
        wave[i] = cos(2.0 * M_PI * (double)i / PIECE);
    /* Pieces begin before the first sample, so that the edges count in full too. */
    for (long at = -PIECE / 2; at < (long)n; at += PIECE / 2) {
        for (long i = 0; i < PIECE; i++)
            padded[i] = at + i >= 0 && at + i < (long)n ? x[at + i] : 0.0f;
        add_piece(padded, wave, power);
    }
    double edge = edge_power(power);
    size_t first = 1, last = PIECE / 2 - 1;
    while (first < last && !(power[first] > edge))
        first++;
    while (last > first && !(power[last] > edge))
        last--;
    if (!(edge > 0.0) || !isfinite(edge) || last - first < MIN_BINS)
        return -EINVAL;
    band_hz[0] = (double)first * sample_rate_hz / PIECE;
    band_hz[1] = (double)last * sample_rate_hz / PIECE;
    return 0;
}
