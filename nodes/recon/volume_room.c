/* SPDX-License-Identifier: MIT */
#include "nodes/recon/volume_room.h"

#include <errno.h>

#include "msgs/topics.h"
#include "recon/processing.h"

#define VOLUME_HEAD_SIZE 8192 /* of a volume message, without its voxels, at most */

static size_t room_of_voxels(void)
{
    return (topic_volume()->max_size - VOLUME_HEAD_SIZE) / sizeof(float);
}

int volume_room_check(const struct survey *s, struct error *why)
{
    const size_t room = room_of_voxels();
    struct processing p;
    int err = processing_plan(&p, s, why);

    if (err || grid_size(&p.grid) <= room)
        return err;
    return error_say(why, -EINVAL,
                     "volume: %zu voxels do not fit a message; expected at most %zu, use "
                     "larger steps",
                     grid_size(&p.grid), room);
}

void volume_room_fit(struct volume *v)
{
    if (grid_size(&v->grid) + grid_size(&v->around.grid) > room_of_voxels())
        v->around = (struct surroundings_view){.intensity = NULL};
}
