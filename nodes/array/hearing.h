/* nodes/array/hearing.h -- does each microphone hear the speakers, and each speaker reach
 * a microphone?  A cable that is out still gives noise and hum, which no level tells from
 * a quiet room; but nothing in it is as long ago as any other thing.  So a ping counts as
 * heard where, compressed, something stands out of the trace.
 *
 * A microphone is deaf when it heard none of the pings of 70 ms that others heard; a
 * speaker is mute when nobody heard it when it sounded last, or 30 dB less than most:
 * late echoes of the one before are that loud. */
#ifndef ANLOS_NODES_ARRAY_HEARING_H
#define ANLOS_NODES_ARRAY_HEARING_H

#include <stddef.h>

#include "msgs/array.pb-c.h"
#include "msgs/complaint.h"
#include "msgs/survey.h"

struct hearing_faults {
    size_t deaf, of_microphones;
    size_t mute, of_speakers; /* that have sounded */
};

struct hearing;

/* The survey outlives it.  0, -EINVAL (pings are too short to tell), -ENOMEM. */
int hearing_create(struct hearing **out, const struct survey *s, struct complaint *why);

/* Of all pings up to this one.  note: gets what was not said before, or stays as it is. A
 * microphone whose samples are no numbers, or a ping of another shape, is not judged. */
void hearing_ping(struct hearing *h, const Anlos__Ping *ping, struct hearing_faults *out,
                  char *note, size_t note_size);
void hearing_destroy(struct hearing *h);

#endif
