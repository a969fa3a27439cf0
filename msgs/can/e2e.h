/* SPDX-License-Identifier: MIT */
/* msgs/can/e2e.h -- end-to-end protection of AUTOSAR (PRS E2EProtocol, R23-11): what is
 * lost, repeated, late, damaged or somebody else's is known for what it is; and that of
 * our frames.
 *
 * Profile 11, nibble variant: byte 0 is a CRC-8 (SAE J1850 polynomial 0x1D, from 0, not
 * inverted) over the low byte of the data ID, a byte 0 and bytes 1..; byte 1 is the
 * counter, 0..14, in the low and bits 8..11 of the data ID in the high nibble.  Data IDs
 * of this variant are to have 1..14 there (0x100 to 0xeff): a nibble of zeros or of ones
 * is what a line that is stuck sends, too.
 * Profile 5: bytes 0 and 1 are a CRC-16 (CCITT-FALSE, low byte first) over bytes 2.. and
 * then the data ID, low byte first; byte 2 is the counter, 0..255. */
#ifndef ANLOS_MSGS_CAN_E2E_H
#define ANLOS_MSGS_CAN_E2E_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/can/layout.h"

enum e2e_verdict {
    E2E_OK,
    E2E_SOME_LOST,      /* as good, and up to max_delta - 1 before it did not come */
    E2E_NO_NEW_DATA,    /* nothing came */
    E2E_REPEATED,       /* the same counter once more */
    E2E_WRONG_SEQUENCE, /* more lost than max_delta allows, late, or begun anew */
    E2E_WRONG_CRC,      /* damaged, or of another data ID */
};

/* Of a receiver, for each data ID.  All zero is one that has heard nothing: its first
 * frame is E2E_OK whatever the counter.  After a time-out it should restart. */
struct e2e_check {
    bool began;
    uint8_t counter; /* of the last undamaged frame */
};

#define E2E_P11_COUNTERS 15
#define E2E_P05_COUNTERS 256

/* Fill in CRC, counter and nibble.  size: 2.. of P11, 3.. of P05.  Only the low 12 bits
 * of data_id protect in P11. */
void e2e_p11_protect(uint8_t *data, size_t size, uint16_t data_id, uint8_t counter);
void e2e_p05_protect(uint8_t *data, size_t size, uint16_t data_id, uint8_t counter);

/* data NULL: nothing has come since the last call.  max_delta: how far the counter may
 * have gone on, 1..: 1 allows no loss.  A frame of a wrong sequence is not to be used,
 * and is what the next one is compared with. */
enum e2e_verdict e2e_p11_check(struct e2e_check *c, const uint8_t *data, size_t size,
                               uint16_t data_id, uint8_t max_delta);
enum e2e_verdict e2e_p05_check(struct e2e_check *c, const uint8_t *data, size_t size,
                               uint16_t data_id, uint8_t max_delta);

/* May the frame be used? */
bool e2e_is_usable(enum e2e_verdict v);
const char *e2e_verdict_text(enum e2e_verdict v);

/* The state machine of AUTOSAR's E2E protection (PRS E2EProtocol, E2E_SM, R23-11; one
 * window for all states, clearToInvalid): may an input be believed, judged by the newest
 * checks of it, not by the last one alone?
 *
 *     NODATA --a frame that is not damaged--> INIT --enough are good--> VALID
 *       ^                                      |                       |   ^
 *       |                                      | too many              |   | enough
 *       | e2e_sm_reset                         | are damaged           v   | are good
 *       '------------------------------------- '----------------> INVALID
 *
 * INVALID follows on VALID when too few are good or too many damaged.  Good are E2E_OK
 * and E2E_SOME_LOST, damaged E2E_WRONG_CRC; what is repeated, out of sequence or did not
 * come is neither.  Data are to be used in VALID only.
 *
 * The frame that leads to INIT does not count, nor does on the way back from INVALID what
 * led to it.  So what sends the same frame for ever never becomes VALID. */

#define E2E_SM_MAX_WINDOW 16

enum e2e_state { E2E_NODATA, E2E_INIT, E2E_VALID, E2E_INVALID, E2E_STATES };

/* Names as in the standard: of the newest `window` checks so many have to be good, and so
 * many may be damaged.  1 <= min_ok_valid <= min_ok_init, min_ok_invalid <= window;
 * max_error_init, max_error_invalid <= max_error_valid. */
struct e2e_sm_config {
    uint8_t window; /* 1..E2E_SM_MAX_WINDOW */
    uint8_t min_ok_init, max_error_init;
    uint8_t min_ok_valid, max_error_valid;
    uint8_t min_ok_invalid, max_error_invalid;
};

/* All zero: nothing came. */
struct e2e_sm {
    enum e2e_state state;
    enum e2e_verdict window[E2E_SM_MAX_WINDOW]; /* [min(n, cfg.window)], a ring */
    unsigned n;                                 /* checks since it was cleared */
};

/* Takes in a check, of a frame that came or of a time in which none came.  Returns the
 * state. */
enum e2e_state e2e_sm_check(struct e2e_sm *sm, const struct e2e_sm_config *cfg,
                            enum e2e_verdict verdict);

/* To NODATA: nothing has come for so long that whoever comes is somebody else. */
void e2e_sm_reset(struct e2e_sm *sm);

const char *e2e_state_text(enum e2e_state state);

/* -- our frames -------------------------------------------------------------------------
 */

/* Profile 11 on those of 8 bytes, profile 5 on FD.  The data ID of a frame is its
 * identifier, so it tells the sensor and the frame; each identifier counts for itself,
 * all frames of it. */

/* How far a counter may have gone on: two frames in a row may get lost. */
#define CAN_MAX_DELTA 3

/* Of one sender, all zero at the start.  Indexed by identifier - base. */
struct can_protection {
    uint32_t base;
    uint8_t counters[CAN_SENSOR_STEP]; /* of the next frame */
};

/* Of one receiver, all zero at the start. */
struct can_checks {
    uint32_t base;
    struct e2e_check checks[CAN_SENSOR_STEP];
};

/* Writes CRC, counter and nibble into a frame of ours; any other is left alone.  The
 * counter goes on with can_protection_sent, so that a frame that the bus did not take and
 * that is tried again leaves no gap. */
void can_protect(const struct can_protection *p, struct can_frame_data *f);
void can_protection_sent(struct can_protection *p, const struct can_frame_data *f);

/* E2E_WRONG_CRC also when the frame is none of ours or not as long as it should be. */
enum e2e_verdict can_check(struct can_checks *c, const struct can_frame_data *f);

/* What comes next of this identifier is the first one: after a time-out. */
void can_checks_forget(struct can_checks *c, enum can_id id);

#endif
