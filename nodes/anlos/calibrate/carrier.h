/* SPDX-License-Identifier: MIT */
/* nodes/anlos/calibrate/carrier.h -- the stage that carries an array from one position of
 * its survey to the next, waited for. */
#ifndef ANLOS_NODES_ANLOS_CALIBRATE_CARRIER_H
#define ANLOS_NODES_ANLOS_CALIBRATE_CARRIER_H

#include <stddef.h>

#include "dsp/error.h"
#include "recon/survey.h"

struct carrier;

/* The survey must outlive it.  0, and as stage_open (hal/stage.h). */
int carrier_open(struct carrier **out, const char *uri, const struct survey *survey,
                 struct error *why);

/* Returns when the stage stands there and has settled.  0, -EINTR (Ctrl-C), -EIO (the
 * stage has a fault), -ERANGE and others of stage_move. */
int carrier_move(struct carrier *c, size_t position, struct error *why);
void carrier_close(struct carrier *c); /* of NULL: nothing */

#endif
