/* msgs/can/layout.h -- the frames of anlos.dbc beside this file as a table: pack, unpack
 * and `anlos can decode` all read it, and a test holds it against the DBC. */
#ifndef ANLOS_MSGS_CAN_LAYOUT_H
#define ANLOS_MSGS_CAN_LAYOUT_H

#include <stddef.h>
#include <stdint.h>

#include "msgs/can/signal.h"

/* Where the identifiers of a sensor begin: the base of the vehicle + 0x10 * sensor. */
#define CAN_BASE_DEFAULT 0x400
#define CAN_SENSOR_STEP  0x10

enum can_id { /* added to where the sensor's begin */
              CAN_ID_STATUS = 0x00,
              CAN_ID_DIAGNOSIS = 0x01,
              CAN_ID_LIST_HEADER = 0x02,
              CAN_ID_TIME = 0x03,
              CAN_ID_OBJECT_STATE = 0x04,
              CAN_ID_OBJECT_DYNAMICS = 0x05,
              CAN_ID_OBJECT_QUALITY = 0x06,
              CAN_ID_OBJECT_FD = 0x08,
              CAN_ID_EGO_MOTION = 0x0C,
              CAN_ID_AMBIENT = 0x0D,
              CAN_ID_WALL_IN = 0x0E,
};

enum can_profile { CAN_PROFILE_11_NIBBLE, CAN_PROFILE_05 }; /* msgs/can/e2e.h */

struct can_message {
    const char *name;
    enum can_id id;
    uint8_t size;
    bool fd;
    bool input;        /* from the vehicle */
    unsigned cycle_ms; /* 0: with each list */
    enum can_profile profile;
    const struct can_signal *signals; /* [n_signals] */
    size_t n_signals;
};

/* In the order of their identifiers. */
const struct can_message *can_messages(size_t *n);

/* NULL: none of ours.  base: where the identifiers of the sensor begin. */
const struct can_message *can_message_find(uint32_t base, uint32_t id);

#endif
