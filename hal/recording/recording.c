#include "hal/recording/recording.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "hal/recording/riff.h"
#include "hal/recording/wav_open.h"
#include "hal/recording/wav_samples.h"
#include "recon/tail.h"

enum { BLOCK_FRAMES = 2048 };

struct recording {
    size_t n_positions, n_speakers, n_microphones, slot_samples, n_frames;
    size_t n_slots; /* in a file */
    size_t n_held;  /* whole slots that are in the one file of pings */
    double sample_rate_hz;
    size_t n_files; /* one a position, or one whose slots are the positions */
    char **paths;   /* [n_files] */

    struct emission *emissions; /* [n_emissions], of one stage position */
    size_t n_emissions;
    bool has_table;     /* emissions.csv says which */
    size_t n_ping;      /* samples of an emission: slot and tail */
    uint64_t n_samples; /* of the last file */
};

static bool is_wav(const char *name)
{
    size_t n = strlen(name);
    return name[0] != '.' && n > 4 && !strcasecmp(name + n - 4, ".wav");
}

static int select_wav(const struct dirent *e)
{
    return is_wav(e->d_name);
}

static int by_name(const struct dirent **a, const struct dirent **b)
{
    return strcmp((*a)->d_name, (*b)->d_name);
}

static int join_paths(struct recording *r, const char *folder, struct dirent **entries)
{
    r->paths = calloc(r->n_files, sizeof *r->paths);
    if (!r->paths)
        return -ENOMEM;
    for (size_t i = 0; i < r->n_files; i++)
        if (asprintf(&r->paths[i], "%s/%s", folder, entries[i]->d_name) < 0) {
            r->paths[i] = NULL;
            return -ENOMEM;
        }
    return 0;
}

/* Of a recording that is one file: what is no longer than a slot is the replica beside
 * it.  Moves the others to the front; returns how many. */
static int leave_out_replicas(const struct recording *r, const char *folder,
                              struct dirent **entries, int n)
{
    int kept = 0;
    for (int i = 0; i < n; i++) {
        SF_INFO info;
        char *path = NULL;
        struct dirent *entry = entries[i];
        SNDFILE *f = NULL;
        if (asprintf(&path, "%s/%s", folder, entry->d_name) >= 0)
            wav_open(&f, &info, path, NULL);
        bool is_short = f && (uint64_t)info.frames <= r->slot_samples;
        if (f)
            sf_close(f);
        free(path);
        if (is_short)
            continue;
        entries[i] = entries[kept];
        entries[kept++] = entry;
    }
    return kept;
}

static int list_files(struct recording *r, const char *folder, struct complaint *why)
{
    struct dirent **entries = NULL;
    int n = scandir(folder, &entries, select_wav, by_name), n_found = n, err = 0;
    if (n < 0)
        return complain(why, -errno, "%s: no folder of WAV files: %s", folder,
                        strerror(errno));
    if (n > 1 && r->n_files != r->n_positions)
        n = leave_out_replicas(r, folder, entries, n);
    if (n == 0)
        err = complain(why, -EINVAL, "%s: expected %zu WAV files, found none", folder,
                       r->n_files);
    else if ((size_t)n != r->n_files && r->n_files != r->n_positions)
        err = complain(why, -EINVAL,
                       "%s: %d WAV files, but the survey names pings; expected one file "
                       "of consecutive slots",
                       folder, n);
    else if ((size_t)n != r->n_files)
        err = complain(why, -EINVAL,
                       "%s: %d WAV files, but the survey's stage.positions_m has %zu "
                       "entries; expected one file for each",
                       folder, n, r->n_positions);
    else if (join_paths(r, folder, entries) < 0)
        err = complain(why, -ENOMEM, "%s: out of memory", folder);
    for (int i = 0; i < n_found; i++)
        free(entries[i]);
    free(entries);
    return err;
}

static int check_size(const char *path, struct complaint *why)
{
    uint64_t promised, present;
    int err = riff_data_size(path, &promised, &present);
    if (err)
        return wav_complain(why, err, path);
    if (present < promised)
        return complain(why, -EINVAL,
                        "%s: truncated: its header promises %" PRIu64
                        " bytes of sound, %" PRIu64 " are there",
                        path, promised, present);
    return 0;
}

static int check_info(const struct recording *r, const char *path, const SF_INFO *info,
                      struct complaint *why)
{
    size_t slots = r->n_slots;
    size_t least = r->has_table ? 1 : (slots - 1) * r->slot_samples + 1;
    if (info->samplerate != (int)(r->sample_rate_hz + 0.5))
        return complain(why, -EINVAL, "%s: %d Hz, but the survey's sample_rate_hz is %g",
                        path, info->samplerate, r->sample_rate_hz);
    if (info->channels < 1 || (size_t)info->channels != r->n_microphones)
        return complain(why, -EINVAL,
                        "%s: %d channels, but the survey's microphones_m has %zu entries",
                        path, info->channels, r->n_microphones);
    if (info->frames < 1)
        return complain(why, -EINVAL, "%s: holds no sound; expected %zu frames", path,
                        slots * r->slot_samples);
    if ((uint64_t)info->frames < least && r->n_files != r->n_positions)
        return complain(why, -EINVAL,
                        "%s: %" PRId64 " frames, but the slot of the last of %zu pings "
                        "begins at frame %zu (slot_samples %zu)",
                        path, (int64_t)info->frames, r->n_positions, least - 1,
                        r->slot_samples);
    if ((uint64_t)info->frames < least)
        return complain(
            why, -EINVAL,
            "%s: %" PRId64 " frames, but the slot of the last of %zu speakers "
            "begins at frame %zu (slot_samples %zu)",
            path, (int64_t)info->frames, r->n_speakers, least - 1, r->slot_samples);
    return 0;
}

static SNDFILE *open_file(const struct recording *r, const char *path, SF_INFO *info,
                          int *err, struct complaint *why)
{
    SNDFILE *f;
    *err = wav_open(&f, info, path, why);
    if (!*err)
        *err = check_info(r, path, info, why);
    if (!*err)
        return f;
    if (f)
        sf_close(f);
    return NULL;
}

static int check_files(struct recording *r, struct complaint *why)
{
    SF_INFO info;
    for (size_t i = 0; i < r->n_files; i++) {
        int err = check_size(r->paths[i], why);
        if (err)
            return err;
        SNDFILE *f = open_file(r, r->paths[i], &info, &err, why);
        if (err)
            return err;
        r->n_samples = (uint64_t)info.frames;
        r->n_held = (size_t)info.frames / r->slot_samples;
        sf_close(f);
    }
    return 0;
}

static int check_emissions(const struct recording *r, const char *folder,
                           uint64_t n_samples, struct complaint *why)
{
    const struct emission *last = &r->emissions[r->n_emissions - 1];

    if (last->sample < n_samples)
        return 0;
    return complain(why, -EINVAL,
                    "%s/" EMISSIONS_FILE ": the last emission is at sample %" PRIu64
                    ", but %s holds %" PRIu64,
                    folder, last->sample, r->paths[0], n_samples);
}

/* Of an array that stands. */
static int list_emissions(struct recording *r, const char *folder, const struct survey *s,
                          struct complaint *why)
{
    char *path;
    int err = 0;

    if (asprintf(&path, "%s/" EMISSIONS_FILE, folder) < 0)
        return complain(why, -ENOMEM, "%s: out of memory", folder);
    r->has_table = !access(path, F_OK);
    if (r->has_table)
        err = emissions_load(&r->emissions, &r->n_emissions, path, s, why);
    free(path);
    return err;
}

static int complete_emissions(struct recording *r, const char *folder,
                              const struct survey *s, struct complaint *why)
{
    if (r->has_table)
        return check_emissions(r, folder, r->n_samples, why);
    /* What follows the last speaker's slot is its tail. */
    uint64_t n = r->n_samples <= r->n_frames ? 1 : r->n_samples;
    return emissions_in_turn(&r->emissions, &r->n_emissions, s, n)
               ? complain(why, -ENOMEM, "%s: out of memory", folder)
               : 0;
}

int recording_open(struct recording **out, const char *folder, const struct survey *s,
                   struct complaint *why)
{
    *out = NULL;
    struct recording *r = calloc(1, sizeof *r);
    if (!r)
        return complain(why, -ENOMEM, "%s: out of memory", folder);
    r->n_positions = s->n_positions;
    r->n_files = s->pings_m ? 1 : s->n_positions;
    r->n_speakers = s->n_speakers;
    r->n_microphones = s->n_microphones;
    r->slot_samples = s->slot_samples;
    r->sample_rate_hz = s->sample_rate_hz;
    r->n_slots = s->pings_m ? s->n_positions : survey_slots(s, s->n_speakers);
    r->n_frames = survey_slots(s, s->n_speakers) * s->slot_samples + tail_samples(s);
    r->n_ping = s->slot_samples + tail_samples(s);
    bool stands = s->n_positions == 1 && !s->pings_m;
    int err = stands ? list_emissions(r, folder, s, why) : 0;
    if (!err)
        err = list_files(r, folder, why);
    if (!err)
        err = check_files(r, why);
    if (!err && stands)
        err = complete_emissions(r, folder, s, why);
    if (err)
        recording_close(r);
    else
        *out = r;
    return err;
}

size_t recording_frames(const struct recording *r)
{
    return r->n_frames;
}

size_t recording_spare_slots(const struct recording *r)
{
    bool one_file = r->n_files != r->n_positions;
    return one_file && r->n_held > r->n_slots ? r->n_held - r->n_slots : 0;
}

static bool is_float(const SF_INFO *info)
{
    int format = info->format & SF_FORMAT_SUBMASK;
    return format == SF_FORMAT_FLOAT || format == SF_FORMAT_DOUBLE;
}

/* Block by block: what was read is still in the cache when it is separated. */
static int read_frames(SNDFILE *f, const struct wav_samples *w, size_t n, float *samples,
                       const char *path, struct complaint *why)
{
    float *block = malloc(BLOCK_FRAMES * w->n_channels * sizeof *block);
    size_t at = 0;
    if (!block)
        return complain(why, -ENOMEM, "%s: out of memory", path);
    while (at < n) {
        size_t wanted = n - at < BLOCK_FRAMES ? n - at : BLOCK_FRAMES;
        sf_count_t got = sf_readf_float(f, block, (sf_count_t)wanted);
        if (got <= 0)
            break;
        wav_samples_separate(w, block, at, (size_t)got, samples);
        at += (size_t)got;
    }
    free(block);
    if (at < n)
        return complain(why, -EIO, "%s: broken off after %zu of %zu frames", path, at, n);
    wav_samples_finish(w, n, samples);
    return 0;
}

int recording_read_slots(const struct recording *r, size_t position, float *samples,
                         uint32_t *clipped, uint32_t *not_finite, struct complaint *why)
{
    SF_INFO info;
    int err;
    if (position >= r->n_positions)
        return complain(why, -EINVAL, "position %zu of %zu", position, r->n_positions);
    if (r->has_table)
        return complain(why, -EINVAL,
                        "%s: beside it " EMISSIONS_FILE " tells of an array that stands "
                        "(scan: {mode: fixed}); 'anlos bag import' makes a bag of it, "
                        "for 'anlos recon --bag'",
                        r->paths[0]);
    bool one_file = r->n_files != r->n_positions;
    const char *path = r->paths[one_file ? 0 : position];
    SNDFILE *f = open_file(r, path, &info, &err, why);
    if (err)
        return err;
    struct wav_samples w = {.n_channels = r->n_microphones,
                            .n_frames = r->n_frames,
                            .n_slots = one_file ? 1 : r->n_slots,
                            .slot_samples = r->slot_samples,
                            .is_float = is_float(&info)};
    size_t first = one_file ? position * r->slot_samples : 0;
    size_t n = (size_t)info.frames - first;
    n = n < r->n_frames ? n : r->n_frames;
    if (first && sf_seek(f, (sf_count_t)first, SEEK_SET) < 0)
        err = complain(why, -EIO, "%s: broken off before frame %zu", path, first);
    if (!err)
        err = read_frames(f, &w, n, samples, path, why);
    if (!err)
        wav_samples_count(&w, samples, n, clipped, not_finite);
    sf_close(f);
    return err;
}

const struct emission *recording_emissions(const struct recording *r, size_t *n)
{
    *n = r->n_emissions;
    return r->emissions;
}

uint64_t recording_samples(const struct recording *r)
{
    return r->n_samples;
}

bool recording_goes_on(const struct recording *r)
{
    return r->has_table || (r->emissions && r->n_samples > r->n_frames);
}

int recording_read_emission(const struct recording *r, size_t i, float *samples,
                            uint32_t *clipped, uint32_t *not_finite,
                            struct complaint *why)
{
    SF_INFO info;
    int err;
    if (i >= r->n_emissions)
        return complain(why, -EINVAL, "emission %zu of %zu", i, r->n_emissions);
    SNDFILE *f = open_file(r, r->paths[0], &info, &err, why);
    if (err)
        return err;
    struct wav_samples w = {.n_channels = r->n_microphones,
                            .n_frames = r->n_ping,
                            .n_slots = 1,
                            .slot_samples = r->n_ping,
                            .is_float = is_float(&info)};
    uint64_t first = r->emissions[i].sample, end = (uint64_t)info.frames;
    uint64_t left = first < end ? end - first : 0;
    size_t n = left < r->n_ping ? (size_t)left : r->n_ping;
    if (first && n && sf_seek(f, (sf_count_t)first, SEEK_SET) < 0)
        err = complain(why, -EIO, "%s: broken off before frame %" PRIu64, r->paths[0],
                       first);
    if (!err)
        err = read_frames(f, &w, n, samples, r->paths[0], why);
    if (!err)
        wav_samples_count(&w, samples, n, clipped, not_finite);
    sf_close(f);
    return err;
}

int recording_read(const struct recording *r, size_t position, float *samples,
                   uint32_t *clipped, uint32_t *not_finite, struct complaint *why)
{
    size_t n = r->n_speakers * r->n_microphones;
    uint32_t *counts = calloc(2 * n, sizeof *counts);
    if (!counts)
        return complain(why, -ENOMEM, "out of memory");
    int err = recording_read_slots(r, position, samples, counts, counts + n, why);
    memset(clipped, 0, r->n_microphones * sizeof *clipped);
    memset(not_finite, 0, r->n_microphones * sizeof *not_finite);
    for (size_t i = 0; i < n && !err; i++) {
        clipped[i % r->n_microphones] += counts[i];
        not_finite[i % r->n_microphones] += counts[n + i];
    }
    free(counts);
    return err;
}

void recording_close(struct recording *r)
{
    if (!r)
        return;
    for (size_t i = 0; r->paths && i < r->n_files; i++)
        free(r->paths[i]);
    free(r->paths);
    free(r->emissions);
    free(r);
}
