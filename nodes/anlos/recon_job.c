#include "nodes/anlos/recon_job.h"

#include <errno.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/wisdom.h"
#include "hal/survey_file.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/recon_traces.h"
#include "nodes/rt/objects.h"

struct recon_worker {
    struct compressor *compressor;
    float *samples, *background; /* [n_microphones][frames] */
    float *ping;                 /* [n_microphones][ping_samples] */
    float complex *traces;       /* [n_microphones][format.n_samples] */
    uint32_t *clipped, *not_finite;
    bool *masked; /* all [n_microphones] */
    struct stopwatch stages[RECON_STAGES];
};

/* Processing knows the field, not the file. */
static void name_survey(const struct recon_options *options, int err,
                        struct complaint *why)
{
    struct complaint named;

    if (!options->survey || !strncmp(why->text, options->survey, strlen(options->survey)))
        return;
    complain(&named, err, "%s: %.900s", options->survey, why->text);
    *why = named;
}

int recon_job_open(struct recon_job *job, const struct recon_options *options,
                   struct complaint *why)
{
    memset(job, 0, sizeof *job);
    job->options = options;
    struct stopwatch now = stopwatch_now(false);
    if (options->traces) {
        int err = recon_traces_open(job, why);
        stopwatch_lap(&job->stages[RECON_READ], &now, false);
        return err;
    }
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
        err = complain(why, -EINVAL, "%s: %zu frames, expected the %zu of %s",
                       options->background, recording_frames(job->background),
                       recording_frames(job->recording), options->wav);
    stopwatch_lap(&job->stages[RECON_READ], &now, false);
    return err;
}

static int worker_create(struct recon_worker *w, const struct recon_job *job,
                         struct complaint *why)
{
    size_t n_mics = job->survey.n_microphones;
    size_t frames = recording_frames(job->recording);
    int err = compressor_create(&w->compressor, &job->processing, &job->survey,
                                job->options->compression, job->options->window, why);
    if (err)
        return err;
    struct trace_format format;
    compressor_format(w->compressor, &format);
    w->samples = malloc(n_mics * frames * sizeof *w->samples);
    if (job->background)
        w->background =
            malloc(n_mics * recording_frames(job->background) * sizeof *w->background);
    w->ping = malloc(n_mics * job->processing.ping_samples * sizeof *w->ping);
    w->traces = malloc(n_mics * format.n_samples * sizeof *w->traces);
    w->clipped = malloc(n_mics * sizeof *w->clipped);
    w->not_finite = malloc(n_mics * sizeof *w->not_finite);
    w->masked = malloc(n_mics * sizeof *w->masked);
    if (!w->samples || (job->background && !w->background) || !w->ping || !w->traces ||
        !w->clipped || !w->not_finite || !w->masked)
        return complain(why, -ENOMEM, "out of memory");
    return 0;
}

static void worker_clear(struct recon_worker *w)
{
    compressor_destroy(w->compressor);
    free(w->samples);
    free(w->background);
    free(w->ping);
    free(w->traces);
    free(w->clipped);
    free(w->not_finite);
    free(w->masked);
}

/* None for traces: they come compressed. */
static int create_workers(struct recon_job *job, struct complaint *why)
{
    if (job->options->traces)
        return 0;
    const struct survey *s = &job->survey;
    int err = 0;
    job->workers = calloc(job->options->threads, sizeof *job->workers);
    if (!job->workers)
        return complain(why, -ENOMEM, "out of memory");
    for (size_t t = 0; !err && t < job->options->threads; t++)
        err = worker_create(&job->workers[t], job, why);
    if (!err)
        err = channel_check_create(&job->scene_check, s->n_microphones, s->n_positions);
    if (!err && job->background)
        err = channel_check_create(&job->background_check, s->n_microphones,
                                   s->n_positions);
    return err;
}

int recon_job_plan(struct recon_job *job, struct complaint *why)
{
    struct stopwatch now = stopwatch_now(false);
    wisdom_load(); /* without it planning takes longer, nothing else */
    int err = pool_create(&job->pool, job->options->threads);
    if (err)
        return complain(why, err, "%zu threads: %s", job->options->threads,
                        strerror(-err));
    err = create_workers(job, why);
    if (!err) {
        if (job->workers)
            compressor_format(job->workers[0].compressor, &job->format);
        err = processing_imager(&job->imager, &job->processing, job->options->method,
                                &job->format, job->pool, why);
        if (err == -EINVAL || err == -ENOTSUP)
            name_survey(job->options, err, why);
    }
    if (!err) {
        job->intensity = calloc(grid_size(&job->processing.grid), sizeof *job->intensity);
        if (!job->intensity)
            err = -ENOMEM;
    }
    if (err == -ENOMEM)
        complain(why, err, "out of memory");
    if (!err)
        wisdom_save(); /* an unwritable cache only costs the next run its start */
    stopwatch_lap(&job->stages[RECON_PLAN], &now, false);
    return err;
}

/* What all threads of a run share. */
struct run {
    struct recon_job *job;
    atomic_int err; /* the first */
    struct complaint *why;
};

static void run_fail(struct run *run, int err, const struct complaint *why)
{
    int none = 0;
    if (atomic_compare_exchange_strong(&run->err, &none, err) && why && run->why)
        *run->why = *why;
}

/* Scene minus background, sample by sample; dsp/background.h says why not as traces. */
static int read_position(struct recon_job *job, struct recon_worker *w, size_t position,
                         struct complaint *why)
{
    size_t frames = recording_frames(job->recording);
    size_t n_mics = job->survey.n_microphones;
    memset(w->masked, 0, n_mics * sizeof *w->masked);
    int err = recording_read(job->recording, position, w->samples, w->clipped,
                             w->not_finite, why);
    if (err)
        return err;
    channel_check_position(job->scene_check, position, frames, w->samples, w->clipped,
                           w->not_finite, w->masked);
    if (!job->background)
        return 0;
    err = recording_read(job->background, position, w->background, w->clipped,
                         w->not_finite, why);
    if (err)
        return err;
    channel_check_position(job->background_check, position, frames, w->background,
                           w->clipped, w->not_finite, w->masked);
    for (size_t i = 0; i < n_mics * frames; i++)
        w->samples[i] -= w->background[i];
    return 0;
}

/* The ping of a slot; one whose tail runs past the end of the recording is continued with
 * zeros in a buffer of its own. */
static const float *find_ping(const struct recon_job *job, struct recon_worker *w,
                              size_t speaker, size_t *stride)
{
    size_t frames = recording_frames(job->recording);
    size_t n = job->processing.ping_samples;
    size_t start = speaker * job->survey.slot_samples;
    *stride = frames;
    if (start + n <= frames)
        return w->samples + start;
    size_t there = frames - start;
    for (size_t i = 0; i < job->survey.n_microphones; i++) {
        memcpy(w->ping + i * n, w->samples + i * frames + start, there * sizeof(float));
        memset(w->ping + i * n + there, 0, (n - there) * sizeof(float));
    }
    *stride = n;
    return w->ping;
}

static bool all_masked(const bool *masked, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (!masked[i])
            return false;
    return true;
}

static void process_position(void *ctx, size_t position, size_t thread)
{
    struct run *run = ctx;
    struct recon_job *job = run->job;
    struct recon_worker *w = &job->workers[thread];
    struct complaint why = {0};

    if (atomic_load(&run->err) || interrupt_requested())
        return;
    struct stopwatch now = stopwatch_now(true);
    int err = read_position(job, w, position, &why);
    stopwatch_lap(&w->stages[RECON_READ], &now, true);
    if (err) {
        run_fail(run, err, &why);
        return;
    }
    if (all_masked(w->masked, job->survey.n_microphones))
        return; /* its pings are lost, and counted as such */
    for (size_t j = 0; j < job->survey.n_speakers; j++) {
        size_t stride;
        const float *ping = find_ping(job, w, j, &stride);
        compressor_execute(w->compressor, ping, stride, w->traces);
        stopwatch_lap(&w->stages[RECON_COMPRESS], &now, true);
        imager_add(job->imager, position, j, w->traces, w->masked);
        stopwatch_lap(&w->stages[RECON_STACK], &now, true);
    }
}

/* Stages that ran side by side on several threads share the wall time by their parts. */
static void share_times(struct recon_job *job, double wall_s)
{
    double busy_s = 0.0;
    for (size_t t = 0; t < job->options->threads; t++)
        for (int i = 0; i < RECON_STAGES; i++)
            busy_s += job->workers[t].stages[i].wall_s;
    for (size_t t = 0; t < job->options->threads; t++) {
        for (int i = 0; i < RECON_STAGES; i++) {
            const struct stopwatch *part = &job->workers[t].stages[i];
            job->stages[i].cpu_s += part->cpu_s;
            if (busy_s > 0.0)
                job->stages[i].wall_s += wall_s * part->wall_s / busy_s;
        }
    }
}

int recon_job_run(struct recon_job *job, struct complaint *why)
{
    struct run run = {.job = job, .why = why};
    struct detect_config detect;
    struct stopwatch phase = {0}, now = stopwatch_now(false);

    atomic_init(&run.err, 0);
    if (job->options->traces) {
        recon_traces_add(job);
        stopwatch_lap(&job->stages[RECON_STACK], &now, false);
    } else {
        pool_run(job->pool, job->survey.n_positions, process_position, &run);
        stopwatch_lap(&phase, &now, false);
        share_times(job, phase.wall_s);
    }
    if (interrupt_requested())
        return complain(why, -EINTR, "interrupted");
    int err = atomic_load(&run.err);
    if (err)
        return err;
    if (!imager_pings(job->imager))
        return complain(why, -ENODATA,
                        "%s: no microphone is usable in any position; expected sound",
                        job->options->wav);

    imager_image(job->imager, job->intensity);
    stopwatch_lap(&job->stages[RECON_IMAGE], &now, false);
    if (interrupt_requested())
        return complain(why, -EINTR, "interrupted");
    detect_config_default(&detect);
    err = objects_find(&job->detections, &job->survey, &detect, 0.0,
                       &job->processing.grid, job->intensity);
    stopwatch_lap(&job->stages[RECON_DETECT], &now, false);
    if (err)
        return complain(why, err, "detection: %s", strerror(-err));
    job->detections->scan = 1;
    job->detections->counter = 1;
    return 0;
}

void recon_job_clear(struct recon_job *job)
{
    objects_free(job->detections);
    free(job->intensity);
    imager_destroy(job->imager);
    for (size_t t = 0; job->workers && t < job->options->threads; t++)
        worker_clear(&job->workers[t]);
    free(job->workers);
    channel_check_destroy(job->background_check);
    channel_check_destroy(job->scene_check);
    pool_destroy(job->pool);
    recording_close(job->background);
    recording_close(job->recording);
    traces_clear(&job->traces);
    survey_clear(&job->survey);
    memset(job, 0, sizeof *job);
}
