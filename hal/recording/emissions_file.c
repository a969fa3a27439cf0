#include "hal/recording/emissions_file.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>

#include "hal/decimal.h"
#include "hal/table_file.h"

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

static struct emission *append(struct emissions *t)
{
    if (t->n == t->room) {
        size_t room = t->room ? 2 * t->room : 256;
        struct emission *grown = realloc(t->list, room * sizeof *grown);
        if (!grown)
            return NULL;
        t->list = grown;
        t->room = room;
    }
    return &t->list[t->n];
}

static const char *take_row(void *ctx, char *const *fields)
{
    struct emissions *t = ctx;
    struct emission *e = append(t);

    if (!e)
        return "out of memory";
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
                   const struct survey *s, struct complaint *why)
{
    struct emissions t = {.survey = s,
                          .heard_in = calloc(s->n_speakers, sizeof *t.heard_in)};
    int err = t.heard_in ? table_load(path, columns, N_COLUMNS, take_row, &t, why)
                         : complain(why, -ENOMEM, "%s: out of memory", path);

    free(t.heard_in);
    if (!err && !t.n)
        err = complain(why, -EINVAL, "%s: expected a line for each emission, found none",
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
