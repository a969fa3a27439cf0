/* SPDX-License-Identifier: MIT */
/* anlos/survey.h -- where speakers, microphones, stage and wall are, and what is emitted
 * when: all that the processing of a recording is planned from.
 *
 * A new survey has the chirp of the paper (Lindell, Wetzstein and Koltun 2019: 2 to 20
 * kHz in 62.5 ms, a slot each) at 48 kHz in dry air of 20 C, a stage that stands, and
 * nothing else: speakers and microphones have to be said.  Without a gate everything
 * behind the direct sound is imaged up to 4 m; without a volume the grid follows from
 * aperture, gate and band; without a wall objects stay where they are imaged.
 *
 * Functions copy what they are given.  Those that set return ANLOS_INVALID for NULL, for
 * counts out of range and for numbers that are none; whether all fits together
 * anlos_survey_check says, and so does whatever is created from a survey. */
#ifndef ANLOS_SURVEY_H
#define ANLOS_SURVEY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <anlos/error.h>

ANLOS_BEGIN

struct anlos_survey; /* opaque */

/* Called through anlos_survey_create, which tells it what the program was compiled with.
 * ANLOS_VERSION_MISMATCH: with headers that do not go with this library. */
ANLOS_API int anlos_survey_create_for(uint32_t version_number, struct anlos_survey **out,
                                      struct anlos_error *why);

/* destroy it.  ANLOS_INVALID, ANLOS_VERSION_MISMATCH, ANLOS_NO_MEMORY. */
static inline int anlos_survey_create(struct anlos_survey **out, struct anlos_error *why)
{
    return anlos_survey_create_for(ANLOS_VERSION_NUMBER, out, why);
}

/* Of NULL: nothing. */
ANLOS_API void anlos_survey_destroy(struct anlos_survey *s);

/* -- elements ---------------------------------------------------------------------------
 */

/* xyz_m [n][3], at stage position 0; 1 to 4096 of each. */
ANLOS_API int anlos_survey_speakers(struct anlos_survey *s, const double *xyz_m, size_t n,
                                    struct anlos_error *why);
ANLOS_API int anlos_survey_microphones(struct anlos_survey *s, const double *xyz_m,
                                       size_t n, struct anlos_error *why);

/* A stage carries all of them: axis of length 1, positions_m [n] along it. */
ANLOS_API int anlos_survey_stage(struct anlos_survey *s, const double axis[3],
                                 const double *positions_m, size_t n,
                                 struct anlos_error *why);

/* In place of all three: each ping (position 0..n-1) has places of its own, xyz_m
 * [n][speaker, microphone][3]; up to 65536. */
ANLOS_API int anlos_survey_pings(struct anlos_survey *s, const double *xyz_m, size_t n,
                                 struct anlos_error *why);

/* The factory curve of one microphone (of those set last): gain_db [n] at frequency_hz
 * [n], rising.  Of all of them, or of none. */
ANLOS_API int anlos_survey_response(struct anlos_survey *s, size_t microphone,
                                    const double *frequency_hz, const double *gain_db,
                                    size_t n, struct anlos_error *why);

/* -- sound ------------------------------------------------------------------------------
 */

/* Linear FM (Lindell 2019, Eq. 5); stop below start: it falls.  sine: it begins as one,
 * else as a cosine. */
ANLOS_API int anlos_survey_chirp(struct anlos_survey *s, double start_hz, double stop_hz,
                                 double duration_s, bool sine, struct anlos_error *why);

/* What is emitted in place of a chirp, samples [n] at the sample rate, its band from
 * start_hz to stop_hz. */
ANLOS_API int anlos_survey_replica(struct anlos_survey *s, const float *samples, size_t n,
                                   double start_hz, double stop_hz,
                                   struct anlos_error *why);

/* Samples a second; from one emission to the next slot_samples; and latency_samples from
 * the nominal to the real emission, fractions too.  Where a chirp is longer than a slot,
 * the gate has to tell them apart. */
ANLOS_API int anlos_survey_sampling(struct anlos_survey *s, double sample_rate_hz,
                                    size_t slot_samples, double latency_samples,
                                    struct anlos_error *why);

/* alternates: every second emission runs from stop to start.  together: how many begin in
 * one slot, 1, or 2 of a chirp that alternates. */
ANLOS_API int anlos_survey_firing(struct anlos_survey *s, bool alternates,
                                  unsigned together, struct anlos_error *why);

/* Speed of sound, 300 to 360 m/s. */
ANLOS_API int anlos_survey_sound_speed(struct anlos_survey *s, double m_s,
                                       struct anlos_error *why);

/* The same from the air: -20 to 50 C, humidity 0..1 (Cramer, J. Acoust. Soc. Am. 93
 * (1993) 2510, Eq. 15; to 0.1 %). */
ANLOS_API int anlos_survey_air(struct anlos_survey *s, double temperature_c,
                               double humidity, struct anlos_error *why);

/* -- scene ------------------------------------------------------------------------------
 */

/* Ranges from the array, half the path, that are imaged. */
ANLOS_API int anlos_survey_gate(struct anlos_survey *s, double near_m, double far_m,
                                struct anlos_error *why);

/* Voxels: each axis {min, max, step}. */
ANLOS_API int anlos_survey_volume(struct anlos_survey *s, const double x_m[3],
                                  const double y_m[3], const double z_m[3],
                                  struct anlos_error *why);

/* One more wall, { p : normal . p = distance_m }, normal of length 1, that mirrors what
 * is seen from near_m to far_m of range (0, 0: everything).  Up to 8. */
ANLOS_API int anlos_survey_add_wall(struct anlos_survey *s, const double normal[3],
                                    double distance_m, double near_m, double far_m,
                                    struct anlos_error *why);

/* The wall that was added last begins at one point and ends at another, in either order:
 * the array's frame, as they are along it.  Without this it is endless. */
ANLOS_API int anlos_survey_end_wall(struct anlos_survey *s, const double from_m[3],
                                    const double to_m[3], struct anlos_error *why);

/* The array in the vehicle (x forward, y left, z up): where its frame's origin is, and
 * its x and y axes, of length 1.  Objects are placed in the vehicle's frame then. */
ANLOS_API int anlos_survey_mount(struct anlos_survey *s, const double origin_m[3],
                                 const double x_axis[3], const double y_axis[3],
                                 struct anlos_error *why);

/* -- all of it --------------------------------------------------------------------------
 */

/* Plausible and consistent?  The sentence names the field and its limits. */
ANLOS_API int anlos_survey_check(const struct anlos_survey *s, struct anlos_error *why);

/* Of all that images and objects depend on: equal surveys have equal ids.  0: of NULL. */
ANLOS_API uint64_t anlos_survey_id(const struct anlos_survey *s);

/* So many samples of each microphone a ping should have, from the nominal start of its
 * emission: its slot, and what rings on into the next.  0: of NULL, or of a survey that
 * anlos_survey_check refuses. */
ANLOS_API size_t anlos_survey_ping_samples(const struct anlos_survey *s);

/* How many samples one emission has; written to out [n], amplitude 1, where that is room
 * enough.  down: the other direction of a chirp that alternates.  0: as above. */
ANLOS_API size_t anlos_survey_emission(const struct anlos_survey *s, bool down,
                                       float *out, size_t n);

ANLOS_END

#endif
