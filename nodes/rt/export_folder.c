/* SPDX-License-Identifier: MIT */
#include "nodes/rt/export.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#define UNFINISHED ".unfinished."

/* mkdir -p; *existing: length of the leading part that was there before. */
static int make_folders(const char *folder, size_t *existing)
{
    char path[PATH_MAX];
    struct stat st;
    size_t length = strlen(folder);

    if (!length)
        return -ENOENT;
    if (length >= sizeof path)
        return -ENAMETOOLONG;
    memcpy(path, folder, length + 1);
    *existing = 0;
    for (size_t i = 1; i <= length; i++) {
        if (path[i] != '/' && path[i] != '\0')
            continue;
        path[i] = '\0';
        if (!mkdir(path, 0777))
            ; /* made */
        else if (errno == EEXIST && !stat(path, &st) && S_ISDIR(st.st_mode))
            *existing = i;
        else
            return errno == EEXIST ? -ENOTDIR : -errno;
        path[i] = folder[i];
    }
    return 0;
}

/* Removes what make_folders made, as far as it is empty. */
static void remove_folders(const char *folder, size_t existing)
{
    char path[PATH_MAX];
    size_t length = strlen(folder);
    memcpy(path, folder, length + 1);
    while (length > existing) {
        path[length] = '\0';
        rmdir(path);
        while (length > existing && path[--length] != '/')
            ;
    }
}

static int try_to_write(const char *folder)
{
    char probe[PATH_MAX];
    if (snprintf(probe, sizeof probe, "%s/.probe.XXXXXX", folder) >= (int)sizeof probe)
        return -ENAMETOOLONG;
    int fd = mkstemp(probe);
    if (fd < 0)
        return -errno;
    close(fd);
    unlink(probe);
    return 0;
}

static int open_folder(const char *folder, size_t *existing, struct error *why)
{
    *existing = strlen(folder);
    int err = make_folders(folder, existing);
    if (!err)
        err = try_to_write(folder);
    if (err)
        return error_say(why, err, "%s: cannot be written: %s", folder, strerror(-err));
    return 0;
}

int export_folder(const char *folder, struct error *why)
{
    size_t existing;
    return open_folder(folder, &existing, why);
}

int export_vacant(const char *folder, const char *const *names, size_t n,
                  struct error *why)
{
    for (size_t i = 0; i < n; i++) {
        char path[PATH_MAX];
        struct stat st;
        if (snprintf(path, sizeof path, "%s/%s", folder, names[i]) < (int)sizeof path &&
            !lstat(path, &st))
            return error_say(why, -EEXIST,
                             "%s exists already; remove it or name another folder", path);
    }
    return 0;
}

/* Calls visit for each entry of a folder; stops at the first that fails. */
static int each_entry(const char *folder,
                      int (*visit)(const char *folder, const char *name, void *ctx),
                      void *ctx)
{
    DIR *d = opendir(folder);
    if (!d)
        return -errno;
    int err = 0;
    for (struct dirent *e = readdir(d); e && !err; e = readdir(d))
        if (strcmp(e->d_name, ".") && strcmp(e->d_name, ".."))
            err = visit(folder, e->d_name, ctx);
    closedir(d);
    return err;
}

static int remove_entry(const char *folder, const char *name, void *ctx)
{
    char path[PATH_MAX];
    (void)ctx;
    if (snprintf(path, sizeof path, "%s/%s", folder, name) >= (int)sizeof path)
        return -ENAMETOOLONG;
    if (!unlink(path))
        return 0;
    if (errno != EISDIR && errno != EPERM)
        return -errno;
    each_entry(path, remove_entry, NULL);
    return rmdir(path) ? -errno : 0;
}

/* A descriptor that holds the lock of a folder, or -1: somebody else has it, or the file
 * system has no locks.  links: O_NOFOLLOW or 0. */
static int lock_folder(const char *folder, int links, int operation)
{
    int fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC | links);
    if (fd >= 0 && flock(fd, operation)) {
        close(fd);
        return -1;
    }
    return fd;
}

static void unlock_folder(int fd)
{
    if (fd >= 0)
        close(fd);
}

/* What has the name of a stage, but no process that holds its lock. */
static int remove_leftover(const char *folder, const char *name, void *ctx)
{
    char path[PATH_MAX];
    (void)ctx;
    if (strncmp(name, UNFINISHED, strlen(UNFINISHED)) ||
        snprintf(path, sizeof path, "%s/%s", folder, name) >= (int)sizeof path)
        return 0;
    int lock = lock_folder(path, O_NOFOLLOW, LOCK_EX | LOCK_NB);
    if (lock < 0)
        return 0;
    each_entry(path, remove_entry, NULL);
    rmdir(path); /* if it cannot be removed, it does no harm */
    unlock_folder(lock);
    return 0;
}

/* Makes the stage's own folder.  The lock of the one around it keeps another process from
 * taking it for a leftover before it has a lock of its own. */
static int make_stage(struct export_stage *stage)
{
    int err = 0, around = lock_folder(stage->folder, 0, LOCK_EX);
    if (around >= 0)
        each_entry(stage->folder, remove_leftover, NULL);
    if (!mkdtemp(stage->path))
        err = -errno;
    else if (chmod(stage->path, 0755)) {
        err = -errno;
        rmdir(stage->path);
    } else {
        stage->lock = lock_folder(stage->path, O_NOFOLLOW, LOCK_EX | LOCK_NB);
    }
    unlock_folder(around);
    return err;
}

int export_stage_begin(struct export_stage *stage, const char *folder, struct error *why)
{
    memset(stage, 0, sizeof *stage);
    stage->lock = -1;
    if (strlen(folder) >= sizeof stage->folder)
        return error_say(why, -ENAMETOOLONG, "%s: path too long", folder);
    strcpy(stage->folder, folder);
    int err = open_folder(folder, &stage->existing, why);
    if (err)
        return err;
    snprintf(stage->path, sizeof stage->path, "%s/" UNFINISHED "XXXXXX", folder);
    err = make_stage(stage);
    if (err) {
        remove_folders(folder, stage->existing);
        return error_say(why, err, "%s: cannot be written: %s", folder, strerror(-err));
    }
    return 0;
}

static int move_entry(const char *from_folder, const char *to_folder, const char *name)
{
    char from[PATH_MAX], to[PATH_MAX];
    if (snprintf(from, sizeof from, "%s/%s", from_folder, name) >= (int)sizeof from ||
        snprintf(to, sizeof to, "%s/%s", to_folder, name) >= (int)sizeof to)
        return -ENAMETOOLONG;
    return rename(from, to) ? -errno : 0;
}

static int is_content(const struct dirent *e)
{
    return strcmp(e->d_name, ".") && strcmp(e->d_name, "..");
}

/* Moves all out of the stage, or nothing. */
static int move_all(const struct export_stage *stage)
{
    struct dirent **list;
    int n = scandir(stage->path, &list, is_content, NULL), moved = 0;
    int err = n < 0 ? -errno : 0;
    while (!err && moved < n) {
        err = move_entry(stage->path, stage->folder, list[moved]->d_name);
        moved += !err;
    }
    while (err && moved-- > 0)
        move_entry(stage->folder, stage->path, list[moved]->d_name);
    for (int i = 0; i < n; i++)
        free(list[i]);
    if (n >= 0)
        free(list);
    return err;
}

int export_stage_commit(struct export_stage *stage, struct error *why)
{
    int err = move_all(stage);
    if (!err && rmdir(stage->path))
        err = -errno;
    if (!err) {
        unlock_folder(stage->lock);
        stage->lock = -1;
    }
    if (err)
        error_say(why, err, "%s: cannot be written: %s", stage->folder, strerror(-err));
    return err;
}

void export_stage_abandon(struct export_stage *stage)
{
    each_entry(stage->path, remove_entry, NULL);
    rmdir(stage->path);
    unlock_folder(stage->lock);
    stage->lock = -1;
    remove_folders(stage->folder, stage->existing);
}
