/* SPDX-License-Identifier: MIT */
/* nodes/foxglove/convert.h -- messages of ours as messages in Foxglove's schemas.  Each
 * is a pure function: the same message in the same setting gives the same bytes.
 *
 * What is imaged appears mirrored behind the wall; where the wall is known, everything is
 * shown where it really is, in front of it. */
#ifndef ANLOS_NODES_FOXGLOVE_CONVERT_H
#define ANLOS_NODES_FOXGLOVE_CONVERT_H

#include "nodes/foxglove/message.h"
#include "nodes/foxglove/parts.h"
#include "nodes/foxglove/setting.h"

/* *out is in the arena.  0, -ENOMEM, -EAGAIN (its survey is not known yet), -EINVAL (it
 * does not hold). */
typedef int (*foxglove_convert)(struct arena *a, const struct setting *s,
                                const struct foxglove_message *m, ProtobufCMessage **out);

/* "volume" to foxglove.PointCloud: x, y, z in m and intensity in dB of the brightest
 * voxel, of those that stand out. */
int convert_cloud(struct arena *a, const struct setting *s,
                  const struct foxglove_message *m, ProtobufCMessage **out);

/* "volume" to foxglove.VoxelGrid: intensity in dB of the brightest, each cell the maximum
 * of as many voxels as leave no more than 2^18 cells. */
int convert_voxels(struct arena *a, const struct setting *s,
                   const struct foxglove_message *m, ProtobufCMessage **out);

/* "volume" to foxglove.CompressedImage: its maxima as imaged (mirrored), as a PNG with
 * axes in m, seen from the front, from above, from the side. */
int convert_front(struct arena *a, const struct setting *s,
                  const struct foxglove_message *m, ProtobufCMessage **out);
int convert_top(struct arena *a, const struct setting *s,
                const struct foxglove_message *m, ProtobufCMessage **out);
int convert_side(struct arena *a, const struct setting *s,
                 const struct foxglove_message *m, ProtobufCMessage **out);

/* "detections" to foxglove.SceneUpdate: for each object a dot, an ellipsoid of two
 * standard deviations, a box of its size, a label, and of one that moves an arrow as long
 * as it goes over ground in a second. */
int convert_objects(struct arena *a, const struct setting *s,
                    const struct foxglove_message *m, ProtobufCMessage **out);

/* "survey" to foxglove.SceneUpdate: the vehicle, the speakers and microphones, and the
 * wall that the survey was given, as long as no "wall" came. */
int convert_scene(struct arena *a, const struct setting *s,
                  const struct foxglove_message *m, ProtobufCMessage **out);

/* "wall" to foxglove.SceneUpdate: each wall, whence it is known and how likely it is. */
int convert_walls(struct arena *a, const struct setting *s,
                  const struct foxglove_message *m, ProtobufCMessage **out);

/* "survey" and "stage/state" to foxglove.FrameTransforms: array in vehicle, stage in
 * array. */
int convert_transforms(struct arena *a, const struct setting *s,
                       const struct foxglove_message *m, ProtobufCMessage **out);

/* "detections" to anlos.Figures, for plots (nodes/rt/list_figures.h). */
int convert_figures(struct arena *a, const struct setting *s,
                    const struct foxglove_message *m, ProtobufCMessage **out);

/* "log" to foxglove.Log. */
int convert_log(struct arena *a, const struct setting *s,
                const struct foxglove_message *m, ProtobufCMessage **out);

#endif
