/* SPDX-License-Identifier: MIT */
/* nodes/anlos/can/can.h -- `anlos can`: what the frames on the vehicle's bus say, how
 * many came, and what was wrong with them. */
#ifndef ANLOS_NODES_ANLOS_CAN_CAN_H
#define ANLOS_NODES_ANLOS_CAN_CAN_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "dsp/error.h"
#include "msgs/can/e2e.h"
#include "msgs/can/frames.h"
#include "msgs/can/layout.h"

/* A line that candump wrote, of a log (-L) or for the screen:
 *   (1764000000.250000) can0 404#2A10000000000000
 *   (1764000000.250000)  can0  404   [8]  2A 10 00 00 00 00 00 00
 * The time may be missing on the screen.  Longer lines than any of candump's are none. */

#define CAN_LINE_SIZE 512 /* the longest of candump with its end: FD with text beside */

struct can_line {
    bool dated;
    int64_t stamp_ns; /* as written; not dated: 0 */
    char interface[16];
    bool data; /* false: a remote or an error frame, or an identifier of 29 bits */
    struct can_frame_data frame;
};

/* 0, -EINVAL. */
int can_line_parse(struct can_line *out, const char *text);

/* Did the object lists come whole?  A list is its header, a time, and for each object
 * three frames or one of FD, all of the header's counter. */

struct lists {
    uint64_t whole;
    uint64_t cut; /* of which something was missing when the next one began */
    bool under_way;
    struct can_list_header header;
    unsigned frames[CAN_SENSOR_STEP]; /* by enum can_id, of the list under way */
};

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

struct decode {
    struct tally tally;    /* base: of the sensor */
    uint16_t shown;        /* 1 << enum can_id of what is printed; the rest is counted */
    const char *interface; /* of a file: only this one's; NULL: of all */
    bool json;
    double seconds; /* of an interface: stop then; 0: never */
};

/* Until the end of the file, or interrupt_requested.  0, -EINTR, -EIO, -ENOMEM or what
 * else reading or printing says. */
int decode_file(struct decode *d, FILE *f);

#endif
