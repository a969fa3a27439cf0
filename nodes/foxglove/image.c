#include "nodes/foxglove/image.h"

#include <errno.h>

#include "nodes/rt/volume_grid.h"

int image_open(struct image *out, const struct setting *s,
               const struct foxglove_message *m, size_t max)
{
    const Anlos__Volume *volume = (const Anlos__Volume *)m->content;

    out->intensity = volume_grid(volume, &out->grid);
    if (!out->intensity)
        return -EINVAL;
    if (!s->has_survey || s->survey_id != volume->survey_id)
        return -EAGAIN;
    out->has_wall = setting_wall(s, &out->wall);
    levels_measure(&out->levels, out->intensity, grid_size(&out->grid), max);
    return 0;
}
