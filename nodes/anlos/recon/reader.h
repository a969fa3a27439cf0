/* SPDX-License-Identifier: MIT */
/* nodes/anlos/recon/reader.h -- a recording to compressed traces: read, check the
 * channels, subtract the background, compress.  One position at a time on each thread,
 * so that memory stays small however long the recording is. */
#ifndef ANLOS_NODES_ANLOS_RECON_READER_H
#define ANLOS_NODES_ANLOS_RECON_READER_H

#include <complex.h>
#include <stdbool.h>

#include "dsp/error.h"
#include "dsp/pool.h"
#include "hal/recording/recording.h"
#include "nodes/anlos/recon/report.h"
#include "recon/frontend/backgrounds.h"
#include "recon/frontend/channel_check.h"
#include "recon/frontend/compressor.h"

struct recon_reader_config { /* all outlive the reader */
    const struct survey *survey;
    const struct processing *processing;
    struct recording *recording, *background; /* background: NULL for none */
    struct channel_check *scene_check, *background_check;
    enum compression compression;
    enum window window;
    struct pool *pool;
};

/* traces [n_microphones][format.n_samples] and masked [n_microphones] of one ping.
 * Threads call it at once, for different positions. */
struct recon_sink {
    void (*take)(void *ctx, size_t position, size_t speaker, const float complex *traces,
                 const bool *masked);
    void *ctx;
    bool (*wants)(void *ctx, size_t position, size_t speaker); /* NULL: every ping.  Asked
                                                                * right before, by the
                                                                * same thread */
};

struct recon_reader;

/* Plans and allocates.  When the air has changed since the background was recorded
 * (dsp/drift.h; a few pings are looked at), traces are subtracted from traces, not
 * samples from samples.  0, -EINVAL, -ENOMEM, -EIO. */
int recon_reader_create(struct recon_reader **out, const struct recon_reader_config *cfg,
                        struct error *why);
/* How much louder the background is within the gate than the recording, in dB, of the
 * pings that were looked at; NaN: none were. */
double recon_reader_background_db(const struct recon_reader *r);
void recon_reader_format(const struct recon_reader *r, struct trace_format *out);

/* All positions.  Adds to stages[RECON_STAGES], of which it fills in those of reading,
 * compressing and (the sink's) stacking; *air: what it has done.  0, -EINTR (Ctrl-C),
 * -EIO. */
int recon_reader_run(struct recon_reader *r, const struct recon_sink *sink,
                     struct stopwatch *stages, struct air *air, struct error *why);

/* After a run in other air than the background's: positions whose file ends with its last
 * slot.  Of several speakers the last one's ping was left out there; one alone was not,
 * and its stretch is uncertain. */
size_t recon_reader_cut(const struct recon_reader *r);
void recon_reader_destroy(struct recon_reader *r);

#endif
