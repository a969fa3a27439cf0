/* nodes/anlos/replay/settings.h -- with what a bag is processed: its own launch file's
 * settings, and the command line's where these are given. */
#ifndef ANLOS_NODES_ANLOS_REPLAY_SETTINGS_H
#define ANLOS_NODES_ANLOS_REPLAY_SETTINGS_H

#include "nodes/anlos/recon/options.h"
#include "nodes/anlos/replay/chain.h"
#include "nodes/rt/launchfile.h"

struct settings {
    struct launchfile *launch;     /* NULL: the bag has none */
    char name[256];                /* of the launch file; empty: none */
    char revision[128];            /* of the program that recorded; empty: not known */
    struct imager_options imaging; /* those of the launch file, and of o */
    struct chain_config chain; /* but for the bus; borrows from launch, imaging and o */
};

/* 0; errors of opening a bag and of launchfile_load; -EINVAL (options that the method has
 * not, a method for a fixed array).  *s stays where it is.  Clear with settings_clear,
 * also after an error. */
int settings_load(struct settings *s, const struct recon_options *o, struct error *why);
void settings_clear(struct settings *s);

#endif
