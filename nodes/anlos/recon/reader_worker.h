/* nodes/anlos/recon/reader_worker.h -- inside the reader: what one thread needs to make
 * traces of one stage position, and the steps of it. */
#ifndef ANLOS_NODES_ANLOS_RECON_READER_WORKER_H
#define ANLOS_NODES_ANLOS_RECON_READER_WORKER_H

#include <stdint.h>

#include "dsp/drift.h"
#include "nodes/anlos/recon/reader.h"

struct reader_setup { /* the same for all threads */
    struct recon_reader_config cfg;
    struct processing processing; /* with the length of pings that is needed */
    bool drifting;                /* traces are subtracted, not samples */
};

struct reader_worker {
    struct compressor *compressor;
    struct drift *drift;         /* only while drifting, as are background_traces */
    float *samples, *background; /* [n_microphones][frames] */
    float *ping;                 /* [n_microphones][ping_samples] */
    float complex *traces, *background_traces; /* [n_microphones][format.n_samples] */
    uint32_t *clipped, *not_finite;
    bool *masked; /* all [n_microphones] */
    struct stopwatch stages[RECON_STAGES];
    struct air air;
    size_t n_cut; /* positions whose last ping breaks off */
};

/* 0, -EINVAL, -ENOMEM; clear it also after a failure. */
int reader_worker_create(struct reader_worker *w, const struct reader_setup *r,
                         struct complaint *why);
void reader_worker_clear(struct reader_worker *w);

/* Samples and background of a position; check: its channels are judged, counted and
 * masked.  0, -EIO, -EINVAL. */
int reader_worker_read(const struct reader_setup *r, struct reader_worker *w,
                       size_t position, bool check, struct complaint *why);

/* Scene minus background sample by sample halves the compressions. */
void reader_worker_subtract(const struct reader_setup *r, struct reader_worker *w);

/* samples (the worker's, or its background) of one speaker's ping to traces. */
void reader_worker_compress(const struct reader_setup *r, struct reader_worker *w,
                            const float *samples, size_t speaker, float complex *traces);

/* The file ends with the last slot: what echoes of it would have come later is missing,
 * and that leaks like an emission that is cut off (dsp/drift.h). */
bool reader_worker_is_cut(const struct reader_setup *r, const struct reader_worker *w);

#endif
