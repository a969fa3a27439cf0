/* SPDX-License-Identifier: MIT */
#include "msgs/hosts.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define TCP       "tcp://"
#define IPC       "ipc://"
#define LINE_SIZE 512
#define PATH_SIZE 256

static int set_folder(struct host *h, const char *text, struct error *why)
{
    size_t length = strlen(text);
    if (text[0] != '/' || length < 2 || length >= sizeof h->folder ||
        strpbrk(text, " \t\n"))
        return error_say(why, -EINVAL,
                         "%s%s: expected the absolute path of a folder, of at most %zu "
                         "characters and without blanks",
                         IPC, text, sizeof h->folder - 1);
    memcpy(h->folder, text, length + 1);
    h->address[0] = 0;
    return 0;
}

static int set_address(struct host *h, const char *text, struct error *why)
{
    struct in_addr address;
    char *end = NULL;
    const char *colon = strchr(text, ':');
    size_t length = colon ? (size_t)(colon - text) : 0;
    unsigned long port =
        colon && isdigit((unsigned char)colon[1]) ? strtoul(colon + 1, &end, 10) : 0;
    bool whole = length && length < sizeof h->address && end && !*end;

    h->address[0] = 0;
    if (whole)
        memcpy(h->address, text, length);
    if (whole)
        h->address[length] = 0;
    if (!whole || inet_pton(AF_INET, h->address, &address) != 1 ||
        address.s_addr == htonl(INADDR_ANY) || port < 1024 ||
        port > 65536 - hosts_n_ports())
        return error_say(why, -EINVAL,
                         "%s%s: expected the IPv4 address of this host as the others "
                         "reach it and a port, e.g. tcp://10.0.0.1:7400; port from 1024 "
                         "to %u, for it takes %u from there on",
                         TCP, text, 65536 - hosts_n_ports(), hosts_n_ports());
    h->port = (unsigned)port;
    h->folder[0] = 0;
    return 0;
}

int host_set_endpoint(struct host *h, const char *text, struct error *why)
{
    if (!strncmp(text, TCP, sizeof TCP - 1))
        return set_address(h, text + sizeof TCP - 1, why);
    if (!strncmp(text, IPC, sizeof IPC - 1))
        return set_folder(h, text + sizeof IPC - 1, why);
    return error_say(why, -EINVAL, "%s: expected tcp://ADDRESS:PORT or ipc:///FOLDER",
                     text);
}

size_t hosts_find(const struct hosts *h, const char *name)
{
    for (size_t i = 0; i < h->n; i++)
        if (!strcmp(h->list[i].name, name))
            return i;
    return HOSTS_MAX;
}

static bool has_node(const struct host *h, const char *node)
{
    for (size_t i = 0; i < h->n_nodes; i++)
        if (!strcmp(h->nodes[i], node))
            return true;
    return false;
}

bool hosts_may_run(const struct hosts *h, size_t i, const char *node)
{
    bool listed = false;
    for (size_t k = 0; k < h->n; k++)
        listed |= has_node(&h->list[k], node);
    return !listed || has_node(&h->list[i], node);
}

static bool is_loopback(const char *address)
{
    return !strncmp(address, "127.", 4);
}

bool hosts_use_keys(const struct hosts *h)
{
    for (size_t i = 0; i < h->n; i++)
        if (h->list[i].address[0] &&
            (h->list[i].keys[0] || !is_loopback(h->list[i].address)))
            return true;
    return false;
}

/* All ports before that of the node's topic; of all when there is no such topic. */
static unsigned count_ports(const struct topic *t, const char *node)
{
    const char *name;
    unsigned n = 0;
    for (const struct topic *k = topics_all(); k->name; k++)
        for (size_t i = 0; (name = topic_publisher(k, i)); i++, n++)
            if (k == t && !strcmp(name, node))
                return n;
    return n;
}

unsigned hosts_port(const struct host *h, const char *node, const struct topic *t)
{
    return h->port + count_ports(t, node);
}

unsigned hosts_n_ports(void)
{
    return count_ports(NULL, "");
}

bool hosts_overlap(const struct host *a, const struct host *b)
{
    if (strcmp(a->address, b->address) != 0)
        return false;
    if (!a->address[0])
        return !strcmp(a->folder, b->folder);
    unsigned apart = a->port > b->port ? a->port - b->port : b->port - a->port;
    return apart < hosts_n_ports();
}

int host_check_address(const struct host *h, struct error *why)
{
    struct sockaddr_in at = {.sin_family = AF_INET}; /* any free port */
    if (!h->address[0])
        return 0;
    inet_pton(AF_INET, h->address, &at.sin_addr);
    int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    int err = fd < 0 || bind(fd, (struct sockaddr *)&at, sizeof at) ? -errno : 0;
    if (fd >= 0)
        close(fd);
    return err ? error_say(why, err, "host %s: %s: %s", h->name, h->address,
                           err == -EADDRNOTAVAIL ? "is no address of this machine"
                                                 : strerror(-err))
               : 0;
}

/* The word becomes a name of at most size - 1 characters.  false: it is none. */
static bool copy_name(char *out, size_t size, const char *word)
{
    size_t length = word ? strlen(word) : 0;
    if (!length || length >= size)
        return false;
    memcpy(out, word, length + 1);
    return true;
}

static int read_host(struct hosts *h, const char *name, char **rest, struct error *why)
{
    struct host *host = &h->list[h->n];
    const char *word = strtok_r(NULL, " \n", rest);
    if (h->n == HOSTS_MAX || !copy_name(host->name, sizeof host->name, name) || !word)
        return error_say(why, -EINVAL, "expected up to %d lines HOST ENDPOINT NODE...",
                         HOSTS_MAX);
    int err = host_set_endpoint(host, word, why);
    while (!err && (word = strtok_r(NULL, " \n", rest)))
        if (host->n_nodes == HOSTS_MAX_NODES ||
            !copy_name(host->nodes[host->n_nodes++], ENVELOPE_NODE_SIZE, word))
            err = error_say(why, -EINVAL, "%s: too long, or one node too many", word);
    h->n += !err;
    return err;
}

/* The path of the keys may have blanks. */
static int read_here(char here[HOSTS_NAME_SIZE], char keys[HOSTS_KEYS_SIZE], char **rest,
                     struct error *why)
{
    const char *path = NULL;
    if (!copy_name(here, HOSTS_NAME_SIZE, strtok_r(NULL, " \n", rest)) ||
        ((path = strtok_r(NULL, "\n", rest)) &&
         (path[0] != '/' || !copy_name(keys, HOSTS_KEYS_SIZE, path))))
        return error_say(why, -EINVAL, "expected here HOST, and the folder of its keys");
    return 0;
}

static int read_lines(struct hosts *h, FILE *f, struct error *why)
{
    char line[LINE_SIZE], here[HOSTS_NAME_SIZE] = "", keys[HOSTS_KEYS_SIZE] = "", *rest;
    int err = 0;
    while (!err && fgets(line, sizeof line, f)) {
        const char *name = strtok_r(line, " \n", &rest);
        if (name && !strcmp(name, "here"))
            err = read_here(here, keys, &rest, why);
        else
            err = read_host(h, name, &rest, why);
    }
    if (!err && ferror(f))
        err = error_say(why, -EIO, "%s", strerror(EIO));
    if (!err && (h->here = hosts_find(h, here)) == HOSTS_MAX)
        err = error_say(why, -EINVAL, "there is no host \"%s\"", here);
    if (!err)
        memcpy(h->list[h->here].keys, keys, sizeof keys);
    return err;
}

int hosts_read(struct hosts *out, const char *run_dir, struct error *why)
{
    char path[PATH_SIZE];
    struct error inner = {""};
    *out = (struct hosts){0};
    if (snprintf(path, sizeof path, "%s/hosts", run_dir) >= (int)sizeof path)
        return 0; /* no socket has room there either, and the error is about that */
    FILE *f = fopen(path, "re");
    if (!f)
        return errno == ENOENT ? 0
                               : error_say(why, -errno, "%s: %s", path, strerror(errno));
    int err = read_lines(out, f, &inner);
    if (err)
        error_say(why, err, "%s: %.600s; 'anlos launch' writes it anew", path,
                  inner.text);
    fclose(f);
    return err;
}

static void write_lines(const struct hosts *h, FILE *f)
{
    const char *keys = h->list[h->here].keys;
    fprintf(f, "here %s%s%s\n", h->list[h->here].name, *keys ? " " : "", keys);
    for (size_t i = 0; i < h->n; i++) {
        const struct host *host = &h->list[i];
        if (host->address[0])
            fprintf(f, "%s %s%s:%u", host->name, TCP, host->address, host->port);
        else
            fprintf(f, "%s %s%s", host->name, IPC, host->folder);
        for (size_t k = 0; k < host->n_nodes; k++)
            fprintf(f, " %s", host->nodes[k]);
        fprintf(f, "\n");
    }
}

int hosts_write(const struct hosts *h, const char *run_dir, struct error *why)
{
    char path[PATH_SIZE], fresh[PATH_SIZE];
    if (snprintf(path, sizeof path, "%s/hosts", run_dir) >= (int)sizeof path ||
        snprintf(fresh, sizeof fresh, "%s/hosts.%ld", run_dir, (long)getpid()) >=
            (int)sizeof fresh)
        return error_say(why, -ENAMETOOLONG, "run folder %s: path too long", run_dir);
    if (!h->n)
        return unlink(path) == 0 || errno == ENOENT
                   ? 0
                   : error_say(why, -errno, "%s: %s", path, strerror(errno));
    unlink(fresh); /* and not through a link that somebody has put there */
    FILE *f = fopen(fresh, "wxe");
    int err = f ? 0 : -errno;
    if (f)
        write_lines(h, f);
    if (f && (ferror(f) | fclose(f)))
        err = errno ? -errno : -EIO;
    if (!err && rename(fresh, path) != 0)
        err = -errno;
    if (err) {
        error_say(why, err, "%s: %s", path, strerror(-err));
        unlink(fresh);
    }
    return err;
}
