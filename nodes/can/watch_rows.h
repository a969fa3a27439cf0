/* nodes/can/watch_rows.h -- the rows of the table in watch.h: when each fault is there,
 * and what it does to the state. */
#ifndef ANLOS_NODES_CAN_WATCH_ROWS_H
#define ANLOS_NODES_CAN_WATCH_ROWS_H

#include "nodes/can/watch.h"

struct watch_row {
    bool fixed_only;
    enum can_state state;
    int64_t hold_ns; /* it has to be well for so long: WATCH_HEALTH_NS or more */
    bool (*is_bad)(const struct watch *w, int64_t now_ns);
};

extern const struct watch_row watch_rows[CAN_FAULTS];

/* So few microphones are left that an image shows more of them than of the world. */
bool watch_is_blind(const struct watch *w);

/* Does the vehicle tell a temperature? */
bool watch_has_ambient(const struct watch *w, int64_t now_ns);

#endif
