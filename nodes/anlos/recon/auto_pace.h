/* nodes/anlos/recon/auto_pace.h -- inside `--method auto`: on a budget, how many
 * speakers' pings are to be compressed.  The first pings tell what one takes here, in
 * time of the processor, so that what else runs here counts for nothing; the planner then
 * weighs more pairs against finer steps, as if nothing were known of the scene.  Where
 * there is time to, a few stage positions keep all speakers: they tell how the elements
 * stand (recon/coherence). */
#ifndef ANLOS_NODES_ANLOS_RECON_AUTO_PACE_H
#define ANLOS_NODES_ANLOS_RECON_AUTO_PACE_H

#include "nodes/anlos/recon/auto.h"

struct recon_auto_pace;

/* job outlives it.  0, -ENOMEM. */
int recon_auto_pace_create(struct recon_auto_pace **out, const struct recon_auto *a,
                           const struct recon_job *job);

/* Is this ping to be compressed?  Its time counts from here. */
bool recon_auto_pace_wants(struct recon_auto_pace *p, size_t position, size_t speaker);

/* It is. */
void recon_auto_pace_done(struct recon_auto_pace *p, size_t position);

/* Every so manieth speaker was, or will be. */
size_t recon_auto_pace_stride(const struct recon_auto_pace *p);

/* And so many of the positions that tell how the elements stand. */
size_t recon_auto_pace_sampled(const struct recon_auto_pace *p);

/* No choice any more: as another has chosen. */
void recon_auto_pace_follow(struct recon_auto_pace *p, size_t stride);
void recon_auto_pace_destroy(struct recon_auto_pace *p);

#endif
