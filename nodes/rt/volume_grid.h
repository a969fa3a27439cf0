/* nodes/rt/volume_grid.h -- the grid and the intensity inside a volume message. */
#ifndef ANLOS_NODES_RT_VOLUME_GRID_H
#define ANLOS_NODES_RT_VOLUME_GRID_H

#include "msgs/volume.pb-c.h"
#include "recon/grid.h"

/* intensity [nz][ny][nx], borrowed from the message.  NULL: the message does not hold, or
 * its grid lies or reaches farther than 10 km, or is finer than 1 um. */
const float *volume_grid(const Anlos__Volume *v, struct grid *out);

#endif
