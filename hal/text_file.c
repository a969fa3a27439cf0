/* SPDX-License-Identifier: MIT */
#include "hal/text_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static int open_regular(const char *path, int *fd)
{
    struct stat st;

    *fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (*fd < 0 || fstat(*fd, &st) < 0)
        return -errno;
    if (S_ISDIR(st.st_mode))
        return -EISDIR;
    if (!S_ISREG(st.st_mode))
        return -EINVAL;
    return st.st_size > (off_t)TEXT_FILE_MAX_SIZE ? -EFBIG : 0;
}

int text_file_open(FILE **out, const char *path, struct error *why)
{
    int fd, err = open_regular(path, &fd);

    if (!err) {
        *out = fdopen(fd, "r");
        err = *out ? 0 : -errno;
    }
    if (err && fd >= 0)
        close(fd);
    if (err == -EINVAL)
        return error_say(why, err, "%s: not a regular file", path);
    if (err == -EFBIG)
        return error_say(why, -EINVAL, "%s: larger than %u MiB; expected a text file",
                         path, TEXT_FILE_MAX_SIZE >> 20);
    return err ? error_say(why, err, "%s: %s", path, strerror(-err)) : 0;
}

int text_file_lines(const char *path, int (*take)(void *ctx, char *line, size_t number),
                    void *ctx, struct error *why)
{
    char *line = NULL;
    size_t room = 0;
    FILE *f;
    int err = text_file_open(&f, path, why);

    if (err)
        return err;
    for (size_t i = 1; !err && getline(&line, &room, f) >= 0; i++)
        err = take(ctx, line, i);
    if (!err && ferror(f))
        err = error_say(why, -EIO, "%s: cannot be read", path);
    free(line);
    fclose(f);
    return err;
}

static int write_to(const char *partial, bool synced,
                    void (*print)(FILE *f, const void *what), const void *what)
{
    unlink(partial); /* and not through a link that somebody has put there */
    FILE *f = fopen(partial, "wxe");
    int err = 0;

    if (!f)
        return -errno;
    print(f, what);
    if (fflush(f) || ferror(f) || (synced && fsync(fileno(f)) < 0))
        err = errno ? -errno : -EIO;
    if (fclose(f) && !err)
        err = -errno;
    return err;
}

int text_file_write(const char *path, bool synced,
                    void (*print)(FILE *f, const void *what), const void *what)
{
    char *partial;

    if (asprintf(&partial, "%s.part", path) < 0)
        return -ENOMEM;
    int err = write_to(partial, synced, print, what);
    if (!err && rename(partial, path) < 0)
        err = -errno;
    if (err)
        unlink(partial);
    free(partial);
    return err;
}

const char *decimal_print(double x, char out[DECIMAL_SIZE])
{
    for (int digits = 6; digits <= 17; digits++) {
        snprintf(out, DECIMAL_SIZE, "%.*g", digits, x);
        if (strtod(out, NULL) == x)
            break;
    }
    return out;
}
