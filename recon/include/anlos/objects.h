/* SPDX-License-Identifier: MIT */
/* anlos/objects.h -- the hidden objects: where they really are, how sure that is, and,
 * where they are tracked, how they move. */
#ifndef ANLOS_OBJECTS_H
#define ANLOS_OBJECTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <anlos/error.h>

enum anlos_shape { ANLOS_SHAPE_UNKNOWN, ANLOS_POINT, ANLOS_PLATE, ANLOS_EXTENDED };

enum anlos_multipath {               /* how an echo came */
                       ANLOS_DIRECT, /* from the object itself */
                       ANLOS_PAIR,   /* from one object to another */
                       ANLOS_FACE,   /* by way of a flat face, or of the ground */
                       ANLOS_SHADOW  /* from behind an object, by way of it */
};

enum anlos_track_state { ANLOS_NEW, ANLOS_MEASURED, ANLOS_PREDICTED, ANLOS_DELETED };
enum anlos_motion { ANLOS_MOTION_UNKNOWN, ANLOS_STANDING, ANLOS_MOVING };

/* Positions are in the vehicle's frame, or in the array's where no mount is known; see
 * struct anlos_list. */
struct anlos_object {
    size_t size; /* sizeof(struct anlos_object) */
    uint32_t id; /* from 1; of a track it stays from list to list */
    bool placed; /* false: it is there, but no wall has shown where; neither velocity nor
                    position, covariance and extent is known */
    double position_m[3];
    double covariance_m2[6]; /* xx xy xz yy yz zz, of image and wall together; 100 m of
                                standard deviation: not known along there */
    double extent_m[3];      /* full size of what is above half amplitude; 0: a point */
    uint32_t wall;       /* id of what mirrored it; 0: none, it is where it is imaged */
    bool height_assumed; /* the array hears none */
    bool behind_no_wall; /* walls are known, but none stands before it in its gate */
    bool in_free_view;
    double virtual_m[3];      /* as imaged, in the array's frame */
    double existence;         /* 0..1, a probability; of a track: of it and its wall, and
                                 of one predicted: within a metre of its place */
    double level_db;          /* above the noise floor of the image */
    int shape;                /* enum anlos_shape, */
    double shape_probability; /* among the three */
    int multipath;            /* enum anlos_multipath; if not direct: */
    uint32_t of[2];     /* ids of the objects that make it; twice the same: of one */
    uint32_t at_border; /* bit 2 a + e: at the low (e = 0) or high (1) end of axis a
                           of the image: it may go on beyond */

    bool tracked;             /* what follows is known */
    int state;                /* enum anlos_track_state */
    int motion;               /* enum anlos_motion */
    double age_s, unseen_s;   /* since it was seen first, and last */
    double velocity_m_s[2];   /* x, y over ground along the axes of the position */
    double velocity_m2_s2[3]; /* covariance, xx xy yy */
};

struct anlos_list {       /* of objects */
    size_t size;          /* sizeof(struct anlos_list) */
    size_t n;             /* objects, at most 64; strongest or likeliest first */
    int64_t capture_ns;   /* of the image that they were found in */
    uint32_t scan, frame; /* likewise */
    uint32_t counter;     /* rises with each list */
    bool preview;
    bool mirrored;         /* false: no wall is known, positions are virtual or absent */
    bool in_vehicle_frame; /* false: no mount is known, positions are the array's */
    bool tracked;          /* ids stay with objects from list to list */
    bool ego_unknown; /* the vehicle says no more how it moves: taken to be as it was */
    size_t n_areas;   /* that it can tell of, at most 15 */
};

/* A part of the floor that a list can tell of, a convex polygon.  Outside of all of them
 * it claims nothing, neither that something is there nor that nothing is. */
struct anlos_area {
    size_t size;            /* sizeof(struct anlos_area) */
    uint32_t wall;          /* by way of which it is seen; 0: directly */
    size_t n_corners;       /* 3..8, */
    double corners_m[8][2]; /* counterclockwise: x, y of the vehicle's frame, or x, z of
                               the array's where no mount is known */
};

#endif
