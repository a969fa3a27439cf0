/* nodes/view/hang_up.h -- ends the connections of a server at once.  civetweb's threads
 * look at its stop flag only every 2 s while they wait for a client, and has no call to
 * close a client's socket. */
#ifndef ANLOS_NODES_VIEW_HANG_UP_H
#define ANLOS_NODES_VIEW_HANG_UP_H

/* Shuts down every TCP socket of this process whose own port is that one, listening or
 * connected: whoever waits for it or writes to it wakes.  Their owners close them. */
void hang_up(unsigned port);

#endif
