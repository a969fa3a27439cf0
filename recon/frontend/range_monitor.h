/* SPDX-License-Identifier: MIT */
/* recon/frontend/range_monitor.h -- how far away would a person still be found?  Of a
 * fixed array that knows a wall.  The wall's echo, the reference, is measured in each
 * ping, and recon/detection/detection_range.h says what is left of a person, and how much
 * of that the noise of now lets be found.  The range is limited when a person at the end
 * of the gate would be found less often than RANGE_PROBABILITY for RANGE_LESS_S, and is
 * so no more when it reaches RANGE_CLEAR_RATIO farther. */
#ifndef ANLOS_RECON_FRONTEND_RANGE_MONITOR_H
#define ANLOS_RECON_FRONTEND_RANGE_MONITOR_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"
#include "dsp/pulse_compress.h"
#include "recon/static_array/frames.h"
#include "recon/survey.h"
#include "recon/walls/walls.h"

#define RANGE_PROBABILITY 0.9
#define RANGE_CLEAR_RATIO 1.1
#define RANGE_LESS_S      1.2

struct range_config {
    bool ranges; /* a fixed array: say how far it reaches; else what follows is nothing */
    size_t n_pings; /* in an image */
    enum frames_sum sum;
    double false_alarm_rate; /* of a voxel */
    double person_m;         /* scattering length (recon/detection/detection_range.h) */
};

struct range_ping { /* what was heard of a speaker, from its emission to the next */
    size_t speaker;
    const float complex *traces; /* [n_microphones][format.n_samples] */
    const double *noise;         /* [n_microphones] power of a sample */
    const bool *usable;          /* [n_microphones] */
    bool speaker_usable;
};

struct range_levels { /* NaN: not known */
    double echo;      /* power of the wall's echo in a trace, a mean */
    double range_m;   /* up to which a person is found; 0: nowhere in the gate, which */
    double gate_m;    /* ends here */
    bool limited;     /* range_m is less */
};

struct range_monitor;

/* gate_m: near and far end of what is imaged.  The survey outlives it.  0, -EINVAL (a
 * false-alarm rate or number of pings that makes no sense), -ENOMEM. */
int range_monitor_create(struct range_monitor **out, const struct range_config *cfg,
                         const struct survey *s, const struct trace_format *format,
                         const double gate_m[2], struct error *why);

/* What the one before has learnt of the same array, in other air. */
void range_monitor_inherit(struct range_monitor *r, const struct range_monitor *before);

/* Topic "wall": the surest wall's echo is the reference from now on.  One that was not
 * seen for a second may be elsewhere: until it is, the reference stays what it was, as it
 * does after a list that is none. */
void range_monitor_walls(struct range_monitor *r, const struct walls *walls);
/* Whose echo is the reference, in the array frame; NULL: none is heard now. */
const struct wall_gate *range_monitor_wall(const struct range_monitor *r);

/* Some samples about the wall's echo in each trace. */
void range_monitor_take(struct range_monitor *r, const struct range_ping *ping);
void range_monitor_levels(const struct range_monitor *r, struct range_levels *out);
void range_monitor_destroy(struct range_monitor *r);

#endif
