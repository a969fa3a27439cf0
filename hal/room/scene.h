/* hal/room/scene.h -- a scene file: the survey's keys, and the world that a survey does
 * not know.  All lengths in m, in the array frame. */
#ifndef ANLOS_HAL_ROOM_SCENE_H
#define ANLOS_HAL_ROOM_SCENE_H

#include <stdint.h>

#include "hal/survey/yaml.h"
#include "msgs/complaint.h"
#include "msgs/survey.h"

enum scene_kind {
    SCENE_POINT,
    SCENE_RECTANGLE,
    SCENE_POLYGON,
    SCENE_LETTER,
    SCENE_CORNER,
};

/* As the file has it; NULL: not given. */
struct scene_object {
    char name[32];
    int kind;
    double position_m[3];
    double *scattering_length_m; /* point */
    double *side_m;              /* corner: edge of the trihedral */
    double *size_m;              /* [2] width, height of rectangle, letter */
    double (*outline_m)[2];      /* polygon: right and up from position_m */
    unsigned n_outline;
    char letter[2];
    double *stroke_m; /* letter */
    double *facing;   /* [3] the front's direction; default: to the mirrored array */
    double *up;       /* [3] default: the array's y axis */
    double *reflectivity;
};

struct scene_wall {      /* what the survey's wall does to sound */
    double reflectivity; /* of each of the two bounces on the way to an object and back */
    double echo;         /* of the array's own image in the wall */
    uint32_t patches;    /* diffuse scatterers on it */
    double scattering_length_m, roughness_m;
};

struct scene_clutter { /* points anywhere around, in both passes */
    uint32_t points;
    double scattering_length_m, near_m, far_m;
};

struct scene_microphones { /* synthetic response curves, known to the processor */
    double ripple_db;
};

struct scene_errors { /* unknown to the processor; rms for each axis, element, position */
    double gain_db, element_m, stage_m;
};

struct scene_noise {
    double *snr_db; /* power of the objects' echoes in the recording over the noise's */
    double *rms;    /* or absolute, full scale +-1 */
};

struct scene_drift {     /* of the air, against temperature_c */
    double background_c; /* during the background pass */
    double scan_c;       /* from the first to the last position of a pass */
};

struct scene_fault { /* of one speaker or microphone */
    uint32_t channel;
    double gain_db;
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
    int array; /* 0: as the keys say, 1: paper */
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
    struct scene_object *objects;
    unsigned n_objects;
};

/* Reads and checks a file; optional mappings are there with their defaults.  *survey: as
 * the processor should know it, but for synthetic microphones.  scene_free the one,
 * survey_clear the other.  0, -ENOENT, -EINVAL ("file:line: key: expected"), -ENOMEM. */
int scene_load(struct scene **out, struct survey *survey, const char *path,
               struct complaint *why);
void scene_free(struct scene *s);

/* Ranges, and keys that belong to another kind of object (scene_check.c). */
int scene_check(const struct scene *s, const char *path, struct complaint *why);

#endif
