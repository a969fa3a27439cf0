/* nodes/anlos/sim/job.h -- a scene file to a recording on disk: both passes as WAV files,
 * survey.yaml with its calibration curves, truth.json. */
#ifndef ANLOS_NODES_ANLOS_SIM_JOB_H
#define ANLOS_NODES_ANLOS_SIM_JOB_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/complaint.h"

struct sim_options { /* borrow from argv */
    const char *scene, *out;
    size_t threads;
    bool progress; /* a line on stderr that is rewritten */
};

/* Reads the scene and checks the output folder, renders and writes: everything appears in
 * the folder at the end, or nothing.  *bad_input tells whose fault a failure is.
 * 0, -EINTR (Ctrl-C, see interrupt.h), -EEXIST (the folder holds a recording already),
 * other negative errno. */
int sim_job_run(const struct sim_options *options, bool *bad_input,
                struct complaint *why);

#endif
