/* nodes/view/guard.h -- who may read the pages: a web page of somebody else's, open in
 * the same browser, may not.  It could reach a server on loopback by a name of its own
 * that it lets point there (DNS rebinding): so only addresses, "localhost" and the
 * address that was configured are taken as Host; and it could open a WebSocket across
 * origins, which browsers let pass: so an Origin has to be the page's own. */
#ifndef ANLOS_NODES_VIEW_GUARD_H
#define ANLOS_NODES_VIEW_GUARD_H

#include <stdbool.h>

/* host: the request's Host header, with or without port; NULL: it has none. */
bool guard_host(const char *host, const char *address);

/* origin: the request's Origin header; NULL: no browser sent it. */
bool guard_origin(const char *origin, const char *host);

#endif
