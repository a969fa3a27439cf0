/* SPDX-License-Identifier: MIT */
/* recon/volume.h -- an image of the hidden (mirrored) scene, and what it was made of. */
#ifndef ANLOS_RECON_VOLUME_H
#define ANLOS_RECON_VOLUME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "recon/grid.h"
#include "recon/imaging/surroundings.h"
#include "recon/survey.h"

struct volume {
    uint64_t survey_id;
    int64_t capture_ns;     /* of the newest ping */
    uint32_t scan, frame;   /* of the newest ping; frame 0: of a scan */
    struct grid grid;       /* in the array frame */
    const float *intensity; /* [nz][ny][nx] */
    struct grid blocks;     /* of voxels */
    const float *newest; /* [nz][ny][nx] of these: means of the newest ping's image alone
                          * (frames_newest); NULL: none, or what stands is in it */
    struct surroundings_view around; /* what lies around it, when that was looked at */
    const char *method;
    enum survey_source source;
    double sound_speed_m_s;
    bool preview; /* more pings of this scan are to come */
    size_t pings_used, pings_expected;
    double age_s; /* of those used in the mean, before the newest; 0: one after the other,
                     as the survey fires them */
    size_t pings_blanked;      /* of those expected: a sound from outside drowned them */
    size_t microphones_masked; /* in any of them */
    uint64_t clipped_samples;
    bool standing_left;  /* what stands was to be taken away, and may still be in it */
    bool standing_taken; /* it was taken away, from all of it: remains may be left */
};

#endif
