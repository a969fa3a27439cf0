/* SPDX-License-Identifier: MIT */
/* nodes/array/acquisition.h -- the node array: fire commands to shots, recordings to ping
 * messages; the survey, in the air as the vehicle says it; how the device does. */
#ifndef ANLOS_NODES_ARRAY_ACQUISITION_H
#define ANLOS_NODES_ARRAY_ACQUISITION_H

#include <stdbool.h>
#include <stdint.h>

#include "hal/array.h"
#include "msgs/array.pb-c.h"
#include "msgs/health.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "nodes/rt/loop.h"
#include "recon/survey.h"

struct acquisition;

extern const struct loop acquisition_loop; /* closes the array, too */

/* node and array are not owned; node NULL: for the steps below alone.  0, -ENOMEM,
 * -EINVAL (its survey does not pack). */
int acquisition_create(struct acquisition **out, struct node *node, struct array *array);

/* The survey as a message, owned by the acquisition. */
const Anlos__Survey *acquisition_survey(const struct acquisition *s);

/* Takes another one of the same array: pings name it from now on.  0, -ENOMEM, -EINVAL
 * (it does not pack; the old one stays). */
int acquisition_take_survey(struct acquisition *s, const struct survey *survey);

/* Elements stand elsewhere, beside this survey: from now on another one has them there.
 * 0, -ESTALE (of another survey, or of a recording or a scan, which are as they were
 * surveyed), -EINVAL, -ENOMEM: the survey stays. */
int acquisition_places(struct acquisition *s, const Anlos__ElementPlaces *said,
                       struct error *why);

/* Queues a shot.  One without end, or of a stage that does not stop, goes on until
 * another one is queued, or an endless one without speakers, which is none.  The scan
 * sends a command again until it hears of its pings: one with the id and sender's epoch
 * of the newest one is ignored.  0, -EINVAL (a position or speaker that the survey has
 * not; the error says which), -ENOBUFS (too many shots are waiting). */
int acquisition_fire(struct acquisition *s, const Anlos__FireCommand *command,
                     int64_t epoch_ns, struct error *why);

/* Whether the stage may stand elsewhere than the scan knows: pushed by hand, or in fault.
 * Pings recorded then, and the rest of the shots that were queued then, are not valid. */
void acquisition_displaced(struct acquisition *s, bool displaced);

/* Where the stage was, as it reports on its way.  Pings of a stage that does not stop are
 * placed by that (nodes/rt/stage_line.h); those over a millimetre beside their place in
 * the survey, or that no report tells of, are not valid. */
void acquisition_stage(struct acquisition *s, double place_m, int64_t at_ns);

/* Is there anything to record? */
bool acquisition_busy(const struct acquisition *s);

/* Does it go round without end? */
bool acquisition_is_endless(const struct acquisition *s);

/* Was the newest shot one without end, which ended nevertheless?  Recordings do. */
bool acquisition_has_ended(const struct acquisition *s);

/* Blocks until the next ping of the shots queued is recorded.  The message borrows from
 * the array until the next call.  0, -ENODATA (nothing to do), -EINTR (a signal) and
 * -EAGAIN (the device is away): call again; other negative errno of the array: the rest
 * of that shot is lost. */
int acquisition_next(struct acquisition *s, Anlos__Ping *out, int64_t *t0_ns,
                     struct error *why);
void acquisition_destroy(struct acquisition *s);

/* The air that sound goes through, as the vehicle says it (topic "ambient"): an array
 * that stands and was measured at another temperature would place what it hears at 4 m
 * wrong by 7 mm for each kelvin. */
struct ambient {
    int64_t changed_ns; /* monotonic; 0: never */
};

/* Gives a survey, which is `measured` but for what this sets, the temperature and speed
 * of sound of what the vehicle says, where the speed differs by more than it takes to
 * tell, and not more often than once a minute: whoever images starts anew then.  In
 * colder air the gate ends where the slot does.  false: it stays as it is. */
bool ambient_take(struct ambient *a, const struct survey *measured, struct survey *s,
                  const Anlos__Ambient *said, int64_t now_ns);

/* An element that was knocked stands where it is heard to stand: moves it in the survey,
 * of the same array as the measured one.  0, or -EINVAL with an error (no such element,
 * no number, more than SURVEY_SAME_M from its measured place): the survey is as it was
 * then. */
int places_correct(struct survey *s, const struct survey *measured,
                   const Anlos__MovedElement *m, struct error *why);

#endif
