/* SPDX-License-Identifier: MIT */
/* recon/imaging/scan_imager.h -- the traces of a scan, ping by ping in any order, to its
 * images. Plans when the survey is known and works while traces arrive, so that the image
 * is a matter of milliseconds after the last one.
 *
 * One thread at a time; it works on as many as it was created with. */
#ifndef ANLOS_RECON_IMAGING_SCAN_IMAGER_H
#define ANLOS_RECON_IMAGING_SCAN_IMAGER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "recon/frontend/compressor.h"
#include "recon/traces.h"
#include "recon/volume.h"

struct scan_imager_config {
    const char *method;                   /* must outlive the imager */
    const struct imager_options *options; /* likewise; NULL: the defaults */
    size_t threads;                       /* at least 1 */
    enum compression compression; /* the front end's: it decides the traces' format */
    bool (*stop)(void *ctx);      /* pool_stop_by, of each plan and image anew */
    void *stop_ctx;
};

struct scan_imager;

/* 0, -ENOMEM, -EAGAIN (threads). */
int scan_imager_create(struct scan_imager **out, const struct scan_imager_config *cfg);

/* Plans for a survey, which it copies; the traces of another one are forgotten.  0, or a
 * negative errno and an error (of the survey or of the method; -ECANCELED: stopped). */
int scan_imager_survey(struct scan_imager *r, const struct survey *survey,
                       struct error *why);

/* As if there had been none. */
void scan_imager_forget(struct scan_imager *r);

/* survey_id of what it is planned for; 0: nothing. */
uint64_t scan_imager_survey_id(const struct scan_imager *r);

/* Takes one ping's traces; those of another scan than the newest begin a new one.  0,
 * -EINVAL (they do not fit the survey), -EAGAIN (there is no survey yet). */
int scan_imager_traces(struct scan_imager *r, const struct traces *traces);

size_t scan_imager_pings(const struct scan_imager *r);
size_t scan_imager_pings_expected(const struct scan_imager *r);
bool scan_imager_is_complete(const struct scan_imager *r);   /* every ping is in */
int64_t scan_imager_capture_ns(const struct scan_imager *r); /* of the newest ping */

/* Another stage position is complete since the last image? */
bool scan_imager_has_new_position(const struct scan_imager *r);

/* Images what is in, and what lies around the volume, but for a preview.  Borrowed, good
 * until the next image.  0, or -ECANCELED: stopped; what is in stays. */
int scan_imager_image(struct scan_imager *r, bool preview, struct volume *out);

/* A new scan: forget all traces. */
void scan_imager_reset(struct scan_imager *r);
void scan_imager_destroy(struct scan_imager *r);

#endif
