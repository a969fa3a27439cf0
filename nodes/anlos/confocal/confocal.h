/* SPDX-License-Identifier: MIT */
/* nodes/anlos/confocal/confocal.h -- `anlos recon --confocal`: an optical scan through
 * the same imaging as sound (Lindell 2019, Fig. 9): the light-cone transform of the
 * counts, or f-k migration or back-projection of their square root as a wave. */
#ifndef ANLOS_NODES_ANLOS_CONFOCAL_CONFOCAL_H
#define ANLOS_NODES_ANLOS_CONFOCAL_CONFOCAL_H

#include "dsp/error.h"
#include "dsp/pool.h"
#include "msgs/detections.pb-c.h"
#include "nodes/anlos/confocal/scan.h"
#include "nodes/anlos/recon/job.h"
#include "nodes/anlos/stopwatch.h"
#include "recon/survey.h"

struct confocal_job {
    const struct recon_options *options;
    double gate_m[2];     /* as asked for, up to where the file ends */
    double band_hz[2];    /* of the waves; light-cone transform: 0, 0 */
    size_t n_not_finite;  /* samples of the file */
    struct survey survey; /* each place of the scan is a ping of its own */
    struct pool *pool;
    struct grid grid;
    float *intensity; /* [nz][ny][nx] */
    Anlos__DetectionList *detections;
    struct stopwatch stages[RECON_STAGES], total;
};

/* "lct\0fk\0backprojection\0", as imager_methods; the first is the default. */
const char *confocal_methods(void);
bool confocal_has_method(const char *name);

/* Of the light-cone transform's Wiener filter: what single photons bear. */
#define CONFOCAL_SNR_DB 3.0

/* Reads and images.  confocal_job_clear it, also after a failure.  0, or as
 * confocal_file_load; -EINTR (Ctrl-C), -ENOTSUP (the method cannot). */
int confocal_job_run(struct confocal_job *job, const struct recon_options *options,
                     struct error *why);
void confocal_job_clear(struct confocal_job *job);

/* Runs options->confocal and writes the same files as for sound.  began: when the command
 * started.  Returns the exit code. */
int confocal_run(const struct recon_options *options, const struct stopwatch *began);

#endif
