/* SPDX-License-Identifier: MIT */
/* nodes/can/uds_server.h -- answers a diagnostic tester on the vehicle's bus: the
 * requests of hal/can/isotp.h by nodes/can/uds.h.  Time is an argument. */
#ifndef ANLOS_NODES_CAN_UDS_SERVER_H
#define ANLOS_NODES_CAN_UDS_SERVER_H

#include "hal/can/isotp.h"
#include "hal/device.h"
#include "nodes/can/diagnosis.h"
#include "nodes/can/trouble.h"
#include "nodes/can/watch.h"
#include "nodes/rt/launchfile.h"

enum { UDS_SERVER_COUNTS = 4 };

struct uds_server { /* all zero: nobody is answered */
    struct isotp *link;
    struct trouble_memory memory;
    uint64_t requests, refused, cleared;
    uint64_t unsent; /* answers that the kernel did not take */
};

/* Listens, if the launch file has can.diagnosis.  w: initialised.  0, or as isotp_open
 * with an error. */
int uds_server_open(struct uds_server *s, const struct launchfile *l,
                    const struct watch *w, struct error *why);

/* After each watch_step, at least once in UDS_P2_MS: keeps the trouble codes, and answers
 * what has been asked.  ahead_ns: of the vehicle's time over now_ns.  0, or why the
 * newest answer was not sent. */
int uds_server_step(struct uds_server *s, const struct watch *w,
                    const struct diagnosis *d, int64_t now_ns, int64_t ahead_ns);

/* How many there are: none when nobody is answered. */
size_t uds_server_counts(const struct uds_server *s,
                         struct device_count out[UDS_SERVER_COUNTS]);

void uds_server_close(struct uds_server *s);

#endif
