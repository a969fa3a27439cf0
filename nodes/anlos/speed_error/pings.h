/* nodes/anlos/speed_error/pings.h -- all pings of a scene in memory, less its background,
 * to traces and to whoever takes them: what `anlos recon` does with files. */
#ifndef ANLOS_NODES_ANLOS_SPEED_ERROR_PINGS_H
#define ANLOS_NODES_ANLOS_SPEED_ERROR_PINGS_H

#include "dsp/pool.h"
#include "nodes/anlos/speed_error/scene.h"
#include "nodes/anlos/recon/reader.h"
#include "recon/processing.h"

struct bench_pings_config { /* all outlive the pings */
    const struct bench_scene *scene;
    const struct survey *survey; /* what is used of the scene's: */
    size_t speaker_stride, position_stride;
    const struct processing *processing;
    struct pool *pool;
};

struct bench_pings;

/* Plans and allocates, for the length of pings and the band that processing has now.
 * 0, -EINVAL, -ERANGE, -ENOMEM. */
int bench_pings_create(struct bench_pings **out, const struct bench_pings_config *cfg,
                       struct trace_format *format, struct error *why);

/* All of them; fewer when a person interrupts.  Adds the wall time, in the shares that
 * compression and the sink had of the threads' time, and the threads' processor time. */
void bench_pings_run(struct bench_pings *p, const struct recon_sink *sink,
                     struct stopwatch *compress, struct stopwatch *keep);
void bench_pings_destroy(struct bench_pings *p);

#endif
