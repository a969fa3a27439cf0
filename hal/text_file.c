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

const char *decimal_print(double x, char out[DECIMAL_SIZE])
{
    for (int digits = 6; digits <= 17; digits++) {
        snprintf(out, DECIMAL_SIZE, "%.*g", digits, x);
        if (strtod(out, NULL) == x)
            break;
    }
    return out;
}
