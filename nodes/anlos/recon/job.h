/* SPDX-License-Identifier: MIT */
/* nodes/anlos/recon/job.h -- a recording to an image in one process: read and compress
 * (recon_reader), decide when nobody has (recon_auto), stack, image, detect. */
#ifndef ANLOS_NODES_ANLOS_RECON_JOB_H
#define ANLOS_NODES_ANLOS_RECON_JOB_H

#include "dsp/error.h"
#include "hal/recording/recording.h"
#include "msgs/detections.pb-c.h"
#include "nodes/anlos/psf/file.h"
#include "nodes/anlos/recon/options.h"
#include "nodes/anlos/recon/reader.h"
#include "nodes/anlos/recon/report.h"
#include "nodes/anlos/recon/traces_file.h"
#include "nodes/anlos/stopwatch.h"
#include "recon/frontend/channel_check.h"
#include "recon/planning/trace_set.h"
#include "recon/processing.h"
#include "recon/survey.h"

struct recon_auto;

struct recon_job {
    const struct recon_options *options;
    const char *method;         /* the options', or what suits the recording: */
    const char *method_because; /* NULL when it was asked for */
    struct imager_options imaging;
    struct psf_file psf; /* when options->psf names one */
    struct survey survey;
    struct recording *recording, *background; /* background: NULL for none */
    struct traces_file traces;                /* in place of both, or without pings */
    struct processing processing;
    struct pool *pool;
    struct imager *imager;
    struct recon_reader *reader;  /* NULL: traces, not a recording */
    struct recon_auto *automatic; /* NULL: the method was named */
    struct trace_format format;
    struct trace_set heard; /* what was imaged, where auto does not keep it; or none: */
    float complex *heard_data; /* of it */
    bool *heard_at;
    struct channel_check *scene_check, *background_check;
    struct air air;   /* since the background */
    size_t n_pings;   /* that were imaged */
    float *intensity; /* [nz][ny][nx] */
    struct imager_outcome outcome;
    Anlos__DetectionList *detections;
    struct stopwatch stages[RECON_STAGES], total;
};

/* Survey, files and geometry, without heavy work: everything that can be wrong with the
 * input before the first sample is read.  recon_job_clear it, also after a failure. */
int recon_job_open(struct recon_job *job, const struct recon_options *options,
                   struct error *why);

/* Plans and allocates. */
int recon_job_plan(struct recon_job *job, struct error *why);

/* recording_check_background, where there is one. */
int recon_job_check_background(const struct recon_job *job, struct error *why);

/* 0, -EINTR (Ctrl-C, see interrupt.h), -EIO (a file), -ENODATA (no ping is usable),
 * -ENOMEM. */
int recon_job_run(struct recon_job *job, struct error *why);
void recon_job_clear(struct recon_job *job);

#endif
