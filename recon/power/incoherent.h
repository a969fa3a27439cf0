/* SPDX-License-Identifier: MIT */
/* recon/power/incoherent.h -- what `--method incoherent` goes through, for who plans it.
 */
#ifndef ANLOS_RECON_POWER_INCOHERENT_H
#define ANLOS_RECON_POWER_INCOHERENT_H

#include <stdbool.h>

#include "recon/geometry.h"
#include "recon/grid.h"

/* Voxels that back-projection of power goes through for such an image, in all slabs;
 * *scan: by the fast way of an array on a stage. */
double incoherent_voxels(const struct geometry *g, const struct grid *image, bool *scan);

#endif
