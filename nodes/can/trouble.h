/* SPDX-License-Identifier: MIT */
/* nodes/can/trouble.h -- the sensor's trouble codes: of each fault of the status frame
 * what has become of its test, as the status byte of ISO 14229-1, annex D.2, and a freeze
 * frame of its first failure.  Time is an argument.
 *
 * The test of a fault is its row in nodes/can/watch.h.  It has a result in a sensor that
 * has begun; before, only what has been there for TROUBLE_SETTLE_NS without a break has
 * failed: what is not there yet is not missed.  A failure confirms its code at once, as
 * the watch has waited where there is something to wait for.  The operation cycle is the
 * run of the process, and so is the memory. */
#ifndef ANLOS_NODES_CAN_TROUBLE_H
#define ANLOS_NODES_CAN_TROUBLE_H

#include <stdbool.h>
#include <stdint.h>

#include "msgs/can/frames.h"

#define TROUBLE_SETTLE_NS 10000000000LL

enum { /* the status byte */
       TROUBLE_FAILED = 0x01,
       TROUBLE_FAILED_THIS_CYCLE = 0x02,
       TROUBLE_PENDING = 0x04,
       TROUBLE_CONFIRMED = 0x08,
       TROUBLE_UNTESTED_SINCE_CLEAR = 0x10,
       TROUBLE_FAILED_SINCE_CLEAR = 0x20,
       TROUBLE_UNTESTED_THIS_CYCLE = 0x40,
       TROUBLE_AVAILABLE = 0x7f, /* there is no warning lamp */
};

/* How the sensor does at one time.  NaN: not known. */
struct freeze_frame {
    uint64_t unix_ms; /* by the vehicle's time */
    enum can_state state;
    uint16_t faults;  /* 1 << enum can_fault */
    double latency_s; /* age of the newest list's sound when it came */
    double noise_db;  /* of compressed noise, over an echo of gain 1 */
    double snr_db;    /* of the strongest object */
    double range_m;   /* up to which a person is found */
    double temperature_c;
};

struct trouble_code {
    uint8_t status;
    bool fails;       /* the fault is there, */
    int64_t since_ns; /* since then */
    bool has_frame;
    struct freeze_frame first; /* of its first failure since it was cleared */
};

/* The self-test always runs, and what it finds are faults.  A tester may ask what it has
 * found from then on: of the array and its elements, for so long, once the sensor has
 * begun; nodes tell their health once a second. */
#define SELF_TEST_NS 5000000000LL

enum self_test_state { SELF_TEST_NEVER, SELF_TEST_RUNS, SELF_TEST_DONE };

struct self_test {
    enum self_test_state state;
    int64_t began_ns; /* 0: with the next step of a sensor that has begun */
    uint16_t faults;  /* 1 << enum can_fault, that were there since */
};

struct trouble_memory {
    uint16_t supported; /* 1 << enum can_fault: faults that this sensor tests */
    struct trouble_code codes[CAN_FAULTS];
    struct self_test self_test;
};

void trouble_init(struct trouble_memory *m, uint16_t supported);

bool trouble_supports(const struct trouble_memory *m, int fault);

/* Begins anew.  false: nothing is tested here, as in a replay. */
bool trouble_start_self_test(struct trouble_memory *m);

/* At now_ns these are the faults (now->faults); begun: as of the watch. */
void trouble_step(struct trouble_memory *m, const struct freeze_frame *now, bool begun,
                  int64_t now_ns);

/* Forgets a code and its freeze frame; what still fails has failed anew with the next
 * step. */
void trouble_clear(struct trouble_memory *m, int fault);

#endif
