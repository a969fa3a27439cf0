/* SPDX-License-Identifier: MIT */
#include "nodes/rt/rundir.h"

#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static int name_folder(char out[RUNDIR_SIZE], const char *asked)
{
    const char *runtime = getenv("XDG_RUNTIME_DIR");
    int n;

    if (asked)
        n = snprintf(out, RUNDIR_SIZE, "%s", asked);
    else if (runtime && runtime[0] == '/' && !access(runtime, W_OK | X_OK))
        n = snprintf(out, RUNDIR_SIZE, "%s/anlos", runtime);
    else
        n = snprintf(out, RUNDIR_SIZE, "/tmp/anlos-%u", (unsigned)geteuid());
    return n > 0 && n < RUNDIR_SIZE ? 0 : -EINVAL;
}

int rundir_name(char out[RUNDIR_SIZE], const char *asked, struct error *why)
{
    if (!name_folder(out, asked))
        return 0;
    return error_say(why, -EINVAL, "run folder: expected 1 to %d characters",
                     RUNDIR_SIZE - 1);
}

/* Whoever may rename the folder can put another one in its place. */
static int check_parents(const char *run_dir, const char *path, struct error *why)
{
    char parent[PATH_MAX];
    struct stat st;

    snprintf(parent, sizeof parent, "%s", path);
    for (char *slash; (slash = strrchr(parent, '/'));) {
        slash[slash == parent] = '\0';
        if (!stat(parent, &st) && (st.st_mode & S_IWOTH) && !(st.st_mode & S_ISVTX))
            return error_say(
                why, -EACCES,
                "run folder %s: anybody may replace it, for %.200s is "
                "everybody's (mode %03o): 'chmod o-w' or 'chmod +t' that, or "
                "choose another folder",
                run_dir, parent, (unsigned)st.st_mode & 07777);
        if (slash == parent)
            break;
    }
    return 0;
}

/* As it is written, with its links, and as it really is. */
static int check_way(const char *run_dir, struct error *why)
{
    char here[PATH_MAX - RUNDIR_SIZE - 1] = "", written[PATH_MAX];

    if (run_dir[0] != '/' && !getcwd(here, sizeof here))
        return error_say(why, -errno, "run folder %s: %s", run_dir, strerror(errno));
    snprintf(written, sizeof written, "%s/%s", here, run_dir);
    int err = check_parents(run_dir, written, why);
    char *real = err ? NULL : realpath(run_dir, NULL);
    if (real)
        err = check_parents(run_dir, real, why);
    free(real);
    return err;
}

int rundir_check(const char *run_dir, struct error *why)
{
    struct stat st;
    int err = check_way(run_dir, why);

    if (err)
        return err;
    if (stat(run_dir, &st))
        return errno == ENOENT ? 0
                               : error_say(why, -errno, "run folder %s: %s", run_dir,
                                           strerror(errno));
    if (!S_ISDIR(st.st_mode))
        return error_say(why, -EINVAL, "run folder %s: is not a folder", run_dir);
    if (st.st_uid != geteuid())
        return error_say(why, -EACCES,
                         "run folder %s: is user %u's, who could speak in your name: be "
                         "that user ('setpriv --reuid=%u --clear-groups COMMAND' as "
                         "root), or choose another folder",
                         run_dir, (unsigned)st.st_uid, (unsigned)st.st_uid);
    if (st.st_mode & 022)
        return error_say(why, -EACCES,
                         "run folder %s: others may write into it (mode %03o) and speak "
                         "in your name: 'chmod go-w' it, or choose another folder",
                         run_dir, (unsigned)st.st_mode & 07777);
    if (access(run_dir, R_OK | W_OK | X_OK))
        return error_say(why, -errno, "run folder %s: %s", run_dir, strerror(errno));
    return 0;
}

int rundir_open(char out[RUNDIR_SIZE], const char *asked, struct error *why)
{
    struct stat st;

    if (rundir_name(out, asked, why))
        return -EINVAL;
    if (mkdir(out, 0700) && errno != EEXIST) {
        int err = -errno;
        return error_say(why, err, "run folder %s: %s", out, strerror(-err));
    }
    /* In /tmp anybody may have made it first. */
    if (!asked && !lstat(out, &st) && S_ISLNK(st.st_mode))
        return error_say(why, -EACCES, "run folder %s: is a link; try --run-dir", out);
    return rundir_check(out, why);
}

static void launch_link(char out[RUNDIR_SIZE + 16], const char *run_dir)
{
    snprintf(out, RUNDIR_SIZE + 16, "%s/launch-file", run_dir);
}

int rundir_set_launch(const char *run_dir, const char *path, struct error *why)
{
    char link[RUNDIR_SIZE + 16];
    struct stat st;

    launch_link(link, run_dir);
    bool there = !lstat(link, &st);
    if (there && !S_ISLNK(st.st_mode))
        return error_say(why, -EEXIST, "%s: is there, and not of anlos", link);
    if (there && unlink(link))
        return error_say(why, -errno, "%s: %s", link, strerror(errno));
    if (!path)
        return 0;
    char *real = realpath(path, NULL);
    int err = real && !symlink(real, link) ? 0 : -errno;
    free(real);
    return err ? error_say(why, err, "%s: %s", link, strerror(-err)) : 0;
}

char *rundir_launch(const char *run_dir)
{
    char link[RUNDIR_SIZE + 16];

    launch_link(link, run_dir);
    return realpath(link, NULL);
}

/* -- who lives there --------------------------------------------------------------------
 */

/* "1: FLOCK  ADVISORY  WRITE 6533 fe:00:11993496 0 EOF"; one that waits has "->". */
void presence_read(struct presence_locks *out, const char *path)
{
    char line[256];
    FILE *f = fopen(path ? path : "/proc/locks", "re");

    out->n = 0;
    if (!f)
        return;
    while (out->n < PRESENCE_MAX_LOCKS && fgets(line, sizeof line, f)) {
        uint64_t inode;
        int pid;
        if (sscanf(line, "%*u: FLOCK %*s %*s %d %*x:%*x:%" SCNu64, &pid, &inode) != 2)
            continue;
        out->held[out->n].pid = pid;
        out->held[out->n++].inode = inode;
    }
    fclose(f);
}

static FILE *open_lock(const char *run_dir, const char *node)
{
    char path[PATH_MAX];
    int n = snprintf(path, sizeof path, "%s/%s.lock", run_dir, node);

    return n > 0 && (size_t)n < sizeof path ? fopen(path, "re") : NULL;
}

bool presence_replays(const char *run_dir, const char *node)
{
    char word[8] = "";
    FILE *f = open_lock(run_dir, node);

    if (!f)
        return false;
    bool replays = fscanf(f, "%*d %7s", word) == 1 && !strcmp(word, "replay");
    fclose(f);
    return replays;
}

enum presence presence_of(const struct presence_locks *locks, const char *run_dir,
                          const char *node)
{
    struct stat st;
    int pid = 0;
    FILE *f = open_lock(run_dir, node);

    if (!f)
        return PRESENCE_NEVER;
    bool known = !fstat(fileno(f), &st) && fscanf(f, "%d", &pid) == 1;
    fclose(f);
    for (size_t i = 0; known && i < locks->n; i++)
        if (locks->held[i].pid == pid && locks->held[i].inode == st.st_ino)
            return PRESENCE_ALIVE;
    return PRESENCE_GONE;
}
