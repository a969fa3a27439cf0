#include "nodes/anlos/mat_library.h"

#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <hdf5.h>
#include <matio.h>

#include "nodes/anlos/mat_file.h"
#include "nodes/anlos/mat_truncation.h"

#define MOST_INFLATED 1100 /* bytes that deflate makes of one, and some */
#define SLACK_BYTES   65536

struct mat_library {
    mat_t *mat;
    char *path;
    size_t size; /* of the file */
};

/* libmatio tells nothing about why a file does not open. */
static int check_readable(const char *path, size_t *size, struct complaint *why)
{
    char c;
    struct stat st = {.st_size = 0};
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    int err = fd < 0 || fstat(fd, &st) < 0 || read(fd, &c, 1) < 0 ? -errno : 0;
    bool cut_off = !err && mat_truncation_check(fd);
    if (fd >= 0)
        close(fd);
    if (cut_off)
        return complain(why, -EIO, "%s: truncated: its last variable is not whole", path);
    if (!err && !S_ISREG(st.st_mode))
        return complain(why, -EINVAL, "%s: not a regular file", path);
    *size = (size_t)st.st_size;
    return err ? complain(why, err, "%s: %s", path, strerror(-err)) : 0;
}

int mat_library_open(struct mat_library **out, const char *path, struct complaint *why)
{
    size_t size = 0;
    int err = check_readable(path, &size, why);
    if (err)
        return err;
    struct mat_library *f = calloc(1, sizeof *f);
    if (f)
        f->path = strdup(path);
    if (!f || !f->path) {
        free(f);
        return complain(why, -ENOMEM, "%s: out of memory", path);
    }
    f->size = size;
    H5Eset_auto(H5E_DEFAULT, NULL, NULL); /* or it prints every error that it meets */
    f->mat = Mat_Open(path, MAT_ACC_RDONLY);
    /* Any bytes pass for version 4, which has no mark. */
    if (!f->mat || (Mat_GetVersion(f->mat) != MAT_FT_MAT5 &&
                    Mat_GetVersion(f->mat) != MAT_FT_MAT73)) {
        mat_library_close(f);
        return complain(why, -EINVAL, "%s: expected a MATLAB file, v5 or v7.3", path);
    }
    *out = f;
    return 0;
}

static matvar_t *find(struct mat_library *f, const char *name)
{
    Mat_Rewind(f->mat);
    return Mat_VarReadInfo(f->mat, name);
}

bool mat_library_has(struct mat_library *f, const char *name)
{
    matvar_t *v = find(f, name);
    Mat_VarFree(v);
    return v != NULL;
}

static bool is_numeric(enum matio_classes class)
{
    switch (class) {
    case MAT_C_DOUBLE:
    case MAT_C_SINGLE:
    case MAT_C_INT8:
    case MAT_C_UINT8:
    case MAT_C_INT16:
    case MAT_C_UINT16:
    case MAT_C_INT32:
    case MAT_C_UINT32:
    case MAT_C_INT64:
    case MAT_C_UINT64:
        return true;
    default:
        return false;
    }
}

static int check_shape(const struct mat_library *f, const matvar_t *v, const char *name,
                       size_t rank, size_t extents[], struct complaint *why)
{
    size_t n = 1;
    if (!is_numeric(v->class_type))
        return complain(why, -EINVAL, "%s: %s: expected an array of numbers, not sparse",
                        f->path, name);
    for (size_t d = 0; d < rank; d++)
        extents[d] = 1;
    for (size_t d = 0; d < (size_t)v->rank; d++) {
        if (d >= rank && v->dims[d] != 1)
            return complain(why, -EINVAL, "%s: %s: %d dimensions, expected %zu", f->path,
                            name, v->rank, rank);
        if (d < rank)
            extents[d] = v->dims[d];
        if (!v->dims[d])
            return complain(why, -EINVAL, "%s: %s: is empty", f->path, name);
        if (v->dims[d] > MAT_FILE_MAX_ELEMENTS / n)
            return complain(why, -EFBIG, "%s: %s: expected at most %zu elements", f->path,
                            name, MAT_FILE_MAX_ELEMENTS);
        n *= v->dims[d];
    }
    if (n * Mat_SizeOfClass((int)v->class_type) > f->size * MOST_INFLATED + SLACK_BYTES)
        return complain(why, -EIO, "%s: %s: %zu elements, more than the file can hold",
                        f->path, name, n);
    return 0;
}

static int find_shape(struct mat_library *f, const char *name, size_t rank,
                      size_t extents[], matvar_t **out, struct complaint *why)
{
    matvar_t *v = find(f, name);
    if (!v)
        return complain(why, -ENOENT, "%s: expected a variable %s", f->path, name);
    int err = check_shape(f, v, name, rank, extents, why);
    if (err)
        Mat_VarFree(v);
    else
        *out = v;
    return err;
}

int mat_library_extents(struct mat_library *f, const char *name, size_t rank,
                        size_t extents[], struct complaint *why)
{
    matvar_t *v = NULL;
    int err = find_shape(f, name, rank, extents, &v, why);
    Mat_VarFree(v);
    return err;
}

#define CONVERT(class, type, to)                                                         \
    case class:                                                                          \
        for (size_t i = 0; i < n; i++)                                                   \
            out[i * stride] = (to)((const type *)from)[i];                               \
        break

#define CONVERT_NUMBERS(class, to)                                                       \
    switch (class) {                                                                     \
        CONVERT(MAT_C_DOUBLE, double, to);                                               \
        CONVERT(MAT_C_SINGLE, float, to);                                                \
        CONVERT(MAT_C_INT8, int8_t, to);                                                 \
        CONVERT(MAT_C_UINT8, uint8_t, to);                                               \
        CONVERT(MAT_C_INT16, int16_t, to);                                               \
        CONVERT(MAT_C_UINT16, uint16_t, to);                                             \
        CONVERT(MAT_C_INT32, int32_t, to);                                               \
        CONVERT(MAT_C_UINT32, uint32_t, to);                                             \
        CONVERT(MAT_C_INT64, int64_t, to);                                               \
        CONVERT(MAT_C_UINT64, uint64_t, to);                                             \
    default:                                                                             \
        break;                                                                           \
    }

static void to_float(const void *from, enum matio_classes class, size_t n, size_t stride,
                     float *restrict out)
{
    CONVERT_NUMBERS(class, float)
}

/* Positions and clocks need more digits than a float holds. */
static void to_double(const void *from, enum matio_classes class, size_t n,
                      double *restrict out)
{
    const size_t stride = 1;
    CONVERT_NUMBERS(class, double)
}

/* Where an element stands. */
static const char *part(const struct mat_variable *v, const char *from, size_t element)
{
    return from + element * v->element_size;
}

int mat_library_load(struct mat_library *f, const char *name, size_t rank,
                     size_t extents[], bool may_be_complex, struct mat_variable *out,
                     struct complaint *why)
{
    matvar_t *v = NULL;
    int err = find_shape(f, name, rank, extents, &v, why);
    if (err)
        return err;
    if (v->isComplex && !may_be_complex) {
        Mat_VarFree(v);
        return complain(why, -EINVAL, "%s: %s: is complex, expected real numbers",
                        f->path, name);
    }
    *out = (struct mat_variable){
        .variable = v,
        .n = 1,
        .element_size = Mat_SizeOfClass((int)v->class_type),
    };
    for (size_t d = 0; d < rank; d++)
        out->n *= extents[d];
    int failed = Mat_VarReadDataAll(f->mat, v);
    const mat_complex_split_t *split = v->data;
    if (failed || !v->data || (v->isComplex && (!split->Re || !split->Im)) ||
        v->nbytes < out->n * out->element_size) {
        Mat_VarFree(v);
        return complain(why, -EIO, "%s: %s: truncated or unreadable", f->path, name);
    }
    out->re = v->isComplex ? split->Re : v->data;
    out->im = v->isComplex ? split->Im : NULL;
    return 0;
}

void mat_library_floats(const struct mat_variable *v, size_t first, size_t n, float *out)
{
    to_float(part(v, v->re, first), v->variable->class_type, n, 1, out);
}

void mat_library_doubles(const struct mat_variable *v, size_t first, size_t n,
                         double *out)
{
    to_double(part(v, v->re, first), v->variable->class_type, n, out);
}

void mat_library_complex(const struct mat_variable *v, size_t first, size_t n,
                         float complex *out)
{
    float *parts = (float *)out;

    memset(out, 0, n * sizeof *out);
    to_float(part(v, v->re, first), v->variable->class_type, n, 2, parts);
    if (v->im)
        to_float(part(v, v->im, first), v->variable->class_type, n, 2, parts + 1);
}

void mat_library_close(struct mat_library *f)
{
    if (!f)
        return;
    if (f->mat)
        Mat_Close(f->mat);
    free(f->path);
    free(f);
}
