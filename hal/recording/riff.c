#include "hal/recording/riff.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

static uint32_t read_32(const unsigned char *p, bool big)
{
    if (big)
        return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
    return (uint32_t)p[3] << 24 | (uint32_t)p[2] << 16 | (uint32_t)p[1] << 8 | p[0];
}

/* Walks the chunks to "data"; an RF64 file has its size in the chunk "ds64". */
static int find_data(FILE *f, uint64_t file_size, uint64_t *promised, uint64_t *present)
{
    unsigned char head[12], ds64[16];
    uint64_t at = 12, size_64 = 0;
    if (fread(head, 1, 12, f) != 12 || memcmp(head + 8, "WAVE", 4))
        return -EINVAL;
    bool big = !memcmp(head, "RIFX", 4);
    if (!big && memcmp(head, "RIFF", 4) && memcmp(head, "RF64", 4))
        return -EINVAL;
    while (!fseeko(f, (off_t)at, SEEK_SET) && fread(head, 1, 8, f) == 8) {
        uint64_t size = read_32(head + 4, big);
        at += 8;
        if (!memcmp(head, "ds64", 4) && fread(ds64, 1, 16, f) == 16)
            size_64 = (uint64_t)read_32(ds64 + 12, false) << 32 |
                      read_32(ds64 + 8, false);
        if (!memcmp(head, "data", 4)) {
            *present = file_size > at ? file_size - at : 0;
            *promised = size == UINT32_MAX && size_64 ? size_64 : size;
            if (*promised == 0 || *promised == UINT32_MAX)
                *promised = *present;
            return 0;
        }
        at += size + (size & 1);
    }
    return ferror(f) ? -EIO : -EINVAL;
}

int riff_data_size(const char *path, uint64_t *promised, uint64_t *present)
{
    struct stat st;
    FILE *f = fopen(path, "re");
    if (!f)
        return -errno;
    int err = fstat(fileno(f), &st) < 0
                  ? -errno
                  : find_data(f, (uint64_t)st.st_size, promised, present);
    fclose(f);
    return err;
}
