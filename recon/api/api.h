/* SPDX-License-Identifier: MIT */
/* recon/api/api.h -- what the public functions (recon/include/anlos) share: errors, sizes
 * of structures, the planner's lock, and structures of outside to those of inside and
 * back. */
#ifndef ANLOS_RECON_API_API_H
#define ANLOS_RECON_API_API_H

#include <anlos/anlos.h>

#include "dsp/error.h"
#include "recon/detection/objects.h"
#include "recon/pipeline.h"
#include "recon/survey.h"
#include "recon/volume.h"
#include "recon/walls/walls.h"

struct anlos_survey {
    struct survey inside;
};

struct api_config { /* stays where it is: the inside borrows from it */
    struct pipeline_config inside;
    struct imager_options options;
    char method[32];
};

int api_configure(struct api_config *p, const struct anlos_config *given,
                  struct anlos_error *why);

/* What takes pings: counts and cleans them, and numbers the rounds.  {0}: of no survey.
 */
struct api_pings {
    struct survey survey;
    uint64_t survey_id;   /* 0: none */
    size_t clean_samples; /* room in clean, of each microphone */
    float *clean;         /* [n_microphones][clean_samples]: without what is not finite */
    uint32_t *clipped, *not_finite; /* [n_microphones] */
    bool *heard;                    /* [n_speakers] in this round, and its number */
    uint32_t frame;
    uint64_t clipped_samples, not_finite_samples; /* of all pings */
};

int api_pings_survey(struct api_pings *p, const struct survey *survey,
                     struct anlos_error *why);
void api_pings_forget(struct api_pings *p);

/* Checks it and borrows from it and from p; *now_ns: when it was whole. */
int api_pings_take(struct api_pings *p, const struct api_config *cfg,
                   const struct anlos_ping *given, struct ping *out, int64_t *now_ns,
                   struct anlos_error *why);

/* Writes the sentence (why may be NULL) and returns code. */
int api_fail(struct anlos_error *why, int code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* The same of an error of inside, a negative errno with its sentence; where there is
 * none, `doing` says what was tried. */
int api_fail_inside(struct anlos_error *why, int err, const struct error *inside,
                    const char *doing);

/* A structure that begins with its size, from whoever may know fewer members of it: what
 * he does not know is 0.  least: its size in the first version of the interface. */
int api_take(void *out, size_t size, size_t least, const void *in, const char *name,
             struct anlos_error *why);

/* The other way: out as far as it is known there. */
int api_give(void *out, size_t least, const void *from, size_t size, const char *name,
             struct anlos_error *why);

#define API_TAKE(own, in, name, why)                                                     \
    api_take(own, sizeof *(own), sizeof *(own), in, name, why)
#define API_GIVE(out, own, name, why)                                                    \
    api_give(out, sizeof *(own), own, sizeof *(own), name, why)

/* 0, or ANLOS_INVALID: it is NULL. */
int api_there(const void *argument, const char *name, struct anlos_error *why);
int api_finite(const double *x, size_t n, const char *name, struct anlos_error *why);
int api_stamp(int64_t stamp_ns, const char *name, struct anlos_error *why);

/* Around all that plans or destroys plans. */
void api_lock(void);
void api_unlock(void);

/* ANLOS_INVALID with what survey_check says. */
int api_survey(const struct anlos_survey *s, struct anlos_error *why);

struct api_objects { /* the newest list */
    struct object_list list;
    int64_t capture_ns;
    bool there;
};
int api_objects_list(const struct api_objects *o, struct anlos_list *out,
                     struct anlos_error *why);
int api_objects_area(const struct api_objects *o, size_t i, struct anlos_area *out,
                     struct anlos_error *why);
int api_objects_at(const struct api_objects *o, size_t i, struct anlos_object *out,
                   struct anlos_error *why);

/* A volume of a survey; borrows. */
int api_volume(struct volume *out, const struct anlos_image *given, uint64_t survey_id,
               struct anlos_error *why);

/* Traces of a survey; borrows.  unmasked [n_microphones], of who says nothing of masks.
 */
int api_traces(struct traces *out, const struct anlos_traces *given,
               const struct survey *survey, uint64_t survey_id, const bool *unmasked,
               struct anlos_error *why);

int api_motion(struct ego_motion *out, double speed_m_s, double yaw_rate_rad_s,
               int64_t capture_ns, struct anlos_error *why);

/* Of a ping that gave no traces. */
int api_fail_ping(const struct frontend_output *front, struct anlos_error *why);

void api_image(struct anlos_image *out, const struct volume *volume);
void api_list(struct anlos_list *out, const struct object_list *list, int64_t capture_ns);
void api_object(struct anlos_object *out, const struct object *object);
void api_wall(struct anlos_wall *out, const struct walls *walls, size_t i);

/* walls [n], each as large as the first says. */
int api_walls(struct walls *out, const struct anlos_wall *walls, size_t n,
              struct anlos_error *why);

#endif
