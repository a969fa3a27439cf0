/* nodes/foxglove/image.h -- a volume that is to be converted: its grid, its brightness
 * and the wall that mirrors it. */
#ifndef ANLOS_NODES_FOXGLOVE_IMAGE_H
#define ANLOS_NODES_FOXGLOVE_IMAGE_H

#include "nodes/foxglove/level.h"
#include "nodes/foxglove/message.h"
#include "nodes/foxglove/setting.h"
#include "recon/grid.h"

struct image { /* borrows from the message */
    struct grid grid;
    const float *intensity; /* [nz][ny][nx] */
    struct levels levels;
    bool has_wall;
    struct wall wall;
};

/* At most max voxels are to stand out.  0, -EAGAIN (the survey is not that of the
 * volume), -EINVAL (it does not hold). */
int image_open(struct image *out, const struct setting *s,
               const struct foxglove_message *m, size_t max);

#endif
