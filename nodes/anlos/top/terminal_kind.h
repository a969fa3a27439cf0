/* nodes/anlos/top/terminal_kind.h -- what kinds of terminals can do; apart from
 * terminal.h, for the macros of <term.h> have the commonest of names. */
#ifndef ANLOS_NODES_ANLOS_TOP_TERMINAL_KIND_H
#define ANLOS_NODES_ANLOS_TOP_TERMINAL_KIND_H

#include <stdbool.h>

/* Can it put the cursor anywhere?  kind: its name (TERM), may be NULL.  To be asked
 * before newterm, which does not give back all that it took when it fails. */
bool terminal_kind_can_place(const char *kind);

#endif
