/* SPDX-License-Identifier: MIT */
#include "nodes/rt/launchfile_hosts.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/yaml_file.h"
#include "msgs/keys.h"

struct key {
    char text[40];
};

/* A key of the host that is being added. */
static struct key key_of(const struct launchfile *l, const struct host *h,
                         const char *name)
{
    struct key k;

    snprintf(k.text, sizeof k.text, "hosts[%td].%s", h - l->hosts.list, name);
    return k;
}

static int copy_name(const struct launchfile *l, struct host *h, const char *name,
                     struct error *why)
{
    size_t length = strlen(name);

    if (length >= sizeof h->name || strspn(name, HOSTS_NAME_CHARACTERS) != length ||
        !strcmp(name, "here"))
        return yaml_error_say(why, -EINVAL, l->path, key_of(l, h, "name").text,
                              "expected up to %zu letters, digits, '-', '_' and '.', and "
                              "not 'here', but found \"%s\"",
                              sizeof h->name - 1, name);
    if (hosts_find(&l->hosts, name) != HOSTS_MAX)
        return yaml_error_say(why, -EINVAL, l->path, key_of(l, h, "name").text,
                              "expected each host once, but %s is there twice", name);
    memcpy(h->name, name, length + 1);
    return 0;
}

/* Where the node has been put already; NULL: nowhere yet. */
static const struct host *find_node(const struct hosts *h, const char *node)
{
    for (size_t i = 0; i < h->n; i++)
        for (size_t k = 0; k < h->list[i].n_nodes; k++)
            if (!strcmp(h->list[i].nodes[k], node))
                return &h->list[i];
    return NULL;
}

/* The host is in the list already, so a node that is twice on it is found too. */
static int copy_nodes(struct launchfile *l, struct host *h,
                      const struct launch_text_host *t, struct error *why)
{
    for (unsigned i = 0; i < t->nodes_count; i++) {
        const struct host *other = find_node(&l->hosts, t->nodes[i]);
        if (!launchfile_has_node(l, t->nodes[i]))
            return yaml_error_say(why, -EINVAL, l->path, key_of(l, h, "nodes").text,
                                  "%s: %s is not one of the launch file's nodes", h->name,
                                  t->nodes[i]);
        if (other)
            return yaml_error_say(
                why, -EINVAL, l->path, key_of(l, h, "nodes").text,
                "expected each node on one host, but %s is on %s and %s", t->nodes[i],
                other->name, h->name);
        snprintf(h->nodes[h->n_nodes++], ENVELOPE_NODE_SIZE, "%s", t->nodes[i]);
    }
    return 0;
}

static int check_endpoint(const struct launchfile *l, const struct host *h,
                          struct error *why)
{
    const struct hosts *all = &l->hosts;

    for (const struct host *o = all->list; o < h; o++) {
        if (!o->address[0] != !h->address[0])
            return yaml_error_say(
                why, -EINVAL, l->path, key_of(l, h, "endpoint").text,
                "expected all by tcp:// or all by ipc://, but %s and %s "
                "differ",
                o->name, h->name);
        if (hosts_overlap(o, h))
            return yaml_error_say(
                why, -EINVAL, l->path, key_of(l, h, "endpoint").text,
                h->address[0] ? "%s and %s have the same address: expected ports at "
                                "least %u apart"
                              : "%s and %s have the same folder",
                o->name, h->name, hosts_n_ports());
    }
    return 0;
}

/* Whole, as other processes need it, who may stand elsewhere.  NULL: no memory, or there
 * is no current folder. */
static char *whole_path(const struct launchfile *l, const char *path)
{
    char *beside = launchfile_beside(l, path), *out = NULL;
    char *folder = beside && beside[0] != '/' ? realpath(".", NULL) : NULL;

    if (beside && beside[0] == '/')
        return beside;
    if (folder && asprintf(&out, "%s/%s", folder, beside) < 0)
        out = NULL;
    free(folder);
    free(beside);
    return out;
}

static int copy_keys(const struct launchfile *l, struct host *h, const char *path,
                     struct error *why)
{
    if (!path)
        return 0;
    if (!h->address[0])
        return yaml_error_say(
            why, -EINVAL, l->path, key_of(l, h, "keys").text,
            "%s: expected none with an endpoint ipc://: it never leaves "
            "this machine",
            h->name);
    char *whole = whole_path(l, path);
    bool fits = whole && strlen(whole) < sizeof h->keys && !strchr(whole, '\n');
    if (fits)
        strcpy(h->keys, whole);
    free(whole);
    if (!fits)
        return yaml_error_say(why, -EINVAL, l->path, key_of(l, h, "keys").text,
                              "%s: expected the path of a folder, of at most %zu "
                              "characters",
                              h->name, sizeof h->keys - 1);
    return 0;
}

static int add_host(struct launchfile *l, const struct launch_text_host *t,
                    struct error *why)
{
    struct hosts *all = &l->hosts;
    struct host *h = &all->list[all->n];
    struct error inner = {""};

    if (all->n == HOSTS_MAX)
        return yaml_error_say(why, -EINVAL, l->path, "hosts", "expected at most %d",
                              HOSTS_MAX);
    int err = copy_name(l, h, t->name, why);
    if (err)
        return err;
    if (host_set_endpoint(h, t->endpoint, &inner))
        return yaml_error_say(why, -EINVAL, l->path, key_of(l, h, "endpoint").text,
                              "%s: %.600s", h->name, inner.text);
    all->n++;
    err = check_endpoint(l, h, why);
    if (!err)
        err = copy_keys(l, h, t->keys, why);
    return err ? err : copy_nodes(l, h, t, why);
}

int launchfile_copy_hosts(struct launchfile *l, const struct launch_text *t,
                          struct error *why)
{
    int err = 0;

    for (unsigned i = 0; !err && i < t->hosts_count; i++)
        err = add_host(l, &t->hosts[i], why);
    for (unsigned i = 0; !err && l->hosts.n && i < l->n_nodes; i++)
        if (!find_node(&l->hosts, l->nodes[i]))
            err = yaml_error_say(why, -EINVAL, l->path, "hosts",
                                 "expected each node on one host, but %s is on none",
                                 l->nodes[i]);
    return err;
}

static void list_names(const struct hosts *h, char *text, size_t size)
{
    size_t used = 0;

    for (size_t i = 0; i < h->n && used < size; i++)
        used += (size_t)snprintf(text + used, size - used, "%s%s", i ? ", " : "",
                                 h->list[i].name);
}

int launchfile_choose_host(struct launchfile *l, const char *name, struct error *why)
{
    char names[HOSTS_MAX * (HOSTS_NAME_SIZE + 2)] = "";
    size_t here = name ? hosts_find(&l->hosts, name) : HOSTS_MAX;

    if (!name && !l->hosts.n)
        return 0;
    if (!l->hosts.n)
        return error_say(why, -EINVAL,
                         "--host %s: %s has no hosts, all is on one machine", name,
                         l->path);
    list_names(&l->hosts, names, sizeof names);
    if (!name)
        return error_say(why, -EINVAL,
                         "%s is for several hosts: which one is this? "
                         "--host, one of %s",
                         l->path, names);
    if (here == HOSTS_MAX)
        return error_say(why, -EINVAL, "--host %s: expected one of %s, as in %s", name,
                         names, l->path);
    l->hosts.here = here;
    char *keys = l->hosts.list[here].keys;
    if (hosts_use_keys(&l->hosts) && !keys[0] && keys_default_folder(keys))
        return error_say(
            why, -EINVAL,
            "%s: where are the keys of %s? Neither HOME nor "
            "XDG_CONFIG_HOME says it, nor does hosts[%zu].keys: they are made "
            "with 'anlos keys new --out DIR'",
            l->path, name, here);
    return 0;
}

int launchfile_check_keys(const struct launchfile *l, struct error *why)
{
    const struct hosts *h = &l->hosts;
    struct error inner = {""};

    if (!h->n || !hosts_use_keys(h))
        return 0;
    struct keys *keys = malloc(sizeof *keys);
    if (!keys)
        return error_say(why, -ENOMEM, "not enough memory for the keys");
    int err = keys_read(keys, h->list[h->here].keys, &inner);
    if (!err)
        err = keys_check_hosts(keys, h, &inner);
    keys_forget(keys);
    free(keys);
    return err ? error_say(why, err,
                           "host %s talks with other machines, and only with those whose "
                           "keys it has: %.800s",
                           h->list[h->here].name, inner.text)
               : 0;
}

bool launchfile_runs_here(const struct launchfile *l, const char *node)
{
    return launchfile_has_node(l, node) &&
           (!l->hosts.n || hosts_may_run(&l->hosts, l->hosts.here, node));
}

int launchfile_join_hosts(struct launchfile *l, const char *name, const char *run_dir,
                          struct error *why)
{
    struct hosts written;
    int err;

    if (!name && !l->hosts.n)
        return 0;
    if (!name && (err = hosts_read(&written, run_dir, why)))
        return err;
    if (!name && written.n)
        return 0;
    err = launchfile_choose_host(l, name, why);
    return err ? err : hosts_write(&l->hosts, run_dir, why);
}
