/* SPDX-License-Identifier: MIT */
#include "recon/frontend/frontend.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/blanker.h"
#include "dsp/eigencanceler.h"
#include "dsp/tone_finder.h"
#include "recon/frontend/channel_check.h"
#include "recon/frontend/interference.h"
#include "recon/frontend/own_sound.h"

/* That a sound from outside is none of the place. */
#define LONGEST_NS INT64_C(500000000)

/* Slower is standing: 5 mm in a tenth of a second is a quarter of the shortest wave. */
#define STANDING_M_S   0.05
#define STANDING_RAD_S 0.01

struct frontend {
    struct frontend_config cfg;
    bool ego_heard; /* somebody tells of the vehicle's motion */
    struct ego_path ego;
    double ambient_c; /* NaN: not known */

    struct survey survey;
    uint64_t survey_id; /* 0: no survey yet */
    struct processing processing;
    struct compressor *compressor;
    struct trace_format format, whole_format; /* of the gate; of all that is compressed */
    size_t gate;      /* first sample of the whole that is the gate's */
    bool hears_walls; /* of this survey */
    struct wall_receiver receiver;
    struct self_test *self_test; /* NULL, for this reason: */
    struct error unjudged;
    bool judges_whole; /* by the whole that is compressed; else it compresses itself */
    bool fits;         /* the newest ping */
    struct recorded_background *recorded;
    struct mean_background *mean; /* of a static array */
    struct own_sound *own;        /* NULL: it is not told apart from the background */
    struct blanker *blanker;
    struct interference *interference;
    struct tone_finder *tones; /* NULL: pings are too short for it, or it is a scan */
    struct eigencanceler *canceler;
    float complex *cancelled;    /* [n_microphones][whole_format.n_samples] */
    float complex *newest;       /* the same, or whole or traces: no tones are in it */
    struct channel_check *check; /* of one ping at a time */
    unsigned *noticed;           /* [n_microphones], faults said already */
    bool missing_noticed;        /* a speaker's background */
    bool *masked;                /* [n_microphones]: unfit, or its background was */
    float *padded;               /* [n_microphones][ping_samples] */
    float complex *traces;       /* [n_microphones][format.n_samples] */
    float complex *whole;        /* [n_microphones][whole_format.n_samples]; NULL: */
                                 /* the same, until something is subtracted */
};

int frontend_create(struct frontend **out, const struct frontend_config *cfg)
{
    struct frontend *f = calloc(1, sizeof *f);

    if (!f)
        return -ENOMEM;
    f->cfg = *cfg;
    f->ambient_c = NAN;
    *out = f;
    return 0;
}

/* -- survey -----------------------------------------------------------------------------
 */

void frontend_forget(struct frontend *f)
{
    compressor_destroy(f->compressor);
    recorded_background_destroy(f->recorded);
    mean_background_destroy(f->mean);
    own_sound_destroy(f->own);
    blanker_destroy(f->blanker);
    interference_destroy(f->interference);
    tone_finder_destroy(f->tones);
    eigencanceler_destroy(f->canceler);
    free(f->cancelled);
    wall_receiver_clear(&f->receiver);
    self_test_destroy(f->self_test);
    channel_check_destroy(f->check);
    free(f->noticed);
    free(f->masked);
    free(f->padded);
    free(f->traces);
    free(f->whole);
    survey_clear(&f->survey);
    *f = (struct frontend){.cfg = f->cfg,
                           .ego_heard = f->ego_heard,
                           .ego = f->ego,
                           .ambient_c = f->ambient_c};
}

/* An adaptive background is of a static array, and while the vehicle moves its own sound
 * takes the background's place. */
static bool listens_beyond(const struct frontend *f)
{
    return f->cfg.background == BACKGROUND_ADAPTIVE &&
           f->cfg.compression == COMPRESSION_MATCHED_FILTER;
}

/* Of the traces; the number of them where it comes later. */
static size_t first_sample_at(const struct trace_format *t, double delay_s)
{
    double sample = ceil((delay_s - t->t0_s) * t->rate_hz);

    return (size_t)fmin(fmax(sample, 0.0), (double)t->n_samples);
}

/* The samples of a trace before the next emission is heard. */
static size_t quiet(const struct frontend *f)
{
    return listens_beyond(f) ? first_sample_at(&f->format, f->processing.quiet_s)
                             : f->format.n_samples;
}

/* Judged by what lies in the gate. */
static int create_blanker(struct frontend *f)
{
    const struct trace_format *t = &f->format;
    size_t from = first_sample_at(t, f->processing.gate_s[0]);
    struct blanker_config cfg = {.n_channels = f->survey.n_microphones,
                                 .n_samples = t->n_samples,
                                 .from = from < t->n_samples ? from : t->n_samples - 1,
                                 .until = quiet(f),
                                 .longest_ns = LONGEST_NS};

    return blanker_create(&f->blanker, &cfg);
}

static int create_own_sound(struct frontend *f)
{
    if (!listens_beyond(f))
        return 0;
    return own_sound_create(&f->own, f->survey.n_speakers, f->survey.n_microphones,
                            f->format.n_samples, quiet(f));
}

/* Of a static array whose pings are long enough.  0, -ENOMEM. */
static int create_tone_finder(struct frontend *f)
{
    const struct survey *s = &f->survey;
    size_t n_whole = f->whole_format.n_samples;
    const struct tone_finder_config finder = {
        .n_speakers = s->n_speakers,
        .n_channels = s->n_microphones,
        .n_samples = f->processing.ping_samples,
        .rate_hz = s->sample_rate_hz,
        .band_hz = {fmin(s->chirp_start_hz, s->chirp_stop_hz),
                    fmax(s->chirp_start_hz, s->chirp_stop_hz)}};
    const struct eigencanceler_config canceler = {.n_speakers = s->n_speakers,
                                                  .n_channels = s->n_microphones,
                                                  .n_samples = n_whole};

    if (s->n_positions > 1)
        return 0;
    int err = tone_finder_create(&f->tones, &finder);
    if (err)
        return err == -EINVAL ? 0 : err;
    f->cancelled = calloc(s->n_microphones * n_whole, sizeof *f->cancelled);
    return f->cancelled ? eigencanceler_create(&f->canceler, &canceler) : -ENOMEM;
}

static int allocate(struct frontend *f)
{
    size_t n_mics = f->survey.n_microphones;

    f->noticed = calloc(n_mics, sizeof *f->noticed);
    f->masked = calloc(n_mics, sizeof *f->masked);
    f->padded = calloc(n_mics * f->processing.ping_samples, sizeof *f->padded);
    f->traces = calloc(n_mics * f->format.n_samples, sizeof *f->traces);
    bool apart = f->judges_whole || f->whole_format.n_samples != f->format.n_samples;
    if (apart)
        f->whole = calloc(n_mics * f->whole_format.n_samples, sizeof *f->whole);
    f->newest = f->whole ? f->whole : f->traces;
    if (!f->noticed || !f->masked || !f->padded || !f->traces || (apart && !f->whole))
        return -ENOMEM;
    int err = channel_check_create(&f->check, n_mics, 1);
    if (!err)
        err = create_blanker(f);
    if (!err)
        err = interference_create(&f->interference, &f->survey, &f->format, quiet(f));
    if (!err)
        err = create_tone_finder(f);
    if (!err)
        err = create_own_sound(f);
    if (!err)
        err = mean_background_create(&f->mean, f->survey.n_speakers, n_mics,
                                     f->format.n_samples, f->cfg.background_s);
    if (!err)
        err = recorded_background_create(&f->recorded, &f->survey, &f->processing,
                                         &f->format);
    return err;
}

static bool judges(const struct frontend *f, const struct survey *s)
{
    return f->cfg.judges_array && s->source != SURVEY_REPLAY && !s->pings_m;
}

static int create_compressor(struct frontend *f, struct error *why)
{
    return compressor_create(&f->compressor, &f->processing, &f->survey,
                             f->cfg.compression, f->cfg.window, why);
}

/* Whoever needs the sound from the emission on takes what is compressed for the image,
 * where that is what he needs and the transform holds it; else he has compressors of his
 * own.  Who finds the walls says when an array cannot hear any. */
static int plan_compression(struct frontend *f, struct error *why)
{
    struct processing *p = &f->processing;
    struct error none;
    double until_s = 0.0, least_s, most_s, reaches_s[3];
    bool alone = false, matched = f->cfg.compression == COMPRESSION_MATCHED_FILTER &&
                                  f->cfg.window == WINDOW_HANN &&
                                  !survey_overlaps(&f->survey) && !f->survey.pings_m;
    int err = -ERANGE;

    f->hears_walls =
        f->cfg.hears_walls && !f->survey.pings_m &&
        !wall_receiver_reach(&f->survey, f->cfg.wall_reach_m, &until_s, &alone, &none);
    self_test_reach(&f->survey, &least_s, &most_s);
    f->judges_whole = judges(f, &f->survey) && matched && least_s < most_s;
    reaches_s[0] = f->hears_walls && matched && alone ? until_s : 0.0;
    reaches_s[1] = f->judges_whole && !(reaches_s[0] > 0.0) ? most_s : 0.0;
    reaches_s[2] = f->judges_whole ? fmax(least_s, p->gate_s[1]) : 0.0;
    for (int i = 0; err == -ERANGE && i < 3; i++) {
        p->reach_s = reaches_s[i];
        if (p->reach_s > 0.0)
            err = create_compressor(f, &none);
    }
    if (err == -ERANGE) {
        p->reach_s = 0.0;
        err = create_compressor(f, why);
    }
    if (err)
        return err;
    compressor_format(f->compressor, &f->format);
    compressor_whole(f->compressor, &f->whole_format, &f->gate);
    f->judges_whole = f->judges_whole && fmax(p->reach_s, p->gate_s[1]) >= least_s &&
                      p->reach_s > 0.0;
    if (!f->hears_walls)
        return 0;
    bool given = alone && p->reach_s >= until_s;
    return wall_receiver_open(&f->receiver, &f->survey, f->cfg.wall_reach_m,
                              given ? &f->whole_format : NULL, why);
}

static void plan_self_test(struct frontend *f)
{
    struct range_config range = f->cfg.range;

    if (!judges(f, &f->survey))
        return;
    if (!range.n_pings)
        range.n_pings = f->survey.n_speakers;
    self_test_create(&f->self_test, &range, &f->survey,
                     f->judges_whole ? &f->whole_format : NULL, &f->unjudged);
}

static int plan(struct frontend *f, const struct survey *survey, struct error *why)
{
    int err = survey_copy(&f->survey, survey);

    if (err)
        return error_say(why, err, "survey: %s", strerror(-err));
    err = processing_plan(&f->processing, &f->survey, why);
    if (!err && listens_beyond(f))
        processing_listen_beyond(&f->processing, &f->survey);
    if (!err)
        err = plan_compression(f, why);
    if (err)
        return err;
    err = allocate(f);
    if (err)
        return error_say(why, err, "background: %s", strerror(-err));
    plan_self_test(f);
    return 0;
}

int frontend_survey(struct frontend *f, const struct survey *survey, struct error *why)
{
    struct self_test *before = f->self_test;
    struct survey was = f->survey;

    f->self_test = NULL;
    f->survey = (struct survey){.n_speakers = 0};
    frontend_forget(f);
    int err = plan(f, survey, why);
    if (err)
        frontend_forget(f);
    else
        f->survey_id = survey_id(survey);
    if (before && f->self_test && survey_is_same_array(&was, &f->survey))
        self_test_inherit(f->self_test, before);
    self_test_destroy(before);
    survey_clear(&was);
    return err;
}

uint64_t frontend_survey_id(const struct frontend *f)
{
    return f->survey_id;
}

/* -- motion and air ---------------------------------------------------------------------
 */

void frontend_ego(struct frontend *f, const struct ego_motion *motion, int64_t capture_ns)
{
    f->ego_heard = true;
    if (motion)
        ego_path_add(&f->ego, capture_ns, motion);
}

void frontend_temperature(struct frontend *f, double temperature_c)
{
    f->ambient_c = temperature_c;
}

static bool is_slow(const struct ego_motion *m)
{
    return fabs(m->speed_m_s) < STANDING_M_S && fabs(m->yaw_rate_rad_s) < STANDING_RAD_S;
}

static bool stands_at(const struct ego_path *p, int64_t at_ns)
{
    struct ego_motion now;

    return !ego_path_at(p, at_ns, &now) && is_slow(&now);
}

/* As far as it was told by now: a ping that ends while the vehicle sets off was not heard
 * standing.  Where nobody tells, it stands; when who told is silent, it does not. */
static bool stands_during(const struct frontend *f, int64_t from_ns)
{
    const struct ego_path *p = &f->ego;
    double ping_s = (double)f->processing.ping_samples / f->survey.sample_rate_hz;
    int64_t to_ns = from_ns + llrint(1e9 * ping_s);
    bool stands = stands_at(p, from_ns) && stands_at(p, to_ns);

    if (!f->ego_heard)
        return true;
    for (size_t k = 0; stands && k < p->n; k++)
        stands = p->stamp_ns[k] < from_ns || p->stamp_ns[k] > to_ns ||
                 is_slow(&p->motion[k]);
    return stands;
}

/* As it is told, not only for want of news. */
static bool moves_at(const struct frontend *f, int64_t at_ns)
{
    struct ego_motion now;

    return !ego_path_at(&f->ego, at_ns, &now) && !is_slow(&now);
}

/* -- microphones ------------------------------------------------------------------------
 */

/* Said once for each; for people they count from 1. */
static void notice_faults(struct frontend *f, size_t mic,
                          const struct channel_summary *summary,
                          struct frontend_output *out)
{
    const struct {
        bool is;
        const char *text;
    } faults[] = {{summary->silent, "is silent"},
                  {summary->damaged, "has samples that are not finite"},
                  {summary->clipped, "is clipped"}};

    for (unsigned i = 0; i < sizeof faults / sizeof *faults; i++) {
        if (!faults[i].is || f->noticed[mic] & 1u << i)
            continue;
        f->noticed[mic] |= 1u << i;
        text_add(out->note, sizeof out->note, "; ", "microphone %zu %s", mic + 1,
                 faults[i].text);
    }
}

/* Which are fit to be used, and the clipped samples of all. */
static uint64_t judge_microphones(struct frontend *f, const struct ping *ping,
                                  struct frontend_output *out)
{
    size_t n = f->survey.n_microphones;
    struct channel_summary summary;
    uint64_t clipped = 0;

    out->faults.n = n;
    memset(f->masked, 0, n * sizeof *f->masked);
    channel_check_position(f->check, 0, ping->n_samples, ping->samples, ping->clipped,
                           ping->not_finite, f->masked);
    for (size_t i = 0; i < n; i++) {
        channel_check_summary(f->check, i, &summary);
        notice_faults(f, i, &summary, out);
        out->faults.silent += summary.silent;
        out->faults.damaged += summary.damaged;
        out->faults.clipped += summary.clipped;
        clipped += ping->clipped[i];
    }
    return clipped;
}

static void silence_masked(struct frontend *f)
{
    for (size_t m = 0; m < f->survey.n_microphones; m++)
        if (f->masked[m])
            memset(f->traces + m * f->format.n_samples, 0,
                   f->format.n_samples * sizeof *f->traces);
}

/* [n_microphones][*stride]: a ping as long as need be, filled up with silence. */
static const float *samples_of(struct frontend *f, const struct ping *ping,
                               size_t *stride)
{
    size_t need = f->processing.ping_samples, n = ping->n_samples;
    const float *x = ping->samples;

    *stride = n < need ? need : n;
    if (n >= need)
        return x;
    for (size_t m = 0; m < f->survey.n_microphones; m++) {
        memcpy(f->padded + m * need, x + m * n, n * sizeof *x);
        memset(f->padded + m * need + n, 0, (need - n) * sizeof *x);
    }
    return f->padded;
}

/* -- compression and steady tones ------------------------------------------------------
 */

/* Listens for tones; what is there is taken out of all that is compressed, but for what
 * judges the array: loud direct sound of one microphone gets into the others.  The mean
 * is of the traces that it is subtracted from; a recorded background has no tones taken
 * out. */
static void cancel_tones(struct frontend *f, const struct ping *ping,
                         const float *samples, size_t stride)
{
    size_t n = f->survey.n_microphones * f->whole_format.n_samples;
    bool was = tone_finder_found(f->tones)->kind != TONE_NONE;

    tone_finder_ping(f->tones, ping->speaker, samples, stride);
    bool is = tone_finder_found(f->tones)->kind != TONE_NONE;
    if (f->cfg.background == BACKGROUND_RECORDED)
        return;
    if (is) {
        memcpy(f->cancelled, f->newest, n * sizeof *f->cancelled);
        f->newest = f->cancelled;
    }
    eigencanceler_execute(f->canceler, ping->speaker, is, f->newest);
    if (was != is)
        mean_background_reset(f->mean);
}

static void compress(struct frontend *f, const struct ping *ping)
{
    size_t n, n_whole = f->whole_format.n_samples;
    const float *x = samples_of(f, ping, &n);

    compressor_execute(f->compressor, ping->down, x, n, f->whole ? f->whole : f->traces);
    f->newest = f->whole ? f->whole : f->traces;
    if (f->tones && ping->frame && ping->valid)
        cancel_tones(f, ping, x, n);
    for (size_t m = 0; f->newest != f->traces && m < f->survey.n_microphones; m++)
        memcpy(f->traces + m * f->format.n_samples, f->newest + m * n_whole + f->gate,
               f->format.n_samples * sizeof *f->traces);
}

/* Tones taken out. */
static const float complex *whole_of(const struct frontend *f)
{
    if (!(f->processing.reach_s > 0.0))
        return NULL;
    return f->newest;
}

/* -- background -------------------------------------------------------------------------
 */

/* Of a static array it is the mean so far. */
static void keep_background(struct frontend *f, const struct ping *ping)
{
    const float complex *traces = f->traces;

    if (ping->frame)
        traces = mean_background_record(f->mean, ping, f->traces);
    recorded_background_keep(f->recorded, ping, f->masked, traces);
}

static bool subtract_adaptive(struct frontend *f, const struct ping *ping, bool stands)
{
    if (stands)
        return mean_background_subtract(f->mean, ping->speaker, ping->capture_ns,
                                        f->masked, f->traces);
    mean_background_reset(f->mean);
    return false;
}

static void blank(struct frontend *f)
{
    for (size_t m = 0; m < f->survey.n_microphones; m++)
        f->masked[m] = true;
    silence_masked(f);
    mean_background_drop(f->mean);
}

/* true: a background was subtracted, or would have been.  Nobody takes the pings of a
 * static array again: one that a sound from outside drowned is of no use. */
static bool subtract_background(struct frontend *f, const struct ping *ping,
                                bool *blanked)
{
    bool adaptive = f->cfg.background == BACKGROUND_ADAPTIVE;
    bool stands = adaptive && stands_during(f, ping->capture_ns);
    const float complex *mean = stands ? mean_background_of(f->mean, ping->speaker)
                                       : NULL;

    *blanked = ping->frame &&
               blanker_execute(f->blanker, f->traces, mean, f->masked, ping->capture_ns);
    if (*blanked) {
        blank(f);
        return mean || (!adaptive && recorded_background_is_kept(f->recorded, ping));
    }
    return adaptive
               ? subtract_adaptive(f, ping, stands)
               : recorded_background_subtract(f->recorded, ping, f->masked, f->traces);
}

/* -- another array ---------------------------------------------------------------------
 */

/* Takes out what another array made of a ping, which the background does not learn. true:
 * one is present. */
static bool excise_foreign(struct frontend *f, const struct ping *ping, bool subtracted)
{
    size_t n = f->survey.n_microphones * f->format.n_samples;
    struct ego_motion now = {.speed_m_s = 0};
    struct interference_levels levels;

    ego_path_at(&f->ego, ping->capture_ns, &now);
    const uint8_t *foreign = interference_ping(
        f->interference, &(struct interference_ping){.ping = ping,
                                                     .subtracted = subtracted,
                                                     .speed_m_s = now.speed_m_s,
                                                     .traces = f->traces,
                                                     .masked = f->masked});
    for (size_t k = 0; foreign && k < n; k++)
        f->traces[k] = foreign[k] ? 0.0f : f->traces[k];
    if (foreign && f->cfg.background == BACKGROUND_ADAPTIVE)
        mean_background_excise(f->mean, foreign);
    interference_levels(f->interference, &levels);
    return levels.present;
}

void frontend_tones(const struct frontend *f, struct tone_found *out)
{
    *out = f->tones ? *tone_finder_found(f->tones)
                    : (struct tone_found){.kind = TONE_NONE};
}

/* -- pings ------------------------------------------------------------------------------
 */

static bool fits(const struct frontend *f, const struct ping *ping,
                 struct frontend_output *out)
{
    const struct survey *s = &f->survey;

    if (!f->survey_id)
        return false;
    if (ping->survey_id != f->survey_id) {
        snprintf(out->note, sizeof out->note, "a ping of another survey cannot be used");
        return false;
    }
    if (ping->samples && ping->n_microphones == s->n_microphones &&
        ping->position < s->n_positions && ping->speaker < s->n_speakers &&
        (!ping->down || s->chirp_alternates))
        return true;
    snprintf(out->note, sizeof out->note, "a ping does not have the survey's shape");
    return false;
}

/* A scan records what is missing, a static array does not. */
static bool lacks_background(struct frontend *f, const struct ping *ping,
                             struct frontend_output *out)
{
    if (ping->pass != PASS_SCENE || f->cfg.background != BACKGROUND_RECORDED ||
        recorded_background_is_kept(f->recorded, ping))
        return false;
    if (ping->frame && !f->missing_noticed) {
        f->missing_noticed = true;
        snprintf(out->note, sizeof out->note,
                 "speaker %u has no background: its pings are not used", ping->speaker);
    }
    return true;
}

static void write_traces(const struct frontend *f, const struct ping *ping,
                         struct traces *out)
{
    *out = (struct traces){
        .survey_id = f->survey_id,
        .capture_ns = ping->capture_ns,
        .scan = ping->scan,
        .frame = ping->frame,
        .position = ping->position,
        .speaker = ping->speaker,
        .stage_m = ping->stage_m,
        .temperature_c = isnan(ping->temperature_c) ? f->ambient_c : ping->temperature_c,
        .down = ping->down,
        .n_microphones = f->survey.n_microphones,
        .format = f->format,
        .samples = f->traces,
        .masked = f->masked};
}

void frontend_ping(struct frontend *f, const struct ping *ping,
                   struct frontend_output *out)
{
    *out = (struct frontend_output){.outcome = FRONTEND_REFUSED};
    f->fits = fits(f, ping, out);
    bool usable = f->fits && ping->valid;
    bool lacks = usable && lacks_background(f, ping, out);
    if ((usable && (!lacks || whole_of(f))) || (f->fits && f->judges_whole))
        compress(f, ping);
    out->has_returns = f->hears_walls;
    if (f->hears_walls)
        wall_receiver_take(&f->receiver, ping, usable ? whole_of(f) : NULL,
                           &out->returns);
    if (!usable)
        return;
    if (lacks) {
        out->outcome = FRONTEND_LACKS_BACKGROUND;
        return;
    }
    uint64_t clipped = judge_microphones(f, ping, out);
    silence_masked(f);
    if (ping->pass == PASS_BACKGROUND) {
        keep_background(f, ping);
        out->outcome = FRONTEND_KEPT;
        return;
    }
    if (f->own)
        own_sound_subtract(f->own, ping->speaker, moves_at(f, ping->capture_ns),
                           f->masked, f->traces);
    bool blanked, subtracted = subtract_background(f, ping, &blanked);
    if (f->own && !subtracted)
        own_sound_mute(f->own, f->traces);
    if (subtracted && !ping->frame && !out->note[0])
        recorded_background_judge(f->recorded, out->note, sizeof out->note);
    if (blanked)
        interference_break(f->interference);
    else if (ping->frame && excise_foreign(f, ping, subtracted))
        subtracted = false; /* what is left is not only what moves */
    write_traces(f, ping, &out->traces);
    out->traces.clipped_samples = clipped;
    out->traces.background_subtracted = subtracted;
    out->traces.blanked = blanked;
    out->outcome = FRONTEND_TRACES;
}

struct self_test *frontend_self_test(const struct frontend *f, const char **why)
{
    *why = f->unjudged.text;
    return f->self_test;
}

bool frontend_judge(struct frontend *f, const struct ping *ping,
                    struct self_test_faults *out, char *note, size_t note_size)
{
    if (!f->self_test || !f->fits)
        return false;
    self_test_tone(f->self_test,
                   f->tones && tone_finder_found(f->tones)->kind != TONE_NONE);
    self_test_ping(f->self_test, ping, f->judges_whole ? f->whole : NULL,
                   f->judges_whole ? f->newest : NULL, out, note, note_size);
    return true;
}

void frontend_interference(const struct frontend *f, struct interference_levels *out)
{
    *out = (struct interference_levels){.present = false};
    if (f->interference)
        interference_levels(f->interference, out);
}

const struct air *frontend_air(const struct frontend *f)
{
    static const struct air nothing = {.pings = 0};

    return f->recorded ? recorded_background_air(f->recorded) : &nothing;
}

void frontend_destroy(struct frontend *f)
{
    if (!f)
        return;
    frontend_forget(f);
    free(f);
}
