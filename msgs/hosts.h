/* SPDX-License-Identifier: MIT */
/* msgs/hosts.h -- the machines of a system that runs on more than one: which nodes run
 * where, and where their sockets stand.  RUN_DIR/hosts holds it, so that each node and
 * each tool of a machine has it from the run folder; without that file everything is on
 * this machine.
 *
 *   here vehicle /etc/anlos/keys
 *   vehicle tcp://10.0.0.1:7400 stage array scan can
 *   computer tcp://10.0.0.2:7400 dsp recon track report
 *
 * An endpoint is tcp://ADDRESS:PORT, an IPv4 address and the first of the ports of
 * hosts_port; or ipc:///FOLDER, the run folder of another system on the same machine.  A
 * node that is in no list (hand, launcher) may run on any host.  The folder after the
 * name of this host is that of its keys (msgs/keys.h), when hosts_use_keys. */
#ifndef ANLOS_MSGS_HOSTS_H
#define ANLOS_MSGS_HOSTS_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"
#include "msgs/envelope.h"
#include "msgs/topics.h"

#define HOSTS_MAX          8
#define HOSTS_MAX_NODES    16
#define HOSTS_NAME_SIZE    32
#define HOSTS_ADDRESS_SIZE 16 /* of an IPv4 address */
#define HOSTS_FOLDER_SIZE  88
#define HOSTS_KEYS_SIZE    256
#define HOSTS_NAME_CHARACTERS                                                            \
    "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_."

struct host {
    char name[HOSTS_NAME_SIZE];
    char address[HOSTS_ADDRESS_SIZE]; /* empty: its sockets are in folder */
    unsigned port;                    /* the first one */
    char folder[HOSTS_FOLDER_SIZE];
    char keys[HOSTS_KEYS_SIZE]; /* the folder; empty: none is named */
    size_t n_nodes;
    char nodes[HOSTS_MAX_NODES][ENVELOPE_NODE_SIZE];
};

struct hosts {
    size_t n; /* 0: everything is on this machine */
    size_t here;
    struct host list[HOSTS_MAX];
};

/* Fills in address and port, or folder.  0, -EINVAL with what was expected. */
int host_set_endpoint(struct host *h, const char *text, struct error *why);

/* The i-th host, by its name; HOSTS_MAX: there is none. */
size_t hosts_find(const struct hosts *h, const char *name);

/* Is the node to be looked for on the i-th host? */
bool hosts_may_run(const struct hosts *h, size_t i, const char *node);

/* Is what goes from host to host encrypted, and only between those who know each other?
 * Yes when one names its keys, or can be reached from other machines. */
bool hosts_use_keys(const struct hosts *h);

/* The port of a node's topic: the host's first one, and one for each publisher of each
 * topic in the order of msgs/topics.h, whether it runs there or not: the same everywhere.
 * hosts_n_ports says how many. */
unsigned hosts_port(const struct host *h, const char *node, const struct topic *t);
unsigned hosts_n_ports(void);

/* Do both need the same port of one address, or the same folder? */
bool hosts_overlap(const struct host *a, const struct host *b);

/* Is its address one of this machine?  0, -EADDRNOTAVAIL, other negative errno. */
int host_check_address(const struct host *h, struct error *why);

/* Without the file *out has no hosts.  0, -EINVAL (contents), other negative errno. */
int hosts_read(struct hosts *out, const char *run_dir, struct error *why);

/* Replaces the file, or removes it when there are no hosts.  0 or a negative errno. */
int hosts_write(const struct hosts *h, const char *run_dir, struct error *why);

#endif
