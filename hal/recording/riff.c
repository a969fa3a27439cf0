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

struct riff {
    FILE *f;
    uint64_t file_size;
    bool big;
    uint64_t at;  /* of the content of the chunk that came last */
    char name[4]; /* its name, and its length */
    uint64_t length;
};

static int open_riff(struct riff *r, const char *path)
{
    unsigned char head[12];
    struct stat st;

    int err = stat(path, &st) < 0 ? -errno : 0;
    if (!err && !S_ISREG(st.st_mode)) /* a pipe would be waited for */
        err = -ESPIPE;
    if (err)
        return err;
    *r = (struct riff){
        .f = fopen(path, "re"), .at = 12, .file_size = (uint64_t)st.st_size};
    if (!r->f)
        return -errno;
    if (fread(head, 1, 12, r->f) != 12 || memcmp(head + 8, "WAVE", 4))
        err = ferror(r->f) ? -EIO : -EINVAL;
    r->big = !err && !memcmp(head, "RIFX", 4);
    if (!err && !r->big && memcmp(head, "RIFF", 4) && memcmp(head, "RF64", 4))
        err = -EINVAL;
    if (err)
        fclose(r->f);
    return err;
}

/* 0, -EINVAL (no more chunks), -EIO. */
static int next_chunk(struct riff *r)
{
    unsigned char head[8];

    r->at += r->length + (r->length & 1);
    if (fseeko(r->f, (off_t)r->at, SEEK_SET) || fread(head, 1, 8, r->f) != 8)
        return ferror(r->f) ? -EIO : -EINVAL;
    memcpy(r->name, head, 4);
    r->length = read_32(head + 4, r->big);
    r->at += 8;
    return 0;
}

/* An RF64 file has the size of its data in the chunk "ds64". */
int riff_data_size(const char *path, uint64_t *promised, uint64_t *present)
{
    unsigned char ds64[16];
    uint64_t size_64 = 0;
    struct riff r;
    int err = open_riff(&r, path);

    if (err)
        return err;
    while (!(err = next_chunk(&r)) && memcmp(r.name, "data", 4))
        if (!memcmp(r.name, "ds64", 4) && fread(ds64, 1, 16, r.f) == 16)
            size_64 = (uint64_t)read_32(ds64 + 12, false) << 32 |
                      read_32(ds64 + 8, false);
    if (!err) {
        *present = r.file_size > r.at ? r.file_size - r.at : 0;
        *promised = r.length == UINT32_MAX && size_64 ? size_64 : r.length;
        if (*promised == 0 || *promised == UINT32_MAX)
            *promised = *present;
    }
    fclose(r.f);
    return err;
}

int riff_format(const char *path, unsigned *format)
{
    unsigned char number[2];
    struct riff r;
    int err = open_riff(&r, path);

    if (err)
        return err;
    while (!(err = next_chunk(&r)) && memcmp(r.name, "fmt ", 4))
        ;
    if (!err && fread(number, 1, 2, r.f) != 2)
        err = -EINVAL;
    if (!err)
        *format = r.big ? number[0] << 8 | number[1] : number[1] << 8 | number[0];
    fclose(r.f);
    return err;
}
