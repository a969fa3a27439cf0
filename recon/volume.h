/* SPDX-License-Identifier: MIT */
/* recon/volume.h -- an image of the hidden (mirrored) scene, and what it was made of. */
#ifndef ANLOS_RECON_VOLUME_H
#define ANLOS_RECON_VOLUME_H

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "recon/grid.h"
#include "recon/imaging/surroundings.h"
#include "recon/survey.h"

#define VOLUME_MOVERS 8

/* What goes along a course, by the phases of the image's pings (velocity_filter.h). */
struct volume_mover {
    float at_m[3]; /* in the middle of their time, in the array frame of the newest */
    float velocity_m_s[3]; /* over ground, along the same axes */
    float power;           /* of all pings in phase, over the median of the image; > 0 */
};

_Static_assert(sizeof(struct volume_mover) == 7 * sizeof(float), "rows of seven");

/* The same of what stands out where what stands was taken away, which moves: it goes as
 * this says with this probability. */
struct volume_course {
    struct volume_mover mover;
    float sure; /* 0..1 */
};

_Static_assert(sizeof(struct volume_course) == 8 * sizeof(float), "rows of eight");

/* From outside: within 10 km, slower than its sound. */
static inline bool volume_mover_is_sound(const struct volume_mover *m)
{
    bool sound = m->power > 0.0f && m->power <= FLT_MAX;

    for (int a = 0; a < 3; a++)
        sound = sound && fabsf(m->at_m[a]) <= 1e4f && fabsf(m->velocity_m_s[a]) < 340.0f;
    return sound;
}

static inline bool volume_course_is_sound(const struct volume_course *c)
{
    return volume_mover_is_sound(&c->mover) && c->sure >= 0.0f && c->sure <= 1.0f;
}

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
    const struct volume_mover *movers;       /* looked for where standing_left */
    const struct volume_mover *ambiguous;    /* so what rests overhead or behind the array
                                                would go, too */
    const struct volume_course *courses;     /* looked for where standing_taken */
    size_t n_movers, n_ambiguous, n_courses; /* up to VOLUME_MOVERS of each */
};

#endif
