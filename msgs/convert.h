/* msgs/convert.h -- messages as the plain types that dsp and recon work on, and back.
 * What comes out of a message borrows its arrays, and what goes into one is borrowed by
 * it, but for surveys, which own theirs. */
#ifndef ANLOS_MSGS_CONVERT_H
#define ANLOS_MSGS_CONVERT_H

#include "dsp/complaint.h"
#include "msgs/array.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/tensor.h"
#include "msgs/traces.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "recon/ego.h"
#include "recon/ping.h"
#include "recon/survey.h"
#include "recon/traces.h"

/* The survey as message bytes in *out; free() it.  0, -ENOMEM, -EINVAL (does not pass
 * survey_check). */
int survey_pack(const struct survey *s, uint8_t **out, size_t *size);

/* From a received message; *s owns its arrays, and needs no survey_clear after an error.
 * 0, -ENOMEM, -EINVAL (incomplete, does not pass survey_check, or its id is not that of
 * its content). */
int survey_from_message(struct survey *s, const Anlos__Survey *m, struct complaint *why);

/* Who records with a program of his own need not know what an id is made of: gives a
 * message without one that of its content, if it is a survey at all. */
void survey_complete_id(Anlos__Survey *m);

/* samples is NULL where the message's arrays do not fit each other. */
void ping_from_message(struct ping *p, const Anlos__Ping *m, int64_t capture_ns);

/* masked [n_microphones] and view are storage for the message. */
void traces_to_message(const struct traces *t, protobuf_c_boolean *masked,
                       struct tensor_view *view, Anlos__Traces *m);

/* out; NULL: somebody told of the motion, but not that. */
const struct ego_motion *ego_from_message(struct ego_motion *out,
                                          const Anlos__EgoMotion *m);

#endif
