/* SPDX-License-Identifier: MIT */
/* recon/detection/objects.h -- the hidden objects of an image: where they really are
 * (mirrored at the wall, in the vehicle frame when a mount is known), with covariance. */
#ifndef ANLOS_RECON_DETECTION_OBJECTS_H
#define ANLOS_RECON_DETECTION_OBJECTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "recon/detection/detect.h"
#include "recon/grid.h"
#include "recon/survey.h"
#include "recon/tracking/track.h"
#include "recon/walls/field_of_view.h"
#include "recon/walls/walls.h"

#define OBJECTS_MAX 64

/* Where an imaged object really is: in the vehicle frame, or in the array's without a
 * mount. */
struct placement {
    double position_m[3];
    double covariance_m2[6]; /* of image and wall together; the height of an array that
                                cannot tell it is that of the array, give or take half a
                                metre; one on a vehicle takes things to stand on the
                                ground, which brings them nearer */
    double height_m2[6];     /* of that, what the assumed height does */
    double extent_m[3];
    uint32_t wall;       /* that mirrored it; 0: none did, it is where it is imaged */
    bool height_assumed; /* the array hears none */
    bool behind_no_wall; /* walls are known, but none stands before it in its gate */
    bool in_free_view;
};

struct object {
    uint32_t id; /* from 1 */
    bool placed; /* false: it is there, but no wall has shown where; neither velocity nor
                    what `place` says of position, covariance and extent is known */
    struct placement place;
    double virtual_m[3]; /* as imaged, in the array frame; of a track: where its echo is,
                            the middle of what is heard of it */
    double middle_m[3];  /* likewise, of all that is bright there */
    double covariance_m2[6], extent_m[3]; /* as imaged, too; of no track */
    double existence;                     /* 0..1; of a track: of it and its wall */
    double lately;                        /* as struct detection has it; of no track */
    double proven;   /* 0..1, as single pings tell (struct detection); of no track */
    double level_db; /* above the noise floor of the image */
    bool has_course; /* by the phases of the image's pings (struct volume_mover), */
    bool moves;      /* and nothing at rest would go so; of no track */
    double course_m_s[2], course_power; /* then: x, z in the array frame, as imaged */
    double course_doubt;                /* wrong with this probability */
    struct shape_guess shape;
    unsigned at_border; /* PEAK_BORDER (recon/detection/peak.h) */
    enum multipath multipath;
    uint32_t of[2]; /* then: ids of the objects that make it; twice the same: of one */

    bool tracked; /* what follows is known */
    enum track_state state;
    enum track_motion motion;
    double age_s, unseen_s;   /* since it was seen first, and last */
    double velocity_m_s[2];   /* x, y over ground along the axes of the position */
    double velocity_m2_s2[3]; /* covariance, xx xy yy */
};

struct object_list {
    uint32_t scan, frame; /* of the image; frame 0: of a scan */
    uint32_t counter;     /* rises with each list */
    bool preview;
    bool mirrored;         /* false: no wall is known, positions are virtual or absent */
    bool in_vehicle_frame; /* false: no mount is known, positions are the array's */
    bool tracked;          /* ids stay with objects from list to list */
    bool ego_unknown; /* the vehicle says no more how it moves: taken to be as it was */
    enum survey_source source;
    double temperature_c, sound_speed_m_s;
    struct field_of_view view; /* outside, nothing is claimed: neither that anything is
                                  there nor that nothing is; of a tracker's lists */
    size_t n;
    struct object objects[OBJECTS_MAX]; /* [n]; of an image: strongest first */
};

/* Sets resolution_m, and cluster_m where details of one object are seen apart. */
void objects_resolution(struct detect_config *cfg, const struct survey *s,
                        const struct grid *grid);

/* Detects and places: strongest first, ids from 1; what is less likely than min_existence
 * (0..1) is left out.  cfg->resolution_m is not read: it follows from the survey.
 * Without a wall the positions are the virtual ones (mirrored = false), without a mount
 * they stay in the array frame.  intensity: [nz][ny][nx].  walls: e.g. the newest that
 * were heard; NULL: the survey's.  0, -ENOMEM, -ECANCELED (its pool has stopped). */
int objects_find(struct object_list *out, const struct survey *s,
                 const struct walls *walls, const struct detect_config *cfg,
                 double min_existence, const struct grid *grid, const float *intensity);

/* One more at the end of a list that has room. */
void objects_add(struct object_list *out, const struct survey *s,
                 const struct walls *walls, const struct detection *detection);

/* The places alone; detections[n], n <= OBJECTS_MAX. */
void objects_list(struct object_list *out, const struct survey *s,
                  const struct walls *walls, const struct detection *detections,
                  size_t n);
void objects_place(struct placement *out, const struct survey *s,
                   const struct walls *walls, const struct detection *detection);

/* One that is of no track, as if the wall of that index had mirrored it; walls->n: as if
 * none had. */
void objects_place_by(struct object *o, const struct survey *s, const struct walls *walls,
                      size_t wall);

/* A standard deviation from which on a place is not known along that axis, rather than
 * known badly (PEAK_UNKNOWN_M, turned). */
#define OBJECTS_KNOWN_M 10.0

#endif
