/* nodes/can/inbox.h -- what the vehicle tells over CAN: its frames, checked, as messages.
 * Time is an argument. */
#ifndef ANLOS_NODES_CAN_INBOX_H
#define ANLOS_NODES_CAN_INBOX_H

#include <stdbool.h>
#include <stdint.h>

#include "hal/canbus.h"
#include "msgs/can/protection.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/wall.pb-c.h"

#define INBOX_EGO_NS  100000000LL /* motion that is older is not known */
#define INBOX_WALL_NS 2000000000LL
#define INBOX_AWAY_NS 3000000000LL /* who was silent for so long counts anew */
#define INBOX_WALLS   15           /* as the frame numbers them, from 1 */

enum inbox_kind {
    INBOX_NOTHING, /* of no use, and no mistake: not available, or not to be believed */
    INBOX_WRONG,   /* damaged, repeated or out of sequence: not to be used */
    INBOX_EGO,
    INBOX_AMBIENT,
    INBOX_WALLS_GIVEN
};

struct inbox_wall {
    Anlos__Wall message;
    Anlos__Vec3 normal;
    double covariance[6];
    int64_t given_ns; /* 0: not known */
};

struct inbox {
    struct can_checks checks;
    int64_t heard_ns[CAN_SENSOR_STEP]; /* the newest frame, by enum can_id; 0: none */
    bool moves;                        /* ego is valid */
    int64_t ego_ns;                    /* when it was said last; 0: never */
    Anlos__EgoMotion ego;              /* the newest, to be published */
    Anlos__Ambient ambient;
    struct inbox_wall walls[INBOX_WALLS];
    Anlos__WallList wall_list; /* of those known; points to the following */
    Anlos__Wall *wall_pointers[INBOX_WALLS];
    uint64_t wrong;
};

/* base: where the identifiers of the sensor begin.  i must stay where it is. */
void inbox_init(struct inbox *i, uint32_t base);

/* The identifiers for canbus_listen; returns how many. */
size_t inbox_ids(const struct inbox *i, uint32_t ids[CANBUS_MAX_INPUTS]);

/* What a frame that came at came_ns brought, in ego, ambient or wall_list. */
enum inbox_kind inbox_take(struct inbox *i, const struct can_frame_data *f,
                           int64_t came_ns);

/* True once when nothing valid has come for INBOX_EGO_NS: ego says so then. */
bool inbox_ego_ends(struct inbox *i, int64_t now_ns);

/* True once when a wall was not given for INBOX_WALL_NS: wall_list is without it then. */
bool inbox_walls_end(struct inbox *i, int64_t now_ns);

#endif
