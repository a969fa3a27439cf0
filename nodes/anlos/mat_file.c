/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/mat_file.h"

#include <complex.h>
#include <errno.h>
#include <fcntl.h>
#include <hdf5.h>
#include <math.h>
#include <matio.h>
#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "dsp/error.h"

/* Variables of a MATLAB file by libmatio.  A damaged file can make libmatio and HDF5
 * crash, loop and take all memory: only for a process of its own
 * (nodes/anlos/mat_file.h). */

struct mat_variable { /* with its data */
    matvar_t *variable;
    size_t n, element_size;
    const char *re, *im; /* [n] elements of the variable's class; im NULL: real */
};

/* MATLAB files are read in a child process with bounded time and memory, one for each
 * question: libmatio and HDF5 do not withstand damaged files, and what becomes of them
 * there is an error here.  Of other threads the child would have the locks that they held
 * and not them: there may be none. */

enum mat_what { MAT_OPEN, MAT_HAS, MAT_EXTENTS, MAT_FLOATS, MAT_DOUBLES, MAT_COMPLEX };

struct mat_question {
    const char *path;
    enum mat_what what;
    const char *name; /* of a variable; not with MAT_OPEN */
    size_t rank;      /* of its extents */
};

/* MATLAB v5 files that end too early: libmatio reads what is missing as zeros, without
 * an error, so their elements are walked over here (MAT-File Format, MathWorks R2023a,
 * 1-9). */

#define V5_HEADER     128
#define V5_COMPRESSED 15

static uint32_t word_at(const uint8_t *p, bool little)
{
    return little ? p[0] | p[1] << 8 | p[2] << 16 | (uint32_t)p[3] << 24
                  : p[3] | p[2] << 8 | p[1] << 16 | (uint32_t)p[0] << 24;
}

/* Does the last element reach beyond the file's end?  Of files that are not v5 nothing is
 * said: false.  Does not move the file's position. */
static bool mat_truncation_check(int fd)
{
    uint8_t head[V5_HEADER], tag[8];
    struct stat st;
    if (fstat(fd, &st) || pread(fd, head, sizeof head, 0) != (ssize_t)sizeof head)
        return false;
    bool little = head[126] == 'I' && head[127] == 'M';
    bool big = head[126] == 'M' && head[127] == 'I';
    if ((!little && !big) || head[little ? 125 : 124] != 1) /* version 0x0100 */
        return false;
    off_t at = V5_HEADER;
    while (at < st.st_size) {
        if (pread(fd, tag, sizeof tag, at) != (ssize_t)sizeof tag)
            return true;
        uint32_t type = word_at(tag, little), size = word_at(tag + 4, little);
        at += 8;
        if (type >> 16) /* a small element: its data are in the tag */
            continue;
        at += type == V5_COMPRESSED ? (off_t)size : ((off_t)size + 7) / 8 * 8;
    }
    return at > st.st_size;
}

#define MOST_INFLATED 1100 /* bytes that deflate makes of one, and some */
#define SLACK_BYTES   65536

struct mat_library {
    mat_t *mat;
    char *path;
    size_t size; /* of the file */
};

/* libmatio tells nothing about why a file does not open. */
static int check_readable(const char *path, size_t *size, struct error *why)
{
    char c;
    struct stat st = {.st_size = 0};
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    int err = fd < 0 || fstat(fd, &st) < 0 || read(fd, &c, 1) < 0 ? -errno : 0;
    bool cut_off = !err && mat_truncation_check(fd);
    if (fd >= 0)
        close(fd);
    if (cut_off)
        return error_say(why, -EIO, "%s: truncated: its last variable is not whole",
                         path);
    if (!err && !S_ISREG(st.st_mode))
        return error_say(why, -EINVAL, "%s: not a regular file", path);
    *size = (size_t)st.st_size;
    return err ? error_say(why, err, "%s: %s", path, strerror(-err)) : 0;
}

static void mat_library_close(struct mat_library *f)
{
    if (!f)
        return;
    if (f->mat)
        Mat_Close(f->mat);
    free(f->path);
    free(f);
}

/* As nodes/anlos/mat_file.h has them. */
static int mat_library_open(struct mat_library **out, const char *path, struct error *why)
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
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    }
    f->size = size;
    H5Eset_auto(H5E_DEFAULT, NULL, NULL); /* or it prints every error that it meets */
    f->mat = Mat_Open(path, MAT_ACC_RDONLY);
    /* Any bytes pass for version 4, which has no mark. */
    if (!f->mat || (Mat_GetVersion(f->mat) != MAT_FT_MAT5 &&
                    Mat_GetVersion(f->mat) != MAT_FT_MAT73)) {
        mat_library_close(f);
        return error_say(why, -EINVAL, "%s: expected a MATLAB file, v5 or v7.3", path);
    }
    *out = f;
    return 0;
}

static matvar_t *find(struct mat_library *f, const char *name)
{
    Mat_Rewind(f->mat);
    return Mat_VarReadInfo(f->mat, name);
}

static bool mat_library_has(struct mat_library *f, const char *name)
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
                       size_t rank, size_t extents[], struct error *why)
{
    size_t n = 1;
    if (!is_numeric(v->class_type))
        return error_say(why, -EINVAL, "%s: %s: expected an array of numbers, not sparse",
                         f->path, name);
    for (size_t d = 0; d < rank; d++)
        extents[d] = 1;
    for (size_t d = 0; d < (size_t)v->rank; d++) {
        if (d >= rank && v->dims[d] != 1)
            return error_say(why, -EINVAL, "%s: %s: %d dimensions, expected %zu", f->path,
                             name, v->rank, rank);
        if (d < rank)
            extents[d] = v->dims[d];
        if (!v->dims[d])
            return error_say(why, -EINVAL, "%s: %s: is empty", f->path, name);
        if (v->dims[d] > MAT_FILE_MAX_ELEMENTS / n)
            return error_say(why, -EFBIG, "%s: %s: expected at most %zu elements",
                             f->path, name, MAT_FILE_MAX_ELEMENTS);
        n *= v->dims[d];
    }
    if (n * Mat_SizeOfClass((int)v->class_type) > f->size * MOST_INFLATED + SLACK_BYTES)
        return error_say(why, -EIO, "%s: %s: %zu elements, more than the file can hold",
                         f->path, name, n);
    return 0;
}

static int find_shape(struct mat_library *f, const char *name, size_t rank,
                      size_t extents[], matvar_t **out, struct error *why)
{
    matvar_t *v = find(f, name);
    if (!v)
        return error_say(why, -ENOENT, "%s: expected a variable %s", f->path, name);
    int err = check_shape(f, v, name, rank, extents, why);
    if (err)
        Mat_VarFree(v);
    else
        *out = v;
    return err;
}

static int mat_library_extents(struct mat_library *f, const char *name, size_t rank,
                               size_t extents[], struct error *why)
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

/* Reads all of a variable, which stays as long as its process.  0, as
 * mat_file_read_float. */
static int mat_library_load(struct mat_library *f, const char *name, size_t rank,
                            size_t extents[], bool may_be_complex,
                            struct mat_variable *out, struct error *why)
{
    matvar_t *v = NULL;
    int err = find_shape(f, name, rank, extents, &v, why);
    if (err)
        return err;
    if (v->isComplex && !may_be_complex) {
        Mat_VarFree(v);
        return error_say(why, -EINVAL, "%s: %s: is complex, expected real numbers",
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
        return error_say(why, -EIO, "%s: %s: truncated or unreadable", f->path, name);
    }
    out->re = v->isComplex ? split->Re : v->data;
    out->im = v->isComplex ? split->Im : NULL;
    return 0;
}

/* Its elements from `first` on, converted: out[n]. */
static void mat_library_floats(const struct mat_variable *v, size_t first, size_t n,
                               float *out)
{
    to_float(part(v, v->re, first), v->variable->class_type, n, 1, out);
}

static void mat_library_doubles(const struct mat_variable *v, size_t first, size_t n,
                                double *out)
{
    to_double(part(v, v->re, first), v->variable->class_type, n, out);
}

static void mat_library_complex(const struct mat_variable *v, size_t first, size_t n,
                                float complex *out)
{
    float *parts = (float *)out;

    memset(out, 0, n * sizeof *out);
    to_float(part(v, v->re, first), v->variable->class_type, n, 2, parts);
    if (v->im)
        to_float(part(v, v->im, first), v->variable->class_type, n, 2, parts + 1);
}

#define LEAST_CPU_S    5
#define BYTES_A_SECOND ((rlim_t)4 << 20) /* of the file, on a slow machine */
#define WAIT           30 /* times that: for who waits for a processor, a disk or a lock */
#define LEAST_MEMORY   ((rlim_t)256 << 20)
#define MOST_MEMORY    ((rlim_t)6 << 30) /* MAT_FILE_MAX_ELEMENTS, read and inflated */
#define MEMORY_A_BYTE  3300              /* what deflate holds, three times */
#define BLOCK          4096              /* elements that are converted at once */

struct answer {
    int err;
    size_t extents[MAT_FILE_MAX_RANK];
    struct error why;
};

/* -- the child -- */
static int send_bytes(int fd, const void *data, size_t size)
{
    const char *at = data;

    while (size) {
        ssize_t n = write(fd, at, size);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return -1;
        at += n;
        size -= (size_t)n;
    }
    return 0;
}

static size_t element_size(enum mat_what what)
{
    return what == MAT_FLOATS ? sizeof(float) : 8; /* double, complex float */
}

static int send_data(int fd, enum mat_what what, const struct mat_variable *v)
{
    union {
        float floats[BLOCK];
        double doubles[BLOCK];
        float complex pairs[BLOCK];
    } block;

    for (size_t first = 0; first < v->n; first += BLOCK) {
        size_t n = v->n - first < BLOCK ? v->n - first : BLOCK;
        if (what == MAT_FLOATS)
            mat_library_floats(v, first, n, block.floats);
        else if (what == MAT_DOUBLES)
            mat_library_doubles(v, first, n, block.doubles);
        else
            mat_library_complex(v, first, n, block.pairs);
        if (send_bytes(fd, &block, n * element_size(what)))
            return -1;
    }
    return 0;
}

/* What more it takes than the parent had when it forked. */
static void limit(const char *path)
{
    struct stat st = {.st_size = 0};
    unsigned long pages = 0;
    FILE *f = fopen("/proc/self/statm", "re");

    if (f && fscanf(f, "%lu", &pages) != 1)
        pages = 0;
    if (f)
        fclose(f);
    stat(path, &st);
    rlim_t size = (rlim_t)st.st_size, more = MOST_MEMORY;
    if (size < MOST_MEMORY / MEMORY_A_BYTE)
        more = LEAST_MEMORY + size * MEMORY_A_BYTE;
    rlim_t memory = pages * (rlim_t)sysconf(_SC_PAGESIZE) + more;
    rlim_t cpu_s = LEAST_CPU_S + size / BYTES_A_SECOND;
    setrlimit(RLIMIT_AS, &(struct rlimit){memory, memory});
    setrlimit(RLIMIT_CPU, &(struct rlimit){cpu_s, cpu_s});
    setrlimit(RLIMIT_CORE, &(struct rlimit){0, 0});
    sigset_t none;
    sigemptyset(&none);
    signal(SIGALRM, SIG_DFL);
    sigprocmask(SIG_SETMASK, &none, NULL);
    alarm((unsigned)cpu_s * WAIT);
}

static int answer(struct answer *a, const struct mat_question *q, struct mat_variable *v)
{
    struct mat_library *f = NULL;
    int err = mat_library_open(&f, q->path, &a->why);

    if (err || q->what == MAT_OPEN)
        return err;
    if (q->what == MAT_HAS)
        return mat_library_has(f, q->name) ? 0 : -ENOENT;
    if (q->what == MAT_EXTENTS)
        return mat_library_extents(f, q->name, q->rank, a->extents, &a->why);
    return mat_library_load(f, q->name, q->rank, a->extents, q->what == MAT_COMPLEX, v,
                            &a->why);
}

/* The system cleans up behind it. */
static _Noreturn void serve(int fd, const struct mat_question *q)
{
    struct answer a = {.why = {""}};
    struct mat_variable v = {.n = 0};

    signal(SIGPIPE, SIG_DFL);
    limit(q->path);
    a.err = answer(&a, q, &v);
    int failed = send_bytes(fd, &a, sizeof a);
    if (!failed && !a.err)
        failed = send_data(fd, q->what, &v);
    _exit(failed ? 1 : 0);
}

/* -- the parent -- */

/* 0, -EIO: it ended before. */
static int receive_bytes(int fd, void *data, size_t size)
{
    char *at = data;

    while (size) {
        ssize_t n = read(fd, at, size);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return -EIO;
        at += n;
        size -= (size_t)n;
    }
    return 0;
}

/* The child may be anything by now: nothing that it says is relied on. */
static int receive(int fd, const struct mat_question *q, struct answer *a, void **data)
{
    size_t n = 1;
    int err = receive_bytes(fd, a, sizeof *a);

    if (err)
        return err;
    a->why.text[sizeof a->why.text - 1] = '\0';
    if (a->err || q->what < MAT_FLOATS)
        return a->err > 0 ? -EIO : 0;
    for (size_t d = 0; d < q->rank; d++) {
        if (!a->extents[d] || a->extents[d] > MAT_FILE_MAX_ELEMENTS / n)
            return -EIO;
        n *= a->extents[d];
    }
    *data = malloc(n * element_size(q->what));
    if (!*data)
        return -ENOMEM;
    err = receive_bytes(fd, *data, n * element_size(q->what));
    if (err)
        free(*data);
    return err;
}

static int start(const struct mat_question *q, pid_t *pid, int *fd, struct error *why)
{
    int ends[2];

    if (pipe(ends) < 0)
        return error_say(why, -errno, "%s: %s", q->path, strerror(errno));
    *pid = fork();
    if (!*pid) {
        close(ends[0]);
        serve(ends[1], q);
    }
    int err = *pid < 0 ? -errno : 0;
    close(ends[1]);
    *fd = ends[0];
    if (err)
        close(ends[0]);
    return err ? error_say(why, err, "%s: %s", q->path, strerror(-err)) : 0;
}

static int blame(const struct mat_question *q, int err, int status, struct error *why)
{
    if (err == -ENOMEM)
        return error_say(why, err, "%s: out of memory", q->path);
    if (WIFSIGNALED(status) &&
        (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGALRM))
        return error_say(why, -EIO,
                         "%s: takes longer to read than a file of its size may", q->path);
    return error_say(why, -EIO, "%s: damaged: the MATLAB library cannot read it",
                     q->path);
}

/* extents[rank] are written from MAT_EXTENTS on, *data from MAT_FLOATS on: free() it.
 * 0, -ENOENT (no such variable) and other errno of reading, -EINVAL (what is in the file
 * does not suit), -EFBIG, -EIO (truncated, or damaged so that it cannot be read),
 * -ENOMEM, and errors of fork(2) and pipe(2). */
static int mat_process_ask(const struct mat_question *q, size_t extents[], void **data,
                           struct error *why)
{
    struct answer a;
    pid_t pid = -1;
    int fd = -1, status = 0;
    int err = start(q, &pid, &fd, why);

    if (err)
        return err;
    err = receive(fd, q, &a, data);
    close(fd); /* a child that still writes ends by that */
    while (waitpid(pid, &status, 0) < 0 && errno == EINTR)
        ;
    if (err)
        return blame(q, err, status, why);
    if (a.err)
        return a.why.text[0] ? error_say(why, a.err, "%s", a.why.text) : a.err;
    if (q->what >= MAT_EXTENTS)
        memcpy(extents, a.extents, q->rank * sizeof *extents);
    return 0;
}

struct mat_file {
    char *path;
};

int mat_file_open(struct mat_file **out, const char *path, struct error *why)
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
        return error_say(why, -ENOMEM, "%s: out of memory", path);
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
                     struct error *why)
{
    const struct mat_question q = {
        .path = f->path, .what = MAT_EXTENTS, .name = name, .rank = rank};

    return mat_process_ask(&q, extents, NULL, why);
}

static int read_all(struct mat_file *f, enum mat_what what, const char *name, size_t rank,
                    size_t extents[], void **out, struct error *why)
{
    const struct mat_question q = {
        .path = f->path, .what = what, .name = name, .rank = rank};

    return mat_process_ask(&q, extents, out, why);
}

int mat_file_read_float(struct mat_file *f, const char *name, size_t rank,
                        size_t extents[], float **out, struct error *why)
{
    void *data;
    int err = read_all(f, MAT_FLOATS, name, rank, extents, &data, why);

    if (!err)
        *out = data;
    return err;
}

int mat_file_read_double(struct mat_file *f, const char *name, size_t rank,
                         size_t extents[], double **out, struct error *why)
{
    void *data;
    int err = read_all(f, MAT_DOUBLES, name, rank, extents, &data, why);

    if (!err)
        *out = data;
    return err;
}

int mat_file_read_complex(struct mat_file *f, const char *name, size_t rank,
                          size_t extents[], float complex **out, struct error *why)
{
    void *data;
    int err = read_all(f, MAT_COMPLEX, name, rank, extents, &data, why);

    if (!err)
        *out = data;
    return err;
}

int mat_file_read_number(struct mat_file *f, const char *name, double *out,
                         struct error *why)
{
    size_t extents[2];
    double *value = NULL;
    int err = mat_file_read_double(f, name, 2, extents, &value, why);
    if (err)
        return err;
    if (extents[0] * extents[1] != 1)
        err = error_say(why, -EINVAL, "%s: %s: %zu x %zu, expected one number", f->path,
                        name, extents[0], extents[1]);
    else if (!isfinite(*value))
        err = error_say(why, -EINVAL, "%s: %s: is %g, expected a number", f->path, name,
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
