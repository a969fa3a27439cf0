#include "nodes/anlos/mat_file.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/mat_process.h"

struct mat_file {
    char *path;
};

int mat_file_open(struct mat_file **out, const char *path, struct complaint *why)
{
    const struct mat_question q = {.path = path, .what = MAT_OPEN};
    struct mat_file *f;
    int err = mat_process_ask(&q, NULL, NULL, why);

    if (err)
        return err;
    f = calloc(1, sizeof *f);
    if (f)
        f->path = strdup(path);
    if (!f || !f->path) {
        free(f);
        return complain(why, -ENOMEM, "%s: out of memory", path);
    }
    *out = f;
    return 0;
}

bool mat_file_has(struct mat_file *f, const char *name)
{
    const struct mat_question q = {.path = f->path, .what = MAT_HAS, .name = name};

    return !mat_process_ask(&q, NULL, NULL, NULL);
}

int mat_file_extents(struct mat_file *f, const char *name, size_t rank, size_t extents[],
                     struct complaint *why)
{
    const struct mat_question q = {
        .path = f->path, .what = MAT_EXTENTS, .name = name, .rank = rank};

    return mat_process_ask(&q, extents, NULL, why);
}

static int read_all(struct mat_file *f, enum mat_what what, const char *name, size_t rank,
                    size_t extents[], void **out, struct complaint *why)
{
    const struct mat_question q = {
        .path = f->path, .what = what, .name = name, .rank = rank};

    return mat_process_ask(&q, extents, out, why);
}

int mat_file_read_float(struct mat_file *f, const char *name, size_t rank,
                        size_t extents[], float **out, struct complaint *why)
{
    void *data;
    int err = read_all(f, MAT_FLOATS, name, rank, extents, &data, why);

    if (!err)
        *out = data;
    return err;
}

int mat_file_read_double(struct mat_file *f, const char *name, size_t rank,
                         size_t extents[], double **out, struct complaint *why)
{
    void *data;
    int err = read_all(f, MAT_DOUBLES, name, rank, extents, &data, why);

    if (!err)
        *out = data;
    return err;
}

int mat_file_read_complex(struct mat_file *f, const char *name, size_t rank,
                          size_t extents[], float complex **out, struct complaint *why)
{
    void *data;
    int err = read_all(f, MAT_COMPLEX, name, rank, extents, &data, why);

    if (!err)
        *out = data;
    return err;
}

int mat_file_read_number(struct mat_file *f, const char *name, double *out,
                         struct complaint *why)
{
    size_t extents[2];
    double *value = NULL;
    int err = mat_file_read_double(f, name, 2, extents, &value, why);
    if (err)
        return err;
    if (extents[0] * extents[1] != 1)
        err = complain(why, -EINVAL, "%s: %s: %zu x %zu, expected one number", f->path,
                       name, extents[0], extents[1]);
    else if (!isfinite(*value))
        err = complain(why, -EINVAL, "%s: %s: is %g, expected a number", f->path, name,
                       *value);
    else
        *out = *value;
    free(value);
    return err;
}

void mat_file_close(struct mat_file *f)
{
    if (!f)
        return;
    free(f->path);
    free(f);
}
