#include "dsp/wisdom.h"

#include <errno.h>
#include <fcntl.h>
#include <fftw3.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define WISDOM_MAX_SIZE (8u << 20)

/* path[PATH_MAX]: the folder and the tail. */
static int wisdom_path(char *path, const char *tail)
{
    const char *base = getenv("XDG_CACHE_HOME"), *sub = "";
    int n;

    if (!base || base[0] != '/') { /* the standard: relative ones are to be ignored */
        base = getenv("HOME");
        sub = "/.cache";
    }
    if (!base || base[0] != '/')
        return -ENOENT;
    n = snprintf(path, PATH_MAX, "%s%s/anlos%s", base, sub, tail);
    return n < 0 || n >= PATH_MAX ? -ENAMETOOLONG : 0;
}

/* Makes the folder and its parents. */
static int folder_make(char *path)
{
    for (char *p = path + 1;; p++) {
        char kept = *p;
        if (kept != '/' && kept != '\0')
            continue;
        *p = '\0';
        int err = mkdir(path, 0700) && errno != EEXIST ? -errno : 0;
        *p = kept;
        if (err || kept == '\0')
            return err;
    }
}

int wisdom_load(void)
{
    char path[PATH_MAX];
    char *text = NULL;
    struct stat st;
    FILE *f;
    int err = wisdom_path(path, "/fftwf.wisdom");

    if (err)
        return err;
    f = fopen(path, "re");
    if (!f)
        return -errno;
    if (fstat(fileno(f), &st)) {
        err = -errno;
        goto done;
    }
    if (!S_ISREG(st.st_mode) || st.st_size < 0 || st.st_size > WISDOM_MAX_SIZE) {
        err = -EINVAL;
        goto done;
    }
    text = calloc(1, (size_t)st.st_size + 1);
    if (!text)
        err = -ENOMEM;
    else if (fread(text, 1, (size_t)st.st_size, f) != (size_t)st.st_size)
        err = -EIO;
    else if (!fftwf_import_wisdom_from_string(text))
        err = -EINVAL;
done:
    free(text);
    fclose(f);
    return err;
}

static int text_write(int fd, const char *text, size_t size)
{
    while (size) {
        ssize_t n = write(fd, text, size);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return n < 0 ? -errno : -EIO;
        text += n;
        size -= (size_t)n;
    }
    return 0;
}

/* Under another name first, so that a reader never sees half of it. */
static int wisdom_write(const char *text)
{
    char path[PATH_MAX], part[PATH_MAX];
    int fd, err = wisdom_path(path, "/fftwf.wisdom");

    if (!err)
        err = wisdom_path(part, "/fftwf.XXXXXX");
    if (err)
        return err;
    fd = mkostemp(part, O_CLOEXEC);
    if (fd < 0)
        return -errno;
    err = text_write(fd, text, strlen(text));
    if (close(fd) && !err)
        err = -errno;
    if (!err && rename(part, path))
        err = -errno;
    if (err)
        unlink(part);
    return err;
}

int wisdom_save(void)
{
    char folder[PATH_MAX];
    char *text;
    int err = wisdom_path(folder, "");

    if (!err)
        err = folder_make(folder);
    if (err)
        return err;
    text = fftwf_export_wisdom_to_string();
    if (!text)
        return -ENOMEM;
    err = wisdom_write(text);
    free(text);
    return err;
}
