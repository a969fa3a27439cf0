/* SPDX-License-Identifier: MIT */
/* tests/e2e/can_log.h -- what the sensor told the vehicle: reads the log of its bus while
 * it is written, by the decoder of `anlos can`. */
#ifndef ANLOS_TESTS_E2E_CAN_LOG_H
#define ANLOS_TESTS_E2E_CAN_LOG_H

#include "tests/hal/scratch.h"

#include "nodes/anlos/can/can.h"

struct can_log_status {
    int64_t stamp_ns; /* of its frame, whole microseconds */
    enum can_state state;
    uint16_t faults;
    bool shutdown;
};

struct can_log {
    FILE *file; /* NULL: not there yet */
    struct tally tally;
    struct can_log_status statuses[8000]; /* [n_statuses] */
    size_t n_statuses;
    unsigned lists, objects; /* since the newest status of another state */
};

static inline void can_log_take(struct can_log *l, const struct can_line *line)
{
    struct tally_frame f = tally_take(&l->tally, line);
    struct can_status s;

    assert_non_null(f.m);
    l->lists += f.m->id == CAN_ID_LIST_HEADER;
    l->objects += f.m->id == CAN_ID_OBJECT_STATE;
    if (f.m->id != CAN_ID_STATUS)
        return;
    assert_int_equal(can_unpack_status(&line->frame, &s), 0);
    assert_true(l->n_statuses < sizeof l->statuses / sizeof *l->statuses);
    if (l->n_statuses && l->statuses[l->n_statuses - 1].state != s.state)
        l->lists = l->objects = 0;
    l->statuses[l->n_statuses++] =
        (struct can_log_status){line->stamp_ns, s.state, s.faults, s.shutdown};
}

/* All whole lines that are new. */
static inline void can_log_read(struct can_log *l, const char *path)
{
    char text[CAN_LINE_SIZE];
    struct can_line line;

    if (!l->file && !(l->file = fopen(path, "r")))
        return;
    for (;;) {
        long at = ftell(l->file);
        if (!fgets(text, sizeof text, l->file) || !strchr(text, '\n')) {
            assert_int_equal(fseek(l->file, at, SEEK_SET), 0);
            return;
        }
        assert_int_equal(can_line_parse(&line, text), 0);
        can_log_take(l, &line);
    }
}

/* The newest; NULL: there is none. */
static inline const struct can_log_status *can_log_now(const struct can_log *l)
{
    return l->n_statuses ? &l->statuses[l->n_statuses - 1] : NULL;
}

#endif
