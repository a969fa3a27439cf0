/* nodes/anlos/recon_job.h -- a recording to an image in one process: read, check,
 * subtract the background, compress, stack, image, detect.  One position at a time on
 * each thread, so that memory stays small however long the recording is. */
#ifndef ANLOS_NODES_ANLOS_RECON_JOB_H
#define ANLOS_NODES_ANLOS_RECON_JOB_H

#include "hal/recording.h"
#include "msgs/complaint.h"
#include "msgs/detections.pb-c.h"
#include "msgs/survey.h"
#include "nodes/rt/channel_check.h"
#include "nodes/anlos/stopwatch.h"
#include "nodes/anlos/traces_file.h"
#include "nodes/rt/compressor.h"
#include "nodes/rt/processing.h"

struct recon_options {                                    /* borrow from argv */
    const char *survey, *wav, *background, *method, *out; /* background: NULL for none */
    const char *traces;                                   /* in place of wav, or NULL */
    const char *confocal;                                 /* optical scan, or NULL */
    bool has_gate;                                        /* of the optical scan */
    double gate_m[2];
    bool has_volume; /* in place of the survey's */
    double volume_m[3][3];
    size_t threads;
    enum window window;
    enum compression compression;
};

enum recon_stage {
    RECON_PLAN,
    RECON_READ,
    RECON_COMPRESS,
    RECON_STACK,
    RECON_IMAGE,
    RECON_DETECT,
    RECON_WRITE,
    RECON_STAGES
};

struct recon_worker; /* a thread's scratch */

struct recon_job {
    const struct recon_options *options;
    struct survey survey;
    struct recording *recording, *background; /* background: NULL for none */
    struct traces_file traces;                /* in place of both, or without pings */
    struct processing processing;
    struct pool *pool;
    struct imager *imager;
    struct recon_worker *workers; /* [options->threads] */
    struct trace_format format;
    struct channel_check *scene_check, *background_check;
    float *intensity; /* [nz][ny][nx] */
    Anlos__DetectionList *detections;
    struct stopwatch stages[RECON_STAGES], total;
};

/* Survey, files and geometry, without heavy work: everything that can be wrong with the
 * input before the first sample is read.  recon_job_clear it, also after a failure. */
int recon_job_open(struct recon_job *job, const struct recon_options *options,
                   struct complaint *why);

/* Plans and allocates. */
int recon_job_plan(struct recon_job *job, struct complaint *why);

/* 0, -EINTR (Ctrl-C, see interrupt.h), -EIO (a file), -ENODATA (no ping is usable),
 * -ENOMEM. */
int recon_job_run(struct recon_job *job, struct complaint *why);
void recon_job_clear(struct recon_job *job);

#endif
