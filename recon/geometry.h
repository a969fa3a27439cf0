/* SPDX-License-Identifier: MIT */
/* recon/geometry.h -- where sound leaves and arrives, as the reconstruction sees it.
 * Array frame: x along the stage, y along the array, z forward. */
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
void geometry_microphone(const struct geometry *g, size_t position, size_t microphone,
                         double out[3]);

/* Both of a trace of [n_positions][n_speakers][n_microphones]. */
void geometry_pair(const struct geometry *g, size_t trace, double speaker[3],
                   double microphone[3]);

/* Of metres: squares of more than 1e150 would be no numbers. */
double geometry_distance(const double a[3], const double b[3]);

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
