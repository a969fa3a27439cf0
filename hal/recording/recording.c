/* SPDX-License-Identifier: MIT */
#include "hal/recording/recording.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <sndfile.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "dsp/list.h"
#include "hal/recording/riff.h"
#include "hal/table_file.h"
#include "hal/text_file.h"
#include "recon/tail.h"

enum { SAMPLE, SPEAKER, FRAME, DOWN, VALID, TIME, TEMPERATURE, N_COLUMNS };

static const struct table_column columns[N_COLUMNS] = {
    [SAMPLE] = {"sample", true},
    [SPEAKER] = {"speaker", true},
    [FRAME] = {"frame", false},
    [DOWN] = {"down", false},
    [VALID] = {"valid", false},
    [TIME] = {"time_s", false},
    [TEMPERATURE] = {"temperature_c", false}};

struct emissions {
    const struct survey *survey;
    struct emission *list; /* [n] of [room] */
    size_t n, room;
    uint64_t *heard_in; /* [n_speakers], the frame of its newest turn; 0: had none */
    size_t in_frame;    /* emissions of the newest frame so far */
    char text[160];
};

static const char *take_numbers(const struct emissions *t, char *const *f,
                                struct emission *e)
{
    uint64_t speaker, frame = 1, down = 0, valid = 1;

    if (!table_count(f[SAMPLE], INT64_MAX, &e->sample))
        return "sample: expected a whole number from 0";
    if (!table_count(f[SPEAKER], t->survey->n_speakers - 1, &speaker))
        return "speaker: expected a whole number from 0, of the survey's speakers_m";
    if (f[FRAME] && (!table_count(f[FRAME], UINT32_MAX, &frame) || !frame))
        return "frame: expected a whole number from 1";
    if (f[DOWN] && !table_count(f[DOWN], t->survey->chirp_alternates, &down))
        return t->survey->chirp_alternates
                   ? "down: expected 0 or 1"
                   : "down: expected 0, as the survey's chirps do not alternate";
    if (f[VALID] && !table_count(f[VALID], 1, &valid))
        return "valid: expected 0 or 1";
    e->speaker = (uint32_t)speaker;
    e->frame = (uint32_t)frame;
    e->down = down;
    e->valid = valid;
    e->temperature_c = NAN;
    if (f[TEMPERATURE] && *f[TEMPERATURE] &&
        !table_number(f[TEMPERATURE], &e->temperature_c))
        return "temperature_c: expected degrees, or nothing";
    e->has_time = f[TIME];
    if (f[TIME] && !table_time(f[TIME], &e->time_ns))
        return "time_s: expected seconds from 0";
    return NULL;
}

/* What the file does not name. */
static void complete(struct emissions *t, char *const *f, struct emission *e)
{
    uint32_t newest = t->n ? t->list[t->n - 1].frame : 1;

    if (!f[FRAME])
        e->frame = t->heard_in[e->speaker] == newest ? newest + 1 : newest;
    t->in_frame = e->frame == newest ? t->in_frame : 0;
    if (!f[DOWN])
        e->down = survey_is_down(t->survey, t->in_frame);
    t->in_frame++;
    t->heard_in[e->speaker] = e->frame;
}

static const char *take_row(void *ctx, char *const *fields)
{
    struct emissions *t = ctx;

    if (list_grow(&t->list, t->n, &t->room, sizeof *t->list))
        return "out of memory";
    struct emission *e = &t->list[t->n];
    const char *wrong = take_numbers(t, fields, e);
    if (wrong)
        return wrong;
    if (t->n && e->sample < t->list[t->n - 1].sample)
        return "sample: before that of the line above";
    complete(t, fields, e);
    t->n++;
    return NULL;
}

int emissions_load(struct emission **out, size_t *n, const char *path,
                   const struct survey *s, struct error *why)
{
    struct emissions t = {.survey = s,
                          .heard_in = calloc(s->n_speakers, sizeof *t.heard_in)};
    int err = t.heard_in ? table_load(path, columns, N_COLUMNS, take_row, &t, why)
                         : error_say(why, -ENOMEM, "%s: out of memory", path);

    free(t.heard_in);
    if (!err && !t.n)
        err = error_say(why, -EINVAL, "%s: expected a line for each emission, found none",
                        path);
    if (err) {
        free(t.list);
        return err;
    }
    *out = t.list;
    *n = t.n;
    return 0;
}

int emissions_in_turn(struct emission **out, size_t *n, const struct survey *s,
                      uint64_t n_samples)
{
    size_t slots = survey_slots(s, s->n_speakers);
    size_t rounds = (size_t)(n_samples / ((uint64_t)slots * s->slot_samples)) + 1;

    *n = 0;
    *out = calloc(rounds * s->n_speakers, sizeof **out);
    if (!*out)
        return -ENOMEM;
    for (size_t k = 0; k < rounds * s->n_speakers; k++) {
        size_t in_round = k % s->n_speakers, round = k / s->n_speakers;
        uint64_t slot = (uint64_t)round * slots + survey_slot_of(s, in_round);
        if ((slot + 1) * s->slot_samples > n_samples && round)
            continue; /* cut off; of the first round it may be silent at its end */
        (*out)[(*n)++] = (struct emission){.sample = slot * s->slot_samples,
                                           .speaker = (uint32_t)in_round,
                                           .frame = (uint32_t)round + 1,
                                           .down = survey_is_down(s, in_round),
                                           .valid = true,
                                           .temperature_c = s->temperature_c};
    }
    return 0;
}

void emission_print(FILE *f, const struct emission *e)
{
    char text[DECIMAL_SIZE] = "";

    if (!e) {
        fputs("sample,speaker,frame,down,valid,time_s,temperature_c\n", f);
        return;
    }
    if (!isnan(e->temperature_c))
        decimal_print(e->temperature_c, text);
    fprintf(f, "%" PRIu64 ",%u,%u,%d,%d,%" PRId64 ".%09" PRId64 ",%s\n", e->sample,
            e->speaker, e->frame, e->down, e->valid, e->time_ns / 1000000000,
            e->time_ns % 1000000000, text);
}

enum { BLOCK_FRAMES = 2048 };

struct recording {
    size_t n_positions, n_speakers, n_microphones, slot_samples, n_frames;
    size_t n_slots; /* of a position */
    bool one_file;  /* whose slots are those of all positions, one behind the other */
    size_t n_held;  /* whole slots that are in the one file of pings */
    double sample_rate_hz;
    size_t n_files; /* one a position, or one */
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

static int list_files(struct recording *r, const char *folder, struct error *why)
{
    struct dirent **entries = NULL;
    int n = scandir(folder, &entries, select_wav, by_name), n_found = n, err = 0;
    if (n < 0)
        return error_say(why, -errno, "%s: no folder of WAV files: %s", folder,
                         strerror(errno));
    if (n > 1 && r->one_file)
        n = leave_out_replicas(r, folder, entries, n);
    if (n == 0)
        err = error_say(why, -EINVAL, "%s: expected %zu WAV files, found none", folder,
                        r->n_files);
    else if ((size_t)n != r->n_files && r->one_file)
        err = error_say(why, -EINVAL,
                        "%s: %d WAV files, but the survey names pings, or a stage that "
                        "is continuous; expected one file of consecutive slots",
                        folder, n);
    else if ((size_t)n != r->n_files)
        err = error_say(why, -EINVAL,
                        "%s: %d WAV files, but the survey's stage.positions_m has %zu "
                        "entries; expected one file for each",
                        folder, n, r->n_positions);
    else if (join_paths(r, folder, entries) < 0)
        err = error_say(why, -ENOMEM, "%s: out of memory", folder);
    for (int i = 0; i < n_found; i++)
        free(entries[i]);
    free(entries);
    return err;
}

static int check_size(const char *path, struct error *why)
{
    uint64_t promised, present;
    int err = riff_data_size(path, &promised, &present);
    if (err)
        return wav_error_say(why, err, path);
    if (present < promised)
        return error_say(why, -EINVAL,
                         "%s: truncated: its header promises %" PRIu64
                         " bytes of sound, %" PRIu64 " are there",
                         path, promised, present);
    return 0;
}

static int check_info(const struct recording *r, const char *path, const SF_INFO *info,
                      struct error *why)
{
    size_t slots = r->one_file ? r->n_positions * r->n_slots : r->n_slots;
    size_t least = r->has_table ? 1 : (slots - 1) * r->slot_samples + 1;
    if (info->samplerate != (int)(r->sample_rate_hz + 0.5))
        return error_say(why, -EINVAL, "%s: %d Hz, but the survey's sample_rate_hz is %g",
                         path, info->samplerate, r->sample_rate_hz);
    if (info->channels < 1 || (size_t)info->channels != r->n_microphones)
        return error_say(
            why, -EINVAL,
            "%s: %d channels, but the survey's microphones_m has %zu entries", path,
            info->channels, r->n_microphones);
    if (info->frames < 1)
        return error_say(why, -EINVAL, "%s: holds no sound; expected %zu frames", path,
                         slots * r->slot_samples);
    if ((uint64_t)info->frames < least && r->one_file)
        return error_say(why, -EINVAL,
                         "%s: %" PRId64 " frames, but the slot of the last of %zu pings "
                         "begins at frame %zu (slot_samples %zu)",
                         path, (int64_t)info->frames, r->n_positions * r->n_speakers,
                         least - 1, r->slot_samples);
    if ((uint64_t)info->frames < least)
        return error_say(
            why, -EINVAL,
            "%s: %" PRId64 " frames, but the slot of the last of %zu speakers "
            "begins at frame %zu (slot_samples %zu)",
            path, (int64_t)info->frames, r->n_speakers, least - 1, r->slot_samples);
    return 0;
}

static SNDFILE *open_file(const struct recording *r, const char *path, SF_INFO *info,
                          int *err, struct error *why)
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

static int check_files(struct recording *r, struct error *why)
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
                           uint64_t n_samples, struct error *why)
{
    const struct emission *last = &r->emissions[r->n_emissions - 1];

    if (last->sample < n_samples)
        return 0;
    return error_say(why, -EINVAL,
                     "%s/" EMISSIONS_FILE ": the last emission is at sample %" PRIu64
                     ", but %s holds %" PRIu64,
                     folder, last->sample, r->paths[0], n_samples);
}

/* Of an array that stands. */
static int list_emissions(struct recording *r, const char *folder, const struct survey *s,
                          struct error *why)
{
    char *path;
    int err = 0;

    if (asprintf(&path, "%s/" EMISSIONS_FILE, folder) < 0)
        return error_say(why, -ENOMEM, "%s: out of memory", folder);
    r->has_table = !access(path, F_OK);
    if (r->has_table)
        err = emissions_load(&r->emissions, &r->n_emissions, path, s, why);
    free(path);
    return err;
}

static int complete_emissions(struct recording *r, const char *folder,
                              const struct survey *s, struct error *why)
{
    if (r->has_table)
        return check_emissions(r, folder, r->n_samples, why);
    /* What follows the last speaker's slot is its tail. */
    uint64_t n = r->n_samples <= r->n_frames ? 1 : r->n_samples;
    return emissions_in_turn(&r->emissions, &r->n_emissions, s, n)
               ? error_say(why, -ENOMEM, "%s: out of memory", folder)
               : 0;
}

int recording_open(struct recording **out, const char *folder, const struct survey *s,
                   struct error *why)
{
    *out = NULL;
    struct recording *r = calloc(1, sizeof *r);
    if (!r)
        return error_say(why, -ENOMEM, "%s: out of memory", folder);
    r->n_positions = s->n_positions;
    r->one_file = s->pings_m || s->continuous;
    r->n_files = r->one_file ? 1 : s->n_positions;
    r->n_speakers = s->n_speakers;
    r->n_microphones = s->n_microphones;
    r->slot_samples = s->slot_samples;
    r->sample_rate_hz = s->sample_rate_hz;
    r->n_slots = survey_slots(s, s->n_speakers);
    r->n_frames = survey_slots(s, s->n_speakers) * s->slot_samples + tail_samples(s);
    r->n_ping = s->slot_samples + tail_samples(s);
    bool stands = s->n_positions == 1 && !s->pings_m;
    int err = stands ? list_emissions(r, folder, s, why) : 0;
    if (!err)
        err = list_files(r, folder, why);
    if (!err)
        err = check_files(r, why);
    if (s->continuous)
        r->n_held = 0;
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
    return r->one_file && r->n_held > r->n_positions ? r->n_held - r->n_positions : 0;
}

static bool is_float(const SF_INFO *info)
{
    int format = info->format & SF_FORMAT_SUBMASK;
    return format == SF_FORMAT_FLOAT || format == SF_FORMAT_DOUBLE;
}

/* Block by block: what was read is still in the cache when it is separated. */
static int read_frames(SNDFILE *f, const struct wav_samples *w, size_t n, float *samples,
                       const char *path, struct error *why)
{
    float *block = malloc(BLOCK_FRAMES * w->n_channels * sizeof *block);
    size_t at = 0;
    if (!block)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
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
        return error_say(why, -EIO, "%s: broken off after %zu of %zu frames", path, at,
                         n);
    wav_samples_finish(w, n, samples);
    return 0;
}

int recording_read_slots(const struct recording *r, size_t position, float *samples,
                         uint32_t *clipped, uint32_t *not_finite, struct error *why)
{
    SF_INFO info;
    int err;
    if (position >= r->n_positions)
        return error_say(why, -EINVAL, "position %zu of %zu", position, r->n_positions);
    if (r->has_table)
        return error_say(why, -EINVAL,
                         "%s: beside it " EMISSIONS_FILE " tells of an array that stands "
                         "(scan: {mode: fixed}); 'anlos bag import' makes a bag of it, "
                         "for 'anlos recon --bag'",
                         r->paths[0]);
    const char *path = r->paths[r->one_file ? 0 : position];
    SNDFILE *f = open_file(r, path, &info, &err, why);
    if (err)
        return err;
    struct wav_samples w = {.n_channels = r->n_microphones,
                            .n_frames = r->n_frames,
                            .n_slots = r->n_slots,
                            .slot_samples = r->slot_samples,
                            .is_float = is_float(&info)};
    size_t first = r->one_file ? position * r->n_slots * r->slot_samples : 0;
    size_t n = (size_t)info.frames - first;
    n = n < r->n_frames ? n : r->n_frames;
    if (first && sf_seek(f, (sf_count_t)first, SEEK_SET) < 0)
        err = error_say(why, -EIO, "%s: broken off before frame %zu", path, first);
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
                            uint32_t *clipped, uint32_t *not_finite, struct error *why)
{
    SF_INFO info;
    int err;
    if (i >= r->n_emissions)
        return error_say(why, -EINVAL, "emission %zu of %zu", i, r->n_emissions);
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
        err = error_say(why, -EIO, "%s: broken off before frame %" PRIu64, r->paths[0],
                        first);
    if (!err)
        err = read_frames(f, &w, n, samples, r->paths[0], why);
    if (!err)
        wav_samples_count(&w, samples, n, clipped, not_finite);
    sf_close(f);
    return err;
}

int recording_read(const struct recording *r, size_t position, float *samples,
                   uint32_t *clipped, uint32_t *not_finite, struct error *why)
{
    size_t n = r->n_speakers * r->n_microphones;
    uint32_t *counts = calloc(2 * n, sizeof *counts);
    if (!counts)
        return error_say(why, -ENOMEM, "out of memory");
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

int recording_check_background(const struct recording *r, const char *name,
                               const struct recording *background,
                               const char *background_name, struct error *why)
{
    const size_t positions[] = {0, r->n_positions / 2, r->n_positions - 1};
    const struct recording *const both[2] = {r, background};
    size_t n = r->n_microphones * recording_frames(r);
    float *samples = malloc(2 * n * sizeof *samples);
    uint32_t *counts = malloc(2 * r->n_microphones * sizeof *counts);
    int err = samples && counts ? 0 : error_say(why, -ENOMEM, "out of memory");
    bool same = true;

    for (size_t i = 0; !err && same && i < sizeof positions / sizeof *positions; i++) {
        for (int k = 0; !err && k < 2; k++)
            err = recording_read(both[k], positions[i], samples + (size_t)k * n, counts,
                                 counts + r->n_microphones, why);
        same = !err && !memcmp(samples, samples + n, n * sizeof *samples);
    }
    free(samples);
    free(counts);
    return !err && same ? error_say(why, -EINVAL,
                                    "%s: the same sound as %s, of which nothing would be "
                                    "left; expected the room without what is hidden",
                                    background_name, name)
                        : err;
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

enum { WRITE_BLOCK_FRAMES = 4096 };

/* From frame `from` on, of samples [n_microphones][n_frames]. */
static int write_frames(SNDFILE *f, size_t n_microphones, size_t n_frames, size_t from,
                        const float *samples)
{
    float *block = malloc(n_microphones * WRITE_BLOCK_FRAMES * sizeof *block);
    int err = 0;
    if (!block)
        return -ENOMEM;
    for (size_t at = from; at < n_frames && !err; at += WRITE_BLOCK_FRAMES) {
        size_t n = n_frames - at < WRITE_BLOCK_FRAMES ? n_frames - at
                                                      : WRITE_BLOCK_FRAMES;
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
                    struct error *why)
{
    char *path = NULL, *partial = NULL;
    SF_INFO info = {.samplerate = (int)lround(sample_rate_hz),
                    .channels = (int)n_microphones,
                    .format = SF_FORMAT_WAV | SF_FORMAT_FLOAT};
    int err = 0;
    if (asprintf(&path, "%s/pos%02zu.wav", folder, position) < 0)
        return error_say(why, -ENOMEM, "%s: out of memory", folder);
    if (asprintf(&partial, "%s.part", path) < 0) {
        partial = NULL;
        err = error_say(why, -ENOMEM, "%s: out of memory", folder);
        goto names;
    }
    SNDFILE *f = sf_open(partial, SFM_WRITE, &info);
    if (!f) {
        err = error_say(why, -EIO, "%s cannot be written: %s", path, sf_strerror(NULL));
        goto names;
    }
    /* It would hold the time of now: equal recordings are equal files. */
    sf_command(f, SFC_SET_ADD_PEAK_CHUNK, NULL, SF_FALSE);
    err = write_frames(f, n_microphones, n_frames, 0, samples);
    errno = 0;
    if (sf_close(f) && !err)
        err = errno ? -errno : -EIO;
    if (!err && rename(partial, path) < 0)
        err = -errno;
    if (err) {
        unlink(partial);
        error_say(why, err, "%s cannot be written: %s", path, strerror(-err));
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

static int error_say_of(const struct recording_writer *w, int err, struct error *why)
{
    return error_say(why, err, "%s cannot be written: %s", w->path, strerror(-err));
}

int recording_writer_open(struct recording_writer **out, const char *folder,
                          const struct survey *s, struct error *why)
{
    struct recording_writer *w = calloc(1, sizeof *w);
    SF_INFO info = {.samplerate = (int)lround(s->sample_rate_hz),
                    .channels = (int)s->n_microphones,
                    .format = SF_FORMAT_RF64 | SF_FORMAT_FLOAT};
    int err = 0;

    *out = w;
    if (!w)
        return error_say(why, -ENOMEM, "%s: out of memory", folder);
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
        err = error_say(why, -ENOMEM, "%s: out of memory", folder);
        goto fail;
    }
    w->table = fopen(w->table_path, "wxe");
    if (!w->table) {
        err = error_say(why, -errno, "%s cannot be written: %s", w->table_path,
                        strerror(errno));
        goto fail;
    }
    w->file = sf_open(w->path, SFM_WRITE, &info);
    if (!w->file) {
        err =
            error_say(why, -EIO, "%s cannot be written: %s", w->path, sf_strerror(NULL));
        goto table;
    }
    /* A plain WAV file as long as it is short enough for one. */
    sf_command(w->file, SFC_RF64_AUTO_DOWNGRADE, NULL, SF_TRUE);
    sf_command(w->file, SFC_SET_ADD_PEAK_CHUNK, NULL, SF_FALSE);
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
static int write_append(struct recording_writer *w, const float *samples, size_t from)
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
                         const float *samples, struct error *why)
{
    uint64_t at = find_place(w, e, samples);
    int err = fill(w, at);

    if (!err && at + w->n_ping > w->n_written)
        err = write_append(w, samples, (size_t)(w->n_written - at));
    if (err)
        return error_say_of(w, err, why);
    w->last = *e;
    w->last.sample = at;
    emission_print(w->table, &w->last);
    return 0;
}

int recording_writer_close(struct recording_writer *w, int err, struct error *why)
{
    if (!w)
        return err;
    errno = 0;
    if (sf_close(w->file) && !err)
        err = error_say_of(w, errno ? -errno : -EIO, why);
    errno = 0;
    bool failed = ferror(w->table);
    if ((fclose(w->table) || failed) && !err) {
        err = errno ? -errno : -EIO;
        error_say(why, err, "%s cannot be written: %s", w->table_path, strerror(-err));
    }
    writer_free(w);
    return err;
}
