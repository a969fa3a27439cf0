/* SPDX-License-Identifier: MIT */
/* nodes/scan/peers.h -- the other nodes of the system as the scan sees them: who is
 * there, who is ready, who has been restarted. */
#ifndef ANLOS_NODES_SCAN_PEERS_H
#define ANLOS_NODES_SCAN_PEERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/health.pb-c.h"
#include "msgs/scan.pb-c.h"

#define PEERS_MAX       16
#define PEERS_NAME_SIZE 16
#define PEERS_TEXT_SIZE 160

struct peer {
    char name[PEERS_NAME_SIZE];
    int64_t epoch_ns; /* 0: never heard of */
    int64_t heard_ns;
    Anlos__Health__State state; /* as it said in this epoch */
    char text[PEERS_TEXT_SIZE];
};

struct peers {
    struct peer list[PEERS_MAX];
    size_t n;
    int64_t silence_ns; /* a peer not heard of for so long is not there */
};

enum peers_news {
    PEERS_SAME,
    PEERS_STRANGER,  /* not one of those that are waited for */
    PEERS_STALE,     /* from a process that has been replaced: void */
    PEERS_RESTARTED, /* the first of a new process in the place of an old one */
};

/* names[n], n <= PEERS_MAX; more are left out. */
void peers_init(struct peers *p, const char *const *names, size_t n, double silence_s);

/* Any message of a peer has come in. */
enum peers_news peers_hear(struct peers *p, const char *name, int64_t epoch_ns,
                           int64_t now_ns);
void peers_health(struct peers *p, const char *name, const Anlos__Health *health);

/* May a scan go on?  Else *state and text[size] say why not: a peer cannot go on
 * (FAILED), is not there, or there is no survey yet (WAITING).  While one is away nothing
 * can time out: *sign_ns, the last sign of life, is now. */
bool peers_let(const struct peers *p, bool has_survey, int64_t now_ns, int64_t *sign_ns,
               Anlos__ScanStatus__State *state, char *text, size_t size);

/* Has each of them been heard of within so long? */
bool peers_heard(const struct peers *p, int64_t now_ns, int64_t within_ns);

#endif
