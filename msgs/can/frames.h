/* msgs/can/frames.h -- the vehicle's view of hidden objects as CAN frames; the layout is
 * that of anlos.dbc beside this file (Intel byte order, physical = raw * factor +
 * offset). A list is one header frame, one time frame, and a state, a dynamics and a
 * quality frame for each object.
 *
 * The first 16 bits of every frame are sent as 0: CRC, counter and data ID nibble of
 * AUTOSAR E2E profile 11 in its nibble variant go there. */
#ifndef ANLOS_MSGS_CAN_FRAMES_H
#define ANLOS_MSGS_CAN_FRAMES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CAN_MAX_OBJECTS       32
#define CAN_INTERFACE_VERSION 1 /* of the layout; rises when a signal moves */

enum can_id { /* added to the base identifier of the sensor */
              CAN_ID_STATUS = 0x00,
              CAN_ID_LIST_HEADER = 0x02,
              CAN_ID_TIME = 0x03,
              CAN_ID_OBJECT_STATE = 0x04,
              CAN_ID_OBJECT_DYNAMICS = 0x05,
              CAN_ID_OBJECT_QUALITY = 0x06,
};
#define CAN_BASE_DEFAULT 0x400

struct can_frame_data {
    uint32_t id;
    uint8_t size; /* 0..8; up to 64 when fd */
    bool fd;
    uint8_t data[64];
};

enum can_state {
    CAN_INIT,
    CAN_CALIBRATING,
    CAN_ACTIVE,
    CAN_DEGRADED,
    CAN_FAULT,
    CAN_BLOCKED,
    CAN_STANDBY
};
enum can_source { CAN_LIVE, CAN_REPLAY, CAN_SIMULATION, CAN_SOURCE_UNKNOWN };
enum can_measurement { CAN_NEW, CAN_MEASURED, CAN_PREDICTED, CAN_DELETED };

struct can_status { /* every 100 ms */
    enum can_state state;
    enum can_source source;
    uint16_t faults;
    double temperature_c; /* NaN: sent as not available */
    double sound_speed_m_s;
};

struct can_list_header {
    uint8_t number;    /* objects that follow, 0..CAN_MAX_OBJECTS */
    uint16_t counter;  /* measurement counter; its low 12 bits are sent */
    double latency_ms; /* from the capture stamp to sending: the age of the list */
    double cycle_ms;
    bool truncated; /* there were more objects than fit */
};

struct can_object {
    uint8_t id;
    uint8_t counter; /* low bits of the list's counter: a state belongs to one list */
    double position_m[3]; /* vehicle frame */
    enum can_measurement measurement;
    double existence; /* 0..1 */
    double velocity_m_s[2];
    double sigma_m[2];  /* standard deviation of x, y */
    double correlation; /* of x and y */
    double length_m, width_m;
};

/* Each writes one frame.  Values outside a signal's range are clamped to it (x +-81.9 m,
 * y +-40.94 m, z +-12.75 m, the rest in anlos.dbc); NaN is sent as the signal's raw value
 * for not available.  Standard deviations are rounded up. */
void can_pack_status(struct can_frame_data *out, uint32_t base,
                     const struct can_status *s);
void can_pack_list_header(struct can_frame_data *out, uint32_t base,
                          const struct can_list_header *h);
void can_pack_time(struct can_frame_data *out, uint32_t base, int64_t stamp_ns);
void can_pack_object_state(struct can_frame_data *out, uint32_t base,
                           const struct can_object *o);
void can_pack_object_dynamics(struct can_frame_data *out, uint32_t base,
                              const struct can_object *o);
void can_pack_object_quality(struct can_frame_data *out, uint32_t base,
                             const struct can_object *o);

#endif
