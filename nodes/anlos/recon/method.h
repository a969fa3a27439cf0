/* nodes/anlos/recon/method.h -- which method images a recording, and with what options.
 */
#ifndef ANLOS_NODES_ANLOS_RECON_METHOD_H
#define ANLOS_NODES_ANLOS_RECON_METHOD_H

#include "nodes/anlos/recon/job.h"

/* Sets the job's method, the reason when nobody named one, its options and the point
 * spread function, and hands them to the processing.  The survey is known.  0, -EINVAL
 * (an option that the method does not use), or as psf_file_load. */
int recon_method_plan(struct recon_job *job, struct error *why);

#endif
