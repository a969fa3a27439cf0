#include "nodes/anlos/confocal/job.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/confocal/image.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/rt/objects.h"

#define MAX_BINS      512
#define JITTER_STEP_M 4e-3 /* half of what 60 ps are in range: this kind of detector */
#define CLUSTER       4.0  /* places of the scan: bright ones closer are one */

const char *confocal_methods(void)
{
    return "lct\0fk\0backprojection\0";
}

bool confocal_has_method(const char *name)
{
    for (const char *m = confocal_methods(); *m; m += strlen(m) + 1)
        if (!strcmp(m, name))
            return true;
    return false;
}

static int read_scan(struct confocal_job *job, struct confocal_scan *s,
                     struct complaint *why)
{
    const struct recon_options *o = job->options;
    struct confocal_file file;
    int err = confocal_file_load(&file, o->confocal, why);
    if (!err) {
        confocal_file_gate(&file, job->gate_m);
        if (o->has_gate)
            memcpy(job->gate_m, o->gate_m, sizeof job->gate_m);
        job->n_not_finite = file.n_not_finite;
        double least_m = strcmp(o->method, "lct") ? 0.0 : JITTER_STEP_M;
        err = confocal_scan_create(s, &file, job->gate_m, MAX_BINS, least_m, why);
        job->gate_m[1] = fmin(job->gate_m[1], (double)file.n_bins * file.bin_m);
    }
    confocal_file_clear(&file);
    return err;
}

static int detect(struct confocal_job *job, struct complaint *why)
{
    struct detect_config cfg;
    struct stopwatch now = stopwatch_now(false);
    detect_config_default(&cfg);
    cfg.cluster_m = CLUSTER * fmax(job->grid.step_m[0], job->grid.step_m[1]);
    int err = objects_find(&job->detections, &job->survey, &cfg, 0.0, &job->grid,
                           job->intensity);
    stopwatch_lap(&job->stages[RECON_DETECT], &now, false);
    return err ? complain(why, err, "detection: %s", strerror(-err)) : 0;
}

int confocal_job_run(struct confocal_job *job, const struct recon_options *options,
                     struct complaint *why)
{
    struct confocal_scan scan = {0};
    struct stopwatch now = stopwatch_now(false);
    memset(job, 0, sizeof *job);
    job->options = options;
    int err = pool_create(&job->pool, options->threads);
    if (err)
        complain(why, err, "%zu threads: %s", options->threads, strerror(-err));
    if (!err)
        err = read_scan(job, &scan, why);
    stopwatch_lap(&job->stages[RECON_READ], &now, false);
    if (!err && interrupt_requested())
        err = complain(why, -EINTR, "interrupted");
    if (!err)
        err = confocal_image(job, &scan, why);
    if (!err && interrupt_requested())
        err = complain(why, -EINTR, "interrupted");
    if (!err)
        err = detect(job, why);
    confocal_scan_clear(&scan);
    return err;
}

void confocal_job_clear(struct confocal_job *job)
{
    objects_free(job->detections);
    free(job->intensity);
    pool_destroy(job->pool);
    survey_clear(&job->survey);
    memset(job, 0, sizeof *job);
}
