/* SPDX-License-Identifier: MIT */
#include "nodes/launcher/site.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
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

/* -- the folder of results --------------------------------------------------------------
 */

#define RESULTS_LOCK "%s/.anlos-launch.lock"

static bool is_at(int fd, const char *path)
{
    struct stat ours, there;

    return !fstat(fd, &ours) && !lstat(path, &there) && ours.st_ino == there.st_ino &&
           ours.st_dev == there.st_dev;
}

static int refuse_results(int fd, const char *folder, struct error *why)
{
    char owner[32] = "";
    ssize_t n = pread(fd, owner, sizeof owner - 1, 0);

    owner[n > 0 ? n : 0] = 0;
    owner[strcspn(owner, "\n")] = 0;
    return error_say(why, -EADDRINUSE,
                     "%s: another system writes its results there (anlos launch, process "
                     "%s): stop it, or name another folder with --out",
                     folder, owner);
}

/* A descriptor, or a negative errno; -EAGAIN: it went away meanwhile, with its owner. */
static int try_results(const char *path, const char *folder, struct error *why)
{
    int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);

    if (fd < 0)
        return error_say(why, -errno, "%s: %s", path, strerror(errno));
    int err = flock(fd, LOCK_EX | LOCK_NB) ? -errno : 0;
    if (err == -EWOULDBLOCK)
        err = refuse_results(fd, folder, why);
    else if (err) /* no locks here */
        err = 0;
    else if (!is_at(fd, path))
        err = -EAGAIN;
    else if (ftruncate(fd, 0) || dprintf(fd, "%ld\n", (long)getpid()) < 0)
        err = error_say(why, -errno, "%s: %s", path, strerror(errno));
    if (!err)
        return fd;
    close(fd);
    return err;
}

int site_lock_results(int *out, const char *folder, struct error *why)
{
    char path[PATH_MAX];

    if (snprintf(path, sizeof path, RESULTS_LOCK, folder) >= (int)sizeof path)
        return error_say(why, -ENAMETOOLONG, "%s: path too long", folder);
    do
        *out = try_results(path, folder, why);
    while (*out == -EAGAIN);
    return *out < 0 ? *out : 0;
}

void site_unlock_results(int lock, const char *folder)
{
    char path[PATH_MAX];

    if (lock < 0)
        return;
    snprintf(path, sizeof path, RESULTS_LOCK, folder);
    if (is_at(lock, path))
        unlink(path);
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
