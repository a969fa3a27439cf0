/* nodes/dsp/dsp.h -- the dsp node's step: a ping to compressed traces with the background
 * subtracted, as it would sound in the air of now.  Background pings end here and are
 * acknowledged with a receipt; so is every ping that cannot be used.
 *
 * Of an array that stands (Ping.frame) there are no receipts.  A recorded background is
 * the mean of its frames there.  An adaptive one is each speaker's running mean while the
 * vehicle stands: what stands still as well is gone with it, and what stays longer than
 * background_s fades.  Nothing is subtracted from the first ping of each speaker, nor
 * from one during which the vehicle moves, or it is not known whether it does; the mean
 * begins anew when it stands again.  A ping that a sound from outside drowned
 * (dsp/blanker.h) is blanked: its traces are empty, all microphones masked, and neither
 * it nor the one before, which may hold its beginning, counts into the mean. */
#ifndef ANLOS_NODES_DSP_DSP_H
#define ANLOS_NODES_DSP_DSP_H

#include <stdbool.h>
#include <stddef.h>

#include "msgs/array.pb-c.h"
#include "dsp/complaint.h"
#include "msgs/scan.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/traces.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "nodes/dsp/microphones.h"
#include "nodes/rt/air.h"
#include "nodes/rt/background_mode.h"
#include "nodes/rt/compressor.h"

struct dsp_config {
    enum window window;
    enum compression compression;
    enum background_mode background; /* recorded: scene pings are of no use without it */
    double background_s;             /* time constant of an adaptive one */
};

struct dsp_output { /* what to publish; borrows from the dsp until the next ping */
    bool has_traces, has_receipt;
    Anlos__Traces traces;
    Anlos__Receipt receipt;
    char note[256];                     /* for the log; empty: nothing new */
    struct microphones_faults channels; /* n 0: the ping was not looked at */
};

struct dsp;

/* 0, -ENOMEM. */
int dsp_create(struct dsp **out, const struct dsp_config *cfg);

/* Plans for a survey; the background of another one is forgotten.  0, -EINVAL and others
 * of processing_plan; the complaint says what does not fit. */
int dsp_survey(struct dsp *d, const Anlos__Survey *survey, struct complaint *why);
bool dsp_is_planned(const struct dsp *d);

/* How the vehicle moves, and the air around it: before the first of these it stands, and
 * a temperature that was not measured with a ping is not known. */
void dsp_ego(struct dsp *d, const Anlos__EgoMotion *ego, int64_t capture_ns);
void dsp_ambient(struct dsp *d, const Anlos__Ambient *ambient);

/* When the next ping's sample 0 was taken. */
void dsp_stamp(struct dsp *d, int64_t capture_ns);

/* Before dsp_is_planned no ping can be used, and no note says so. */
void dsp_ping(struct dsp *d, const Anlos__Ping *ping, struct dsp_output *out);

/* Of the scan that the newest ping belongs to. */
const struct air *dsp_air(const struct dsp *d);
void dsp_destroy(struct dsp *d);

#endif
