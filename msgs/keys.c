/* SPDX-License-Identifier: MIT */
#include "msgs/keys.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zmq.h>

#include "msgs/endpoint.h"

#define PATH_SIZE (HOSTS_KEYS_SIZE + 16)
#define LINE_SIZE 256

int keys_default_folder(char out[HOSTS_KEYS_SIZE])
{
    const char *config = getenv("XDG_CONFIG_HOME"), *home = getenv("HOME");
    int n;

    if (config && config[0] == '/')
        n = snprintf(out, HOSTS_KEYS_SIZE, "%s/anlos/keys", config);
    else if (home && home[0] == '/')
        n = snprintf(out, HOSTS_KEYS_SIZE, "%s/.config/anlos/keys", home);
    else
        return -ENOENT;
    return n < HOSTS_KEYS_SIZE ? 0 : -ENAMETOOLONG;
}

static int name_file(char path[PATH_SIZE], const char *folder, const char *name,
                     struct error *why)
{
    if (strlen(folder) < HOSTS_KEYS_SIZE &&
        snprintf(path, PATH_SIZE, "%s/%s", folder, name) < PATH_SIZE)
        return 0;
    return error_say(why, -ENAMETOOLONG,
                     "keys %s: expected a path of at most %d characters", folder,
                     HOSTS_KEYS_SIZE - 1);
}

/* Who may write it may speak for anybody.  What the group root may, root may anyway. */
static int check_owner(const char *path, const struct stat *st, unsigned denied,
                       const char *to_do, struct error *why)
{
    unsigned mode = st->st_mode & 0777;

    if (st->st_uid != geteuid() && st->st_uid != 0)
        return error_say(
            why, -EACCES,
            "%s: belongs to user %u, who might have changed it: it has to be "
            "yours or root's",
            path, (unsigned)st->st_uid);
    if (mode & denied & (st->st_gid == 0 ? ~040u : ~0u))
        return error_say(why, -EACCES, "%s: others may %s it (mode %o): %s", path,
                         mode & denied & 022 ? "write" : "read", mode, to_do);
    return 0;
}

static int open_file(FILE **out, const char *path, unsigned denied, const char *to_do,
                     struct error *why)
{
    struct stat st;
    FILE *f = fopen(path, "re");

    if (!f)
        return error_say(why, -errno, "%s: %s", path, strerror(errno));
    int err = fstat(fileno(f), &st) ? -errno : 0;
    if (err)
        error_say(why, err, "%s: %s", path, strerror(-err));
    else if (!S_ISREG(st.st_mode))
        err = error_say(why, -EINVAL, "%s: is not a file", path);
    else
        err = check_owner(path, &st, denied, to_do, why);
    if (err)
        fclose(f);
    else
        *out = f;
    return err;
}

static bool is_key(const char *text)
{
    uint8_t bytes[32];

    return strlen(text) == KEYS_TEXT_SIZE - 1 && zmq_z85_decode(bytes, text);
}

/* The next line HOST KEY.  1, 0 (end of file), -EINVAL. */
static int read_line(FILE *f, const char *path, unsigned *number, struct peer *out,
                     struct error *why)
{
    char line[LINE_SIZE];

    while (fgets(line, sizeof line, f)) {
        ++*number;
        if (!strchr(line, '\n') && !feof(f)) { /* its rest is no line of its own */
            explicit_bzero(line, sizeof line);
            return error_say(why, -EINVAL,
                             "%s:%u: expected a line of at most %d characters, a comment "
                             "too",
                             path, *number, LINE_SIZE - 2);
        }
        char *rest, *host = strtok_r(line, " \t\r\n", &rest),
                    *key = strtok_r(NULL, " \t\r\n", &rest);
        if (!host || host[0] == '#')
            continue;
        bool good = key && is_key(key) && strlen(host) < sizeof out->host &&
                    !strtok_r(NULL, " \t\r\n", &rest);
        if (good) {
            snprintf(out->host, sizeof out->host, "%s", host);
            snprintf(out->key, sizeof out->key, "%s", key);
        }
        explicit_bzero(line, sizeof line);
        return good ? 1
                    : error_say(why, -EINVAL,
                                "%s:%u: expected HOST KEY, the name of a host and a key "
                                "of 40 characters, as 'anlos keys new' prints them",
                                path, *number);
    }
    return ferror(f) ? error_say(why, -EIO, "%s: %s", path, strerror(EIO)) : 0;
}

static int add_peer(struct peers *out, const struct peer *p, const char *path,
                    unsigned number, struct error *why)
{
    if (out->n == KEYS_MAX_PEERS)
        return error_say(why, -EINVAL, "%s: expected at most %d hosts", path,
                         KEYS_MAX_PEERS);
    if (peers_find(out, p->host) || peers_find_key(out, p->key))
        return error_say(why, -EINVAL, "%s:%u: expected each host and each key once",
                         path, number);
    out->list[out->n++] = *p;
    return 0;
}

int keys_read_peers(struct peers *out, const char *folder, struct error *why)
{
    char path[PATH_SIZE];
    struct peer p;
    unsigned number = 0;
    FILE *f = NULL;
    int err = name_file(path, folder, "peers", why);

    out->n = 0;
    if (!err)
        err = open_file(&f, path, 022, "'chmod go-w' it and look what it says", why);
    while (f && (err = read_line(f, path, &number, &p, why)) == 1)
        if ((err = add_peer(out, &p, path, number, why)))
            break;
    if (f)
        fclose(f);
    return err;
}

static int read_secret(struct keys *out, struct error *why)
{
    char path[PATH_SIZE];
    struct peer p = {.key = ""};
    unsigned number = 0;
    FILE *f = NULL;
    int err = name_file(path, out->folder, "secret.key", why);

    if (!err)
        err = open_file(&f, path, 077,
                        "who has read it can listen and command: 'chmod 600' it if "
                        "nobody can have, else remove it and make a new one",
                        why);
    if (err == -ENOENT)
        error_say(why, err,
                  "%s: there is no key: 'anlos keys new --out %s' makes one, on each "
                  "host, and prints the line that belongs into the file peers of the "
                  "others",
                  path, out->folder);
    if (err)
        return err;
    err = read_line(f, path, &number, &p, why);
    fclose(f);
    if (err == 1 && zmq_curve_public(out->public, p.key))
        err = error_say(why, -EINVAL, "%s: is no secret key", path);
    else if (err == 0)
        err = error_say(why, -EINVAL, "%s: is empty", path);
    if (err == 1) {
        memcpy(out->secret, p.key, sizeof out->secret);
        memcpy(out->host, p.host, sizeof out->host);
    }
    explicit_bzero(&p, sizeof p);
    return err == 1 ? 0 : err;
}

int keys_read(struct keys *out, const char *folder, struct error *why)
{
    struct stat st;

    memset(out, 0, sizeof *out);
    if (strlen(folder) >= sizeof out->folder)
        return error_say(why, -ENAMETOOLONG,
                         "keys %s: expected a path of at most %d characters", folder,
                         HOSTS_KEYS_SIZE - 1);
    memcpy(out->folder, folder, strlen(folder) + 1);
    int err = read_secret(out, why);
    if (!err && stat(folder, &st))
        err = error_say(why, -errno, "%s: %s", folder, strerror(errno));
    if (!err)
        err = check_owner(folder, &st, 022, "'chmod go-w' it", why);
    if (!err)
        err = keys_read_peers(&out->peers, folder, why);
    if (err)
        keys_forget(out);
    return err;
}

void keys_forget(struct keys *k)
{
    explicit_bzero(k->secret, sizeof k->secret);
}

/* Never into a file, or through a link, that somebody has put there. */
static int write_new(const char *path, mode_t mode, const char *text)
{
    size_t size = strlen(text);
    int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, mode);
    if (fd < 0)
        return -errno;
    errno = 0;
    int err = write(fd, text, size) != (ssize_t)size ? (errno ? -errno : -EIO)
              : fsync(fd)                            ? -errno
                                                     : 0;
    if (close(fd) && !err)
        err = -errno;
    if (err)
        unlink(path);
    return err;
}

static int write_secret(const char *folder, const char *host, const char *secret,
                        struct error *why)
{
    char path[PATH_SIZE], text[LINE_SIZE];
    int err = name_file(path, folder, "secret.key", why);
    if (err)
        return err;
    snprintf(text, sizeof text,
             "# The secret key of this host: leave it here, and show it nobody.\n%s %s\n",
             host, secret);
    err = write_new(path, 0600, text);
    explicit_bzero(text, sizeof text);
    if (err == -EEXIST)
        return error_say(why, err,
                         "%s is there already, and is kept: 'anlos keys show --out %s' "
                         "prints its public line; remove it to have a new one, which the "
                         "others have to be told",
                         path, folder);
    return err ? error_say(why, err, "%s: %s", path, strerror(-err)) : 0;
}

static int write_peers(const char *folder, const char *host, const char *public,
                       struct error *why)
{
    char path[PATH_SIZE], text[LINE_SIZE];
    int err = name_file(path, folder, "peers", why);
    if (err)
        return err;
    snprintf(
        text, sizeof text,
        "# Who may connect, and who is connected to: HOST KEY, a line each.\n%s %s\n",
        host, public);
    err = write_new(path, 0644, text);
    return err && err != -EEXIST ? error_say(why, err, "%s: %s", path, strerror(-err))
                                 : 0;
}

int keys_create(const char *folder, const char *host, char public[KEYS_TEXT_SIZE],
                struct error *why)
{
    char secret[KEYS_TEXT_SIZE];

    if (!host[0] || strlen(host) >= HOSTS_NAME_SIZE ||
        strspn(host, HOSTS_NAME_CHARACTERS) != strlen(host))
        return error_say(why, -EINVAL,
                         "host \"%s\": expected up to %d letters, digits, '-', '_' and "
                         "'.', as in the launch file",
                         host, HOSTS_NAME_SIZE - 1);
    int err = endpoint_make_folder(folder, NULL);
    if (err)
        return error_say(why, err, "%s: cannot be made: %s", folder, strerror(-err));
    if (zmq_curve_keypair(public, secret))
        return error_say(why, -errno, "no keys: %s", zmq_strerror(errno));
    err = write_secret(folder, host, secret, why);
    explicit_bzero(secret, sizeof secret);
    return err ? err : write_peers(folder, host, public, why);
}

const struct peer *peers_find(const struct peers *p, const char *host)
{
    for (size_t i = 0; i < p->n; i++)
        if (!strcmp(p->list[i].host, host))
            return &p->list[i];
    return NULL;
}

const struct peer *peers_find_key(const struct peers *p, const char *key)
{
    for (size_t i = 0; i < p->n; i++)
        if (!strcmp(p->list[i].key, key))
            return &p->list[i];
    return NULL;
}

int keys_check_hosts(const struct keys *k, const struct hosts *h, struct error *why)
{
    for (size_t i = 0; i < h->n; i++) {
        const struct peer *p = peers_find(&k->peers, h->list[i].name);
        if (i == h->here && p && strcmp(p->key, k->public) != 0)
            return error_say(why, -EINVAL,
                             "%s/peers: %s, which is this host, has another key there "
                             "than its secret.key: its line is now %s %s",
                             k->folder, p->host, p->host, k->public);
        if (i != h->here && !p)
            return error_say(why, -EINVAL,
                             "%s/peers: host %s has no line: add what 'anlos keys show' "
                             "prints there",
                             k->folder, h->list[i].name);
        if (i != h->here && !strcmp(p->key, k->public))
            return error_say(why, -EINVAL,
                             "%s/peers: %s has the key of this host: expected a key of "
                             "its own for each",
                             k->folder, p->host);
    }
    return 0;
}
