/* SPDX-License-Identifier: MIT */
/* nodes/play/tempo.h -- when a message of the bag is due by the machine's clock. */
#ifndef ANLOS_NODES_PLAY_TEMPO_H
#define ANLOS_NODES_PLAY_TEMPO_H

#include <stdbool.h>
#include <stdint.h>

struct tempo {
    double rate; /* of the recording's pace; 0: everything is due at once */
    bool started;
    int64_t bag_ns, machine_ns; /* a point of the line that both times are on */
};

void tempo_init(struct tempo *t, double rate);

/* The bag's time is here now: after a pause, a seek, another rate, or a wait. */
void tempo_set(struct tempo *t, int64_t bag_ns, int64_t machine_ns);

/* The machine's time at which it is due; the first time it is asked, now. */
int64_t tempo_due_ns(struct tempo *t, int64_t bag_ns, int64_t machine_ns);

#endif
