/* nodes/anlos/can/tally.h -- what came, and what was wrong with it. */
#ifndef ANLOS_NODES_ANLOS_CAN_TALLY_H
#define ANLOS_NODES_ANLOS_CAN_TALLY_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "msgs/can/protection.h"
#include "nodes/anlos/can/line.h"
#include "nodes/anlos/can/lists.h"

#define TALLY_VERDICTS (E2E_WRONG_CRC + 1)

struct tally_message {
    uint64_t frames, wrong_size;
    uint64_t verdicts[TALLY_VERDICTS];
    uint64_t n_dated;
    int64_t first_ns, last_ns;
};

struct tally {
    struct can_checks checks; /* base: of the sensor */
    struct tally_message messages[CAN_SENSOR_STEP];
    struct lists lists;
    uint64_t unknown; /* data frames of other identifiers */
    uint64_t other;   /* remote and error frames, identifiers of 29 bits */
    uint64_t no_frames, first_no_frame; /* lines, and the number of the first one */
};

/* A frame of ours as it came.  m NULL: it is not ours, and only counted. */
struct tally_frame {
    const struct can_message *m;
    bool wrong_size; /* nothing else is known of it */
    enum e2e_verdict verdict;
};

struct tally_frame tally_take(struct tally *t, const struct can_line *l);
void tally_no_frame(struct tally *t, uint64_t number);

/* "ok", "wrong size", ... */
const char *tally_verdict_text(const struct tally_frame *f);

/* Frames of ours. */
uint64_t tally_frames(const struct tally *t);

/* Frames of ours that are not to be used, lists that were cut, lines that are no frames.
 */
uint64_t tally_wrong(const struct tally *t);

void tally_print(const struct tally *t, FILE *to);
int tally_print_json(const struct tally *t, FILE *to); /* 0, -ENOMEM */

#endif
