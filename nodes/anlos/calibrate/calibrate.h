/* nodes/anlos/calibrate/calibrate.h -- the subcommands of `anlos calibrate`.  Each prints
 * what it measured and a verdict, and writes its part of the calibration unless that is
 * useless.  *good: the verdict.  0, or a negative errno with s->why. */
#ifndef ANLOS_NODES_ANLOS_CALIBRATE_CALIBRATE_H
#define ANLOS_NODES_ANLOS_CALIBRATE_CALIBRATE_H

#include "nodes/anlos/calibrate/session.h"

int calibrate_time_zero(struct session *s, bool *good);
int calibrate_channels(struct session *s, bool *good);
int calibrate_gains(struct session *s, bool *good);
int calibrate_sound_speed(struct session *s, bool *good);
int calibrate_background(struct session *s, bool *good);
int calibrate_show(struct session *s, bool *good);

#endif
