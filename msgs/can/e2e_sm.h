/* msgs/can/e2e_sm.h -- the state machine of AUTOSAR's E2E protection (PRS E2EProtocol,
 * E2E_SM, R23-11; one window for all states, clearToInvalid): may an input be believed,
 * judged by the newest checks of it, not by the last one alone?
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
#ifndef ANLOS_MSGS_CAN_E2E_SM_H
#define ANLOS_MSGS_CAN_E2E_SM_H

#include <stdbool.h>
#include <stdint.h>

#include "msgs/can/e2e.h"

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

#endif
