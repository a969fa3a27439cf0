/* SPDX-License-Identifier: MIT */
/* recon/static_array/clutter_map.h -- what stood still over ground since an image before,
 * while the vehicle moved: it is set to 0, for it is echoes of walls and of what the
 * array sees directly, of which there is no background.  A hidden object that stands goes
 * with it, as it does in a background.  Of what moves the whole body stays, as bright as
 * what is new of it (recon/static_array/bodies.h). */
#ifndef ANLOS_RECON_STATIC_ARRAY_CLUTTER_MAP_H
#define ANLOS_RECON_STATIC_ARRAY_CLUTTER_MAP_H

#include <stdbool.h>
#include <stdint.h>

#include "recon/ego.h"
#include "recon/grid.h"
#include "recon/mount.h"

struct clutter_map;

/* For images on a grid, each of what was heard in window_ns.  0, -ENOMEM. */
int clutter_map_create(struct clutter_map **out, const struct grid *grid,
                       int64_t window_ns);

/* Mutes voxels of an image [nz][ny][nx], having kept it as it was.  What it is held
 * against has no ping in common with it; where there is none, or the vehicle's path does
 * not reach, nothing is muted.  part, over 0: of its pings that have no background
 * subtracted; of clutter no more than this is left, and it is only kept if all have none.
 */
void clutter_map_mute(struct clutter_map *c, const struct ego_path *path,
                      const struct mount *mount, int64_t stamp_ns, double part,
                      float *image);
void clutter_map_reset(struct clutter_map *c);
void clutter_map_destroy(struct clutter_map *c);

#endif
