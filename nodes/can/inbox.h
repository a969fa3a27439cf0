/* SPDX-License-Identifier: MIT */
/* nodes/can/inbox.h -- what the vehicle tells over CAN: its frames, checked, as messages.
 * Time is an argument.
 *
 * A frame is used when its own check is good and its input is VALID by the rules of the
 * table in inbox.c (msgs/can/e2e.h).  Only silence, longer than what it said last is
 * kept, makes an input restart: one that comes and is wrong stays as it is.  What was
 * said while it was VALID is kept for its time. */
#ifndef ANLOS_NODES_CAN_INBOX_H
#define ANLOS_NODES_CAN_INBOX_H

#include <stdbool.h>
#include <stdint.h>

#include "hal/canbus.h"
#include "msgs/can/e2e.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/wall.pb-c.h"

#define INBOX_EGO_NS     100000000LL /* motion that is older is not known */
#define INBOX_AMBIENT_NS 3000000000LL
#define INBOX_WALL_NS    2000000000LL
#define INBOX_WALLS      15 /* as the frame numbers them, from 1 */

#define INBOX_SAVE_NS 3000000000LL /* between requests, or that there is none */
#define INBOX_NUMBERS 8            /* of events that were taken: none of them again */

enum inbox_input {
    INBOX_EGO_MOTION,
    INBOX_AIR,
    INBOX_WALL_IN,
    INBOX_SAVE_REQUEST,
    INBOX_WALL_ENDS_IN,
    INBOX_INPUTS
};
enum { INBOX_COUNTS = 3 + INBOX_INPUTS, INBOX_TEXT_SIZE = 128 };

enum inbox_kind {
    INBOX_NOTHING, /* of no use, and no mistake: not available, or not believed yet */
    INBOX_WRONG,   /* damaged, repeated or out of sequence: not to be used */
    INBOX_EGO,
    INBOX_AMBIENT,
    INBOX_WALLS_GIVEN,
    INBOX_WALL_ENDS, /* inside: they go with the wall's next frame, which is what brings
                      */
    INBOX_SAVE,      /* an event: save once */
    INBOX_SAVE_AGAIN /* a request that is none: its number was taken, or it had begun
                        before anybody heard that there was none */
};

struct inbox_wall {
    Anlos__Wall message;
    Anlos__Vec3 normal;
    double covariance[6];
    double ends_m[2];      /* of the message */
    int64_t given_ns;      /* 0: not known */
    double next_ends_m[2]; /* said for the frames to come; along the level axis */
    int64_t ends_ns;       /* when; 0: not known to end */
};

/* One event saves once, whatever a sender or a gateway repeats: its number has to come
 * twice in a row, after a frame without a request, and is not taken again. */
struct inbox_save {
    struct can_save_request newest;  /* that INBOX_SAVE or INBOX_SAVE_AGAIN is about */
    bool idle;                       /* said since the last silence and the last event */
    unsigned n_same;                 /* frames in a row with this request; up to 3 */
    uint16_t numbers[INBOX_NUMBERS]; /* a ring, [n_taken] */
    size_t n_taken;
    uint64_t again; /* times INBOX_SAVE_AGAIN */
};

struct inbox_trust { /* in an input */
    struct e2e_sm sm;
    int64_t heard_ns;       /* the newest frame, whatever it was; of NODATA: none */
    enum e2e_verdict wrong; /* with the newest that was; E2E_OK: none since it began */
    uint64_t invalid;       /* times that it became INVALID */
    enum e2e_state told;    /* of inbox_change */
};

struct inbox {
    struct can_checks checks;
    struct inbox_trust trust[INBOX_INPUTS];
    bool moves;           /* ego is valid */
    int64_t ego_ns;       /* when it was said last; 0: never */
    Anlos__EgoMotion ego; /* the newest, to be published */
    Anlos__Ambient ambient;
    struct inbox_wall walls[INBOX_WALLS];
    Anlos__WallList wall_list; /* of those known; points to the following */
    Anlos__Wall *wall_pointers[INBOX_WALLS];
    struct inbox_save save;
    uint64_t wrong;      /* frames that were INBOX_WRONG */
    uint64_t unbelieved; /* good ones of an input that was not VALID */
};

/* base: where the identifiers of the sensor begin.  i must stay where it is. */
void inbox_init(struct inbox *i, uint32_t base);

/* The identifiers for canbus_listen; returns how many. */
size_t inbox_ids(const struct inbox *i, uint32_t ids[CANBUS_MAX_INPUTS]);

/* What a frame that came at came_ns brought, in ego, ambient, wall_list or save. */
enum inbox_kind inbox_take(struct inbox *i, const struct can_frame_data *f,
                           int64_t came_ns);

/* True once when nothing valid has come for INBOX_EGO_NS: ego says so then. */
bool inbox_ego_ends(struct inbox *i, int64_t now_ns);

/* Inputs that were silent for too long restart.  To be called often. */
void inbox_step(struct inbox *i, int64_t now_ns);

/* Is an input INVALID? */
bool inbox_doubts(const struct inbox *i);

/* "EgoMotion invalid (repeated), Ambient init"; empty: all that comes is VALID. */
void inbox_text(const struct inbox *i, char *text, size_t size);

/* The next input whose state became another one, for the log; false: there is none.  That
 * one begins is not said before it is known how. */
bool inbox_change(struct inbox *i, enum e2e_state *state, char *text, size_t size);

/* "inputs_wrong", "inputs_unbelieved", "ego_motion_invalid", ... */
void inbox_counts(const struct inbox *i, struct device_count out[INBOX_COUNTS]);

/* True once when a wall was not given for INBOX_WALL_NS: wall_list is without it then. */
bool inbox_walls_end(struct inbox *i, int64_t now_ns);

#endif
