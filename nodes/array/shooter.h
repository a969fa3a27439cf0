/* nodes/array/shooter.h -- the array node's step: fire commands to shots, recordings to
 * ping messages. */
#ifndef ANLOS_NODES_ARRAY_SHOOTER_H
#define ANLOS_NODES_ARRAY_SHOOTER_H

#include <stdbool.h>
#include <stdint.h>

#include "msgs/survey.pb-c.h"
#include "hal/array.h"
#include "msgs/array.pb-c.h"

struct shooter;

/* array is not owned.  0, -ENOMEM, -EINVAL (its survey does not pack). */
int shooter_create(struct shooter **out, struct array *array);

/* The survey as a message, owned by the shooter. */
const Anlos__Survey *shooter_survey(const struct shooter *s);

/* Takes another one of the same array: pings name it from now on.  0, -ENOMEM, -EINVAL
 * (it does not pack; the old one stays). */
int shooter_take_survey(struct shooter *s, const struct survey *survey);

/* Queues a shot.  One without end goes on until another one is queued, or an endless one
 * without speakers, which is none.  The scan sends a command again until it hears of its
 * pings: one with the id and sender's epoch of the newest one is ignored.  0, -EINVAL (a
 * position or speaker that the survey has not; the complaint says which), -ENOBUFS (too
 * many shots are waiting). */
int shooter_fire(struct shooter *s, const Anlos__FireCommand *command, int64_t epoch_ns,
                 struct complaint *why);

/* Whether the stage may stand elsewhere than the scan knows: pushed by hand, or in fault.
 * Pings recorded then, and the rest of the shots that were queued then, are not valid. */
void shooter_displaced(struct shooter *s, bool displaced);

/* Is there anything to record? */
bool shooter_busy(const struct shooter *s);

/* Does it go round without end? */
bool shooter_is_endless(const struct shooter *s);

/* Was the newest shot one without end, which ended nevertheless?  Recordings do. */
bool shooter_has_ended(const struct shooter *s);

/* Blocks until the next ping of the shots queued is recorded.  The message borrows from
 * the array until the next call.  0, -ENODATA (nothing to do), -EINTR (a signal) and
 * -EAGAIN (the device is away): call again; other negative errno of the array: the rest
 * of that shot is lost. */
int shooter_next(struct shooter *s, Anlos__Ping *out, int64_t *t0_ns,
                 struct complaint *why);
void shooter_destroy(struct shooter *s);

#endif
