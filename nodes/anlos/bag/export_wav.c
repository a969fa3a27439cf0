/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "dsp/list.h"
#include "hal/recording/recording.h"
#include "hal/survey/file.h"
#include "msgs/array.pb-c.h"
#include "msgs/convert.h"
#include "msgs/tensor.h"
#include "nodes/anlos/bag/ego_table.h"
#include "nodes/anlos/bag/export.h"
#include "nodes/anlos/bag/stream.h"
#include "nodes/rt/export.h"
#include "recon/survey.h"
#include "recon/tail.h"

/* Which pings of a bag make up a scan: of each emission the last one that is valid, as
 * pings that failed were taken again. */

struct takes {
    struct survey survey; /* its stage positions are where the stage really stood, unless
                           * it did not stop */
    uint32_t scan;
    uint64_t n_retaken;  /* pings that another one stands for */
    uint64_t n_unplaced; /* of the scan, but not of the survey */
    uint64_t n_others;   /* of other scans */
    bool has_background;
    bool endless; /* of an array that stands: all of its pings count, and nothing of what
                   * follows is filled in */
    /* Number from 1 of the message in the stream, 0: there is none. */
    uint64_t *chosen; /* [2 passes][n_positions][n_speakers] */
    size_t n_missing; /* of the passes that there are */
};

#define MOST_SURVEYS 1000 /* of different ids, which are compared with one another */

struct fact { /* of a ping */
    uint64_t number, survey_id;
    double stage_m;
    uint32_t scan, pass, position, speaker, frame;
    bool valid;
};

struct facts {
    struct fact *list; /* [n] */
    size_t n, room;
    Anlos__Survey **surveys; /* [n_surveys], of different ids */
    size_t n_surveys, surveys_room;
    uint64_t newest_id; /* of what does not say of which survey it is */
};

static int add_survey(struct facts *f, Anlos__Survey *survey)
{
    survey_complete_id(survey);
    f->newest_id = survey->id;
    size_t i = 0;
    while (i < f->n_surveys && f->surveys[i]->id != survey->id)
        i++;
    bool is_new = i == f->n_surveys;
    int err = !is_new ? 0
              : i == MOST_SURVEYS
                  ? -EFBIG
                  : list_grow(&f->surveys, i, &f->surveys_room, sizeof(Anlos__Survey *));
    if (is_new && !err)
        f->surveys[f->n_surveys++] = survey;
    else
        anlos__survey__free_unpacked(survey, NULL);
    return err;
}

static int add_ping(struct facts *f, const Anlos__Ping *p, uint64_t number)
{
    if (list_grow(&f->list, f->n, &f->room, sizeof *f->list))
        return -ENOMEM;
    f->list[f->n++] =
        (struct fact){.number = number,
                      .survey_id = p->survey_id ? p->survey_id : f->newest_id,
                      .stage_m = p->stage_m,
                      .scan = p->scan,
                      .pass = p->pass,
                      .position = p->position,
                      .speaker = p->speaker,
                      .frame = p->frame,
                      .valid = p->valid};
    return 0;
}

static int read_facts(struct facts *f, struct stream *s, struct error *why)
{
    struct stream_message m;
    uint64_t number = 0;
    int err = 0;

    while (!err && !(err = stream_next(s, &m, why))) {
        ProtobufCMessage *content;
        err = stream_unpack(&content, s, &m, why);
        number++;
        if (err)
            return err;
        if (m.topic == topic_survey()) {
            err = add_survey(f, (Anlos__Survey *)content);
        } else {
            err = add_ping(f, (Anlos__Ping *)content, number);
            protobuf_c_message_free_unpacked(content, NULL);
        }
        if (err == -EFBIG)
            error_say(why, err, "more than %d different surveys", MOST_SURVEYS);
        else if (err)
            error_say(why, err, "out of memory");
    }
    return err == -ENODATA ? 0 : err;
}

static void free_facts(struct facts *f)
{
    for (size_t i = 0; i < f->n_surveys; i++)
        anlos__survey__free_unpacked(f->surveys[i], NULL);
    free(f->surveys);
    free(f->list);
}

/* The last ping of the scan says which survey is its. */
static int choose_survey(struct takes *t, const struct facts *f, size_t scan,
                         uint64_t *id, struct error *why)
{
    const struct fact *last = NULL;

    for (size_t i = 0; i < f->n; i++)
        if (!scan || f->list[i].scan == scan)
            last = &f->list[i];
    if (!last)
        return scan ? error_say(why, -ENODATA, "no pings of scan %zu", scan)
                    : error_say(why, -ENODATA, "no pings");
    t->scan = last->scan;
    *id = last->survey_id;
    for (size_t i = 0; i < f->n_surveys; i++)
        if (f->surveys[i]->id == *id)
            return survey_from_message(&t->survey, f->surveys[i], why);
    return error_say(why, -ENODATA, "the survey of the pings is not in the bag");
}

static bool find_slot(const struct takes *t, uint32_t pass, uint32_t position,
                      uint32_t speaker, size_t *slot)
{
    const struct survey *s = &t->survey;

    *slot = ((size_t)pass * s->n_positions + position) * s->n_speakers + speaker;
    return pass < 2 && position < s->n_positions && speaker < s->n_speakers;
}

/* Of an array that stands: is it one of them? */
static bool takes_has(const struct takes *t, const Anlos__Ping *p)
{
    size_t slot;

    return p->scan == t->scan &&
           (!p->survey_id || p->survey_id == survey_id(&t->survey)) &&
           find_slot(t, (uint32_t)p->pass, p->position, p->speaker, &slot);
}

/* The place of a ping among chosen; false: it is none of the scan's. */
static bool takes_slot(const struct takes *t, const Anlos__Ping *p, size_t *slot)
{
    return find_slot(t, (uint32_t)p->pass, p->position, p->speaker, slot);
}

static void choose(struct takes *t, const struct facts *f, uint64_t survey_id)
{
    size_t slot;

    for (size_t i = 0; i < f->n; i++) {
        const struct fact *p = &f->list[i];
        if (p->scan != t->scan) {
            t->n_others++;
            continue;
        }
        if (p->survey_id != survey_id ||
            !find_slot(t, p->pass, p->position, p->speaker, &slot)) {
            t->n_unplaced++;
            continue;
        }
        t->has_background |= p->pass == ANLOS__PASS__BACKGROUND;
        t->endless |= p->frame != 0;
        if (t->endless)
            continue;
        t->n_retaken += !p->valid || t->chosen[slot];
        if (!p->valid)
            continue;
        t->chosen[slot] = p->number;
        if (!t->survey.pings_m && !t->survey.continuous && isfinite(p->stage_m))
            t->survey.stage_positions_m[p->position] = p->stage_m;
    }
}

/* Reads all of the stream; scan 0: the last one.  Clear with takes_clear, also after an
 * error.  0, -ENODATA (no pings, or none of that scan, or no survey of theirs), -EBADMSG,
 * -EFBIG (surveys without number), errors of stream_next. */
static int takes_find(struct takes *t, struct stream *s, size_t scan, struct error *why)
{
    struct facts f = {.list = NULL};
    uint64_t id = 0;

    memset(t, 0, sizeof *t);
    int err = read_facts(&f, s, why);
    if (!err)
        err = choose_survey(t, &f, scan, &id, why);
    size_t n = t->survey.n_positions * t->survey.n_speakers;
    if (!err) {
        t->chosen = calloc(2 * n, sizeof *t->chosen);
        err = t->chosen ? 0 : error_say(why, -ENOMEM, "out of memory");
    }
    if (!err) {
        choose(t, &f, id);
        for (size_t i = 0; !t->endless && i < (t->has_background ? 2 * n : n); i++)
            t->n_missing += !t->chosen[i];
    }
    free_facts(&f);
    return err;
}

static void takes_clear(struct takes *t)
{
    survey_clear(&t->survey);
    free(t->chosen);
    memset(t, 0, sizeof *t);
}

struct wav_file {   /* that is being filled */
    float *samples; /* [n_microphones][n_frames]; NULL: not begun, or written */
    size_t n_left;  /* pings that are still to come */
};

struct wav_set {
    struct takes takes;
    struct export_stage stage;
    char folders[2][PATH_MAX];         /* scene, background; inside the stage */
    size_t n_files, n_slots, n_frames; /* files of a pass; pings and frames of a file */
    struct wav_file *files;            /* [2][n_files] */
    uint64_t n_clipped;
    uint64_t n_endless, n_egos; /* pings of an array that stands; messages of motion */
    struct recording_writer *writers[2];
};

static const char *const pass_names[2] = {"scene", "background"};

static int check_vacant(const char *out, struct error *why)
{
    static const char *const names[] = {"scene",
                                        "background",
                                        "calibration",
                                        "survey.yaml",
                                        "survey.yaml-pings.csv",
                                        "survey.yaml-replica.wav",
                                        EGO_FILE};
    return export_vacant(out, names, sizeof names / sizeof *names, why);
}

static int plan(struct wav_set *w, struct error *why)
{
    const struct survey *s = &w->takes.survey;
    size_t in_file = s->pings_m || s->continuous ? s->n_positions : 1;

    w->n_files = s->n_positions / in_file;
    w->n_slots = in_file * s->n_speakers;
    w->n_frames = in_file * survey_slots(s, s->n_speakers) * s->slot_samples +
                  tail_samples(s);
    w->files = calloc(2 * w->n_files, sizeof *w->files);
    if (!w->files)
        return error_say(why, -ENOMEM, "out of memory");
    for (size_t i = 0; i < 2 * w->n_files * w->n_slots; i++)
        w->files[i / w->n_slots].n_left += w->takes.chosen[i] != 0;
    return 0;
}

static int make_folders(struct wav_set *w, struct error *why)
{
    char path[PATH_MAX];
    bool fits = true;

    for (size_t pass = 0; pass < (w->takes.has_background ? 2u : 1u); pass++) {
        char *folder = w->folders[pass];
        fits = fits && snprintf(folder, PATH_MAX, "%s/%s", w->stage.path,
                                pass_names[pass]) < PATH_MAX;
        if (fits && mkdir(folder, 0777))
            return error_say(why, -errno, "%s: %s", folder, strerror(errno));
    }
    fits = fits && snprintf(path, sizeof path, "%s/survey.yaml", w->stage.path) <
                       (int)sizeof path;
    return fits ? survey_save(&w->takes.survey, path, "calibration", why)
                : error_say(why, -ENAMETOOLONG, "%s: path too long", w->stage.path);
}

static int write_file(struct wav_set *w, size_t i, struct error *why)
{
    const struct survey *s = &w->takes.survey;
    struct wav_file *f = &w->files[i];
    int err = recording_write(w->folders[i / w->n_files], i % w->n_files,
                              s->n_microphones, w->n_frames, s->sample_rate_hz,
                              f->samples, why);

    free(f->samples);
    f->samples = NULL;
    return err;
}

static int begin_file(struct wav_set *w, struct wav_file *f, struct error *why)
{
    if (f->samples)
        return 0;
    f->samples = calloc(w->takes.survey.n_microphones * w->n_frames, sizeof(float));
    return f->samples ? 0 : error_say(why, -ENOMEM, "out of memory");
}

/* slot: among takes.chosen.  The tail goes where no ping of its own is. */
static void place(struct wav_set *w, size_t slot, const float *x, size_t n_samples)
{
    const struct survey *s = &w->takes.survey;
    float *samples = w->files[slot / w->n_slots].samples;
    size_t in_file = slot % w->n_slots, round = in_file / s->n_speakers;
    size_t at = (round * survey_slots(s, s->n_speakers) +
                 survey_slot_of(s, in_file % s->n_speakers)) *
                s->slot_samples;
    bool followed = in_file + 1 < w->n_slots && w->takes.chosen[slot + 1];
    size_t n = followed ? s->slot_samples : s->slot_samples + tail_samples(s);

    n = n < n_samples ? n : n_samples;
    n = n < w->n_frames - at ? n : w->n_frames - at;
    for (size_t m = 0; m < s->n_microphones; m++)
        memcpy(samples + m * w->n_frames + at, x + m * n_samples, n * sizeof *x);
}

static int take_ping(struct wav_set *w, const Anlos__Ping *p, uint64_t number,
                     int64_t capture_ns, struct error *why)
{
    const struct survey *s = &w->takes.survey;
    size_t slot, extents[2];

    (void)capture_ns; /* the slot says it */
    if (!takes_slot(&w->takes, p, &slot) || w->takes.chosen[slot] != number)
        return 0;
    const float *x = p->samples ? tensor_f32(p->samples, 2, extents) : NULL;
    if (!x || extents[0] != s->n_microphones)
        return error_say(why, -EBADMSG, "a ping does not fit its survey");
    struct wav_file *f = &w->files[slot / w->n_slots];
    int err = begin_file(w, f, why);
    if (err)
        return err;
    place(w, slot, x, extents[1]);
    for (size_t m = 0; m < p->n_clipped; m++)
        w->n_clipped += p->clipped[m];
    return --f->n_left ? 0 : write_file(w, slot / w->n_slots, why);
}

/* A position of which there is no ping at all is silent. */
static int write_silent(struct wav_set *w, struct error *why)
{
    int err = 0;

    for (size_t i = 0; i < (w->takes.has_background ? 2 : 1) * w->n_files && !err; i++) {
        bool any = false;
        for (size_t k = 0; k < w->n_slots; k++)
            any |= w->takes.chosen[i * w->n_slots + k] != 0;
        if (any)
            continue;
        err = begin_file(w, &w->files[i], why);
        if (!err)
            err = write_file(w, i, why);
    }
    return err;
}

/* Takes every ping of the bag.  0, errors of the stream and of take. */
static int take_pings(struct wav_set *w, struct stream *s,
                      int (*take)(struct wav_set *w, const Anlos__Ping *p,
                                  uint64_t number, int64_t capture_ns, struct error *why),
                      struct error *why)
{
    struct stream_message m;
    uint64_t number = 0;
    int err = 0;

    stream_rewind(s);
    while (!err && !(err = stream_next(s, &m, why))) {
        number++;
        if (m.topic != topic_ping())
            continue;
        ProtobufCMessage *content;
        err = stream_unpack(&content, s, &m, why);
        if (err)
            return err;
        err = take(w, (Anlos__Ping *)content, number, m.envelope.capture_ns, why);
        protobuf_c_message_free_unpacked(content, NULL);
    }
    return err == -ENODATA ? 0 : err;
}

static int write_files(struct wav_set *w, struct stream *s, struct error *why)
{
    int err = make_folders(w, why);

    if (!err)
        err = take_pings(w, s, take_ping, why);
    return err ? err : write_silent(w, why);
}

/* -- of an array that stands ------------------------------------------------------------
 */
static int open_writers(struct wav_set *w, struct error *why)
{
    int err = make_folders(w, why);

    for (size_t pass = 0; !err && pass < (w->takes.has_background ? 2u : 1u); pass++)
        err = recording_writer_open(&w->writers[pass], w->folders[pass], &w->takes.survey,
                                    why);
    return err;
}

static int put_ping(struct wav_set *w, const Anlos__Ping *p, uint64_t number,
                    int64_t capture_ns, struct error *why)
{
    const struct survey *s = &w->takes.survey;
    const struct emission e = {.speaker = p->speaker,
                               .frame = p->frame,
                               .down = p->down,
                               .valid = p->valid,
                               .has_time = true,
                               .time_ns = capture_ns,
                               .temperature_c = p->temperature_c};
    size_t extents[2];
    const float *x = p->samples ? tensor_f32(p->samples, 2, extents) : NULL;

    (void)number; /* all of them */
    if (!takes_has(&w->takes, p))
        return 0;
    if (!x || extents[0] != s->n_microphones ||
        extents[1] != s->slot_samples + tail_samples(s))
        return error_say(why, -EBADMSG, "a ping does not fit its survey");
    for (size_t m = 0; m < p->n_clipped; m++)
        w->n_clipped += p->clipped[m];
    w->n_endless++;
    return recording_writer_put(w->writers[p->pass == ANLOS__PASS__BACKGROUND], &e, x,
                                why);
}

static int print_egos(FILE *f, struct wav_set *w, struct stream *s, struct error *why)
{
    struct stream_message m;
    int err;

    ego_row_print(f, NULL);
    stream_rewind(s);
    while (!(err = stream_next(s, &m, why))) {
        struct ego_row row = {.time_ns = m.envelope.capture_ns};
        ProtobufCMessage *content;
        err = stream_unpack(&content, s, &m, why);
        if (err)
            return err;
        Anlos__EgoMotion *ego = (Anlos__EgoMotion *)content;
        row.motion = *ego;
        ego_row_print(f, &row);
        w->n_egos++;
        anlos__ego_motion__free_unpacked(ego, NULL);
    }
    return err == -ENODATA ? 0 : err;
}

static int write_egos(struct wav_set *w, struct stream *s, struct error *why)
{
    char path[PATH_MAX + 16];

    snprintf(path, sizeof path, "%s/" EGO_FILE, w->stage.path);
    FILE *f = fopen(path, "wxe");
    if (!f)
        return error_say(why, -errno, "%s: %s", path, strerror(errno));
    stream_select(s, topic_ego()->name);
    int err = print_egos(f, w, s, why);
    errno = 0;
    bool failed = ferror(f);
    if ((fclose(f) || failed) && !err)
        err = error_say(why, errno ? -errno : -EIO, "%s cannot be written", path);
    if (!err && !w->n_egos)
        unlink(path); /* nobody told of any motion */
    return err;
}

static int write_endless(struct wav_set *w, struct stream *s, struct error *why)
{
    int err = open_writers(w, why);

    if (!err)
        err = take_pings(w, s, put_ping, why);
    for (int pass = 0; pass < 2; pass++)
        err = recording_writer_close(w->writers[pass], err, why);
    return err ? err : write_egos(w, s, why);
}

static void say_pings(const struct wav_set *w, const char *out)
{
    const struct takes *t = &w->takes;
    size_t n = (t->has_background ? 2 : 1) * w->n_files * w->n_slots;
    const char *background = t->has_background ? ", with background" : ", no background";

    if (!t->endless)
        printf("%s: scan %u, %zu of %zu pings at %zu positions%s\n", out, t->scan,
               n - t->n_missing, n, t->survey.n_positions, background);
    else
        printf("%s: scan %u, %" PRIu64 " pings of an array that stands%s\n", out, t->scan,
               w->n_endless, background);
    if (w->n_egos)
        printf("%s: " EGO_FILE ", %" PRIu64 " messages of how the vehicle moved\n", out,
               w->n_egos);
    if (t->n_others)
        printf("%s: %" PRIu64 " pings of other scans are not in it; --scan N names "
               "another one\n",
               out, t->n_others);
}

static void say(const struct wav_set *w, const char *out)
{
    const struct takes *t = &w->takes;

    say_pings(w, out);
    if (t->n_retaken)
        printf("%s: %" PRIu64 " pings were taken again; the last valid ones are here\n",
               out, t->n_retaken);
    if (t->n_unplaced)
        printf("%s: %" PRIu64 " pings do not belong to the survey and were left out\n",
               out, t->n_unplaced);
    if (w->n_clipped)
        printf("%s: %" PRIu64 " samples are clipped\n", out, w->n_clipped);
}

static int write_set(struct wav_set *w, struct stream *s, const char *out,
                     struct error *why)
{
    int err = check_vacant(out, why);

    if (!err && !w->takes.endless)
        err = plan(w, why);
    if (!err)
        err = export_stage_begin(&w->stage, out, why);
    if (err)
        return err;
    err = w->takes.endless ? write_endless(w, s, why) : write_files(w, s, why);
    err = export_stage_end(&w->stage, err, why);
    if (!err)
        say(w, out);
    return err;
}

int export_wav(struct stream *s, const struct export_options *o, size_t *n_missing,
               struct error *why)
{
    struct wav_set *w = calloc(1, sizeof *w);

    if (!w)
        return error_say(why, -ENOMEM, "out of memory");
    int err = takes_find(&w->takes, s, o->scan, why);
    if (!err)
        err = write_set(w, s, o->out, why);
    *n_missing = w->takes.n_missing;
    for (size_t i = 0; w->files && i < 2 * w->n_files; i++)
        free(w->files[i].samples);
    free(w->files);
    takes_clear(&w->takes);
    free(w);
    return err;
}
