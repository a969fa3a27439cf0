/* SPDX-License-Identifier: MIT */
/* msgs/keys.h -- who the hosts of a system are to each other: the key pair of this host
 * (Curve25519, as CurveZMQ takes it), and the keys of those that it talks with.  They are
 * in a folder:
 *
 *   secret.key   HOST SECRET: read by its owner alone, or it is refused
 *   peers        lines HOST PUBLIC, as `anlos keys new` prints them; '#': a comment
 *
 * Keys are text of Z85 (ZeroMQ RFC 32), 40 characters. */
#ifndef ANLOS_MSGS_KEYS_H
#define ANLOS_MSGS_KEYS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <time.h>

#include "dsp/error.h"
#include "msgs/hosts.h"

#define KEYS_TEXT_SIZE 41 /* with zero */
#define KEYS_MAX_PEERS 64

struct peer {
    char host[HOSTS_NAME_SIZE];
    char key[KEYS_TEXT_SIZE]; /* public */
};

struct peers {
    size_t n;
    struct peer list[KEYS_MAX_PEERS];
};

struct keys {
    char folder[HOSTS_KEYS_SIZE];
    char host[HOSTS_NAME_SIZE]; /* whose secret it is */
    char secret[KEYS_TEXT_SIZE], public[KEYS_TEXT_SIZE];
    struct peers peers;
};

/* $XDG_CONFIG_HOME/anlos/keys, or $HOME/.config/anlos/keys.  0, -ENOENT (neither is set),
 * -ENAMETOOLONG. */
int keys_default_folder(char out[HOSTS_KEYS_SIZE]);

/* Reads the folder.  0, -ENOENT (no secret, or no peers), -EACCES (others may read the
 * secret, or write any of it), -EINVAL (contents), other negative errno; the error
 * says what to do. */
int keys_read(struct keys *out, const char *folder, struct error *why);

/* The peers alone, anew.  As keys_read. */
int keys_read_peers(struct peers *out, const char *folder, struct error *why);

/* Overwrites the secret. */
void keys_forget(struct keys *k);

/* Makes the folder when it is missing, in it a new secret, and peers with the host's own
 * line if there are none; public: its key.  0, -EEXIST (there is a secret: it is kept),
 * -EINVAL (host), other negative errno. */
int keys_create(const char *folder, const char *host, char public[KEYS_TEXT_SIZE],
                struct error *why);

/* NULL: there is none. */
const struct peer *peers_find(const struct peers *p, const char *host);
const struct peer *peers_find_key(const struct peers *p, const char *key);

/* Has every other host its line in peers, and this one, if it has one, the key of the
 * secret?  0, -EINVAL. */
int keys_check_hosts(const struct keys *k, const struct hosts *h, struct error *why);

#endif
