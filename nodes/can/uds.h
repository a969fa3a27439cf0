/* SPDX-License-Identifier: MIT */
/* nodes/can/uds.h -- what the sensor answers a diagnostic tester: ISO 14229-1 (UDS), as
 * far as it makes sense for a sensor, as a function of bytes.  Numbers are big-endian.
 *
 * | service | | answers |
 * | 0x10 | session control | the default session alone |
 * | 0x14 | clear | a code, or all by 0xFFFFFF |
 * | 0x19 | read trouble codes | 01 number, 02 by status, 04 freeze frame, 0A supported |
 * | 0x22 | read data | up to UDS_MAX_IDENTIFIERS of enum uds_identifier |
 * | 0x31 | routine | 01 start, 03 results of UDS_SELF_TEST |
 * | 0x3E | tester present | |
 *
 * What is an answer itself (0x40 to 0x7F, 0xC0 to 0xFF) is none of a tester, and gets
 * none.  A trouble code is UDS_CODE of its fault, B1A01 and so on in the spelling of
 * workshops; it has one freeze frame, UDS_RECORD. */
#ifndef ANLOS_NODES_CAN_UDS_H
#define ANLOS_NODES_CAN_UDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "nodes/can/trouble.h"

enum {
    UDS_MAX_IDENTIFIERS = 16, /* in one request */
    UDS_ANSWER_SIZE = 320,
    UDS_RECORD = 1,
    UDS_P2_MS = 50,       /* an answer comes within this */
    UDS_P2_STAR_MS = 5000 /* stated, as it has to be; answers are never pending */
};

#define UDS_CLEAR       0x14 /* the service */
#define UDS_CODE(fault) (0x9a0000u | ((unsigned)(fault) + 1) << 8)

enum uds_identifier {
    UDS_SESSION = 0xf186,          /* 1 byte: 1, default */
    UDS_SOFTWARE_VERSION = 0xf195, /* text */
    UDS_SYSTEM_NAME = 0xf197,      /* text */
    /* As now, and in a freeze frame as then; of 16 bits with sign but for the faults,
     * 0x8000: not known. */
    UDS_UNIX_MS = 0xfd01, /* 64 bits */
    UDS_STATE,            /* 8 bits, as in the status frame */
    UDS_FAULTS,           /* 16 bits, as in the status frame */
    UDS_LATENCY,          /* ms */
    UDS_NOISE,            /* 0.1 dB */
    UDS_SNR,              /* 0.1 dB */
    UDS_RANGE,            /* cm */
    UDS_TEMPERATURE,      /* 0.1 degrees C */
};

/* A routine.  Its results are a byte, 0 passed, 1 failed, 2 it runs, and the faults of
 * the array and its elements since it was started, as in the status frame. */
#define UDS_SELF_TEST 0xf001

enum uds_refusal { /* negative response codes */
                   UDS_SERVICE_NOT_SUPPORTED = 0x11,
                   UDS_SUBFUNCTION_NOT_SUPPORTED = 0x12,
                   UDS_WRONG_LENGTH = 0x13,
                   UDS_CONDITIONS_NOT_CORRECT = 0x22, /* nothing is tested in a replay */
                   UDS_WRONG_SEQUENCE = 0x24,         /* results before a start */
                   UDS_OUT_OF_RANGE = 0x31,
};

/* The answer to request[size], of *n bytes; 0: there is none, which is what the tester
 * asked for, or what is not supported was asked of all (functional).  now: how the sensor
 * does.  Returns the refusal, said or not; 0: it was done. */
int uds_answer(struct trouble_memory *m, const struct freeze_frame *now,
               const uint8_t *request, size_t size, bool functional,
               uint8_t answer[UDS_ANSWER_SIZE], size_t *n);

#endif
