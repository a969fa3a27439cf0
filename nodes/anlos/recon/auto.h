/* nodes/anlos/recon/auto.h -- `--method auto`: keeps the traces of a recording, looks at
 * them (recon/probe), and decides what to do with them (recon/planner). */
#ifndef ANLOS_NODES_ANLOS_RECON_AUTO_H
#define ANLOS_NODES_ANLOS_RECON_AUTO_H

#include <jansson.h>

#include "nodes/anlos/recon/job.h"
#include "recon/planner.h"
#include "recon/probe.h"

struct recon_auto {
    struct trace_set set;
    float complex *traces; /* [position][speaker][microphone][format.n_samples] */
    bool *heard;           /* [position][speaker][microphone] */
    struct probe probe;
    struct plan plan;
    double slowness;      /* of this machine; recon/planner.h */
    struct grid whole;    /* the image when nothing is left out */
    double whole_band_hz; /* the top of its band */
    bool looked;          /* there was time to, and reason */
    double kept_s;        /* time of the stack's stage before the image was begun */
};

/* The method's name on the command line. */
extern const char recon_auto_name[];

/* Room for all traces of the job's format.  0, -ENOMEM. */
int recon_auto_create(struct recon_auto **out, const struct recon_job *job,
                      struct complaint *why);

/* What another one has seen and decided becomes that of the job. */
void recon_auto_inherit(struct recon_job *job, const struct recon_auto *from);

/* A reader's sink; of job->automatic.  Traces that recon/trace_check finds unfit count as
 * masked. */
void recon_auto_take(void *ctx, size_t position, size_t speaker,
                     const float complex *traces, const bool *masked);

/* Looks, decides, and puts method, options, grid and band into the job.  *again: the band
 * is another, traces have to be made once more.  0, -ENOMEM, -EINVAL. */
int recon_auto_decide(struct recon_auto *a, struct recon_job *job, bool *again,
                      struct complaint *why);

/* The chosen method cannot do this geometry: decides without it.  false: nothing else is
 * left. */
bool recon_auto_retreat(struct recon_auto *a, struct recon_job *job);

/* Traces to the job's imager. */
int recon_auto_feed(const struct recon_auto *a, struct recon_job *job,
                    struct complaint *why);

/* How much of the budget is gone. */
double recon_auto_spent_s(const struct recon_job *job);

/* What was seen, chosen, and left out, and why. */
json_t *recon_auto_report(const struct recon_auto *a, const struct recon_job *job);

/* The same in a few lines on stdout. */
void recon_auto_print(const struct recon_auto *a, const struct recon_job *job);
void recon_auto_destroy(struct recon_auto *a);

#endif
