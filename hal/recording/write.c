#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <sndfile.h>

#include "hal/recording/recording.h"
#include "recon/tail.h"

enum { BLOCK_FRAMES = 4096 };

/* From frame `from` on, of samples [n_microphones][n_frames]. */
static int write_frames(SNDFILE *f, size_t n_microphones, size_t n_frames, size_t from,
                        const float *samples)
{
    float *block = malloc(n_microphones * BLOCK_FRAMES * sizeof *block);
    int err = 0;
    if (!block)
        return -ENOMEM;
    for (size_t at = from; at < n_frames && !err; at += BLOCK_FRAMES) {
        size_t n = n_frames - at < BLOCK_FRAMES ? n_frames - at : BLOCK_FRAMES;
        for (size_t c = 0; c < n_microphones; c++)
            for (size_t i = 0; i < n; i++)
                block[i * n_microphones + c] = samples[c * n_frames + at + i];
        errno = 0;
        if (sf_writef_float(f, block, (sf_count_t)n) != (sf_count_t)n)
            err = errno ? -errno : -EIO;
    }
    free(block);
    return err;
}

int recording_write(const char *folder, size_t position, size_t n_microphones,
                    size_t n_frames, double sample_rate_hz, const float *samples,
                    struct complaint *why)
{
    char *path = NULL, *partial = NULL;
    SF_INFO info = {.samplerate = (int)lround(sample_rate_hz),
                    .channels = (int)n_microphones,
                    .format = SF_FORMAT_WAV | SF_FORMAT_FLOAT};
    int err = 0;
    if (asprintf(&path, "%s/pos%02zu.wav", folder, position) < 0)
        return complain(why, -ENOMEM, "%s: out of memory", folder);
    if (asprintf(&partial, "%s.part", path) < 0) {
        partial = NULL;
        err = complain(why, -ENOMEM, "%s: out of memory", folder);
        goto names;
    }
    SNDFILE *f = sf_open(partial, SFM_WRITE, &info);
    if (!f) {
        err = complain(why, -EIO, "%s cannot be written: %s", path, sf_strerror(NULL));
        goto names;
    }
    err = write_frames(f, n_microphones, n_frames, 0, samples);
    errno = 0;
    if (sf_close(f) && !err)
        err = errno ? -errno : -EIO;
    if (!err && rename(partial, path) < 0)
        err = -errno;
    if (err) {
        unlink(partial);
        complain(why, err, "%s cannot be written: %s", path, strerror(-err));
    }
names:
    free(partial);
    free(path);
    return err;
}

/* -- of an array that stands ------------------------------------------------------------
 */

/* Slots that may be missing between two pings of one stretch. */
#define MOST_SILENT 1000

struct recording_writer {
    char *path, *table_path;
    SNDFILE *file;
    FILE *table;
    size_t n_microphones, slot_samples, n_ping;
    double sample_rate_hz;
    uint64_t n_written;   /* frames */
    struct emission last; /* with n_written: there was one */
    float *end;           /* [n_microphones][n_ping], the newest frames of the file */
    float *silence;       /* [n_microphones][slot_samples] */
};

static void writer_free(struct recording_writer *w)
{
    free(w->path);
    free(w->table_path);
    free(w->end);
    free(w->silence);
    free(w);
}

static int complain_of(const struct recording_writer *w, int err, struct complaint *why)
{
    return complain(why, err, "%s cannot be written: %s", w->path, strerror(-err));
}

int recording_writer_open(struct recording_writer **out, const char *folder,
                          const struct survey *s, struct complaint *why)
{
    struct recording_writer *w = calloc(1, sizeof *w);
    SF_INFO info = {.samplerate = (int)lround(s->sample_rate_hz),
                    .channels = (int)s->n_microphones,
                    .format = SF_FORMAT_RF64 | SF_FORMAT_FLOAT};
    int err = 0;

    *out = w;
    if (!w)
        return complain(why, -ENOMEM, "%s: out of memory", folder);
    w->n_microphones = s->n_microphones;
    w->slot_samples = s->slot_samples;
    w->n_ping = s->slot_samples + tail_samples(s);
    w->sample_rate_hz = s->sample_rate_hz;
    w->end = calloc(w->n_microphones * w->n_ping, sizeof *w->end);
    w->silence = calloc(w->n_microphones * w->slot_samples, sizeof *w->silence);
    if (asprintf(&w->path, "%s/pos00.wav", folder) < 0)
        w->path = NULL;
    if (asprintf(&w->table_path, "%s/" EMISSIONS_FILE, folder) < 0)
        w->table_path = NULL;
    if (!w->end || !w->silence || !w->path || !w->table_path) {
        err = complain(why, -ENOMEM, "%s: out of memory", folder);
        goto fail;
    }
    w->table = fopen(w->table_path, "wxe");
    if (!w->table) {
        err = complain(why, -errno, "%s cannot be written: %s", w->table_path,
                       strerror(errno));
        goto fail;
    }
    w->file = sf_open(w->path, SFM_WRITE, &info);
    if (!w->file) {
        err = complain(why, -EIO, "%s cannot be written: %s", w->path, sf_strerror(NULL));
        goto table;
    }
    /* A plain WAV file as long as it is short enough for one. */
    sf_command(w->file, SFC_RF64_AUTO_DOWNGRADE, NULL, SF_TRUE);
    emission_print(w->table, NULL);
    return 0;
table:
    fclose(w->table);
fail:
    writer_free(w);
    *out = NULL;
    return err;
}

/* The frames of a channel that the file has from `sample` on already. */
static const float *written(const struct recording_writer *w, size_t m, size_t overlap)
{
    return w->end + (m + 1) * w->n_ping - overlap;
}

static bool goes_on(const struct recording_writer *w, size_t overlap,
                    const float *samples)
{
    for (size_t m = 0; m < w->n_microphones; m++)
        if (memcmp(written(w, m, overlap), samples + m * w->n_ping,
                   overlap * sizeof *samples))
            return false;
    return true;
}

/* Where a ping stands: whole slots after the one before, if time and sound agree. */
static uint64_t find_place(const struct recording_writer *w, const struct emission *e,
                           const float *samples)
{
    if (!w->n_written)
        return 0;
    double slots = 1e-9 * (double)(e->time_ns - w->last.time_ns) * w->sample_rate_hz /
                   (double)w->slot_samples;
    double whole = round(slots);
    if (!(whole >= 0.0 && whole <= MOST_SILENT && fabs(slots - whole) < 0.25))
        return w->n_written;
    uint64_t at = w->last.sample + (uint64_t)whole * w->slot_samples;
    if (at >= w->n_written)
        return at;
    return goes_on(w, (size_t)(w->n_written - at), samples) ? at : w->n_written;
}

/* The newest n_ping - from frames of the ping become those of the file. */
static int append(struct recording_writer *w, const float *samples, size_t from)
{
    int err = write_frames(w->file, w->n_microphones, w->n_ping, from, samples);

    memcpy(w->end, samples, w->n_microphones * w->n_ping * sizeof *samples);
    w->n_written += w->n_ping - from;
    return err;
}

static int fill(struct recording_writer *w, uint64_t until)
{
    int err = 0;

    while (!err && w->n_written < until) {
        uint64_t left = until - w->n_written;
        size_t n = left < w->slot_samples ? (size_t)left : w->slot_samples;
        err = write_frames(w->file, w->n_microphones, n, 0, w->silence);
        w->n_written += n;
    }
    return err;
}

int recording_writer_put(struct recording_writer *w, const struct emission *e,
                         const float *samples, struct complaint *why)
{
    uint64_t at = find_place(w, e, samples);
    int err = fill(w, at);

    if (!err && at + w->n_ping > w->n_written)
        err = append(w, samples, (size_t)(w->n_written - at));
    if (err)
        return complain_of(w, err, why);
    w->last = *e;
    w->last.sample = at;
    emission_print(w->table, &w->last);
    return 0;
}

int recording_writer_close(struct recording_writer *w, int err, struct complaint *why)
{
    if (!w)
        return err;
    errno = 0;
    if (sf_close(w->file) && !err)
        err = complain_of(w, errno ? -errno : -EIO, why);
    errno = 0;
    bool failed = ferror(w->table);
    if ((fclose(w->table) || failed) && !err) {
        err = errno ? -errno : -EIO;
        complain(why, err, "%s cannot be written: %s", w->table_path, strerror(-err));
    }
    writer_free(w);
    return err;
}
