#include "nodes/track/candidates.h"

#include <string.h>

#include "nodes/rt/objects.h"

#define AT_WALL_M 0.25 /* what is imaged so close behind a wall is the wall */

static struct ghost_source source_of(const Anlos__Detection *d)
{
    const double virtual_m[3] = {d->virtual_m->x, d->virtual_m->y, d->virtual_m->z};

    return ghost_source_at(virtual_m, d->level_db);
}

static bool is_behind_a_wall(const struct sight *sight, const Anlos__Detection *d)
{
    const double virtual_m[3] = {d->virtual_m->x, d->virtual_m->y, d->virtual_m->z};

    return !d->behind_no_wall && sight_lost(sight, virtual_m) == sight->lost->n &&
           sight_behind_m(sight, d->wall, virtual_m) > AT_WALL_M;
}

size_t candidates_choose(Anlos__DetectionList *list, const struct sight *sight,
                         const struct ghost_array *array,
                         const struct ghost_source *tracks, size_t n)
{
    struct ghost_source seen[OBJECTS_MAX];
    size_t n_seen = list->n_detections, chosen = 0;

    for (size_t i = 0; i < n_seen; i++)
        seen[i] = source_of(list->detections[i]);
    for (size_t i = 0; i < n_seen; i++) {
        Anlos__Detection *d = list->detections[i];
        if (!is_behind_a_wall(sight, d) || ghosts_may_be(array, &seen[i], seen, n_seen) ||
            ghosts_may_be(array, &seen[i], tracks, n))
            continue;
        memmove(list->detections + chosen + 1, list->detections + chosen,
                (i - chosen) * sizeof(Anlos__Detection *));
        list->detections[chosen++] = d;
    }
    return chosen;
}
