/* SPDX-License-Identifier: MIT */
/* recon/processing.h -- from a survey to the configuration of dsp and recon. */
#ifndef ANLOS_RECON_PROCESSING_H
#define ANLOS_RECON_PROCESSING_H

#include "dsp/deramp.h"
#include "dsp/error.h"
#include "dsp/pulse_compress.h"
#include "recon/imaging/imager.h"
#include "recon/imaging/surroundings.h"
#include "recon/survey.h"
#include "recon/walls/wall.h"

struct processing {
    struct geometry geometry; /* borrows the survey's arrays */
    double band_hz[2];
    double gate_m[2]; /* as asked for, or the default */
    double gate_s[2]; /* delays that the grid needs, inside the gate */
    double quiet_s;   /* from this delay on the next emission is heard, too */
    double reach_s;   /* 0; else a compressor gives more (dsp/pulse_compress.h) */
    struct grid grid;
    size_t ping_samples; /* slot and tail, with the next emission whole */
    size_t echo_samples; /* what echoes alone need; at most ping_samples */
    const struct imager_options *imaging; /* not owned; NULL: the defaults */
};

/* The geometry of a survey; borrows its arrays. */
void processing_geometry(struct geometry *g, const struct survey *s);

/* The chirp that a survey's speakers send. */
struct chirp processing_chirp(const struct survey *s);

/* The survey must outlive *out.  0, -EINVAL (gate beyond the slot; the error names
 * the field and the limit), -EFBIG. */
int processing_plan(struct processing *out, const struct survey *s, struct error *why);

/* As far as PROCESSING_BEYOND_M beyond the gate of a static array, where the grid and a
 * whole ping reach: who comes from there is heard before he is in it.  Beyond quiet_s
 * that asks for recon/frontend/own_sound.h. */
#define PROCESSING_BEYOND_M 0.6
void processing_listen_beyond(struct processing *p, const struct survey *s);

/* A pulse compressor for it; microphones are taken from the survey's responses. */
int processing_compressor(struct pulse_compress **out, const struct processing *p,
                          const struct survey *s, enum window window, struct error *why);

/* The same for the paper's way; a survey with a replica has no chirp to mix with. */
int processing_deramp(struct deramp **out, const struct processing *p,
                      const struct survey *s, enum window window, struct error *why);

/* The formats of their traces, without planning either.  0, or as they. */
int processing_compressor_format(struct trace_format *out, const struct processing *p,
                                 const struct survey *s, struct error *why);
int processing_deramp_format(struct trace_format *out, const struct processing *p,
                             const struct survey *s, struct error *why);

/* An imager for the traces of that compressor. */
int processing_imager(struct imager **out, const struct processing *p, const char *method,
                      const struct trace_format *format, struct pool *pool,
                      struct error *why);

/* The same for what lies around its volume.  0, -ENOTSUP (it cannot be imaged), -EINVAL,
 * -ENOMEM. */
int processing_surroundings(struct surroundings **out, const struct processing *p,
                            const struct trace_format *format, struct pool *pool);

#endif
