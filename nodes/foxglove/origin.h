/* nodes/foxglove/origin.h -- which web pages may connect.  A browser lets any page open a
 * WebSocket to this machine and says, in the header Origin, whose page it is. */
#ifndef ANLOS_NODES_FOXGLOVE_ORIGIN_H
#define ANLOS_NODES_FOXGLOVE_ORIGIN_H

#include <stdbool.h>

/* origin and host: these headers; NULL: not there, which is no browser.  Allowed are
 * pages of this machine (localhost, 127.x.x.x, [::1]), files (the desktop program),
 * Foxglove's own over https, and those of the very address that was asked for, unless
 * that is a name: an attacker's name may be made to point here. */
bool origin_is_allowed(const char *origin, const char *host);

#endif
