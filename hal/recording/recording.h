/* SPDX-License-Identifier: MIT */
/* hal/recording/recording.h -- a folder of WAV files, one multichannel file for each
 * stage position in name order, slot j = emission of speaker j, or of the two that sound
 * together there (survey_slot_of); any PCM or float format.
 * Of a survey that names pings: one mono file, slot k = ping k, which is position k;
 * files no longer than a slot (a replica) do not count beside it.
 * Of a stage that does not stop: one file, the slots of position after position.
 * Of an array that stands (one stage position) the file may go on: round after round, or
 * as emissions.csv in the folder says (below). */
#ifndef ANLOS_HAL_RECORDING_RECORDING_H
#define ANLOS_HAL_RECORDING_RECORDING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "dsp/error.h"
#include "recon/survey.h"

/* The file emissions.csv beside the WAV file of an array that stands: who sounded when,
 * for recordings that are not simply slot after slot.
 *
 *   sample,speaker,frame,down,valid,time_s,temperature_c
 *
 * A line for each emission, in the order of the file; the first line names the columns,
 * of which sample and speaker must be there.  sample: of the file, that the emission
 * begins with (latency_samples before it is heard); speaker: from 0, as in the survey;
 * frame: the round, from 1; down: the chirp runs from stop to start; valid 0: not to be
 * used; time_s: when it was, Unix time or from anything; temperature_c of the air, may be
 * empty. */

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
 * The error is "file:line: what was expected".  0, -EINVAL, errors of table_load,
 * -ENOMEM. */
int emissions_load(struct emission **out, size_t *n, const char *path,
                   const struct survey *s, struct error *why);

/* Slot after slot, the survey's speakers in turn, as many as begin in n_samples. */
int emissions_in_turn(struct emission **out, size_t *n, const struct survey *s,
                      uint64_t n_samples);

/* A line of the file; NULL: that of the names. */
void emission_print(FILE *f, const struct emission *e);

struct recording;

/* Opens the folder and checks every file's header against the survey: number of files,
 * channels, rate, frames (a whole number of slots is not asked for, but the last
 * speaker's slot must have begun).  Only headers are read. 0, -ENOENT, -EINVAL, -ENOMEM;
 * the error names the file and what was expected. */
int recording_open(struct recording **out, const char *folder, const struct survey *s,
                   struct error *why);

/* Frames that recording_read yields: the speakers' slots and tail_samples()
 * (recon/tail.h).
 */
size_t recording_frames(const struct recording *r);

/* Whole slots in the file of pings behind those that the survey names, of which the last
 * may be what a long ping leaves behind: else it names too few, and maybe not those at
 * the end are missing.  0 of any other. */
size_t recording_spare_slots(const struct recording *r);

/* Reads one position: samples [n_microphones][recording_frames], zeros beyond the end of
 * the file; clipped[n_microphones] and not_finite[n_microphones] are counted (samples
 * that are not finite become 0).  Threads may read different positions at once. 0, -EIO
 * (short or unreadable), -EINVAL (also of what emissions.csv tells of). */
int recording_read(const struct recording *r, size_t position, float *samples,
                   uint32_t *clipped, uint32_t *not_finite, struct error *why);

/* The same with the counts of each slot, for pings: clipped and not_finite
 * [survey_slots(n_speakers)][n_microphones]; what follows the last slot counts into it.
 *
 * Clipped is, in PCM files, a run of 3 or more consecutive samples at 0.9999 of full
 * scale or beyond; float files know no full scale, so there it is a run of 4 or more
 * equal samples above half of the channel's maximum. */
int recording_read_slots(const struct recording *r, size_t position, float *samples,
                         uint32_t *clipped, uint32_t *not_finite, struct error *why);

/* Two recordings of one room differ, if only by their noise: of one that is its own
 * background nothing would be left.  Of one survey; the first, middle and last position
 * are read.  0, -EINVAL, -ENOMEM, as recording_read; names are for the error. */
int recording_check_background(const struct recording *r, const char *name,
                               const struct recording *background,
                               const char *background_name, struct error *why);
void recording_close(struct recording *r);

/* -- of an array that stands ------------------------------------------------------------
 */

/* Is there more than one round, or an emissions.csv? */
bool recording_goes_on(const struct recording *r);

/* All that sounded, in the order of the file; borrows.  *n is 0 where there are several
 * positions, or places ping by ping. */
const struct emission *recording_emissions(const struct recording *r, size_t *n);
uint64_t recording_samples(const struct recording *r); /* of the file, a channel */

/* samples [n_microphones][slot_samples + tail_samples()], zeros beyond the end of the
 * file; clipped and not_finite [n_microphones].  As recording_read. */
int recording_read_emission(const struct recording *r, size_t i, float *samples,
                            uint32_t *clipped, uint32_t *not_finite, struct error *why);

/* Writes one, ping by ping, however long it gets: "FOLDER/pos00.wav" (float32; from 4 GB
 * on RF64) and "FOLDER/emissions.csv".  A ping whose beginning is what the one before
 * ended with goes on in it, in whole slots by its time; any other stands apart: each
 * comes back as it was, sample for sample. */
struct recording_writer;
int recording_writer_open(struct recording_writer **out, const char *folder,
                          const struct survey *s, struct error *why);

/* e: with its time; its sample is found here.  samples
 * [n_microphones][slot_samples + tail_samples()].  0 or a negative errno. */
int recording_writer_put(struct recording_writer *w, const struct emission *e,
                         const float *samples, struct error *why);

/* Frees w (or NULL).  err: what went wrong before, which is returned again; the files are
 * of no use then. */
int recording_writer_close(struct recording_writer *w, int err, struct error *why);

/* Writes one position as float32 WAV "FOLDER/posNN.wav": samples
 * [n_microphones][n_frames]. 0 or a negative errno. */
int recording_write(const char *folder, size_t position, size_t n_microphones,
                    size_t n_frames, double sample_rate_hz, const float *samples,
                    struct error *why);

#endif
