/* SPDX-License-Identifier: MIT */
/* recon/static_array/static_array.h -- a static array's newest pings to an image for
 * every frame or every ping (a sliding aperture in time), from where the elements stood
 * when the vehicle moves (recon/static_array/frames.h).  What cannot have come from
 * behind a wall is muted (recon/static_array/first_return.h).
 *
 * One thread at a time; it works on as many as it was created with. */
#ifndef ANLOS_RECON_STATIC_ARRAY_STATIC_ARRAY_H
#define ANLOS_RECON_STATIC_ARRAY_STATIC_ARRAY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "recon/ego.h"
#include "recon/frontend/compressor.h"
#include "recon/static_array/frames.h"
#include "recon/traces.h"
#include "recon/volume.h"
#include "recon/walls/walls.h"

struct static_array_config {
    size_t threads;               /* at least 1 */
    enum compression compression; /* the front end's: it decides the traces' format */
    size_t frame_pings;           /* in a frame; 0: as many as there are speakers */
    size_t pings;                 /* in an image; 0: as in a frame */
    enum frames_sum sum;
    bool every_ping;  /* an image; else every frame */
    bool moving_only; /* what stands still is muted where it was not subtracted; traces go
                       * on beyond the gate, as with an adaptive background */
};

struct static_array;

/* 0, -ENOMEM, -EAGAIN (threads). */
int static_array_create(struct static_array **out, const struct static_array_config *cfg);

/* Plans for a survey, which it copies; the pings of another one are forgotten.  0, or a
 * negative errno and an error: also of a survey whose array moves by itself. */
int static_array_survey(struct static_array *s, const struct survey *survey,
                        struct error *why);

/* As if there had been none. */
void static_array_forget(struct static_array *s);

/* survey_id of what it is planned for; 0: nothing. */
uint64_t static_array_survey_id(const struct static_array *s);

/* How the vehicle moves; NULL: somebody told of it, but not that. */
void static_array_ego(struct static_array *s, const struct ego_motion *motion,
                      int64_t capture_ns);

/* The walls as they stand at an instant: what cannot have come from behind one is muted
 * from then on. */
void static_array_walls(struct static_array *s, const struct walls *walls,
                        int64_t capture_ns);

/* Takes one ping's traces.  true: an image is due; of two speakers that sound together,
 * with the second.  A frame that lacks its last ping is due with the first of the next.
 * note[size] is for the log, empty when there is nothing to say.  Before the first survey
 * none can be used, and no note says so. */
bool static_array_traces(struct static_array *s, const struct traces *traces, char *note,
                         size_t size);

/* The image of the newest pings; with moving_only, where some had no background and the
 * vehicle's motion is known, see recon/static_array/clutter_map.h.  Borrowed, good until
 * the next call. */
void static_array_image(struct static_array *s, struct volume *out);

enum static_array_motion {
    STATIC_ARRAY_STANDS,   /* nothing was ever said of motion: the vehicle counts as
                              standing */
    STATIC_ARRAY_MOVES,    /* known, and made up for */
    STATIC_ARRAY_NO_MOUNT, /* known, but where the array sits is not: counts as standing
                            */
    STATIC_ARRAY_UNKNOWN,  /* not known for a part of the newest image: counts as standing
                            */
};

/* Of the newest image. */
enum static_array_motion static_array_motion(const struct static_array *s);

struct static_array_counts {
    uint64_t images;
    uint64_t unfit;     /* traces that did not fit the survey */
    uint64_t backwards; /* pings from before the newest: all others were forgotten */
    uint64_t unknown;   /* images of STATIC_ARRAY_UNKNOWN */
};

const struct static_array_counts *static_array_counts(const struct static_array *s);
void static_array_destroy(struct static_array *s);

#endif
