/* SPDX-License-Identifier: MIT */
/* recon/frontend/frontend.h -- from a ping to traces: which microphones are fit, pulse
 * compression, blanking of what a sound from outside drowned, and the background
 * subtracted, as it would sound in the air of now.
 *
 * A scan has a background that was recorded before, ping by ping.  A static array
 * (ping.frame) has the mean of its frames there, or an adaptive one: each speaker's
 * running mean while the vehicle stands.  What stands still as well is gone with it, and
 * what stays longer than background_s fades.  Nothing is subtracted from the first ping
 * of each speaker, nor from one during which the vehicle moves, or it is not known
 * whether it does; the mean restarts when it stands again.  A ping of a static array
 * that a sound from outside drowned (dsp/blanker.h) is blanked: its traces are empty, all
 * microphones masked, and neither it nor the one before, which may hold its beginning,
 * counts into the mean.  While another array is heard (recon/frontend/interference.h) its
 * chirps are taken out of each ping and of the mean, and no background counts as
 * subtracted: what is left is not only what moves.
 *
 * While a steady tone or a comb sounds (dsp/tone_finder.h) what all microphones have at
 * once is taken out of a static array's traces, those of the walls too, before anything
 * is subtracted (dsp/eigencanceler.h), unless the background is a recorded one; the mean
 * restarts when it comes and when it goes.
 *
 * Where walls are heard, the same pulse compression gives what arrived from the emission
 * on, before anything is subtracted (recon/walls/wall_receiver.h), also of background
 * pings.  And the array tells of itself by it (recon/frontend/self_test.h), where that is
 * asked for; a recording was judged when it was made, and may begin after the direct
 * sound.
 *
 * No function but create and survey allocates.  One thread at a time. */
#ifndef ANLOS_RECON_FRONTEND_FRONTEND_H
#define ANLOS_RECON_FRONTEND_FRONTEND_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"
#include "dsp/tone_finder.h"
#include "recon/ego.h"
#include "recon/frontend/backgrounds.h"
#include "recon/frontend/compressor.h"
#include "recon/frontend/interference.h"
#include "recon/frontend/self_test.h"
#include "recon/ping.h"
#include "recon/survey.h"
#include "recon/traces.h"
#include "recon/walls/wall_receiver.h"

enum background_mode {
    BACKGROUND_NONE,
    BACKGROUND_RECORDED, /* pings of that pass, and without one a ping is of no use */
    BACKGROUND_ADAPTIVE,
};

struct frontend_config {
    enum window window;
    enum compression compression;
    enum background_mode background;
    double background_s; /* time constant of an adaptive one */
    bool hears_walls;    /* up to wall_reach_m away: what arrived of each ping */
    double wall_reach_m;
    bool judges_array;         /* of a live one, with: */
    struct range_config range; /* n_pings 0: a round of all speakers */
};

struct frontend_faults { /* of how many microphones, so many are: */
    size_t n;            /* 0: the ping was not looked at */
    size_t silent, damaged, clipped;
};

enum frontend_outcome {
    FRONTEND_REFUSED,          /* the ping is of no use */
    FRONTEND_LACKS_BACKGROUND, /* that pass has to be recorded before */
    FRONTEND_KEPT,             /* a background, from now on */
    FRONTEND_TRACES,
};

struct frontend_output { /* borrows from the front end until the next ping */
    enum frontend_outcome outcome;
    bool has_returns; /* whatever the outcome; walls are looked for in them */
    struct wall_returns returns;
    struct traces traces;
    char note[256]; /* for the log; empty: nothing new */
    struct frontend_faults faults;
};

struct frontend;

/* 0, -ENOMEM. */
int frontend_create(struct frontend **out, const struct frontend_config *cfg);

/* Plans for a survey, which it copies; the background of the one before is forgotten, and
 * after an error there is none.  What was learnt of the same array in other air stays. 0,
 * -EINVAL and others of processing_plan; the error says what does not fit. */
int frontend_survey(struct frontend *f, const struct survey *survey, struct error *why);

/* As if there had been none. */
void frontend_forget(struct frontend *f);

/* survey_id of what it is planned for; 0: nothing. */
uint64_t frontend_survey_id(const struct frontend *f);

/* How the vehicle moves; NULL: somebody told of it, but not that.  Before the first of
 * these it stands. */
void frontend_ego(struct frontend *f, const struct ego_motion *motion,
                  int64_t capture_ns);

/* Of the air around; of use where none is measured with a ping. */
void frontend_temperature(struct frontend *f, double temperature_c);

/* Before there is a survey no ping can be used, and no note says so. */
void frontend_ping(struct frontend *f, const struct ping *ping,
                   struct frontend_output *out);

/* What the array tells of itself, or NULL: *why, where it cannot be told. */
struct self_test *frontend_self_test(const struct frontend *f, const char **why);

/* As self_test_ping, of the newest ping, once: the image need not wait for it.  false:
 * nobody judges, or the ping is none of this survey. */
bool frontend_judge(struct frontend *f, const struct ping *ping,
                    struct self_test_faults *out, char *note, size_t note_size);

/* Is another array heard (recon/frontend/interference.h)?  Of a static array. */
void frontend_interference(const struct frontend *f, struct interference_levels *out);

/* Does a steady tone or a comb sound, in the band of the chirps (dsp/tone_finder.h)?  Of
 * a static array. */
void frontend_tones(const struct frontend *f, struct tone_found *out);

/* Of the scan that the newest ping belongs to. */
const struct air *frontend_air(const struct frontend *f);
void frontend_destroy(struct frontend *f);

#endif
