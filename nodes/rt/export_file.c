/* SPDX-License-Identifier: MIT */
#include "nodes/rt/export_file.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

int export_file_open(struct export_file *e, const char *folder, const char *name,
                     struct error *why)
{
    int n = snprintf(e->path, sizeof e->path, "%s/%s", folder, name);
    int m = snprintf(e->temporary, sizeof e->temporary, "%s/.%s.XXXXXX", folder, name);
    if (n >= (int)sizeof e->path || m >= (int)sizeof e->temporary)
        return error_say(why, -ENAMETOOLONG, "%s: path too long", folder);

    int fd = mkstemp(e->temporary);
    if (fd < 0)
        return error_say(why, -errno, "%s: cannot be written: %s", e->path,
                         strerror(errno));
    /* mkstemp makes a private file; what is exported is for everybody whom umask allows.
     */
    mode_t mask = umask(0);
    umask(mask);
    e->f = fchmod(fd, 0666 & ~mask) ? NULL : fdopen(fd, "wb");
    if (!e->f) {
        int err = -errno;
        close(fd);
        unlink(e->temporary);
        return error_say(why, err, "%s: cannot be written: %s", e->path, strerror(-err));
    }
    return 0;
}

int export_file_abandon(struct export_file *e, int err, struct error *why)
{
    if (e->f)
        fclose(e->f);
    e->f = NULL;
    unlink(e->temporary);
    return error_say(why, err, "%s: cannot be written: %s", e->path, strerror(-err));
}

int export_file_commit(struct export_file *e, struct error *why)
{
    errno = 0;
    int failed = fflush(e->f) || ferror(e->f);
    int err = failed ? (errno ? -errno : -EIO) : 0;
    if (fclose(e->f) && !err)
        err = errno ? -errno : -EIO;
    e->f = NULL;
    if (!err && rename(e->temporary, e->path))
        err = -errno;
    return err ? export_file_abandon(e, err, why) : 0;
}
