/* SPDX-License-Identifier: MIT */
/* nodes/rt/export_ink.h -- what the pictures with axes have in common: text, the steps of
 * ticks, and the file. */
#ifndef ANLOS_NODES_RT_EXPORT_INK_H
#define ANLOS_NODES_RT_EXPORT_INK_H

#include <cairo.h>

#include "dsp/error.h"

enum ink_anchor { INK_LEFT, INK_CENTRE, INK_RIGHT };

/* Text whose digits are centred on y. */
void ink_text(cairo_t *cr, double x, double y, double size, enum ink_anchor anchor,
              const char *text);

/* 1, 2 or 5 times a power of ten, for at most n ticks. */
double ink_tick_step(double span, double n);

/* Decimals that tell such ticks apart. */
int ink_digits(double step);

/* A cairo_write_func_t: what cairo writes goes to the FILE `to`. */
cairo_status_t ink_write(void *to, const unsigned char *data, unsigned size);

/* Writes FOLDER/NAME.  0, -ENOMEM (without an error), other negative errno. */
int ink_png(const char *folder, const char *name, cairo_surface_t *surface,
            struct error *why);

#endif
