/* SPDX-License-Identifier: MIT */
/* nodes/anlos/calibrate/calibrate.h -- what the subcommands of `anlos calibrate` share:
 * the array, and the calibration file that each of them renews a part of. */
#ifndef ANLOS_NODES_ANLOS_CALIBRATE_CALIBRATE_H
#define ANLOS_NODES_ANLOS_CALIBRATE_CALIBRATE_H

#include <stdbool.h>
#include <stddef.h>

#include "hal/array.h"
#include "hal/survey/calibration.h"

#define CALIBRATE_MAX_ARRAYS 8

/* The command line of `anlos calibrate`. */

struct calibrate_options { /* borrow from argv */
    const char *what;      /* "time-zero" */
    const char *array, *out, *stage, *folder;
    const char *also[CALIBRATE_MAX_ARRAYS - 1]; /* array: the same before other walls */
    size_t n_also;
    double placed_mm;
    double distance_m, range_m, temperature_c, humidity_percent; /* NaN: not given */
    bool has_pair, fit_speed;
    size_t pair[2]; /* speaker, microphone */
    size_t takes, position;
};

struct session {
    const struct calibrate_options *options;
    struct array *array;             /* NULL: none was named */
    const struct survey *survey;     /* of the array */
    struct survey placed;            /* the same, with the places that are known so far */
    struct calibration *calibration; /* read, or a new one */
    bool existed;
    struct error why;
};

/* The array of a URI as it is, without what a calibration file corrects. */
int session_open_array(struct session *s, const char *uri, struct array **out);

/* Writes the file, with today's date and the array's name.  0, -EINVAL (the survey would
 * be wrong with it), other negative errno. */
int session_save(struct session *s);

/* To a thousandth: what is measured is no more exact, and easier to read. */
double session_round(double x);

/* By what is known so far, else by the survey. */
double session_speed_m_s(const struct session *s);

/* Speakers and microphones with places of their own, and a position that exists?
 * 0, -EINVAL. */
int session_check(struct session *s);

/* A line about pings that came invalid, if there were any. */
void session_print_retaken(size_t pings);

/* A channel's faults in words. */

enum { STATE_SIZE = 48 };

/* "inverted, noisy"; "good" without any (enum calibration_fault).  Returns out. */
const char *state_print(unsigned faults, char out[STATE_SIZE]);

/* The stage that carries an array from one position of its survey to the next, waited
 * for. */

struct carrier;

/* The survey must outlive it.  0, and as stage_open (hal/stage.h). */
int carrier_open(struct carrier **out, const char *uri, const struct survey *survey,
                 struct error *why);

/* Returns when the stage stands there and has settled.  0, -EINTR (Ctrl-C), -EIO (the
 * stage has a fault), -ERANGE and others of stage_move. */
int carrier_move(struct carrier *c, size_t position, struct error *why);
void carrier_close(struct carrier *c); /* of NULL: nothing */

/* The subcommands, each a file of its own.  Each prints what it measured and a verdict,
 * and writes its part of the calibration unless that is useless.  *good: the verdict.  0,
 * or a negative errno with s->why. */

int calibrate_time_zero(struct session *s, bool *good);
int calibrate_channels(struct session *s, bool *good);
int calibrate_array(struct session *s, bool *good);
int calibrate_gains(struct session *s, bool *good);
int calibrate_sound_speed(struct session *s, bool *good);
int calibrate_background(struct session *s, bool *good);

#endif
