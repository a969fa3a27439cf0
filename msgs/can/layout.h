/* SPDX-License-Identifier: MIT */
/* msgs/can/layout.h -- the frames of anlos.dbc beside this file as a table: pack, unpack
 * and `anlos can decode` all read it, and a test holds it against the DBC. */
#ifndef ANLOS_MSGS_CAN_LAYOUT_H
#define ANLOS_MSGS_CAN_LAYOUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* One CAN frame, classic or FD. */
struct can_frame_data {
    uint32_t id;
    uint8_t size; /* 0..8; up to 64 when fd */
    bool fd;
    uint8_t data[64];
};

/* One signal of a frame: where its bits are, what they mean, and which member of a C
 * structure holds its value.  Intel byte order, physical = raw * factor + offset. */

enum can_signal_kind {
    CAN_SIGNAL_NUMBER,  /* clamped to its range */
    CAN_SIGNAL_SIGMA,   /* the same, rounded up: never said better than it is */
    CAN_SIGNAL_CHOICE,  /* has names; what is no choice is sent as missing */
    CAN_SIGNAL_COUNTER, /* wraps around */
    CAN_SIGNAL_BITS,    /* a name for each bit */
    CAN_SIGNAL_FLOAT,   /* float32; NaN is missing */
};

enum can_member_type {
    CAN_MEMBER_NONE, /* E2E protection: in no structure */
    CAN_MEMBER_DOUBLE,
    CAN_MEMBER_BOOL,
    CAN_MEMBER_U8,
    CAN_MEMBER_U16,
    CAN_MEMBER_U32, /* and enumerations */
};

#define CAN_NEVER_MISSING INT64_MIN

struct can_signal {
    const char *name, *unit;
    unsigned start, length;
    enum can_signal_kind kind;
    double factor, offset;
    int64_t min, max; /* raw; below 0: signed.  Of a float: physical */
    int64_t missing;  /* raw, for NaN and for what is no choice; or CAN_NEVER_MISSING */
    struct {
        enum can_member_type type; /* a double holds the physical value / scale, any other
                                      the raw value */
        size_t at;
        double scale; /* physical units in a unit of the member: 100 % in 1 */
    } member;
    const char *const *names; /* of raw values or bits from 0 on, up to NULL; or NULL */
};

/* content: the structure that member.at counts from. */
void can_signal_put(const struct can_signal *s, struct can_frame_data *f,
                    const void *content);
void can_signal_take(const struct can_signal *s, const struct can_frame_data *f,
                     void *content);

/* Would its value be sent as it is, but for the rounding to a step?  So is what is not
 * known.  Only of members of type double. */
bool can_signal_fits(const struct can_signal *s, const void *content);

/* The bits as a number, the sign extended.  Of a float: its bit pattern. */
int64_t can_signal_raw(const struct can_signal *s, const struct can_frame_data *f);

/* In the signal's unit; NaN when missing. */
double can_signal_physical(const struct can_signal *s, const struct can_frame_data *f);

/* So is a number out of its range: nobody sends one that means something. */
bool can_signal_is_missing(const struct can_signal *s, const struct can_frame_data *f);

/* Of a raw value; NULL when it has none. */
const char *can_signal_name(const struct can_signal *s, int64_t raw);

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
              CAN_ID_OBJECT_MOTION = 0x07,
              CAN_ID_OBJECT_FD = 0x08,
              CAN_ID_FIELD_OF_VIEW = 0x09,
              CAN_ID_WALL_ENDS_IN = 0x0B,
              CAN_ID_EGO_MOTION = 0x0C,
              CAN_ID_AMBIENT = 0x0D,
              CAN_ID_WALL_IN = 0x0E,
              CAN_ID_SAVE_REQUEST = 0x0F,
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
