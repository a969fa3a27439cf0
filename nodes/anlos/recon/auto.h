/* SPDX-License-Identifier: MIT */
/* nodes/anlos/recon/auto.h -- `--method auto`: keeps the traces of a recording, looks at
 * them (recon/planning/probe), and decides what to do with them (recon/planning/planner).
 */
#ifndef ANLOS_NODES_ANLOS_RECON_AUTO_H
#define ANLOS_NODES_ANLOS_RECON_AUTO_H

#include <jansson.h>

#include "nodes/anlos/recon/job.h"
#include "recon/planning/planner.h"
#include "recon/planning/probe.h"

struct recon_auto_pace;

struct recon_auto {
    struct trace_set set;
    float complex *traces; /* [position][speaker][microphone][format.n_samples] */
    bool *heard;           /* [position][speaker][microphone] */
    bool *taken;           /* [position][speaker]: compressed, if it was heard or not */
    struct probe probe;
    struct probe unknown; /* what is to be assumed without a look */
    struct plan plan;
    double slowness; /* of this machine; recon/planning/planner.h */
    struct recon_auto_pace *pace;
    struct grid whole;    /* the image when nothing is left out */
    double whole_band_hz; /* the top of its band */
    bool stands;          /* how the elements stand was looked at */
    bool looked;          /* there was time to, and reason */
    double kept_s;        /* time of the stack's stage before the image was begun */
};

/* The method's name on the command line. */
extern const char recon_auto_name[];

/* Room for all traces of the job's format.  0, -ENOMEM. */
int recon_auto_create(struct recon_auto **out, const struct recon_job *job,
                      struct error *why);

/* What another one has seen and decided becomes that of the job. */
void recon_auto_inherit(struct recon_job *job, const struct recon_auto *from);

/* A reader's sink, with recon_auto as its ctx: of a budget's pings only those of as many
 * speakers as there is time for.  Traces that recon/imaging/trace_check finds unfit count
 * as masked. */
struct recon_sink recon_auto_sink(struct recon_auto *a);

/* What is to be done next. */
enum recon_auto_next {
    RECON_AUTO_IMAGE,
    RECON_AUTO_MORE,      /* pings that were left out are wanted after all */
    RECON_AUTO_OTHER_BAND /* traces have to be made once more */
};

/* Looks, decides, and puts method, options, grid and band into the job.  RECON_AUTO_MORE:
 * has decided nothing yet; run the reader with the sink again, then ask again.  0,
 * -ENOMEM, -EINVAL. */
int recon_auto_decide(struct recon_auto *a, struct recon_job *job,
                      enum recon_auto_next *next, struct error *why);

/* The chosen method cannot do this geometry: decides without it.  false: nothing else is
 * left. */
bool recon_auto_retreat(struct recon_auto *a, struct recon_job *job);

/* Traces to the job's imager. */
int recon_auto_feed(const struct recon_auto *a, struct recon_job *job, struct error *why);

/* What was seen, chosen, and left out, and why. */
json_t *recon_auto_report(const struct recon_auto *a, const struct recon_job *job);

/* The same in a few lines on stdout. */
void recon_auto_print(const struct recon_auto *a, const struct recon_job *job);
void recon_auto_destroy(struct recon_auto *a);

/* On a budget, no choice any more of how many speakers' pings are compressed: every
 * stride-th, as another has chosen. */
void recon_auto_pace_follow(struct recon_auto_pace *p, size_t stride);

#endif
