#include "nodes/anlos/mat_process.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "nodes/anlos/mat_file.h"
#include "nodes/anlos/mat_library.h"

#define LEAST_CPU_S    5
#define BYTES_A_SECOND ((rlim_t)4 << 20) /* of the file, on a slow machine */
#define LEAST_MEMORY   ((rlim_t)256 << 20)
#define MOST_MEMORY    ((rlim_t)6 << 30) /* MAT_FILE_MAX_ELEMENTS, read and inflated */
#define MEMORY_A_BYTE  3300              /* what deflate holds, three times */
#define BLOCK          4096              /* elements that are converted at once */

struct answer {
    int err;
    size_t extents[MAT_FILE_MAX_RANK];
    struct complaint why;
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
}

static int answer(struct answer *a, const struct mat_question *q, struct mat_variable *v)
{
    struct mat_library *f;
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

static int start(const struct mat_question *q, pid_t *pid, int *fd, struct complaint *why)
{
    int ends[2];

    if (pipe(ends) < 0)
        return complain(why, -errno, "%s: %s", q->path, strerror(errno));
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
    return err ? complain(why, err, "%s: %s", q->path, strerror(-err)) : 0;
}

static int blame(const struct mat_question *q, int err, int status, struct complaint *why)
{
    if (err == -ENOMEM)
        return complain(why, err, "%s: out of memory", q->path);
    if (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU)
        return complain(why, -EIO, "%s: takes longer to read than a file of its size may",
                        q->path);
    return complain(why, -EIO, "%s: damaged: the MATLAB library cannot read it", q->path);
}

int mat_process_ask(const struct mat_question *q, size_t extents[], void **data,
                    struct complaint *why)
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
        return a.why.text[0] ? complain(why, a.err, "%s", a.why.text) : a.err;
    if (q->what >= MAT_EXTENTS)
        memcpy(extents, a.extents, q->rank * sizeof *extents);
    return 0;
}
