/* SPDX-License-Identifier: MIT */
/* anlos/imager.h -- a scan's traces to an image, by any of the methods (anlos_method):
 * `fast` (midpoint stack and f-k migration), `backprojection`, `confocal`, `lct`
 * (O'Toole 2018), `paper` (Lindell 2019), `incoherent`, `iterative` (ADMM), `sparse`.
 *
 * One thread at a time; it works on as many as the configuration says. */
#ifndef ANLOS_IMAGER_H
#define ANLOS_IMAGER_H

#include <anlos/compressor.h>
#include <anlos/image.h>

ANLOS_BEGIN

struct anlos_imager; /* opaque */

/* Of the configuration: method, options, threads, stop, and the window and compression
 * that the traces were made with.  ANLOS_UNSUPPORTED: the method cannot do this survey;
 * ANLOS_CANCELED. */
ANLOS_API int anlos_imager_create(struct anlos_imager **out,
                                  const struct anlos_config *cfg,
                                  const struct anlos_survey *survey,
                                  struct anlos_error *why);
ANLOS_API void anlos_imager_destroy(struct anlos_imager *m);

/* In any order; those of another scan than the newest begin a new one.  Twice the same
 * ping counts once.  Returns 1 when every ping of the scan is in, else 0. */
ANLOS_API int anlos_imager_add(struct anlos_imager *m, const struct anlos_traces *traces,
                               struct anlos_error *why);

/* Of what is in, at any time; out->size is set, its intensity good until the next call.
 * ANLOS_NOT_READY: nothing is; ANLOS_CANCELED: stopped, and may be asked for again. */
ANLOS_API int anlos_imager_image(struct anlos_imager *m, struct anlos_image *out,
                                 struct anlos_error *why);

ANLOS_END

#endif
