/* SPDX-License-Identifier: MIT */
/* tests/fuzz/messages.h -- an input as messages that came in over the bus: of each, topic
 * u8 (its place in topics_all), size u16 little endian, payload. */
#ifndef ANLOS_TESTS_FUZZ_MESSAGES_H
#define ANLOS_TESTS_FUZZ_MESSAGES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/bag/bytes.h"
#include "msgs/survey.pb-c.h"
#include "msgs/topics.h"
#include "recon/survey.h"

/* The next message; what is too short for its size ends with the input.  false: no more.
 */
bool messages_next(struct bytes *input, const struct topic **topic,
                   struct bytes *payload);

/* survey_from_message after the id was set right: it is a hash of the content, which no
 * one hits by chance.  survey_clear the result of 0. */
int messages_survey(struct survey *out, Anlos__Survey *m);

/* Appends one.  It must have less than 64 KB. */
void messages_put(struct bytes_buffer *out, const struct topic *topic,
                  struct bytes payload);

#endif
