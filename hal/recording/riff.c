/* SPDX-License-Identifier: MIT */
#include "hal/recording/riff.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

static uint32_t read_32(const unsigned char *p, bool big)
{
    if (big)
        return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
    return (uint32_t)p[3] << 24 | (uint32_t)p[2] << 16 | (uint32_t)p[1] << 8 | p[0];
}

struct riff {
    FILE *f;
    uint64_t file_size;
    bool big;
    uint64_t at;  /* of the content of the chunk that came last */
    char name[4]; /* its name, and its length */
    uint64_t length;
};

static int open_riff(struct riff *r, const char *path)
{
    unsigned char head[12];
    struct stat st;

    int err = stat(path, &st) < 0 ? -errno : 0;
    if (!err && !S_ISREG(st.st_mode)) /* a pipe would be waited for */
        err = -ESPIPE;
    if (err)
        return err;
    *r = (struct riff){
        .f = fopen(path, "re"), .at = 12, .file_size = (uint64_t)st.st_size};
    if (!r->f)
        return -errno;
    if (fread(head, 1, 12, r->f) != 12 || memcmp(head + 8, "WAVE", 4))
        err = ferror(r->f) ? -EIO : -EINVAL;
    r->big = !err && !memcmp(head, "RIFX", 4);
    if (!err && !r->big && memcmp(head, "RIFF", 4) && memcmp(head, "RF64", 4))
        err = -EINVAL;
    if (err)
        fclose(r->f);
    return err;
}

/* 0, -EINVAL (no more chunks), -EIO. */
static int next_chunk(struct riff *r)
{
    unsigned char head[8];

    r->at += r->length + (r->length & 1);
    if (fseeko(r->f, (off_t)r->at, SEEK_SET) || fread(head, 1, 8, r->f) != 8)
        return ferror(r->f) ? -EIO : -EINVAL;
    memcpy(r->name, head, 4);
    r->length = read_32(head + 4, r->big);
    r->at += 8;
    return 0;
}

/* An RF64 file has the size of its data in the chunk "ds64". */
int riff_data_size(const char *path, uint64_t *promised, uint64_t *present)
{
    unsigned char ds64[16];
    uint64_t size_64 = 0;
    struct riff r;
    int err = open_riff(&r, path);

    if (err)
        return err;
    while (!(err = next_chunk(&r)) && memcmp(r.name, "data", 4))
        if (!memcmp(r.name, "ds64", 4) && fread(ds64, 1, 16, r.f) == 16)
            size_64 = (uint64_t)read_32(ds64 + 12, false) << 32 |
                      read_32(ds64 + 8, false);
    if (!err) {
        *present = r.file_size > r.at ? r.file_size - r.at : 0;
        *promised = r.length == UINT32_MAX && size_64 ? size_64 : r.length;
        if (*promised == 0 || *promised == UINT32_MAX)
            *promised = *present;
    }
    fclose(r.f);
    return err;
}

/* The number of its sample format, from the chunk "fmt ".  Errors as riff_data_size. */
static int riff_format(const char *path, unsigned *format)
{
    unsigned char number[2];
    struct riff r;
    int err = open_riff(&r, path);

    if (err)
        return err;
    while (!(err = next_chunk(&r)) && memcmp(r.name, "fmt ", 4))
        ;
    if (!err && fread(number, 1, 2, r.f) != 2)
        err = -EINVAL;
    if (!err)
        *format = r.big ? number[0] << 8 | number[1] : number[1] << 8 | number[0];
    fclose(r.f);
    return err;
}

static bool is_linear(unsigned format)
{
    return format == RIFF_PCM || format == RIFF_FLOAT || format == RIFF_EXTENSIBLE;
}

/* What a file with the extensible format names in its own way. */
static bool has_linear_samples(const SF_INFO *info)
{
    switch (info->format & SF_FORMAT_SUBMASK) {
    case SF_FORMAT_PCM_S8:
    case SF_FORMAT_PCM_U8:
    case SF_FORMAT_PCM_16:
    case SF_FORMAT_PCM_24:
    case SF_FORMAT_PCM_32:
    case SF_FORMAT_FLOAT:
    case SF_FORMAT_DOUBLE:
        return true;
    default:
        return false;
    }
}

int wav_error_say(struct error *why, int err, const char *path)
{
    if (err == -ESPIPE)
        return error_say(why, -EINVAL, "%s: is no file; expected a WAV file", path);
    return error_say(why, err, "%s: %s", path,
                     err == -EINVAL ? "no WAV file" : strerror(-err));
}

int wav_open(SNDFILE **out, SF_INFO *info, const char *path, struct error *why)
{
    unsigned format;

    *out = NULL;
    *info = (SF_INFO){.format = 0};
    int err = riff_format(path, &format);
    if (err)
        return wav_error_say(why, err, path);
    if (!is_linear(format))
        return error_say(why, -EINVAL,
                         "%s: a WAV file of format %u; expected PCM or float samples",
                         path, format);
    *out = sf_open(path, SFM_READ, info);
    if (!*out)
        return error_say(why, -EINVAL, "%s: no WAV file: %s", path, sf_strerror(NULL));
    if (has_linear_samples(info))
        return 0;
    sf_close(*out);
    *out = NULL;
    return error_say(why, -EINVAL, "%s: expected a WAV file of PCM or float samples",
                     path);
}

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
