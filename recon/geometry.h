/* SPDX-License-Identifier: MIT */
/* recon/geometry.h -- where sound leaves and arrives, as the reconstruction sees it.
 * Array frame: x along the stage, y along the array, z forward.
 *
 * A stage that does not stop (continuous) has every ping somewhere else, and goes on
 * while it sounds.  A chirp of length T over a band B sends each frequency at its own
 * time, so from its own place: (f - f1) T / B after that of f1, v times as far.  (In time
 * that is the coupling of range and Doppler of a linear chirp.)  Here all of a ping take
 * the place of one frequency, so that the others' paths are wrong by 2 v sin(angle)
 * (f - f1) T / B, as if each were imaged so much beside.  How sharply a frequency sees
 * where something is grows with f, so that under the window W the whole is imaged beside
 * its place by the mean of these with the weight W f^2; with f1 = <f^3> / <f^2>, 12.8 kHz
 * of 2 to 20 under Hann's, that is 0.  What is left widens nothing: 62.5 ms at 8 cm/s and
 * 15 degrees are 1.0 mm of path, 0.37 rad, at 20 kHz.
 * Its echo arrives t later, when the microphone has gone on by v t: all take that of an
 * echo from the middle of the gate, which leaves an object 1 m off that 0.2 mm beside its
 * place at 8 cm/s. */
#ifndef ANLOS_RECON_GEOMETRY_H
#define ANLOS_RECON_GEOMETRY_H

#include <stddef.h>

struct geometry {
    double sound_speed_m_s;
    size_t n_speakers, n_microphones, n_positions;
    const double (*speakers_m)[3];    /* [n_speakers], at stage position 0 */
    const double (*microphones_m)[3]; /* [n_microphones] */
    double stage_axis[3];             /* unit */
    const double *stage_positions_m;  /* [n_positions] */

    /* Of a stage that does not stop: how far it goes from one slot to the next, each of
     * which `together` speakers share; from a slot's beginning until its chirp has got to
     * f1, of speakers with an even number and of others; and from there, for microphones,
     * until its echo arrives.  0: it stands. */
    double slot_m, chirp_m[2], echo_m;
    size_t together;

    /* [n_positions][speaker, microphone]: each ping has places of its own, any motion.
     * n_speakers and n_microphones are 1 then, and what stands above does not count.
     * NULL: elements carried along a stage.  Only geometry_speaker and
     * geometry_microphone know where an element is. */
    const double (*pings_m)[2][3];
};

/* Deep copy that owns its arrays; geometry_clear frees them.  0, -ENOMEM. */
int geometry_copy(struct geometry *out, const struct geometry *g);
void geometry_clear(struct geometry *g);

void geometry_speaker(const struct geometry *g, size_t position, size_t speaker,
                      double out[3]);
/* When it hears that speaker. */
void geometry_microphone(const struct geometry *g, size_t position, size_t speaker,
                         size_t microphone, double out[3]);

/* How far the stage has gone on from its position when a speaker sounds. */
double geometry_gone_on_m(const struct geometry *g, size_t speaker);

/* From how many places of the stage the speakers of a position sound: 1 of one that
 * stands, else each from its own.  And the number of a speaker's. */
size_t geometry_places(const struct geometry *g);
size_t geometry_place(const struct geometry *g, size_t speaker);

/* The same array on a stage that stands at each position.  Borrows g's arrays. */
struct geometry geometry_standing(const struct geometry *g);

/* Both of a trace of [n_positions][n_speakers][n_microphones]. */
void geometry_pair(const struct geometry *g, size_t trace, double speaker[3],
                   double microphone[3]);

/* Of metres: squares of more than 1e150 would be no numbers. */
double geometry_distance(const double a[3], const double b[3]);

/* Sum of the unit vectors from a pair's elements to a place; those at the place itself
 * have no direction. */
void geometry_direction(const double at_m[3], const double speaker_m[3],
                        const double microphone_m[3], double out[3]);

/* How many voxels of such a step along x lie from each stage position to the next; 0: the
 * stage does not run along x in steps of whole voxels, to 0.1 mm. */
size_t geometry_stage_stride(const struct geometry *g, double step_m);

/* Smallest and largest coordinates of the pairs' midpoints. */
void geometry_aperture(const struct geometry *g, double min[3], double max[3]);

/* -6 dB widths of a point's image before the middle of the aperture: lateral ones of a
 * rectangular aperture (1.207 lambda R / 2 D), depth of a Hann-windowed band (c / B).
 * An axis without aperture has no resolution: infinity. */
void geometry_resolution(const struct geometry *g, const double band_hz[2],
                         double range_m, double out[3]);

/* The same at any place before, behind or among the elements, axis by axis, from the wave
 * vectors 2 pi f / c (from speaker + from microphone) that its echoes hold: by their
 * spread over the pings (1.207 of a rectangle) and over the band (Hann).  Before the
 * middle of a plane array it is the former. */
void geometry_resolution_at(const struct geometry *g, const double band_hz[2],
                            const double at_m[3], double out[3]);

#endif
