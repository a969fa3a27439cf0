/* SPDX-License-Identifier: MIT */
/* nodes/anlos/interrupt.h -- Ctrl-C asks a command to stop at the next good place. */
#ifndef ANLOS_NODES_ANLOS_INTERRUPT_H
#define ANLOS_NODES_ANLOS_INTERRUPT_H

#include <stdbool.h>

/* SIGINT, SIGTERM and SIGHUP only set the flag from now on (the second one kills as
 * usual); SIGPIPE and SIGXFSZ become errors of the write that caused them. */
void interrupt_catch(void);
bool interrupt_requested(void);

#endif
