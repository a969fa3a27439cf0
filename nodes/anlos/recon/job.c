/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/recon/job.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hal/survey/file.h"
#include "msgs/convert.h"
#include "nodes/anlos/recon/auto.h"
#include "nodes/rt/stop.h"
#include "recon/detection/clean.h"
#include "recon/detection/objects.h"
#include "recon/imaging/imager.h"

/* -- traces that come compressed from a file, `anlos recon --traces` --------------------
 */

/* A survey of the traces: places, band, speed of sound, and nothing of a recording. */
static int fill_survey(struct recon_job *job, struct error *why)
{
    const struct traces_file *t = &job->traces;
    struct survey *s = &job->survey;
    s->source = SURVEY_REPLAY;
    s->sound_speed_m_s = t->sound_speed_m_s;
    s->temperature_c = NAN;
    s->chirp_start_hz = t->band_hz[0];
    s->chirp_stop_hz = t->band_hz[1];
    s->sample_rate_hz = t->format.rate_hz;
    s->n_speakers = s->n_microphones = 1;
    s->n_positions = t->n_pings;
    s->stage_axis[0] = 1.0;
    s->speakers_m = calloc(1, sizeof *s->speakers_m);
    s->microphones_m = calloc(1, sizeof *s->microphones_m);
    s->stage_positions_m = calloc(t->n_pings, sizeof *s->stage_positions_m);
    s->pings_m = malloc(t->n_pings * sizeof *s->pings_m);
    if (!s->speakers_m || !s->microphones_m || !s->stage_positions_m || !s->pings_m)
        return error_say(why, -ENOMEM, "out of memory");
    memcpy(s->pings_m, t->pings_m, t->n_pings * sizeof *s->pings_m);
    return 0;
}

static double end_s(const struct trace_format *f)
{
    return f->t0_s + (double)(f->n_samples - 1) / f->rate_hz;
}

/* Takes away what is outside of the survey's gate.  delays_s: of the volume. */
static int apply_gate(struct recon_job *job, const double delays_s[2], struct error *why)
{
    const struct survey *s = &job->survey;
    const struct trace_format *f = &job->traces.format;
    const char *survey = job->options->survey;
    double half_c = 0.5 * s->sound_speed_m_s;
    const double gate_s[2] = {s->gate_m[0] / half_c, s->gate_m[1] / half_c};
    if (delays_s[1] <= gate_s[0] || delays_s[0] >= gate_s[1])
        return error_say(why, -EINVAL,
                         "%s: volume: it lies %.2f to %.2f m away, outside the gate of "
                         "%.2f to %.2f m; change gate_m or volume",
                         survey, half_c * delays_s[0], half_c * delays_s[1], s->gate_m[0],
                         s->gate_m[1]);
    if (!traces_cut(&job->traces, gate_s))
        return 0;
    return error_say(why, -EINVAL,
                     "%s: gate_m: %.2f to %.2f m, but the traces of %s last from %.2f to "
                     "%.2f m; change gate_m",
                     survey, s->gate_m[0], s->gate_m[1], job->options->traces,
                     half_c * f->t0_s, half_c * end_s(f));
}

static int plan(struct recon_job *job, struct error *why)
{
    const struct recon_options *o = job->options;
    const struct survey *s = &job->survey;
    const struct trace_format *f = &job->traces.format;
    struct processing *p = &job->processing;
    double half_c = 0.5 * s->sound_speed_m_s, delays_s[2];

    memset(p, 0, sizeof *p);
    processing_geometry(&p->geometry, s);
    memcpy(p->band_hz, job->traces.band_hz, sizeof p->band_hz);
    int err = grid_from_limits(&p->grid, (const double(*)[3])s->volume_m);
    if (err)
        return error_say(why, err, "volume: too many voxels; expected at most 2^28");
    grid_delays(&p->grid, &p->geometry, delays_s);
    if (s->has_gate)
        err = apply_gate(job, delays_s, why);
    if (err)
        return err;
    p->gate_m[0] = s->has_gate ? s->gate_m[0] : half_c * fmax(f->t0_s, 0.0);
    p->gate_m[1] = s->has_gate ? s->gate_m[1] : half_c * end_s(f);
    p->gate_s[0] = fmax(delays_s[0], f->t0_s);
    p->gate_s[1] = fmin(delays_s[1], end_s(f));
    if (p->gate_s[0] >= p->gate_s[1])
        return error_say(why, -EINVAL,
                         "%s: its traces last from %g to %g s, but echoes of the volume "
                         "arrive from %g to %g s; change the volume",
                         o->traces, f->t0_s, end_s(f), delays_s[0], delays_s[1]);
    return 0;
}

static int recon_traces_open(struct recon_job *job, struct error *why)
{
    const struct recon_options *o = job->options;
    struct survey *s = &job->survey;
    int err = o->survey ? survey_load_place(s, o->survey, why) : 0;
    if (!err && o->has_volume) {
        s->has_volume = true;
        memcpy(s->volume_m, o->volume_m, sizeof s->volume_m);
    }
    if (!err && !s->has_volume)
        err = error_say(why, -EINVAL,
                        o->survey ? "%s: expected the key volume, or --volume"
                                  : "%s: expected --volume, or --survey with a volume",
                        o->survey ? o->survey : o->traces);
    if (!err)
        err = traces_load(&job->traces, o->traces, o->has_band ? o->band_hz : NULL, why);
    if (!err)
        err = fill_survey(job, why);
    if (!err)
        err = plan(job, why);
    job->format = job->traces.format;
    return err;
}

struct adding {
    const struct recon_job *job;
    const struct recon_sink *sink;
};

static void add_ping(void *ctx, size_t item, size_t thread)
{
    const struct adding *a = ctx;
    const struct traces_file *t = &a->job->traces;
    (void)thread;
    if (t->masked[item])
        return; /* lost, and counted as such */
    a->sink->take(a->sink->ctx, item, 0, t->traces + item * t->format.n_samples, NULL);
}

static void recon_traces_add(struct recon_job *job, const struct recon_sink *sink)
{
    struct adding a = {job, sink};
    pool_run(job->pool, job->traces.n_pings, add_ping, &a);
}

/* -- which method images the recording, and with what options ---------------------------
 */

/* Nobody asked for one. */
static void choose_method(struct recon_job *job)
{
    if (job->survey.pings_m) {
        job->method = "backprojection";
        job->method_because = "each ping has places of its own";
    } else {
        job->method = "fast";
        job->method_because = "the default";
    }
}

static int recon_method_plan(struct recon_job *job, struct error *why)
{
    const struct recon_options *o = job->options;
    char reason[256];
    job->method = o->method;
    if (!job->method)
        choose_method(job);
    if (o->imaging)
        job->imaging = *o->imaging;
    else
        imager_options_default(&job->imaging);
    if (!strcmp(job->method, recon_auto_name))
        job->method = recon_auto_name;
    else if (imager_options_check(&job->imaging, job->method, reason, sizeof reason))
        return error_say(why, -EINVAL, "--set %s", reason);
    if (o->psf) {
        int err = psf_file_load(&job->psf, o->psf, why);
        if (err)
            return err;
        job->imaging.psf = &job->psf.psf;
    }
    job->processing.imaging = &job->imaging;
    return 0;
}

/* -- plan -------------------------------------------------------------------------------
 */

/* Processing knows the field, neither the file nor the option. */
static void name_survey(const struct recon_options *options, int err, struct error *why)
{
    struct error named;

    if (options->has_volume && !strncmp(why->text, "volume: ", strlen("volume: "))) {
        error_say(&named, err, "--%.900s", why->text);
        *why = named;
        return;
    }
    if (!options->survey || !strncmp(why->text, options->survey, strlen(options->survey)))
        return;
    error_say(&named, err, "%s: %.900s", options->survey, why->text);
    *why = named;
}

int recon_job_check_background(const struct recon_job *job, struct error *why)
{
    return job->background ? recording_check_background(job->recording, job->options->wav,
                                                        job->background,
                                                        job->options->background, why)
                           : 0;
}

/* The survey and what it says, then the files. */
static int open_recording(struct recon_job *job, struct error *why)
{
    const struct recon_options *options = job->options;
    int err = survey_load(&job->survey, options->survey, why);
    if (!err && options->has_volume) {
        job->survey.has_volume = true;
        memcpy(job->survey.volume_m, options->volume_m, sizeof options->volume_m);
    }
    if (!err)
        err = processing_plan(&job->processing, &job->survey, why);
    if (err == -EINVAL || err == -EFBIG)
        name_survey(options, err, why);
    if (!err)
        err = recording_open(&job->recording, options->wav, &job->survey, why);
    if (!err && options->background)
        err = recording_open(&job->background, options->background, &job->survey, why);
    if (!err && job->background &&
        recording_frames(job->background) != recording_frames(job->recording))
        err = error_say(why, -EINVAL, "%s: %zu frames, expected the %zu of %s",
                        options->background, recording_frames(job->background),
                        recording_frames(job->recording), options->wav);
    return err;
}

int recon_job_open(struct recon_job *job, const struct recon_options *options,
                   struct error *why)
{
    memset(job, 0, sizeof *job);
    job->options = options;
    struct stopwatch now = stopwatch_now(false);
    int err = options->traces ? recon_traces_open(job, why) : open_recording(job, why);
    if (!err)
        err = recon_method_plan(job, why);
    stopwatch_lap(&job->stages[RECON_READ], &now, false);
    return err;
}

static int create_reader(struct recon_job *job, struct error *why)
{
    const struct recon_reader_config cfg = {
        .survey = &job->survey,
        .processing = &job->processing,
        .recording = job->recording,
        .background = job->background,
        .scene_check = job->scene_check,
        .background_check = job->background_check,
        .compression = job->options->compression,
        .window = job->options->window,
        .pool = job->pool,
    };
    int err = recon_reader_create(&job->reader, &cfg, why);
    if (!err)
        recon_reader_format(job->reader, &job->format);
    return err;
}

/* None for traces: they come compressed. */
static int create_checks(struct recon_job *job, struct error *why)
{
    const struct survey *s = &job->survey;
    int err = channel_check_create(&job->scene_check, s->n_microphones, s->n_positions);
    if (!err && job->background)
        err = channel_check_create(&job->background_check, s->n_microphones,
                                   s->n_positions);
    return err ? error_say(why, err, "out of memory") : 0;
}

/* Room for what is imaged, for those who look at an object's echoes. */
static int keep_traces(struct recon_job *job, struct error *why)
{
    const struct processing *p = &job->processing;
    const struct geometry *g = &p->geometry;

    job->heard = (struct trace_set){.geometry = g,
                                    .format = job->format,
                                    .band_hz = {p->band_hz[0], p->band_hz[1]},
                                    .gate_m = {p->gate_m[0], p->gate_m[1]}};
    size_t n = g->n_positions * trace_set_pairs(&job->heard);
    job->heard_data = calloc(n * job->format.n_samples, sizeof *job->heard_data);
    job->heard_at = calloc(n, sizeof *job->heard_at);
    job->heard.traces = job->heard_data;
    job->heard.heard = job->heard_at;
    return job->heard_data && job->heard_at ? 0
                                            : error_say(why, -ENOMEM, "out of memory");
}

static int create_imager(struct recon_job *job, struct error *why)
{
    int err = processing_imager(&job->imager, &job->processing, job->method, &job->format,
                                job->pool, why);
    if (err == -EINVAL || err == -ENOTSUP)
        name_survey(job->options, err, why);
    if (err)
        return err;
    job->intensity = calloc(grid_size(&job->processing.grid), sizeof *job->intensity);
    return job->intensity ? 0 : error_say(why, -ENOMEM, "out of memory");
}

/* Whatever else it led to. */
static int say_interrupted(int err, struct error *why)
{
    return interrupt_requested() ? error_say(why, -EINTR, "interrupted") : err;
}

int recon_job_plan(struct recon_job *job, struct error *why)
{
    struct stopwatch now = stopwatch_now(false);
    int err = pool_create(&job->pool, job->options->threads);
    if (err)
        return error_say(why, err, "%zu threads: %s", job->options->threads,
                         strerror(-err));
    pool_stop_by(job->pool, interrupt_stops, NULL);
    if (!job->options->traces) {
        err = create_checks(job, why);
        if (!err)
            err = create_reader(job, why);
    }
    if (!err && job->method == recon_auto_name)
        err = recon_auto_create(&job->automatic, job, why);
    else if (!err)
        err = create_imager(job, why);
    if (!err && !job->automatic)
        err = keep_traces(job, why);
    stopwatch_lap(&job->stages[RECON_PLAN], &now, false);
    return say_interrupted(err, why);
}

/* -- run --------------------------------------------------------------------------------
 */

static void add_to_image(void *ctx, size_t position, size_t speaker,
                         const float complex *traces, const bool *masked)
{
    struct recon_job *job = ctx;
    imager_add(job->imager, position, speaker, traces, masked);
    if (!job->heard.traces)
        return;
    const struct geometry *g = job->heard.geometry;
    size_t n = g->n_microphones, samples = job->format.n_samples;
    size_t first = (position * g->n_speakers + speaker) * n;
    memcpy(job->heard_data + first * samples, traces, n * samples * sizeof *traces);
    for (size_t i = 0; i < n; i++)
        job->heard_at[first + i] = !(masked && masked[i]) &&
                                   trace_check(traces + i * samples, samples);
}

/* All traces to whoever takes them. */
static int make_traces(struct recon_job *job, struct error *why)
{
    struct recon_sink sink = {add_to_image, job, NULL};
    if (job->automatic)
        sink = recon_auto_sink(job->automatic);
    if (job->reader)
        return recon_reader_run(job->reader, &sink, job->stages, &job->air, why);
    struct stopwatch now = stopwatch_now(false);
    recon_traces_add(job, &sink);
    stopwatch_lap(&job->stages[RECON_STACK], &now, false);
    return say_interrupted(0, why);
}

/* The traces of another band.  Channels were checked the first time. */
static int make_traces_again(struct recon_job *job, struct error *why)
{
    struct recon_auto *first = job->automatic;
    recon_reader_destroy(job->reader);
    job->reader = NULL;
    job->automatic = NULL;
    int err = create_reader(job, why);
    if (!err)
        err = recon_auto_create(&job->automatic, job, why);
    if (!err) {
        recon_auto_inherit(job, first);
        err = make_traces(job, why);
    }
    recon_auto_destroy(first);
    return err;
}

static int decide(struct recon_job *job, struct error *why)
{
    enum recon_auto_next next;
    int err = recon_auto_decide(job->automatic, job, &next, why);
    if (!err && next == RECON_AUTO_MORE) {
        err = make_traces(job, why);
        if (!err)
            err = recon_auto_decide(job->automatic, job, &next, why);
    }
    if (!err && next == RECON_AUTO_OTHER_BAND)
        err = make_traces_again(job, why);
    err = say_interrupted(err, why);
    if (err)
        return err;
    struct stopwatch now = stopwatch_now(false);
    job->automatic->kept_s = job->stages[RECON_STACK].wall_s;
    err = create_imager(job, why);
    while (err == -ENOTSUP && recon_auto_retreat(job->automatic, job))
        err = create_imager(job, why);
    if (!err)
        err = recon_auto_feed(job->automatic, job, why);
    stopwatch_lap(&job->stages[RECON_STACK], &now, false);
    return err;
}

/* Objects are looked for in the image before it is sharpened, which goes to *out (NULL:
 * it was not), and its imager into the place of the job's.  The weight that makes points
 * narrower makes what lies beside them brighter: sidelobes and echoes by two ways would
 * be told as objects, and what is faint be lost among them. */
static int image_blunt(struct recon_job *job, const struct trace_set *traces, float **out,
                       struct error *why)
{
    struct imager_options plain = job->imaging;
    struct processing p = job->processing;

    *out = NULL;
    if (!(job->imaging.sharpen > 0.0) || !traces || job->options->budget_s > 0.0)
        return 0;
    imager_destroy(job->imager);
    job->imager = NULL;
    plain.sharpen = 0.0;
    p.imaging = &plain;
    int err =
        processing_imager(&job->imager, &p, job->method, &job->format, job->pool, why);
    if (err)
        return err;
    *out = malloc(grid_size(&p.grid) * sizeof **out);
    if (!*out || trace_set_feed(traces, job->imager, job->pool))
        return error_say(why, -ENOMEM, "out of memory");
    return imager_image(job->imager, *out);
}

static int find_objects(struct recon_job *job, struct error *why)
{
    struct detect_config detect;
    float *blunt;
    detect_config_default(&detect);
    detect_config_method(&detect, job->method, &job->processing.grid);
    if (!detect.multipath)
        detect.traces = NULL;
    else if (job->automatic)
        detect.traces = &job->automatic->set;
    else if (job->heard.traces)
        detect.traces = &job->heard;
    detect.pool = job->pool;
    int err = image_blunt(job, detect.traces, &blunt, why);
    bool own_places = job->processing.geometry.pings_m != NULL;
    const struct clean clean = {detect.traces, job->imager, job->pool,
                                job->options->traces != NULL, own_places};
    if (detect.traces && imager_adds(job->method) && !(job->options->budget_s > 0.0))
        detect.clean = &clean;
    if (own_places) /* seen from all sides, lobes have no one direction */
        detect.traces = NULL;
    if (!err) {
        struct object_list list;
        err = objects_find(&list, &job->survey, NULL, &detect, 0.0, &job->processing.grid,
                           blunt ? blunt : job->intensity);
        list.scan = 1;
        list.counter = 1;
        if (!err)
            err = detections_from_objects(&job->detections, &list);
        if (err)
            error_say(why, err, "detection: %s", strerror(-err));
    }
    free(blunt);
    return err;
}

static int run(struct recon_job *job, struct error *why)
{
    int err = make_traces(job, why);
    if (!err && job->automatic)
        err = decide(job, why);
    if (err)
        return err;
    if (!imager_pings(job->imager))
        return error_say(why, -ENODATA,
                         "%s: no microphone is usable in any position; expected sound",
                         job->options->wav ? job->options->wav : job->options->traces);
    struct stopwatch now = stopwatch_now(false);
    err = imager_image(job->imager, job->intensity);
    imager_outcome(job->imager, &job->outcome);
    job->n_pings = imager_pings(job->imager);
    stopwatch_lap(&job->stages[RECON_IMAGE], &now, false);
    if (!err)
        err = find_objects(job, why);
    stopwatch_lap(&job->stages[RECON_DETECT], &now, false);
    return err;
}

int recon_job_run(struct recon_job *job, struct error *why)
{
    return say_interrupted(run(job, why), why);
}

void recon_job_clear(struct recon_job *job)
{
    detections_free(job->detections);
    free(job->intensity);
    free(job->heard_data);
    free(job->heard_at);
    imager_destroy(job->imager);
    recon_auto_destroy(job->automatic);
    recon_reader_destroy(job->reader);
    channel_check_destroy(job->background_check);
    channel_check_destroy(job->scene_check);
    pool_destroy(job->pool);
    recording_close(job->background);
    recording_close(job->recording);
    traces_clear(&job->traces);
    survey_clear(&job->survey);
    memset(job, 0, sizeof *job);
}
