/* recon/inverse/iterative_slabs.h -- inside `--method iterative`: slabs of depth, each
 * with the point spread function of its middle as a Gaussian. */
#ifndef ANLOS_RECON_INVERSE_ITERATIVE_SLABS_H
#define ANLOS_RECON_INVERSE_ITERATIVE_SLABS_H

#include "recon/imaging/imager.h"

struct iterative_slab {
    size_t first, core;   /* planes of the image that are its own */
    double covariance[6]; /* of the function, voxels^2: xx xy xz yy yz zz */
};

struct iterative_slabs {
    size_t n;
    struct iterative_slab *all; /* [n] */
    size_t margin;              /* planes shared with each neighbour */
    size_t size[3]; /* voxels of a slab with margins and with room for the widest
                     * function */
};

/* measured NULL: from the geometry.  Clear it, also after an error.  0, -ENOMEM, -ENOTSUP
 * (*why says what it needs). */
int iterative_slabs_create(struct iterative_slabs *s, const struct imager_config *cfg,
                           const struct psf *measured, const char **why);
void iterative_slabs_clear(struct iterative_slabs *s);

#endif
