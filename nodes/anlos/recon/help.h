/* nodes/anlos/recon/help.h -- what `anlos recon --help` says. */
#ifndef ANLOS_NODES_ANLOS_RECON_HELP_H
#define ANLOS_NODES_ANLOS_RECON_HELP_H

#include <stdio.h>

/* The methods' options with their defaults, a line or two each. */
void recon_help_settings(FILE *to);

/* 0, or -EIO. */
int recon_help_print(FILE *to);

#endif
