/* SPDX-License-Identifier: MIT */
/* hal/room/scene.h -- a scene file: the survey's keys, and the world that a survey does
 * not know.  All lengths in m, in the array frame; of a drive, whose vehicle moves, in
 * the array frame as it stands over ground at time 0.  Of several `walls` the room has
 * the first. */
#ifndef ANLOS_HAL_ROOM_SCENE_H
#define ANLOS_HAL_ROOM_SCENE_H

#include <stdint.h>

#include "dsp/error.h"
#include "hal/survey/yaml.h"
#include "recon/survey.h"

enum scene_array { SCENE_EXPLICIT, SCENE_PAPER, SCENE_BUMPER };

enum scene_kind {
    SCENE_POINT,
    SCENE_RECTANGLE,
    SCENE_POLYGON,
    SCENE_LETTER,
    SCENE_CORNER,
    SCENE_PERSON, /* bodies of points, hal/room/figure.h */
    SCENE_CYCLIST,
    SCENE_CAR,
    SCENE_KINDS
};

/* An object goes straight from knot to knot; before the first and after the last it
 * stands there. */
struct scene_knot {
    double t_s, position_m[3];
};

/* What another draw than the file's own changes of a path: turned around the upright axis
 * through its middle, moved, and gone along at another speed. */
struct scene_drawn_path {
    double turn_deg;   /* up to so much, to either side */
    double shift_m[3]; /* along each axis, up to so much */
    bool reversed;     /* by another half turn, every second time: from the other side */
    double *speed_m_s; /* [2] from, to: of all its legs */
};

/* As the file has it; NULL: not given. */
struct scene_object {
    char name[32];
    int kind;
    double *position_m;      /* [3] where it stands, or its path; the centre of a body */
    struct scene_knot *path; /* drive: ends where it begins, unless present_s is given */
    unsigned n_path;
    double *present_s; /* [2] drive: it is there from one time to another */
    /* point; of a body the root of its points' squares' sum */
    double *scattering_length_m;
    double *side_m;         /* corner: edge of the trihedral */
    double *size_m;         /* [2] width, height of rectangle, letter */
    double (*outline_m)[2]; /* polygon: right and up from position_m */
    unsigned n_outline;
    char letter[2];
    double *stroke_m; /* letter */
    double *facing;   /* [3] the front's direction; default: to the mirrored array, of a
                         body where it goes */
    double *up;       /* [3] default: the array's y axis */
    double *reflectivity;
    struct scene_drawn_path *drawn; /* drive: of what has a path */
    bool opaque; /* a body of a drive: heard by the side that faces the array */
};

struct scene_wall {      /* what the survey's wall does to sound */
    double reflectivity; /* of each of the two bounces on the way to an object and back */
    double echo;         /* of the array's own image in the wall */
    uint32_t patches;    /* diffuse scatterers on it */
    double scattering_length_m, roughness_m;
    double (*spans_m)[2]; /* [n_spans] where there is any of it, horizontally along it
                             from the foot of the array's origin, x where it is straight
                             ahead; elsewhere it mirrors nothing.  None: it has no end */
    unsigned n_spans;
};

struct scene_clutter { /* points anywhere around, in both passes */
    uint32_t points;
    double scattering_length_m, near_m, far_m;
    bool mirrored; /* by way of the wall, there and back, they are heard once more */
};

struct scene_microphones { /* synthetic response curves, known to the processor */
    double ripple_db;
};

struct scene_errors { /* unknown to the processor; rms for each axis, element, position */
    double gain_db, element_m, stage_m;
};

struct scene_rise { /* louder, or less, from one time to another */
    double during_s[2], by_db;
};

struct scene_slam {     /* a door, a stone: noise that begins at once and fades */
    double during_s[2]; /* drive: at one time of this span, which the seed draws */
    double peak;        /* rms when it begins, at the array, full scale +-1 */
    double decay_s;     /* to 1 / e */
    double *position_m; /* [3] from where it goes to each microphone; not given: all hear
                           it at that time */
};

struct scene_tone { /* electrical: a supply, the mains */
    double frequency_hz;
    double rms; /* full scale +-1, of the first harmonic; of a comb, of all of it */
    uint32_t
        harmonics;  /* of them, up to half the rate, the n-th 1 / n as loud; 0, 1: one */
    uint32_t *comb; /* [2] in their place: from one to another, all as loud, with phases
                       that the seed draws */
    double wander;  /* the frequency goes to and fro by this part of it, in 10 s */
    double spread_db; /* standard deviation of how loud microphones have it; 0: alike */
    double *during_s; /* [2] drive: from one time to another */
};

struct scene_noise {
    double *snr_db; /* power of the objects' echoes in the recording over the noise's */
    double *at_m;   /* snr_db: in place of the objects, of a person at this range (half
                       the path) by way of the wall; what a drive has to say */
    double *rms;    /* or absolute, full scale +-1 */
    struct scene_rise *rises; /* drive: rain, a compressor */
    unsigned n_rises;
    struct scene_slam *slams;
    unsigned n_slams;
    struct scene_tone *tones;
    unsigned n_tones;
};

/* Another vehicle's array of the same design, hal/room/noise.h.  It stands. */
struct scene_interferer {
    double position_m[3];   /* the middle of its speakers */
    double turn_deg;        /* about the upright axis; 0: it looks where ours does */
    double start_s;         /* its first emission, in world time */
    double clock_ppm;       /* its clock is so much faster */
    uint32_t *slot_samples; /* of its clock; default: as many as ours */
    uint32_t jitter_samples;
    bool *stagger;    /* default: yes */
    double level_db;  /* against our speakers */
    bool down;        /* its chirps run from their stop to their start */
    double *during_s; /* [2] only from one time of the drive to another */
};

struct scene_motion {
    double t_s, speed_m_s, yaw_rate_deg_s; /* of the vehicle; yaw to the left */
};

/* A vehicle that stands on its springs and tyres rocks, by wind, steps and engines, and
 * its wheels say nothing of it: three sines of one frequency (of which a whole number
 * fits into the period), each a third of a turn after the one before. */
struct scene_rock {
    double frequency_hz;
    double forward_m, left_m, yaw_deg; /* amplitudes */
};

struct scene_drive { /* repeats for ever; needs a mount and no stage */
    double period_s;
    struct scene_motion *ego; /* straight from knot to knot, constant outside of them;
                                 absent: the vehicle stands */
    unsigned n_ego;
    struct scene_rock *rock;
};

struct scene_drawn { /* what another draw changes of the wall, up to so much */
    double wall_m, wall_deg;
};

struct scene_drift {     /* of the air, against temperature_c */
    double background_c; /* during the background pass */
    double scan_c;       /* from the first to the last position of a pass */
    double rate_c_min;   /* drive: a minute, for half of its period, and then back */
};

struct scene_fault { /* of one speaker or microphone */
    uint32_t channel;
    double gain_db;
    double *during_s; /* [2] drive: gain_db and moved_m only from one time to another:
                         covered, knocked */
    double *moved_m;  /* [3] drive: it stands so far beside its place */
    bool inverted, dead;
    double noise_rms; /* added to what is heard: of a speaker by all, while it emits */
    double *limit;    /* where it clips: of a speaker over the chirp's amplitude, of a
                         microphone over full scale */
    uint32_t *swapped_with; /* the channel whose cable is in its place */
};

struct scene_faults {        /* of the array; unknown to the processor */
    double latency_samples;  /* on top of the survey's */
    double *sound_speed_m_s; /* in place of the survey's */
    struct scene_fault *speakers, *microphones;
    unsigned n_speakers, n_microphones;
};

struct scene {
    struct survey_yaml survey;
    enum scene_array array;
    uint32_t seed;
    double *level;        /* amplitude at 1 m, full scale +-1; default 0.05 */
    double *direct_level; /* of the way from speaker to microphone; default 1 */
    struct scene_wall *wall_sound;
    struct scene_clutter *clutter;
    struct scene_microphones *microphones;
    struct scene_errors *errors;
    struct scene_noise *noise;
    struct scene_drift *drift;
    struct scene_faults *faults;
    struct scene_drive *drive;
    struct scene_drawn *drawn;
    struct scene_interferer *interferers; /* drive */
    unsigned n_interferers;
    double (*building)[2]; /* [n_building] x, z: an outline that hides things from view;
                              for the truth alone, sound does not know it */
    unsigned n_building;
    struct scene_object *objects;
    unsigned n_objects;
};

/* "point" */
const char *scene_kind_name(int kind);

/* Reads and checks a file; optional mappings are there with their defaults.  *survey: as
 * the processor should know it, but for synthetic microphones.  scene_free the one,
 * survey_clear the other.  0, -ENOENT, -EINVAL ("file:line: key: expected"), -ENOMEM. */
int scene_load(struct scene **out, struct survey *survey, const char *path,
               struct error *why);
void scene_free(struct scene *s);

/* The vehicle's z axis in the array frame, or without one the array's y axis. */
void scene_up(const struct survey *s, double up[3]);

/* Draws by its seed what `drawn` says. */
void scene_draw(struct scene *s, struct survey *survey);

#endif
