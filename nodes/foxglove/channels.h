/* SPDX-License-Identifier: MIT */
/* nodes/foxglove/channels.h -- what Foxglove is offered: every topic of msgs/topics.h
 * under its own name and schema, and under "view/" what of it a person looks at, in
 * Foxglove's schemas, and one of ours for its plots:
 *
 *   view/cloud    foxglove.PointCloud       the voxels that stand out, where they are
 *   view/voxels   foxglove.VoxelGrid        the whole image, coarser
 *   view/front    foxglove.CompressedImage  the image's maxima as seen by the array
 *   view/top      foxglove.CompressedImage
 *   view/side     foxglove.CompressedImage
 *   view/objects  foxglove.SceneUpdate      the hidden objects, how certain they are, and
 *                                           how they move
 *   view/scene    foxglove.SceneUpdate      the survey's wall, vehicle, speakers,
 *                                           microphones
 *   view/walls    foxglove.SceneUpdate      the walls that node wall tells of
 *   view/frames   foxglove.FrameTransforms  between the frames below
 *   view/figures  anlos.Figures             signal to noise, latency, number of objects
 *   view/log      foxglove.Log
 *
 * Frames, as Foxglove draws them:
 *   vehicle  x forward, y left, z up; the root, where the survey has a mount
 *   array    x along the stage, y up, z forward to the wall; the root without a mount
 *   stage    the array frame, moved with the elements along the stage
 *
 * What is imaged appears mirrored behind the wall; where the wall is known, everything is
 * shown where it really is, in front of it. */
#ifndef ANLOS_NODES_FOXGLOVE_CHANNELS_H
#define ANLOS_NODES_FOXGLOVE_CHANNELS_H

#include <stdbool.h>

#include "msgs/bag/record.h"
#include "nodes/foxglove/message.h"
#include "nodes/foxglove/parts.h"
#include "nodes/rt/setting.h"

#define CHANNEL_VIEW        "view/" /* what the names of converted ones begin with */
#define CHANNEL_MAX_SOURCES 2

/* A message in another schema; a pure function: the same one in the same setting gives
 * the same bytes.  *out is in the arena.  0, -ENOMEM, -EAGAIN (its survey is not known
 * yet), -EINVAL (it does not hold). */
typedef int (*foxglove_convert)(struct arena *a, const struct setting *s,
                                const struct foxglove_message *m, ProtobufCMessage **out);

struct channel {
    const char *name;
    struct bag_schema schema;                         /* without an id */
    const struct topic *sources[CHANNEL_MAX_SOURCES]; /* NULL: no more */
    foxglove_convert convert;                         /* NULL: a topic as it is */
};

/* Takes what concerns it from any message.  true: there is another survey now, and what
 * was made with the one before does not hold. */
bool setting_take(struct setting *s, const struct foxglove_message *m);

/* How many there are; the first TOPICS_COUNT are those of topics_all. */
size_t channels_count(void);

/* index: 0 up to channels_count. */
void channel_get(size_t index, struct channel *out);
bool channel_is_from(const struct channel *c, const struct topic *t);

/* What the message becomes in the channel, packed into *out, which free() frees.  The
 * setting knows the message already (setting_take).  0, -ENOMEM, as foxglove_convert. */
int channel_pack(const struct channel *c, const struct setting *s,
                 const struct foxglove_message *m, uint8_t **out, size_t *size);

#endif
