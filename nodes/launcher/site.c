/* SPDX-License-Identifier: MIT */
#include "nodes/launcher/site.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "dsp/hash.h"
#include "msgs/endpoint.h"
#include "nodes/rt/launchfile_hosts.h"

int site_open(const struct launchfile *l, const struct arguments *a,
              char run_dir[RUNDIR_SIZE], struct error *why)
{
    const struct host *here = l->hosts.n ? &l->hosts.list[l->hosts.here] : NULL;
    const char *asked = a->run_dir;

    if (here && here->folder[0]) {
        if (asked && strcmp(asked, here->folder) != 0)
            return error_say(why, -EINVAL, "--run-dir %s: %s has %s as the folder of %s",
                             asked, l->path, here->folder, here->name);
        asked = here->folder;
    }
    int err = rundir_open(run_dir, asked, why);
    if (!err && here)
        err = host_check_address(here, why);
    if (!err)
        err = launchfile_check_keys(l, why);
    if (err)
        return err;
    int lock =
        endpoint_lock(run_dir, "launcher", false, why); /* the file is of who runs here */
    if (lock < 0)
        return lock;
    err = rundir_set_launch(run_dir, l->path, why);
    if (!err)
        err = hosts_write(&l->hosts, run_dir, why);
    close(lock);
    return err;
}

void site_close(const struct launchfile *l, const char *run_dir)
{
    const struct hosts none = {.n = 0};
    int lock = endpoint_lock(run_dir, "launcher", false, NULL);

    if (lock < 0) /* or it is of the next one by now */
        return;
    if (l->hosts.n)
        hosts_write(&none, run_dir, NULL);
    rundir_set_launch(run_dir, NULL, NULL);
    close(lock);
}

uint64_t site_launch_file(const struct launchfile *l)
{
    uint64_t hash = HASH_BEGIN;
    FILE *f = fopen(l->path, "re");
    char bytes[4096];
    size_t n;

    if (!f)
        return 0;
    while ((n = fread(bytes, 1, sizeof bytes, f)))
        hash = hash_add(hash, bytes, n);
    fclose(f);
    return hash;
}
