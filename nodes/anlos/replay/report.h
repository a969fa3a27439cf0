/* nodes/anlos/replay/report.h -- what a bag's reconstruction leaves behind: the files of
 * a recording's, warnings, report.json and the table on the screen. */
#ifndef ANLOS_NODES_ANLOS_REPLAY_REPORT_H
#define ANLOS_NODES_ANLOS_REPLAY_REPORT_H

#include "nodes/anlos/replay/chain.h"
#include "nodes/anlos/replay/settings.h"
#include "recon/processing.h"

#define REPLAY_CAN_FILE "can.candump"

struct replay {
    const struct recon_options *options;
    struct settings settings;
    struct canbus *can;
    struct chain chain;
    bool begun;           /* the chain, with the first survey */
    struct survey survey; /* the newest */
    uint64_t survey_id;
    struct processing processing; /* of it */
    bool bad_input;               /* what went wrong is the input's fault */
    struct stopwatch stages[RECON_STAGES], total;
};

/* All files but that of the CAN frames. */
int replay_write(struct replay *r, const char *folder, const struct stopwatch *began,
                 struct error *why);

/* The objects, the time and the folder, on stdout. */
void replay_print(const struct replay *r);

#endif
