/* nodes/anlos/recon/auto_look.h -- inside `--method auto`: what is looked at before the
 * decision, as far as the budget allows. */
#ifndef ANLOS_NODES_ANLOS_RECON_AUTO_LOOK_H
#define ANLOS_NODES_ANLOS_RECON_AUTO_LOOK_H

#include "nodes/anlos/recon/auto.h"

/* Of what is left of the budget a look may take so much: an image of which it is known
 * what is in it makes up for that, measured from 0.1 to 0.5 s. */
#define RECON_AUTO_MOST_LOOK 0.375

/* How the elements stand: probe.coherence.  0, -EINVAL, -ENOMEM. */
int recon_auto_look_at_elements(struct recon_auto *a, struct recon_job *job);

/* So far from their places that phase says nothing. */
bool recon_auto_is_lost(const struct recon_auto *a);

/* The scene, where that is worth its time: fills in the rest of probe, and looked.  0,
 * -EINVAL, -ENOMEM. */
int recon_auto_look(struct recon_auto *a, struct recon_job *job);

#endif
