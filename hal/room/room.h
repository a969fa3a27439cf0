/* SPDX-License-Identifier: MIT */
/* hal/room/room.h -- the simulated room behind `sim:`: what a scene file says, and the
 * sound in it.  Objects are given where they really are, in the array frame; the wall
 * mirrors the array to them and back; in direct view or not, they are heard by way of the
 * wall alone.  Born and Kirchhoff: no multiple scattering, no occlusion but of an
 * opaque body by itself.  Shares no propagation code with recon. */
#ifndef ANLOS_HAL_ROOM_ROOM_H
#define ANLOS_HAL_ROOM_ROOM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "hal/survey/calibration.h"
#include "hal/survey/firing.h"
#include "recon/ping.h"
#include "recon/survey.h"

struct room;

/* What is hidden: for the truth table.  Of a drive as at time 0. */
struct room_object {
    char name[32];
    char kind[16];        /* scene_kind_name() */
    double position_m[3]; /* centre, array frame, where it really is */
    double virtual_m[3];  /* mirrored at the wall: where it is imaged */
    double extent_m[3];   /* full size along the axes; 0 for a point */
};

/* Reads a scene file (hal/room/scene.h says its keys) and plans: FFTW's planner wants one
 * thread at a time.  The noise of noise.snr_db is measured here, against the objects'
 * echoes at up to 8 positions.  0, -ENOENT, -EINVAL ("file:line: key: expected"),
 * -ENOMEM. */
int room_load(struct room **out, const char *path, struct error *why);

/* The same, its array firing in another way, and with all that is random drawn anew:
 * clutter, roughness, unknown errors, noise, slams, and where the scene says `drawn` its
 * wall and how its objects go.  Draw 0 is the file's own; each other number
 * another one, the same each time.  firing may be NULL. */
int room_load_drawn(struct room **out, const char *path, const struct firing *firing,
                    uint32_t draw, struct error *why);

/* The survey as the processor should know it (without the unknown errors of the scene).
 */
const struct survey *room_survey(const struct room *r);

/* calibration_take() into what the processor knows; the room stays as it is.  Ahead of
 * asking for numbers of frames, which the latency changes. */
int room_calibrate(struct room *r, const char *path, struct calibration **out,
                   struct error *why);

/* Where a microphone clips; INFINITY: never. */
float room_limit(const struct room *r, size_t microphone);
size_t room_objects(const struct room *r, const struct room_object **out);

/* Frames that room_record yields for n_speakers emissions: their slots and the tail. */
size_t room_frames(const struct room *r, size_t n_speakers);
size_t room_tail(const struct room *r); /* tail_samples() of its survey, recon/tail.h */

/* What the microphones hear when speakers[n_speakers] emit one after the other, a slot
 * each: samples [n_microphones][room_frames(n_speakers)], slots and directions
 * as recon/survey.h says.  The noise depends on the
 * scene's seed, the pass, the position and `take` only.  The paper's 16 x 16 pairs and
 * 1000 facets take some 30 ms.  0, -EINVAL (no such position, speaker), -ENOTSUP (a
 * drive, a continuous scan: room_stream), -ENOMEM.
 */
int room_record(struct room *r, enum pass pass, size_t position, const uint32_t *speakers,
                size_t n_speakers, uint32_t take, float *samples);
double room_temperature_c(const struct room *r, enum pass pass, size_t position);

/* A drive: the vehicle and its surroundings move (keys `drive`, `path`,
 * hal/room/scene.h). World time runs from 0 to the period and starts again; any time may
 * be asked for.  In a standing scene (not a drive, period 0) nothing below depends on the
 * time. */
bool room_is_drive(const struct room *r);
double room_period_s(const struct room *r);

/* World time at a time of the wall clock: what every process agrees on. */
double room_time_s(const struct room *r, int64_t wall_ns);

struct room_emission {
    enum pass pass;
    uint32_t speaker;
    bool down;     /* the chirp runs from its stop to its start */
    double t_s;    /* world time of sample 0 */
    uint32_t take; /* the emission's number: its noise depends on nothing else but the
                      seed and the pass */
    /* Of a continuous scan: the round, where the stage is at sample 0, and how fast it
     * goes on. */
    size_t position;
    double stage_m, stage_m_s;
};

/* What the microphones hear of one emission, from where everything is at that time, and
 * of no other: samples [n_microphones][room_frames(1)], with noise and faults.  The time
 * axis of each echo is stretched as the ways change while the chirp is under way (hal/
 * room/emitter.h; of a continuous scan hal/room/propagate.h).  At the survey's position
 * 0, of a continuous scan on the way.  See room_stream for emissions that ring into each
 * other.
 * Of a drive it takes some 3 us for each microphone and each piece that moves against the
 * array: 1 ms with 16 microphones and a person, 4 ms with 80 pieces of clutter while the
 * vehicle moves.  A plate has 270 pieces in a square decimetre: keep those small.
 * Of a continuous scan, with 16 microphones and 1200 pieces, 5 ms.
 * 0, -EINVAL (no such speaker; down, and the survey's chirps do not alternate), -ENOMEM.
 */
int room_emit(struct room *r, const struct room_emission *e, float *samples);

/* An endless shot, or a continuous scan: a speaker a slot (two that share one) round
 * after round, each emission from where everything is at its own time, and what rings on
 * of those before it.  Slots and directions as recon/survey.h says. */
struct room_stream;

struct room_stream_config {
    enum pass pass;
    const uint32_t *speakers; /* [n_speakers] of a round; copied */
    size_t n_speakers;
    double start_s; /* world time of the first sample */
    /* Of a continuous scan: the position that the first round belongs to, where the stage
     * is at the first sample and how fast it goes; and its number, for another noise. */
    size_t position;
    double stage_m, stage_m_s;
    uint32_t take;
    uint64_t n_emissions; /* no more; 0: without end */
};

/* The room must outlive it and do nothing else meanwhile.  0, -EINVAL (no such speaker,
 * none), -ENOMEM. */
int room_stream_create(struct room_stream **out, struct room *r,
                       const struct room_stream_config *cfg);

/* Samples from the first sample of the stream to the start of emission n, which is number
 * n % n_speakers of round n / n_speakers. */
uint64_t room_stream_start(const struct room_stream *s, uint64_t n);

/* The ping of emission n: *samples [n_microphones][room_frames(1)], valid until the next
 * call.  n must not fall; what is left out is not rendered unless it rings on into n.
 * Costs one emission.  0, -EINVAL (n fell), -ENOMEM. */
int room_stream_ping(struct room_stream *s, uint64_t n, const float **samples);
void room_stream_destroy(struct room_stream *s);

/* Of a continuous scan that goes as its survey says a round of all speakers, with what
 * rings on of the one before: samples [n_microphones][room_frames(n_speakers)], in which
 * behind its slots those of the next begin.  0, -EINVAL (there is no such round, or the
 * stage stops), -ENOMEM. */
int room_stream_round(struct room *r, enum pass pass, size_t round, float *samples);

/* An object at a time, in the vehicle frame at that time (the array frame without a
 * mount). */
struct room_truth {
    size_t object; /* which of room_objects */
    char name[32];
    char kind[16];          /* scene_kind_name(): "person" */
    double position_m[3];   /* centre */
    double velocity_m_s[3]; /* over ground, along the axes of that frame */
    double extent_m[3];     /* full size along the axes */
    double virtual_m[3];    /* mirrored at the wall: where it is imaged, array frame */
    bool line_of_sight;     /* no building stands between its centre and the array's */
    double until_sight_s;   /* until that is so: 0 when it is now, NaN when never while
                               it is there and the drive lasts */
};

/* The objects that are there at a time; returns how many that are, of which out[max] has
 * the first. */
size_t room_truth(const struct room *r, double t_s, struct room_truth *out, size_t max);

/* How the vehicle moves, and where it has got to: its origin and heading in the vehicle
 * frame of world time 0. */
struct room_ego {
    double speed_m_s, yaw_rate_rad_s;
    bool standstill;
    double x_m, y_m, yaw_rad;
};
void room_ego(const struct room *r, double t_s, struct room_ego *out);

/* The wall { p : normal . p = distance_m } in the array frame at a time, and in the
 * vehicle frame. */
void room_wall(const struct room *r, double t_s, double normal[3], double *distance_m);
void room_vehicle_wall(const struct room *r, double t_s, double normal[3],
                       double *distance_m);
void room_destroy(struct room *r);

#endif
