/* SPDX-License-Identifier: MIT */
/* nodes/launcher/program.h -- a node's program and its command line. */
#ifndef ANLOS_NODES_LAUNCHER_PROGRAM_H
#define ANLOS_NODES_LAUNCHER_PROGRAM_H

#include "nodes/launcher/launcher.h"

#define PROGRAM_MAX_ARGS 24

struct program {
    char path[4096];
    char *argv[PROGRAM_MAX_ARGS]; /* borrows from path and from the launcher's words */
};

/* Where this program is.  0, -ENAMETOOLONG, other negative errno. */
int program_own_folder(char *out, size_t size);

/* Where the nodes' programs are: beside this one, as built, or else where an installation
 * has them; $ANLOS_BIN_DIR wins.  0, -ENAMETOOLONG, other negative errno. */
int program_folder(char *out, size_t size);

/* That of the node: anlos-NAME in cfg->bin_dir.  It must stay where it is, and cfg what
 * it is, while argv is used.  0, -ENAMETOOLONG. */
int program_fill(struct program *p, const struct launcher_config *cfg, const char *node);

#endif
