/* msgs/convert/survey.h -- a survey (recon/survey.h) as its message and back. */
#ifndef ANLOS_MSGS_CONVERT_SURVEY_H
#define ANLOS_MSGS_CONVERT_SURVEY_H

#include "dsp/complaint.h"
#include "msgs/survey.pb-c.h"
#include "recon/survey.h"

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

#endif
