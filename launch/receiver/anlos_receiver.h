/* SPDX-License-Identifier: MIT */
/* anlos_receiver.h -- the vehicle's side of the CAN frames of anlos: takes frames, checks
 * their end-to-end protection (AUTOSAR E2E profiles 11 and 5, and the state machine of
 * SWS_E2ELibrary), puts whole object lists together, watches time-outs, and hands over
 * objects with what may be done with them.  README.md beside this file is the guide;
 * msgs/can/anlos.dbc is the layout.
 *
 * One C99 file without dependencies: no allocation, no input or output, no clock, no
 * recursion, no mutable globals.  State is one struct of the caller's, about 14 kB; calls
 * for one struct must not overlap, those for several sensors (a struct each) may.  A
 * frame costs at most some microseconds on a small controller, and a whole list one copy
 * of it.
 *
 * Time is the caller's: milliseconds of any clock that only goes forward and may wrap
 * around at 2^32.  All calls for a struct take the same clock; one that reads as up to
 * 2^31 ms before the newest frame counts as that frame's time.
 *
 * Frame of reference: vehicle axis system of ISO 8855, X forward, Y left, Z up, of the
 * moment at which the sound was taken.  The origin is the one in which the sensor's mount
 * is given; it has to lie on the ground, and where EgoMotion is told, at the middle of
 * the rear axle (README.md says why).  Metres, seconds, probabilities of 0 to 1. */
#ifndef ANLOS_RECEIVER_H
#define ANLOS_RECEIVER_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define ANLOS_OBJECTS           32u /* that a list holds at most */
#define ANLOS_AREAS             15u
#define ANLOS_CORNERS           8u
#define ANLOS_TROUBLES          16u     /* fault bits */
#define ANLOS_INTERFACE_VERSION 2u      /* of the layout that is understood here */
#define ANLOS_FIRST_ID          0x0400u /* Status of sensor 0; each further one: + 0x10 */

/* Of the protection of one kind of frames: the states of AUTOSAR's E2E state machine. */
enum anlos_link {
    ANLOS_NODATA = 0, /* nothing came, or nothing good within the time-out */
    ANLOS_INIT = 1,   /* too few good frames yet */
    ANLOS_VALID = 2,
    ANLOS_INVALID = 3 /* too many wrong ones: good ones are not believed either */
};

/* What the consumer may do. */
enum anlos_trust {
    ANLOS_TRUST_NONE = 0,    /* nothing: behave as without this sensor */
    ANLOS_TRUST_OBJECTS = 1, /* use what is listed; that nothing is says nothing */
    ANLOS_TRUST_FULL = 2     /* that nothing is listed, within range_m, counts too */
};

enum anlos_state {
    ANLOS_STATE_INIT = 0,
    ANLOS_STATE_CALIBRATING = 1,
    ANLOS_STATE_ACTIVE = 2,
    ANLOS_STATE_DEGRADED = 3,
    ANLOS_STATE_FAULT = 4,
    ANLOS_STATE_BLOCKED = 5,
    ANLOS_STATE_STANDBY = 6,
    ANLOS_STATE_UNKNOWN = 7,
    ANLOS_STATE_SHUTDOWN = 8 /* it was stopped in order: silence is no failure */
};

enum anlos_source {
    ANLOS_SOURCE_LIVE = 0,
    ANLOS_SOURCE_REPLAY = 1,
    ANLOS_SOURCE_SIMULATION = 2,
    ANLOS_SOURCE_UNKNOWN = 3
};

/* Bits of anlos_status.faults; what each asks for stands in README.md. */
#define ANLOS_FAULT_IMAGE_STALE         0x0001u
#define ANLOS_FAULT_EGO_MOTION_MISSING  0x0002u
#define ANLOS_FAULT_TEMPERATURE_UNKNOWN 0x0004u
#define ANLOS_FAULT_CHANNELS_DEAD       0x0008u
#define ANLOS_FAULT_ELEMENT_ERRORS      0x0010u
#define ANLOS_FAULT_WALL_LOST           0x0020u
#define ANLOS_FAULT_CLOCK_JUMP          0x0040u
#define ANLOS_FAULT_INPUT_E2E_WRONG     0x0080u
#define ANLOS_FAULT_ARRAY_AWAY          0x0100u
#define ANLOS_FAULT_NODE_LOST           0x0200u
#define ANLOS_FAULT_CLIPPED             0x0400u
#define ANLOS_FAULT_LISTS_DROPPED       0x0800u
#define ANLOS_FAULT_RANGE_REDUCED       0x1000u
#define ANLOS_FAULT_ELEMENTS_COVERED    0x2000u
#define ANLOS_FAULT_ELEMENTS_MOVED      0x4000u
#define ANLOS_FAULT_INTERFERENCE        0x8000u

enum anlos_quality {
    ANLOS_NOT_AVAILABLE =
        0, /* the sensor does not know it: value is 0 and means nothing */
    ANLOS_AVAILABLE = 1,
    ANLOS_AT_LIMIT = 2 /* at the end of its range: it may be that or more (in size) */
};

struct anlos_value {
    float value;
    enum anlos_quality quality;
};

enum anlos_measurement {
    ANLOS_NEW = 0,       /* told for the first time, or again after a gap */
    ANLOS_MEASURED = 1,  /* heard in this list */
    ANLOS_PREDICTED = 2, /* not heard: where it should be */
    ANLOS_DELETED = 3    /* the last word of it: forget it */
};

enum anlos_class {
    ANLOS_CLASS_UNKNOWN = 0,
    ANLOS_POINT = 1,
    ANLOS_PLATE = 2,
    ANLOS_EXTENDED = 3,
    ANLOS_MULTIPATH = 4 /* rather an echo that others make between them than an object */
};

enum anlos_motion { ANLOS_MOTION_UNKNOWN = 0, ANLOS_STANDING = 1, ANLOS_MOVING = 2 };

/* An object of a list.  What the frames of 8 bytes do not carry is not available there.
 */
struct anlos_object {
    uint8_t id; /* stays with an object from list to list; of scans only within a list */
    enum anlos_measurement measurement;
    enum anlos_class shape;
    enum anlos_motion motion;
    struct anlos_value x_m, y_m, z_m;  /* the middle of it, when the sound was taken */
    struct anlos_value vx_m_s, vy_m_s; /* over ground */
    struct anlos_value existence;      /* 0..1 */
    struct anlos_value sigma_x_m, sigma_y_m, correlation_xy; /* of the place, 1 sigma */
    struct anlos_value sigma_v_m_s;                          /* of the worse axis */
    struct anlos_value length_m, width_m; /* full sizes along X and Y */
    /* Only where ObjectMotion comes: */
    struct anlos_value course_rad; /* of the velocity, from X to the left, -pi..pi */
    struct anlos_value sigma_course_rad;
    struct anlos_value sigma_vx_m_s, sigma_vy_m_s, correlation_v;
    /* Only of CAN FD: */
    struct anlos_value height_m; /* full size along Z */
    struct anlos_value sigma_z_m, correlation_xz, correlation_yz;
    struct anlos_value shape_probability; /* 0..1 */
    struct anlos_value unseen_s;          /* since it was last measured */
    struct anlos_value age_s;             /* since it was first measured */
    uint8_t wall_id;                      /* of the wall that mirrored it; 0: none */
    uint8_t behind_no_wall;               /* 1: perhaps nothing is there */
    uint8_t in_free_view; /* 1: other sensors should see it, or nothing is there */
    uint8_t fd;           /* 1: it came by ObjectFD */
};

/* A convex area of the floor that the list can tell of, its corners counterclockwise.
 * Outside of all areas the list says nothing; inside, as far as status.range_m. */
struct anlos_area {
    uint8_t wall_id;   /* by way of which; 0: directly; 15: that or a higher one */
    uint8_t n_corners; /* 3..ANLOS_CORNERS */
    float x_m[ANLOS_CORNERS], y_m[ANLOS_CORNERS];
};

struct anlos_list {
    uint16_t counter;             /* 0..4095, rises by one a list */
    uint8_t truncated;            /* 1: there were more objects than fit */
    uint8_t synchronised;         /* 1: capture_* is the vehicle's time */
    uint32_t capture_s;           /* when the sound was taken, since 1970 (UTC) */
    uint16_t capture_fraction;    /* 1/65536 s */
    struct anlos_value latency_s; /* from then to the sending; not available: no sound */
    struct anlos_value cycle_s;   /* between lists */
    uint32_t header_ms;           /* the caller's time at which its header came */
    uint8_t n_objects;
    struct anlos_object objects[ANLOS_OBJECTS]; /* [n_objects], in the order they came */
    uint8_t view_known; /* 1: FieldOfView came, and says what it can tell of: */
    uint8_t n_areas;    /* 0: of nothing */
    struct anlos_area areas[ANLOS_AREAS]; /* [n_areas], of those that came whole */
};

struct anlos_status {
    enum anlos_state state;
    enum anlos_source source;
    uint16_t faults; /* ANLOS_FAULT_... */
    struct anlos_value temperature_c, sound_speed_m_s;
    struct anlos_value range_m; /* half the path, up to which a walker is found */
};

struct anlos_diagnosis {
    struct anlos_value cpu, signal_to_noise_db; /* cpu of 0..1 */
    uint16_t dropped_pings;                     /* wraps around at 1024 */
    uint8_t version[3];
    uint8_t trouble_count[ANLOS_TROUBLES]; /* of each fault bit; 15: that or more */
    uint16_t trouble_present;              /* bits: there when it was told last */
};

/* Since init; each wraps around at 2^32. */
struct anlos_counts {
    uint32_t frames_good, frames_lost; /* lost: gaps of up to two that were bridged */
    uint32_t
        frames_damaged; /* wrong CRC, data ID, length or counter value: also another's */
    uint32_t frames_repeated;
    uint32_t
        frames_out_of_sequence; /* more than two lost, late, or their sender restarted */
    uint32_t frames_orphaned;   /* good, but of no list that had begun */
    uint32_t timeouts;
    uint32_t lists_whole; /* handed over */
    uint32_t lists_lost;  /* by the counter of lists: not even their header came */
    uint32_t lists_torn;  /* ended before they were whole */
    uint32_t
        lists_mixed; /* frames of another list, a part twice, both kinds of objects */
    uint32_t lists_repeated; /* whole, but the same as before, or older */
    uint32_t lists_unproven; /* whole, but a kind of its frames was not VALID */
    uint32_t lists_refused; /* a number that cannot be, or of another interface version */
};

/* What to know now. */
struct anlos_view {
    enum anlos_trust trust;
    enum anlos_link status_link, list_link, diagnosis_link;
    const struct anlos_list *list; /* NULL: none that is new enough.  The receiver's,
                                      until the next call for it */
    uint32_t age_ms;               /* of the list: since its sound was taken */
    uint8_t age_known;
    struct anlos_status status;       /* UNKNOWN and without faults unless VALID;
                                         SHUTDOWN until it says another state */
    struct anlos_diagnosis diagnosis; /* what was told last, even if long ago */
    struct anlos_counts counts;
};

struct anlos_config {
    uint16_t
        first_id;    /* of Status: can.base_id + 0x10 x can.sensor; a multiple of 0x10 */
    uint8_t sources; /* bits 1 << enum anlos_source: whose lists may be trusted */
    uint16_t status_ms, list_ms, diagnosis_ms; /* time-outs, since the last good one */
    uint16_t assembly_ms;                      /* from a header to the end of its list */
    uint16_t age_ms; /* of its sound: older lists are not trusted */
};

/* Events, of anlos_receiver_frame and anlos_receiver_tick. */
#define ANLOS_EVENT_FOREIGN   0x01u /* an identifier that the sensor does not send */
#define ANLOS_EVENT_WRONG     0x02u /* the frame was not used */
#define ANLOS_EVENT_STATUS    0x04u /* a new one */
#define ANLOS_EVENT_DIAGNOSIS 0x08u /* a new one */
#define ANLOS_EVENT_LIST      0x10u /* a new one, whole */
#define ANLOS_EVENT_DROPPED   0x20u /* a list was dropped; counts say why */
#define ANLOS_EVENT_TIMEOUT                                                              \
    0x40u /* Status, lists or Diagnosis fell silent; not after                           \
             a shutdown */

/* The rest is the receiver's own. */
#define ANLOS_KINDS  10u
#define ANLOS_WINDOW 6u

struct anlos_channel { /* a kind of frames */
    uint8_t counter;   /* of the newest, once heard */
    uint8_t heard;
    uint8_t state;
    uint8_t newest[ANLOS_WINDOW];
};

struct anlos_watch {
    uint32_t good_ms;
    uint8_t running;
};

struct anlos_receiver {
    struct anlos_config cfg;
    struct anlos_channel channels[ANLOS_KINDS];
    struct anlos_watch status_watch, list_watch, diagnosis_watch;
    struct anlos_list next, list;
    uint8_t parts[ANLOS_OBJECTS];                 /* of next.objects */
    uint8_t motions[ANLOS_OBJECTS][8], n_motions; /* ObjectMotion frames of next */
    struct anlos_area areas[ANLOS_AREAS]; /* of next, by their number, corner by corner */
    uint8_t corners_come[ANLOS_AREAS];    /* of each, bits */
    uint8_t corners_said[ANLOS_AREAS];    /* how many it has; 0xFF: frames disagree */
    uint8_t viewed;                       /* FieldOfView of next came */
    uint8_t number, assembling, timed, listed;
    uint16_t header_counter; /* of the newest header, once header_seen */
    uint8_t header_seen;
    uint32_t headers; /* since the last Time, lost ones too */
    struct anlos_status status;
    struct anlos_diagnosis diagnosis;
    struct anlos_counts counts;
};

/* Sensor 0, live sound only, time-outs of README.md: 350, 600, 3500, 200 and
 * 1000 ms. */
void anlos_config_default(struct anlos_config *cfg);

/* cfg: NULL is the default.  0; -1: a pointer is NULL, an identifier beyond 0x7f0 or no
 * multiple of 0x10, or a time-out of 0. */
int anlos_receiver_init(struct anlos_receiver *r, const struct anlos_config *cfg);

/* A data frame with an 11-bit identifier (not a remote or error frame, nor an extended
 * identifier), data[length], 0..64.  Whatever the bytes are it returns; the events. */
uint32_t anlos_receiver_frame(struct anlos_receiver *r, uint32_t id, const uint8_t *data,
                              uint8_t length, uint32_t now_ms);

/* Time-outs; the events.  At least every 50 ms, beside the frames. */
uint32_t anlos_receiver_tick(struct anlos_receiver *r, uint32_t now_ms);

/* Time-outs, as tick, and then what to know. */
void anlos_receiver_get(struct anlos_receiver *r, uint32_t now_ms,
                        struct anlos_view *view);

#ifdef __cplusplus
}
#endif

#endif
