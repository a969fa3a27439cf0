/* hal/recording/emissions_file.h -- emissions.csv beside the WAV file of an array that
 * stands: who sounded when, for recordings that are not simply slot after slot.
 *
 *   sample,speaker,frame,down,valid,time_s,temperature_c
 *
 * A line for each emission, in the order of the file; the first line names the columns,
 * of which sample and speaker must be there.  sample: of the file, that the emission
 * begins with (latency_samples before it is heard); speaker: from 0, as in the survey;
 * frame: the round, from 1; down: the chirp runs from stop to start; valid 0: not to be
 * used; time_s: when it was, Unix time or from anything; temperature_c of the air, may be
 * empty. */
#ifndef ANLOS_HAL_RECORDING_EMISSIONS_FILE_H
#define ANLOS_HAL_RECORDING_EMISSIONS_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "dsp/complaint.h"
#include "recon/survey.h"

#define EMISSIONS_FILE "emissions.csv"

struct emission {
    uint64_t sample;
    uint32_t speaker;
    uint32_t frame; /* from 1 */
    bool down, valid;
    bool has_time;
    int64_t time_ns;
    double temperature_c; /* NaN: not known */
};

/* *out: [*n], 1 at least; free() it.  Where frames are not named, one is over when a
 * speaker's turn comes again; where directions are not, they are those of the survey.
 * The complaint is "file:line: what was expected".  0, -EINVAL, errors of table_load,
 * -ENOMEM. */
int emissions_load(struct emission **out, size_t *n, const char *path,
                   const struct survey *s, struct complaint *why);

/* Slot after slot, the survey's speakers in turn, as many as begin in n_samples. */
int emissions_in_turn(struct emission **out, size_t *n, const struct survey *s,
                      uint64_t n_samples);

/* A line of the file; NULL: that of the names. */
void emission_print(FILE *f, const struct emission *e);

#endif
