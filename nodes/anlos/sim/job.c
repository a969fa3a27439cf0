#include "nodes/anlos/sim/job.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "dsp/pool.h"
#include "hal/recording/recording.h"
#include "hal/room/room.h"
#include "hal/survey/file.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/sim/truth.h"
#include "nodes/rt/export.h"

struct sim_worker { /* a room records for one thread at a time, so each has its own */
    struct room *room;
    float *samples; /* [n_microphones][frames] */
};

struct sim_job {
    const struct sim_options *options;
    const struct survey *survey; /* of the first worker's room */
    size_t frames;
    struct sim_worker *workers; /* [options->threads] */
    uint32_t *speakers;         /* 0..n_speakers-1 */
    struct export_stage stage;
    char folder[2][PATH_MAX]; /* scene, background; inside the stage */
    pthread_mutex_t lock;     /* of what follows */
    size_t done;
    int err;
    struct complaint why;
};

static const char *const pass_names[2] = {"scene", "background"};

static int create_workers(struct sim_job *job, struct complaint *why)
{
    const char *scene = job->options->scene;
    int err = 0;
    job->workers = calloc(job->options->threads, sizeof *job->workers);
    if (!job->workers)
        return complain(why, -ENOMEM, "out of memory");
    for (size_t t = 0; !err && t < job->options->threads; t++)
        err = room_load(&job->workers[t].room, scene, why);
    if (err)
        return err;
    if (room_is_drive(job->workers[0].room))
        return complain(why, -EINVAL,
                        "%s: a drive has no end; `anlos launch` plays it, and records it "
                        "with --record BAG",
                        scene);
    job->survey = room_survey(job->workers[0].room);
    job->frames = room_frames(job->workers[0].room, job->survey->n_speakers);
    job->speakers = malloc(job->survey->n_speakers * sizeof *job->speakers);
    for (size_t j = 0; job->speakers && j < job->survey->n_speakers; j++)
        job->speakers[j] = (uint32_t)j;
    for (size_t t = 0; t < job->options->threads; t++) {
        job->workers[t].samples =
            malloc(job->survey->n_microphones * job->frames * sizeof(float));
        if (!job->workers[t].samples || !job->speakers)
            return complain(why, -ENOMEM, "out of memory");
    }
    return 0;
}

static int check_vacant(const char *out, struct complaint *why)
{
    static const char *const names[] = {"scene", "background", "calibration",
                                        "survey.yaml", "truth.json"};
    return export_vacant(out, names, sizeof names / sizeof *names, why);
}

static void show_progress(const struct sim_job *job)
{
    if (job->options->progress)
        fprintf(stderr, "\r%zu of %zu recordings ", job->done,
                2 * job->survey->n_positions);
}

/* The background pass comes second, so that a scene that fails does so soon. */
static void record_item(void *ctx, size_t item, size_t thread)
{
    struct sim_job *job = ctx;
    struct sim_worker *w = &job->workers[thread];
    size_t background = item / job->survey->n_positions;
    size_t position = item % job->survey->n_positions;
    struct complaint why = {0};

    pthread_mutex_lock(&job->lock);
    bool stop = job->err || interrupt_requested();
    pthread_mutex_unlock(&job->lock);
    if (stop)
        return;
    int err = room_record(w->room, background ? PASS_BACKGROUND : PASS_SCENE, position,
                          job->speakers, job->survey->n_speakers, 0, w->samples);
    if (err)
        complain(&why, err, "%s: position %zu: %s", job->options->scene, position,
                 strerror(-err));
    else
        err = recording_write(job->folder[background], position,
                              job->survey->n_microphones, job->frames,
                              job->survey->sample_rate_hz, w->samples, &why);
    pthread_mutex_lock(&job->lock);
    job->done++;
    if (err && !job->err) {
        job->err = err;
        job->why = why;
    }
    show_progress(job);
    pthread_mutex_unlock(&job->lock);
}

static int record_all(struct sim_job *job, struct complaint *why)
{
    struct pool *pool;
    for (int pass = 0; pass < 2; pass++) {
        snprintf(job->folder[pass], sizeof job->folder[pass], "%.*s/%s", PATH_MAX - 16,
                 job->stage.path, pass_names[pass]);
        if (mkdir(job->folder[pass], 0777))
            return complain(why, -errno, "%s: cannot be written: %s", job->options->out,
                            strerror(errno));
    }
    int err = pool_create(&pool, job->options->threads);
    if (err)
        return complain(why, err, "%zu threads: %s", job->options->threads,
                        strerror(-err));
    pool_run(pool, 2 * job->survey->n_positions, record_item, job);
    pool_destroy(pool);
    if (job->options->progress)
        fputc('\n', stderr);
    if (interrupt_requested())
        return complain(why, -EINTR, "interrupted");
    if (job->err)
        *why = job->why;
    return job->err;
}

static int write_texts(struct sim_job *job, struct complaint *why)
{
    char path[PATH_MAX + 32];
    const char *calibration = job->survey->n_responses ? "calibration" : NULL;
    int err =
        sim_truth_write(job->workers[0].room, job->options->scene, job->stage.path, why);
    if (!err) {
        snprintf(path, sizeof path, "%s/survey.yaml", job->stage.path);
        err = survey_save(job->survey, path, calibration, why);
    }
    return err;
}

static void clear_workers(struct sim_job *job)
{
    for (size_t t = 0; job->workers && t < job->options->threads; t++) {
        room_destroy(job->workers[t].room);
        free(job->workers[t].samples);
    }
    free(job->workers);
    free(job->speakers);
}

int sim_job_run(const struct sim_options *options, bool *bad_input, struct complaint *why)
{
    struct sim_job *job = calloc(1, sizeof *job);
    if (!job)
        return complain(why, -ENOMEM, "out of memory");
    job->options = options;
    pthread_mutex_init(&job->lock, NULL);

    int err = check_vacant(options->out, why);
    if (!err)
        err = create_workers(job, why);
    if (!err)
        err = export_stage_begin(&job->stage, options->out, why);
    *bad_input = err && err != -ENOMEM;
    if (!err) {
        err = record_all(job, why);
        if (!err)
            err = write_texts(job, why);
        if (!err)
            err = export_stage_commit(&job->stage, why);
        if (err)
            export_stage_abandon(&job->stage);
    }
    clear_workers(job);
    pthread_mutex_destroy(&job->lock);
    free(job);
    return err;
}
