/* nodes/anlos/top/share.h -- who gets how much of the height. */
#ifndef ANLOS_NODES_ANLOS_TOP_SHARE_H
#define ANLOS_NODES_ANLOS_TOP_SHARE_H

#include <stddef.h>

#include "nodes/anlos/top/look.h"

struct share { /* of the height, a panel's lines with its title */
    size_t least, fair, most;
    size_t got;
};

/* Of a panel with so many rows, of which it wants at least some, and some that are fair.
 */
struct share share_want(size_t least_rows, size_t fair_rows, size_t rows);

/* Sets what each got of `left` lines, 1 or more.  The one in focus is always there, the
 * others as long as there is room for their least; then it gets all it can use, and the
 * others first what is fair.  A share of zeros stays away. */
void share_height(struct share s[LOOK_PANELS], enum look_panel focus, size_t left);

#endif
