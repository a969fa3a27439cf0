/* SPDX-License-Identifier: MIT */
/* dsp/cover.h -- is a speaker or a microphone covered, by dirt, snow, a sticker?  The
 * direct sound from each speaker to each microphone says so: what covers a speaker takes
 * as much from all that hear it, what covers a microphone from all that it hears, so a
 * row or a column of the table of pairs drops.
 *
 * A drop is against how loud a pair was in its first rounds; where these do not fit the
 * spreading of sound (1 / distance, and the median of all pairs) by COVER_START_DB,
 * because something was covered from the start, against that.  Only pairs count whose
 * direct sound stands out of noise (COVER_AUDIBLE_DB), and of a speaker those that are
 * within COVER_NEAR_DB of its loudest: nothing else is as loud there.  A speaker's drop
 * is the median of its pairs, a microphone's that of its pairs with speakers that have
 * none.  Where nothing is heard, or a drop is most_db and more, which is how loud late
 * echoes of the speaker before and crosstalk are, a cable is out: that is not called
 * covered.
 *
 * A ping costs a few operations for each pair; one with a pair that is learnt, once for
 * each, a hundred.  Nothing is allocated. */
#ifndef ANLOS_DSP_COVER_H
#define ANLOS_DSP_COVER_H

#include <stdbool.h>
#include <stddef.h>

#define COVER_DROP_DB    10.0 /* covered; free again over... */
#define COVER_FREE_DB    7.0
#define COVER_START_DB   15.0
#define COVER_AUDIBLE_DB 13.0
#define COVER_NEAR_DB    20.0
#define COVER_ROUNDS     3 /* that are learnt from */

struct cover;

/* distance_m [n_speakers][n_microphones] > 0.  0, -EINVAL, -ENOMEM. */
int cover_create(struct cover **out, size_t n_speakers, size_t n_microphones,
                 const double *distance_m, double most_db);

/* A ping: the power of each microphone's direct sound and of its noise, in one unit,
 * both [n_microphones] > 0.  unfit[n_microphones]: samples that are none; NULL: all fit.
 */
void cover_take(struct cover *c, size_t speaker, const double *direct,
                const double *noise, const bool *unfit);

bool cover_speaker(const struct cover *c, size_t speaker);
bool cover_microphone(const struct cover *c, size_t microphone);

/* Does a speaker's direct sound stand out of such noise at a microphone, when neither is
 * covered?  True, too, of a pair of which that was never learnt. */
bool cover_expects(const struct cover *c, size_t speaker, size_t microphone,
                   double noise);

/* The mean of the direct sound over the noise, dB, of the loudest pair of each speaker;
 * NaN: none was learnt. */
double cover_snr_db(const struct cover *c);
void cover_destroy(struct cover *c);

#endif
