/* anlos/pipeline.h -- all stages in one: pings to images, hidden objects and tracks.
 *
 * For each ping: which microphones are fit, pulse compression, background subtracted
 * (anlos's front end); a scan's traces to its image by one of the methods, or a static
 * array's newest pings to an image each round or each ping; objects in it, mirrored back
 * at the walls that are known, tracked where the array is static.  The same code, in the
 * same order, as the processes of anlos run: one recording gives the same objects here,
 * by `anlos recon --bag` and in a vehicle.
 *
 *   anlos_pipeline_config_init(&cfg);
 *   anlos_pipeline_create(&p, &cfg, survey, &why);
 *   for each ping
 *       if (anlos_pipeline_ping(p, &ping, &why) & ANLOS_NEW_OBJECTS) ...
 *   anlos_pipeline_destroy(p);
 *
 * What is fed is copied or used up before a call returns.  What is asked for is copied,
 * but for an image's intensity.  One thread at a time; it works on as many as it was
 * created with. */
#ifndef ANLOS_PIPELINE_H
#define ANLOS_PIPELINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <anlos/error.h>
#include <anlos/image.h>
#include <anlos/objects.h>
#include <anlos/ping.h>
#include <anlos/survey.h>
#include <anlos/walls.h>

ANLOS_BEGIN

enum anlos_array {
    ANLOS_SCAN,        /* every speaker at every stage position once, then an image */
    ANLOS_STATIC_ARRAY /* round after round of its speakers, without end */
};

enum anlos_background {
    ANLOS_BACKGROUND_NONE,
    ANLOS_BACKGROUND_RECORDED, /* pings with `background` come before those without */
    ANLOS_BACKGROUND_ADAPTIVE  /* of a static array: the mean while the vehicle stands */
};

enum anlos_wall_source {
    ANLOS_WALLS_SURVEY, /* those of the survey, or those that anlos_pipeline_walls says */
    ANLOS_WALLS_GIVEN,  /* anlos_pipeline_walls says what is known in the vehicle's frame;
                           they are followed over time */
    ANLOS_WALLS_HEARD   /* found in the array's own first returns */
};

/* anlos_pipeline_config_init it, then change what is to be different. */
struct anlos_pipeline_config {
    size_t size;    /* sizeof(struct anlos_pipeline_config) */
    int array;      /* enum anlos_array; ANLOS_SCAN */
    size_t threads; /* 1; counts the caller, who works too */

    /* Pings to traces. */
    const char *window;      /* "hann"; "hamming", "rectangular" */
    const char *compression; /* "matched_filter"; "deramp" (the paper's) */
    int background;          /* enum anlos_background; ANLOS_BACKGROUND_NONE */
    double background_s;     /* 10: time constant of an adaptive one */

    /* Of a scan. */
    const char *method;         /* "fast"; one of anlos_method */
    const char *const *options; /* [n_options] "NAME=VALUE", of anlos_option; NULL */
    size_t n_options;

    /* Of a static array. */
    size_t frame_pings; /* in a round; 0: as many as there are speakers */
    size_t image_pings; /* the newest, in an image; 0: as in a round; at most 256 */
    bool every_ping;    /* an image; else (false) every round */
    bool coherent;      /* phases add up over pings; else (false) powers */

    /* Objects. */
    double threshold_db;     /* 12, above the noise floor; not with cells */
    double min_existence;    /* 0.5: what is less likely is left out */
    double false_alarm_rate; /* 1e-4, of each voxel, by the cells around it (ordered
                                statistic, Rohling 1983); 0: off.  Of a scan: 0 */
    bool lists;              /* a static array's objects are not tracked; false */
    unsigned confirm_hits, confirm_of; /* 3 of 5 looks confirm a track, */
    double confirm_existence;          /* and 0.9 */
    double coast_s;                    /* 1.5: after that unseen a track ends */

    /* Walls. */
    int walls;      /* enum anlos_wall_source; ANLOS_WALLS_SURVEY */
    double reach_m; /* 5: how far away walls are looked for */
    double lost_s;  /* 3: without being seen or given */
};

/* Called through anlos_pipeline_config_init. */
ANLOS_API void anlos_pipeline_config_fill(struct anlos_pipeline_config *cfg, size_t size,
                                          int array);

/* What holds where nothing is said, as above; of a static array cells decide and the
 * background is adaptive, as in launch/drive.yaml. */
static inline void anlos_pipeline_config_init(struct anlos_pipeline_config *cfg)
{
    anlos_pipeline_config_fill(cfg, sizeof *cfg, ANLOS_SCAN);
}

static inline void anlos_pipeline_config_init_static(struct anlos_pipeline_config *cfg)
{
    anlos_pipeline_config_fill(cfg, sizeof *cfg, ANLOS_STATIC_ARRAY);
}

struct anlos_pipeline; /* opaque */

/* Checks both and plans; keeps neither.  survey may be NULL: anlos_pipeline_survey says
 * it later.  ANLOS_INVALID, ANLOS_UNSUPPORTED, ANLOS_NO_MEMORY, ANLOS_NO_THREADS.  Some
 * 0.1 s for the paper's scan. */
ANLOS_API int anlos_pipeline_create(struct anlos_pipeline **out,
                                    const struct anlos_pipeline_config *cfg,
                                    const struct anlos_survey *survey,
                                    struct anlos_error *why);

/* Of NULL: nothing. */
ANLOS_API void anlos_pipeline_destroy(struct anlos_pipeline *p);

/* Another one from now on: what was heard is forgotten.  After an error none is known. */
ANLOS_API int anlos_pipeline_survey(struct anlos_pipeline *p,
                                    const struct anlos_survey *survey,
                                    struct anlos_error *why);

/* -- in ---------------------------------------------------------------------------------
 */

enum anlos_news { /* bits */
                  ANLOS_NEW_IMAGE = 1,
                  ANLOS_NEW_OBJECTS = 2, /* a list, which may be empty */
                  ANLOS_NEW_WALLS = 4,
                  ANLOS_NEW_NOTE =
                      8 /* something that a person should know: anlos_pipeline_note */
};

/* Returns news, or ANLOS_INVALID (a ping of another survey or shape), ANLOS_NOT_READY (no
 * survey, or no background of this ping was recorded), ANLOS_STALE (its image is older
 * than the one before). */
ANLOS_API int anlos_pipeline_ping(struct anlos_pipeline *p, const struct anlos_ping *ping,
                                  struct anlos_error *why);

/* A scan has ended: one that lacks pings gets its image, of those that are in.  News. */
ANLOS_API int anlos_pipeline_finish(struct anlos_pipeline *p, struct anlos_error *why);

/* How the vehicle moves at a time: speed of its origin forward, yaw rate to the left.
 * From the first of these on silence means that it is not known. */
ANLOS_API int anlos_pipeline_ego(struct anlos_pipeline *p, double speed_m_s,
                                 double yaw_rate_rad_s, int64_t capture_ns,
                                 struct anlos_error *why);

/* Of the air around; of use where none is measured with a ping. */
ANLOS_API int anlos_pipeline_air(struct anlos_pipeline *p, double temperature_c,
                                 struct anlos_error *why);

/* All the walls [n <= 8] that are known at a time; none: n = 0.  In the array's frame, in
 * the order of being sure; with ANLOS_WALLS_GIVEN in the vehicle's.  ANLOS_INVALID also
 * where they are heard.  News. */
ANLOS_API int anlos_pipeline_walls(struct anlos_pipeline *p,
                                   const struct anlos_wall *walls, size_t n,
                                   int64_t capture_ns, struct anlos_error *why);

/* -- out --------------------------------------------------------------------------------
 */

/* out->size is set.  The newest image; its intensity is good until the next ping.
 * ANLOS_NOT_READY: there is none yet. */
ANLOS_API int anlos_pipeline_image(const struct anlos_pipeline *p,
                                   struct anlos_image *out, struct anlos_error *why);

/* The newest list: detections of a scan, tracks of a static array.  ANLOS_NOT_READY. */
ANLOS_API int anlos_pipeline_list(const struct anlos_pipeline *p, struct anlos_list *out,
                                  struct anlos_error *why);

/* Number i of it, out->size set.  ANLOS_INVALID: there are not so many. */
ANLOS_API int anlos_pipeline_object(const struct anlos_pipeline *p, size_t i,
                                    struct anlos_object *out, struct anlos_error *why);

/* How many walls images and tracks go by, and each of them in the array's frame, the
 * surest first. */
ANLOS_API size_t anlos_pipeline_n_walls(const struct anlos_pipeline *p);
ANLOS_API int anlos_pipeline_wall(const struct anlos_pipeline *p, size_t i,
                                  struct anlos_wall *out, struct anlos_error *why);

/* The newest note; "" when there is none. */
ANLOS_API const char *anlos_pipeline_note(const struct anlos_pipeline *p);

/* Counts since it was created. */
struct anlos_health {
    size_t size;      /* sizeof(struct anlos_health) */
    uint64_t pings;   /* that were used */
    uint64_t refused; /* that were not: an error was returned */
    uint64_t blanked; /* that a sound from outside drowned */
    uint64_t unfit;   /* whose traces did not fit the image */
    uint64_t images, lists, wall_lists;
    uint64_t late_images; /* older than the one before: not tracked */
    uint64_t crowded;     /* objects for which there was no room */
    uint64_t clipped_samples, not_finite_samples;
    size_t microphones;              /* of the newest ping, */
    size_t silent, damaged, clipped; /* and so many of them are */
    double sound_speed_m_s;          /* that is worked with; 0: no survey */
};
ANLOS_API int anlos_pipeline_health(const struct anlos_pipeline *p,
                                    struct anlos_health *out, struct anlos_error *why);

/* -- methods ----------------------------------------------------------------------------
 */

/* The name of imaging method i, from 0; NULL: there are not so many. */
ANLOS_API const char *anlos_method(size_t i);

/* Option i of the methods: its name, and in help and methods (each may be NULL) a line
 * and those who use it, as "iterative, sparse".  NULL: there are not so many. */
ANLOS_API const char *anlos_option(size_t i, const char **help, char *methods,
                                   size_t methods_size);

ANLOS_END

#endif
