/* nodes/anlos/confocal/image.h -- an optical scan to a volume: by the light-cone
 * transform of its counts (Lindell 2019, Eq. 9), or by f-k migration or back-projection
 * of their square roots as a wave (nodes/anlos/confocal/traces.h). */
#ifndef ANLOS_NODES_ANLOS_CONFOCAL_IMAGE_H
#define ANLOS_NODES_ANLOS_CONFOCAL_IMAGE_H

#include "nodes/anlos/confocal/job.h"

/* By the job's options: sets its grid, intensity, survey and band_hz.  The scan's counts
 * may change.  0, -ENODATA (nothing changes over time), -ENOTSUP (the method cannot),
 * -ENOMEM. */
int confocal_image(struct confocal_job *job, struct confocal_scan *scan,
                   struct complaint *why);

#endif
