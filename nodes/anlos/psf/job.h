/* nodes/anlos/psf/job.h -- the point spread function of an array: a Gaussian with
 * rotation fitted to the image of a small corner reflector (Lindell 2019, 3.3), or to
 * that of a point which the geometry alone gives (recon/psf.h). */
#ifndef ANLOS_NODES_ANLOS_PSF_JOB_H
#define ANLOS_NODES_ANLOS_PSF_JOB_H

#include "nodes/anlos/psf/file.h"
#include "nodes/anlos/recon/options.h"
#include "recon/grid.h"

struct psf_job {
    struct psf_file file;
    struct grid grid; /* around the point */
    float *intensity; /* [nz][ny][nx] */
    double
        expected_m[3]; /* widths of a coherent image, from the geometry; measured only */
    size_t n_others;   /* objects nearly as bright as the one that was fitted */
    size_t pings, pings_expected;
};

/* Images the recording, then the surroundings of its brightest place in fine steps, and
 * fits there.  psf_job_clear it, also after a failure.  0, as recon_job_run, -EINVAL
 * (nothing stands out, or on the volume's rim), -ERANGE (no peak to fit). */
int psf_job_measure(struct psf_job *job, const struct recon_options *options,
                    struct complaint *why);

/* From the survey's geometry and band for a point in the array frame, behind the wall.
 * 0, as survey_load, -ERANGE (the aperture resolves fewer than two axes), -ENOMEM. */
int psf_job_compute(struct psf_job *job, const char *survey, const double at_m[3],
                    struct complaint *why);
void psf_job_clear(struct psf_job *job);

#endif
