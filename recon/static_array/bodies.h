/* SPDX-License-Identifier: MIT */
/* recon/static_array/bodies.h -- what is left of a thing, once what was as bright before
 * is taken from an image, stands for all of it.  Of something that moves by less than its
 * own length only the front is left: by itself it would be told too far ahead, by 0.2 m
 * where a person walks.  So each bright rest looks for the brightest place of its body in
 * the image as it was, and the whole body comes back, no brighter than the rest was.
 *
 * (Morphological reconstruction: Vincent 1993, "Morphological grayscale reconstruction in
 * image analysis", IEEE Trans. Image Processing 2; the markers are what is left.) */
#ifndef ANLOS_RECON_STATIC_ARRAY_BODIES_H
#define ANLOS_RECON_STATIC_ARRAY_BODIES_H

#include "recon/grid.h"

struct bodies;

/* 0, -ENOMEM. */
int bodies_create(struct bodies **out, const struct grid *grid);

/* image: [nz][ny][nx] as it was; left: the same with zeros where something was taken,
 * gets the bodies of what is brighter than `floor` in it. */
void bodies_restore(struct bodies *b, const float *image, float floor, float *left);
void bodies_destroy(struct bodies *b);

#endif
