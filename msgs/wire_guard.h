/* SPDX-License-Identifier: MIT */
/* msgs/wire_guard.h -- keeps from nanomsg 1.1.5 what would make it abort the process, or
 * deaf: its IPC transport asserts that a frame's first byte is 1 (sipc.c), and a PUB
 * socket that nobody sends to it (xpub.c), of bytes that whoever can open the socket file
 * may write.  And what it has read ahead when a connection breaks, as a handshake of a
 * process that was stopped for a second does, it takes for the beginning of the next one
 * (usock_posix.inc), which breaks too, for ever: so it reads nothing ahead.  And that a
 * peer hangs up between the handshake and the first read it overlooks (streamhdr.c), and
 * holds the closed connection for an open one, for ever: so it is told of it afterwards.
 *
 * nanomsg has no hook for that, so its calls of accept4, connect, recvmsg, epoll_ctl,
 * epoll_wait and close come here: the definitions of a program go before those of the C
 * library.  Of sockets that are none of ours (*.ipc) they are passed on untouched.  What
 * a peer may not say ends its connection, as if it had closed it. */
#ifndef ANLOS_MSGS_WIRE_GUARD_H
#define ANLOS_MSGS_WIRE_GUARD_H

#include <stdint.h>

/* Connections that were ended so, of this process.  To be called by who uses nanomsg: it
 * is what brings the definitions into a program. */
uint64_t wire_guard_refused(void);

#endif
