/* SPDX-License-Identifier: MIT */
/* anlos/image.h -- an image of the hidden (mirrored) scene, and what it was made of. */
#ifndef ANLOS_IMAGE_H
#define ANLOS_IMAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <anlos/error.h>

struct anlos_image {
    size_t size;            /* sizeof(struct anlos_image) */
    uint64_t survey;        /* anlos_survey_id */
    int64_t capture_ns;     /* of the newest ping */
    uint32_t scan, frame;   /* of the newest ping; frame 0: of a scan */
    double origin_m[3];     /* the centre of voxel 0, in the array's frame, */
    double step_m[3];       /* and from voxel to voxel */
    size_t n[3];            /* along x, y, z */
    const float *intensity; /* [n[2]][n[1]][n[0]], >= 0; 0: nothing was imaged there */
    const char *method;
    double sound_speed_m_s;
    bool preview; /* more pings of this scan are to come */
    size_t pings_used, pings_expected;
    size_t pings_blanked;      /* of those expected: a sound from outside drowned them */
    size_t microphones_masked; /* in any of them */
    uint64_t clipped_samples;
    bool standing_left;  /* what stands was to be taken away, and may still be in it */
    bool standing_taken; /* it was taken away, from all of it: remains may be left */
    /* Of a static array the newest ping's image alone, as means over blocks of voxels, of
     * which the middles lie likewise; a tracker sees earlier by it who comes.  NULL:
     * none, or what stands is in it. */
    const float *newest; /* [newest_n[2]][newest_n[1]][newest_n[0]] */
    double newest_origin_m[3], newest_step_m[3];
    size_t newest_n[3];
    /* Of a scan that is whole, by the lower half of the band: the same volume, coarse,
     * and the brightest places beyond it; a detector holds objects against them.  NULL:
     * none, where the method `fast` cannot image. */
    const float *coarse; /* [coarse_n[2]][coarse_n[1]][coarse_n[0]] */
    double coarse_origin_m[3], coarse_step_m[3];
    size_t coarse_n[3];
    const float *beyond; /* [n_beyond][4]: x, y, z in the array's frame, m, and how
                          * bright it is there, in the units of coarse; brightest first */
    size_t n_beyond;
    /* Of a static array what moves by itself, as the phases of the pings tell, where what
     * stands may be left in the image; a tracker is told earlier by it who moves.  NULL:
     * nothing, or it was not looked for. */
    const float *movers; /* [n_movers][7]: x, y, z in the array's frame, m, in the middle
                          * of the pings' time; velocity x, y, z over ground, m/s; how
                          * bright they are in phase, over the median of the image */
    size_t n_movers;
    /* The same where something at rest, overhead or behind the array, would show as that;
     * a tracker follows it, and waits for its places to tell.  NULL: none. */
    const float *ambiguous; /* [n_ambiguous][7], as movers */
    size_t n_ambiguous;
    /* Where what stands was taken away, of what stands out: how it goes; a tracker knows
     * its velocity earlier by it.  NULL: none. */
    const float *courses; /* [n_courses][8]: as movers, and how probable it is that it
                           * goes so, 0..1 */
    size_t n_courses;
};

#endif
