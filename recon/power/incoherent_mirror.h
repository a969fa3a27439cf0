/* recon/power/incoherent_mirror.h -- inside `--method incoherent`: mirrors that face the
 * array. They answer each pair from the one place between speaker and microphone, which
 * back-projection would spread over all voxels at that distance: they stand where they
 * are in the stack of all offsets (Lindell 2019, 3.2), as `--method paper` makes it. */
#ifndef ANLOS_RECON_POWER_INCOHERENT_MIRROR_H
#define ANLOS_RECON_POWER_INCOHERENT_MIRROR_H

#include "recon/imaging/imager.h"

struct incoherent_mirror;

/* *out NULL: midpoints that form no lattice tell nothing.  0, -EINVAL, -ENOMEM. */
int incoherent_mirror_create(struct incoherent_mirror **out,
                             const struct imager_config *cfg);
void incoherent_mirror_add(struct incoherent_mirror *m, size_t position, size_t speaker,
                           const float complex *traces, const bool *masked);

/* false, and nothing written: this is no mirror. */
bool incoherent_mirror_image(struct incoherent_mirror *m, float *intensity);
void incoherent_mirror_reset(struct incoherent_mirror *m);
void incoherent_mirror_destroy(struct incoherent_mirror *m);

#endif
