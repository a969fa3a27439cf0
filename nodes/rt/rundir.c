#include "nodes/rt/rundir.h"

#include <errno.h>
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

int rundir_name(char out[RUNDIR_SIZE], const char *asked, struct complaint *why)
{
    if (!name_folder(out, asked))
        return 0;
    return complain(why, -EINVAL, "run folder: expected 1 to %d characters",
                    RUNDIR_SIZE - 1);
}

int rundir_check(const char *run_dir, struct complaint *why)
{
    struct stat st;

    if (stat(run_dir, &st))
        return errno == ENOENT
                   ? 0
                   : complain(why, -errno, "run folder %s: %s", run_dir, strerror(errno));
    if (!S_ISDIR(st.st_mode))
        return complain(why, -EINVAL, "run folder %s: is not a folder", run_dir);
    if (!access(run_dir, R_OK | W_OK | X_OK))
        return 0;
    if (errno != EACCES)
        return complain(why, -errno, "run folder %s: %s", run_dir, strerror(errno));
    return complain(why, -EACCES,
                    "run folder %s: is user %u's, and closed to others: be that user, or "
                    "choose another folder",
                    run_dir, (unsigned)st.st_uid);
}

int rundir_open(char out[RUNDIR_SIZE], const char *asked, struct complaint *why)
{
    struct stat st;

    if (rundir_name(out, asked, why))
        return -EINVAL;
    if (mkdir(out, 0700) && errno != EEXIST) {
        int err = -errno;
        return complain(why, err, "run folder %s: %s", out, strerror(-err));
    }
    if (lstat(out, &st) || (asked && S_ISLNK(st.st_mode) && stat(out, &st)))
        return complain(why, -errno, "run folder %s: %s", out, strerror(errno));
    int err = rundir_check(out, why);
    if (err)
        return err;
    /* In /tmp anybody may have made it first, to speak in our name. */
    if (!asked && (st.st_uid != geteuid() || (st.st_mode & 022)))
        return complain(why, -EACCES, "run folder %s: must be yours alone; try --run-dir",
                        out);
    return 0;
}
