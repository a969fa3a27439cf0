/* SPDX-License-Identifier: MIT */
/* tests/nodes/wall_message.h -- a message of topic "wall". */
#ifndef ANLOS_TESTS_NODES_WALL_MESSAGE_H
#define ANLOS_TESTS_NODES_WALL_MESSAGE_H

#include <string.h>

#include "msgs/wall.pb-c.h"

struct wall_message { /* one wall, straight ahead */
    Anlos__WallList list;
    Anlos__Wall wall, *each[1];
    Anlos__Vec3 normal;
    double covariance[6], free_view_m[8];
};

static inline void wall_message_make(struct wall_message *m)
{
    anlos__wall_list__init(&m->list);
    anlos__wall__init(&m->wall);
    anlos__vec3__init(&m->normal);
    m->each[0] = &m->wall;
    m->list.n_walls = 1;
    m->list.walls = m->each;
    m->wall.id = 3;
    m->wall.normal = &m->normal;
    m->normal.x = 1.0;
    m->wall.distance_m = 5.0;
    m->wall.gate_far_m = 9.0;
    memset(m->covariance, 0, sizeof m->covariance);
    m->covariance[0] = 1e-4;
    m->covariance[5] = 4e-4;
    m->wall.covariance = m->covariance;
    m->wall.n_covariance = 6;
    m->list.free_view_m = m->free_view_m;
}

#endif
