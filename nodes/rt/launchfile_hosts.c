/* SPDX-License-Identifier: MIT */
#include "nodes/rt/launchfile_hosts.h"

#include <errno.h>
#include <stdlib.h>

#include "dsp/error.h"
#include "msgs/keys.h"

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
    for (size_t i = 0; i < l->hosts.n; i++)
        text_add(names, sizeof names, ", ", "%s", l->hosts.list[i].name);
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
