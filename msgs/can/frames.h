/* SPDX-License-Identifier: MIT */
/* msgs/can/frames.h -- the vehicle's view of hidden objects as CAN frames, and what it
 * tells the sensor.  The layout is that of anlos.dbc beside this file.  A list is one
 * header frame, one time frame, and for each object either a state, a dynamics and a
 * quality frame, or one FD frame; before these, where that is wanted, a motion frame.
 *
 * Packing leaves the bytes of the end-to-end protection 0: msgs/can/e2e.h fills
 * and checks them, when a frame is sent or has come. */
#ifndef ANLOS_MSGS_CAN_FRAMES_H
#define ANLOS_MSGS_CAN_FRAMES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/can/layout.h"

#define CAN_MAX_OBJECTS       32
#define CAN_INTERFACE_VERSION 2 /* of the layout; rises when a signal moves */

enum can_state {
    CAN_INIT,
    CAN_CALIBRATING,
    CAN_ACTIVE,
    CAN_DEGRADED,
    CAN_FAULT,
    CAN_BLOCKED,
    CAN_STANDBY,
    CAN_STATE_UNKNOWN
};
enum can_source { CAN_LIVE, CAN_REPLAY, CAN_SIMULATION, CAN_SOURCE_UNKNOWN };
enum can_time_sync { CAN_NOT_SYNCHRONISED, CAN_SYNCHRONISED, CAN_SYNC_UNKNOWN = 3 };
enum can_measurement { CAN_NEW, CAN_MEASURED, CAN_PREDICTED, CAN_DELETED };
enum can_class { CAN_CLASS_UNKNOWN, CAN_POINT, CAN_PLATE, CAN_EXTENDED, CAN_MULTIPATH };
enum can_motion { CAN_MOTION_UNKNOWN, CAN_STANDING, CAN_MOVING };
enum can_standstill { CAN_ROLLS, CAN_STANDS, CAN_STANDSTILL_UNKNOWN = 3 };
enum can_validity { CAN_INVALID, CAN_VALID, CAN_VALIDITY_UNKNOWN = 3 };

enum can_request { CAN_IDLE, CAN_SAVE, CAN_REQUEST_UNKNOWN = 3 };
enum can_reason { /* of a request to save */
                  CAN_UNSPECIFIED,
                  CAN_DRIVER,
                  CAN_COLLISION,
                  CAN_EMERGENCY_BRAKING,
                  CAN_EVASION,
                  CAN_MISSED_OBJECT,
                  CAN_FALSE_OBJECT,
                  CAN_TEST,
                  CAN_REASON_UNKNOWN = 15
};

enum can_fault { /* bits of the status; what each means is in the DBC */
                 CAN_FAULT_IMAGE_STALE,
                 CAN_FAULT_EGO_MISSING,
                 CAN_FAULT_TEMPERATURE_UNKNOWN,
                 CAN_FAULT_CHANNELS_DEAD,
                 CAN_FAULT_ELEMENT_ERRORS,
                 CAN_FAULT_WALL_LOST,
                 CAN_FAULT_CLOCK_JUMP,
                 CAN_FAULT_INPUT_E2E,
                 CAN_FAULT_ARRAY_AWAY,
                 CAN_FAULT_NODE_LOST,
                 CAN_FAULT_CLIPPED,
                 CAN_FAULT_LISTS_DROPPED,
                 CAN_FAULT_RANGE_REDUCED,
                 CAN_FAULT_ELEMENTS_COVERED,
                 CAN_FAULT_ELEMENTS_MOVED,
                 CAN_FAULT_INTERFERENCE,
                 CAN_FAULTS
};

/* NaN stands for what is not known, in all of these. */
struct can_status { /* every 100 ms */
    enum can_state state;
    enum can_source source;
    uint16_t faults; /* 1 << enum can_fault */
    double temperature_c;
    double sound_speed_m_s;
    double range_m; /* up to which a person is found, 0: nowhere; sent rounded to 0.2 m */
    bool shutdown;  /* nothing comes after this: it was stopped in order */
};

struct can_diagnosis { /* every second */
    double cpu;        /* 0..1 of all processors */
    double snr_db;     /* of the strongest object, or of the image */
    uint16_t dropped;  /* pings that got lost since the start; its low 10 bits are sent */
    uint8_t version_major, version_minor, version_patch; /* to 15, 31, 31 */
    uint8_t trouble;      /* 0: none; 1 + enum can_fault: a fault since the start */
    bool trouble_present; /* it is there now */
    uint8_t trouble_count;
};

struct can_list_header {
    uint8_t number;    /* objects that follow, 0..CAN_MAX_OBJECTS */
    uint16_t counter;  /* measurement counter; its low 12 bits are sent */
    double latency_ms; /* from the capture stamp to sending: the age of the list */
    double cycle_ms;
    bool truncated; /* there were more objects than fit */
    enum can_time_sync time_sync;
    uint8_t version; /* packed as CAN_INTERFACE_VERSION, whatever is here */
};

struct can_time { /* since 1970: a capture stamp */
    uint32_t seconds;
    uint16_t fraction; /* of 2^-16 s, rounded down */
};

struct can_object {
    uint8_t id;
    uint16_t counter;     /* of the list: a state belongs to one; the low 4 or 12 bits */
    double position_m[3]; /* vehicle frame */
    enum can_measurement measurement;
    double existence; /* 0..1 */
    double velocity_m_s[2];
    double sigma_m[2];  /* standard deviation of x, y */
    double correlation; /* of x and y */
    double length_m, width_m;
    enum can_class class;
    enum can_motion motion;
    double sigma_v_m_s; /* the larger one of both axes */

    /* Motion frame only. */
    double course_rad; /* of the velocity, from x to the left; -pi..pi */
    double sigma_course_rad;
    double sigma_velocity_m_s[2]; /* of x, y */
    double velocity_correlation;  /* of x and y */

    /* FD only. */
    double covariance_m2[6]; /* xx xy xz yy yz zz of position_m */
    double height_m;
    double class_probability; /* 0..1 */
    double age_s, unseen_s;   /* since it was seen first, last */
    uint8_t wall;             /* that mirrored it; 0: none */
    bool behind_no_wall, in_free_view;
};

#define CAN_VIEW_AREAS   15
#define CAN_VIEW_CORNERS 8

struct can_view_corner {     /* of a convex area of the floor that a list can tell of */
    uint16_t counter;        /* of the list: the low 4 bits */
    uint8_t wall;            /* by way of which; 0: directly; 15: that or a higher one */
    uint8_t area;            /* from 0; of all areas of the list */
    uint8_t corner, corners; /* from 0; how many the area has: 3..8; 0: nothing is seen */
    double at_m[2];          /* x, y of the vehicle frame */
};

struct can_ego_motion {    /* from the vehicle, every 20 ms */
    double speed_m_s;      /* of the vehicle's origin, forward */
    double yaw_rate_rad_s; /* positive: to the left */
    enum can_standstill standstill;
    enum can_validity validity;
};

struct can_ambient { /* from the vehicle, every second */
    double temperature_c;
    double humidity; /* 0..1 */
};

/* From the vehicle: an upright wall, the points p of the vehicle frame with
 * p.x cos(azimuth) + p.y sin(azimuth) = distance. */
struct can_wall_in {
    uint8_t id;                 /* 1..15; 0: none */
    enum can_validity validity; /* not valid: take it back */
    double azimuth_rad; /* of the normal, which points from the vehicle to the wall */
    double distance_m;
    double sigma_azimuth_rad, sigma_distance_m;
};

/* From the vehicle, before its WallIn: where that wall ends, along it from the foot of
 * the perpendicular from the vehicle's origin, positive to the left of who looks from
 * there at the wall. */
struct can_wall_ends_in {
    uint8_t id;                 /* as in WallIn */
    enum can_validity validity; /* not valid: not known to end */
    double from_m, to_m;        /* on the right, on the left; from < to */
};

/* From the vehicle, every second, and every 100 ms while something happens: keep what was
 * heard. */
struct can_save_request {
    uint16_t number; /* another one with each event */
    enum can_reason reason;
    enum can_request request;
};

/* Each writes one frame; base: where the identifiers of the sensor begin.  Values outside
 * a signal's range are clamped to it; what is not known is sent as the signal's raw value
 * for that.  Standard deviations are rounded up. */
void can_pack_status(struct can_frame_data *out, uint32_t base,
                     const struct can_status *s);
void can_pack_diagnosis(struct can_frame_data *out, uint32_t base,
                        const struct can_diagnosis *d);
void can_pack_list_header(struct can_frame_data *out, uint32_t base,
                          const struct can_list_header *h);
void can_pack_time(struct can_frame_data *out, uint32_t base, int64_t stamp_ns);
void can_pack_object_state(struct can_frame_data *out, uint32_t base,
                           const struct can_object *o);
void can_pack_object_dynamics(struct can_frame_data *out, uint32_t base,
                              const struct can_object *o);
void can_pack_object_quality(struct can_frame_data *out, uint32_t base,
                             const struct can_object *o);
void can_pack_object_motion(struct can_frame_data *out, uint32_t base,
                            const struct can_object *o);
void can_pack_object_fd(struct can_frame_data *out, uint32_t base,
                        const struct can_object *o);
/* Would the double of o at the offset go as it is into the frames of an object, fd: into
 * the FD frame, but for rounding?  False: it is out of the range there, and would be
 * clamped.  What the frames do not carry fits. */
bool can_object_fits(const struct can_object *o, bool fd, size_t offset);
void can_pack_field_of_view(struct can_frame_data *out, uint32_t base,
                            const struct can_view_corner *c);
void can_pack_ego_motion(struct can_frame_data *out, uint32_t base,
                         const struct can_ego_motion *e);
void can_pack_ambient(struct can_frame_data *out, uint32_t base,
                      const struct can_ambient *a);
void can_pack_wall_in(struct can_frame_data *out, uint32_t base,
                      const struct can_wall_in *w);
void can_pack_wall_ends_in(struct can_frame_data *out, uint32_t base,
                           const struct can_wall_ends_in *w);
void can_pack_save_request(struct can_frame_data *out, uint32_t base,
                           const struct can_save_request *r);

/* Each reads one frame, whatever its identifier, into the members that it carries.  0,
 * -EINVAL (not its size or kind of frame). */
int can_unpack_status(const struct can_frame_data *f, struct can_status *out);
int can_unpack_diagnosis(const struct can_frame_data *f, struct can_diagnosis *out);
int can_unpack_list_header(const struct can_frame_data *f, struct can_list_header *out);
int can_unpack_time(const struct can_frame_data *f, int64_t *stamp_ns);
int can_unpack_object_state(const struct can_frame_data *f, struct can_object *out);
int can_unpack_object_dynamics(const struct can_frame_data *f, struct can_object *out);
int can_unpack_object_quality(const struct can_frame_data *f, struct can_object *out);
int can_unpack_object_motion(const struct can_frame_data *f, struct can_object *out);
int can_unpack_object_fd(const struct can_frame_data *f, struct can_object *out);
int can_unpack_field_of_view(const struct can_frame_data *f, struct can_view_corner *out);
int can_unpack_ego_motion(const struct can_frame_data *f, struct can_ego_motion *out);
int can_unpack_ambient(const struct can_frame_data *f, struct can_ambient *out);
int can_unpack_wall_in(const struct can_frame_data *f, struct can_wall_in *out);
int can_unpack_wall_ends_in(const struct can_frame_data *f, struct can_wall_ends_in *out);
int can_unpack_save_request(const struct can_frame_data *f, struct can_save_request *out);

#endif
