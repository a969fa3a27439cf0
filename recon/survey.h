/* SPDX-License-Identifier: MIT */
/* recon/survey.h -- the geometry and timing of an acquisition.
 * Frame ("array frame"): x horizontal along the stage, y up along the array, z forward to
 * the wall.  All positions in m. */
#ifndef ANLOS_RECON_SURVEY_H
#define ANLOS_RECON_SURVEY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"

enum survey_source { SURVEY_LIVE, SURVEY_REPLAY, SURVEY_SIMULATION };

struct survey_response { /* factory calibration of one microphone */
    char serial[32];
    size_t n_points;
    double *frequency_hz; /* [n_points], rising */
    double *gain_db;      /* [n_points] */
};

struct survey_wall {  /* { p : normal . p = distance_m } */
    double normal[3]; /* unit */
    double distance_m;
    double gate_m[2]; /* near, far: ranges that are seen by way of it */
};

#define SURVEY_MAX_WALLS 8
#define SURVEY_SAME_M    0.05

struct survey {
    enum survey_source source;
    double sound_speed_m_s;
    double temperature_c; /* NaN: not known */
    double sample_rate_hz;
    double chirp_start_hz, chirp_stop_hz, chirp_duration_s;
    bool chirp_sine;       /* the chirp starts as a sine; else as a cosine */
    bool chirp_alternates; /* every second emission of a shot runs from stop to start */
    size_t slot_samples; /* from one emission to the next; may be shorter than a chirp */
    size_t together;     /* emissions that start in one slot: 2, or 0 and 1: one */
    double latency_samples; /* from the nominal to the real emission, >= 0 */

    size_t n_speakers, n_microphones, n_positions;
    double (*speakers_m)[3];    /* [n_speakers], at stage position 0 */
    double (*microphones_m)[3]; /* [n_microphones] */
    double stage_axis[3];       /* unit */
    double *stage_positions_m;  /* [n_positions] */
    /* The stage does not stop: position k is where it is when the first slot of round k
     * of all speakers begins, right behind the last slot of the round before, and it goes
     * on at survey_speed_m_s. */
    bool continuous;

    /* [n_positions][speaker, microphone]: each ping has places of its own, in place of
     * speakers, microphones and stage, which are one, one and at 0 then.  Or NULL. */
    double (*pings_m)[2][3];

    /* What is emitted, at the sample rate, in place of the chirp, whose start and stop
     * are the ends of its band then and whose duration is its.  0: the chirp. */
    size_t n_replica;
    float *replica; /* [n_replica] */

    bool has_gate;
    double gate_m[2]; /* near, far: range from the array (half the path) */
    bool has_volume;
    double volume_m[3][3]; /* x, y, z: min, max, step */
    bool has_wall;
    double
        wall_normal[3]; /* unit; the wall is { p : wall_normal . p = wall_distance_m } */
    double wall_distance_m;
    size_t n_walls; /* 0: that one alone; else it is the first of these */
    struct survey_wall walls[SURVEY_MAX_WALLS];
    double wall_ends_m[SURVEY_MAX_WALLS][2]; /* of each, as in struct wall; both 0: not
                                                known to end; the first: of the wall */
    bool has_mount; /* the array's pose in the vehicle frame (x forward, y left, z up) */
    double mount_origin_m[3];
    double mount_x_axis[3], mount_y_axis[3]; /* unit; the array's axes in vehicle terms */

    size_t n_responses;                /* n_microphones, or 0: flat */
    struct survey_response *responses; /* [n_responses] */
};

/* Speed of sound in dry air, m/s (Cramer 1993 to 0.1 %, -20..50 C). */
double survey_sound_speed_m_s(double temperature_c);

/* The same in air of a relative humidity, 0..1: at 20 C half of saturation makes it 0.18
 * % faster. */
double survey_humid_sound_speed_m_s(double temperature_c, double humidity);

#define SURVEY_MAX_ELEMENTS                                                              \
    4096                       /* speakers, microphones, positions; points of a curve    \
                                */
#define SURVEY_MAX_PINGS 65536 /* with places of their own */
#define SURVEY_MAX_PATHS                                                                 \
    ((size_t)1 << 24) /* from a speaker to a microphone at a position: the paper's scan  \
                         has 8192, and to plan for this many takes seconds already */
#define SURVEY_UNIT_TOLERANCE 1e-3 /* of the length of a unit vector */

/* Is it known where any of its walls ends? */
bool survey_walls_end(const struct survey *s);

/* Does the next emission start before the chirp is over?  Then the gate tells them apart:
 * the next one is heard beyond it. */
bool survey_overlaps(const struct survey *s);

/* Where its gate ends at the latest, before the next speaker is heard. */
double survey_gate_limit_m(const struct survey *s);

/* Emission k of a shot, from 0, starts in which slot of it? */
size_t survey_slot_of(const struct survey *s, size_t k);

/* How many slots does a shot of n emissions take? */
size_t survey_slots(const struct survey *s, size_t n);

/* Is a chirp over when its speaker's turn comes again, in an endless shot of n? */
bool survey_round_fits(const struct survey *s, size_t n);

/* How fast the stage of a continuous scan goes along its axis; else 0. */
double survey_speed_m_s(const struct survey *s);

/* How long the pings of such a scan take, from the first to the end of the last one's
 * slot; of any other scan without the time between positions. */
double survey_duration_s(const struct survey *s);

/* Does emission k of a shot run from the chirp's stop to its start?  An endless shot
 * counts them anew in each round, so that a speaker always does the same. */
bool survey_is_down(const struct survey *s, size_t k);

/* Plausible and consistent?  Ranges are stated in the error.  0 or -EINVAL. */
int survey_check(const struct survey *s, struct error *why);

/* What it says of gate, volume, wall and mount alone: the gate without the slot. */
int survey_check_place(const struct survey *s, struct error *why);

/* A hash of everything that the image and the detections depend on, which is all but the
 * source and the temperature (its speed of sound counts).  Equal surveys have equal ids;
 * never 0. */
uint64_t survey_id(const struct survey *s);

/* Is it the same array, but for the air in front of it, what that makes of the gate, and
 * elements that stand up to SURVEY_SAME_M elsewhere by now? */
bool survey_is_same_array(const struct survey *a, const struct survey *b);

/* Gives an empty survey the room for n pings with places of their own, each at 0, and the
 * elements and the stage that go with them.  0, -ENOMEM (survey_clear frees what is
 * there). */
int survey_make_pings(struct survey *s, size_t n);

/* Keeps n stage positions, evenly from the first to the last; of n_positions or more all
 * stay as they are, of none or one two are kept if there are two. */
void survey_spread_positions(struct survey *s, size_t n);

/* A deep copy, unchecked.  0, -ENOMEM. */
int survey_copy(struct survey *out, const struct survey *s);

/* Where the array's frame coordinate p stands in the vehicle frame; p itself without a
 * mount. */
void survey_to_vehicle(const struct survey *s, const double p[3], double out[3]);

/* Frees what s owns and zeroes it. */
void survey_clear(struct survey *s);

#endif
