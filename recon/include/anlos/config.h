/* SPDX-License-Identifier: MIT */
/* anlos/config.h -- with what the stages run, and all of them in anlos/pipeline.h: one
 * configuration, of which each takes its part; what holds where nothing is said is what
 * the launch files of anlos have.  The survey (anlos/survey.h) says the rest. */
#ifndef ANLOS_CONFIG_H
#define ANLOS_CONFIG_H

#include <stdbool.h>
#include <stddef.h>

#include <anlos/error.h>

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

/* anlos_config_init it, then change what is to be different.  A stage takes its part. */
struct anlos_config {
    size_t size;    /* sizeof(struct anlos_config) */
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
    unsigned confirm_hits, confirm_of; /* 2 of 3 looks confirm a track (M of N; M + 1
                                          of N + 2, where M > 1, while what stands is
                                          in the image, and for a while after), */
    double confirm_existence;          /* and 0.95 */
    double coast_s;                    /* 1.5: after that unseen a track ends */

    /* Walls. */
    int walls;      /* enum anlos_wall_source; ANLOS_WALLS_SURVEY */
    double reach_m; /* 5: how far away walls are looked for */
    double lost_s;  /* 3: without being seen or given */

    /* Ends early what takes long of a scan: to plan for it, and its image.  Asked again
     * and again meanwhile, in the thread that called, hundreds of times an image; once it
     * says true, that call returns ANLOS_CANCELED within about a tenth of a second, and
     * what was fed stays.  It must not call this library with the same handle.  NULL:
     * nobody is asked. */
    bool (*stop)(void *stop_ctx);
    void *stop_ctx;
};

/* Called through anlos_config_init. */
ANLOS_API void anlos_config_fill(struct anlos_config *cfg, size_t size, int array);

/* What holds where nothing is said, as above; of a static array cells decide and the
 * background is adaptive, as in launch/drive.yaml. */
static inline void anlos_config_init(struct anlos_config *cfg)
{
    anlos_config_fill(cfg, sizeof *cfg, ANLOS_SCAN);
}

static inline void anlos_config_init_static(struct anlos_config *cfg)
{
    anlos_config_fill(cfg, sizeof *cfg, ANLOS_STATIC_ARRAY);
}

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
