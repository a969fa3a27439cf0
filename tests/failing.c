/* SPDX-License-Identifier: MIT */
#include "tests/failing.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <link.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <time.h>

#include <cmocka.h>

enum { MAX_LIVE = 1 << 15 }; /* a power of two, twice what may live at once */

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static atomic_bool counting;
static size_t calls, turn;   /* the turn-th call fails */
static const char *failed;   /* what it was; NULL: its turn did not come */
static void *live[MAX_LIVE]; /* open addressing; NULL: empty */
static size_t n_live;
static _Thread_local bool working; /* the thread of the work itself, */
static _Thread_local bool lasting; /* in a call whose own memory is not looked at */

/* Is it the turn of this call? */
static bool fails(const char *what, int number)
{
    if (!counting)
        return false;
    pthread_mutex_lock(&mutex);
    bool now = counting && ++calls == turn;
    if (now)
        failed = what;
    pthread_mutex_unlock(&mutex);
    if (now)
        errno = number;
    return now;
}

static size_t place_of(const void *p)
{
    return (size_t)((uintptr_t)p >> 4) * 0x9e3779b97f4a7c15u % MAX_LIVE;
}

static void *keep(void *p)
{
    if (!counting || !p)
        return p;
    pthread_mutex_lock(&mutex);
    size_t i = place_of(p);
    while (live[i] && live[i] != p)
        i = (i + 1) % MAX_LIVE;
    if (!live[i] && ++n_live > MAX_LIVE / 2)
        abort();
    live[i] = p;
    pthread_mutex_unlock(&mutex);
    return p;
}

/* What stands behind it moves up, or else it would not be found any more. */
static void close_gap(size_t gap)
{
    for (size_t i = (gap + 1) % MAX_LIVE; live[i]; i = (i + 1) % MAX_LIVE) {
        size_t wanted = place_of(live[i]);
        if ((i - wanted) % MAX_LIVE < (i - gap) % MAX_LIVE)
            continue;
        live[gap] = live[i];
        live[gap = i] = NULL;
    }
}

static void forget(const void *p)
{
    if (!counting || !p)
        return;
    pthread_mutex_lock(&mutex);
    size_t i = place_of(p);
    while (live[i] && live[i] != p)
        i = (i + 1) % MAX_LIVE;
    if (live[i]) {
        live[i] = NULL;
        n_live--;
        close_gap(i);
    }
    pthread_mutex_unlock(&mutex);
}

/* -- in the place of the real ones
 * -------------------------------------------------------
 */

#define INSTEAD(type, name, arguments, passed, number, failure)                          \
    type __real_##name arguments __attribute__((weak)); /* of a library not linked */    \
    type __wrap_##name arguments;                                                        \
    type __wrap_##name arguments                                                         \
    {                                                                                    \
        return fails(#name, number) ? (failure) : __real_##name passed;                  \
    }

#define MEMORY(name, arguments, passed)                                                  \
    void *__real_##name arguments;                                                       \
    void *__wrap_##name arguments;                                                       \
    void *__wrap_##name arguments                                                        \
    {                                                                                    \
        return fails(#name, ENOMEM) ? NULL : keep(__real_##name passed);                 \
    }

MEMORY(malloc, (size_t size), (size))
MEMORY(calloc, (size_t n, size_t size), (n, size))
MEMORY(aligned_alloc, (size_t alignment, size_t size), (alignment, size))
MEMORY(strdup, (const char *text), (text))
MEMORY(strndup, (const char *text, size_t n), (text, n))

void *__real_realloc(void *p, size_t size);
void *__wrap_realloc(void *p, size_t size);
void *__wrap_realloc(void *p, size_t size)
{
    if (fails("realloc", ENOMEM))
        return NULL;
    forget(p);
    return keep(__real_realloc(p, size));
}

void __real_free(void *p);
void __wrap_free(void *p);
void __wrap_free(void *p)
{
    forget(p);
    __real_free(p);
}

void *__real_mmap(void *at, size_t size, int prot, int flags, int fd, off_t offset);
void *__wrap_mmap(void *at, size_t size, int prot, int flags, int fd, off_t offset);
void *__wrap_mmap(void *at, size_t size, int prot, int flags, int fd, off_t offset)
{
    if (fails("mmap", ENOMEM))
        return MAP_FAILED;
    void *p = __real_mmap(at, size, prot, flags, fd, offset);
    return p == MAP_FAILED ? p : keep(p);
}

void *__real_mremap(void *p, size_t before, size_t size, int flags, ...);
void *__wrap_mremap(void *p, size_t before, size_t size, int flags, ...);
void *__wrap_mremap(void *p, size_t before, size_t size, int flags, ...)
{
    if (fails("mremap", ENOMEM))
        return MAP_FAILED;
    void *grown = __real_mremap(p, before, size, flags);
    if (grown == MAP_FAILED)
        return grown;
    forget(p);
    return keep(grown);
}

int __real_munmap(void *p, size_t size);
int __wrap_munmap(void *p, size_t size);
int __wrap_munmap(void *p, size_t size)
{
    forget(p);
    return __real_munmap(p, size);
}

int __wrap_asprintf(char **out, const char *format, ...);
int __wrap_asprintf(char **out, const char *format, ...)
{
    va_list args;

    if (fails("asprintf", ENOMEM))
        return -1;
    va_start(args, format);
    int n = vasprintf(out, format, args);
    va_end(args);
    keep(n < 0 ? NULL : *out);
    return n;
}

int __wrap_open(const char *path, int flags, ...);
int __wrap_open(const char *path, int flags, ...)
{
    va_list args;

    if (fails("open", EMFILE))
        return -1;
    va_start(args, flags);
    mode_t mode = flags & O_CREAT ? va_arg(args, mode_t) : 0;
    va_end(args);
    return openat(AT_FDCWD, path, flags, mode);
}

/* What is closed is closed, and may not have reached the disk. */
#define CLOSING(name, type, failure)                                                     \
    int __real_##name(type what);                                                        \
    int __wrap_##name(type what);                                                        \
    int __wrap_##name(type what)                                                         \
    {                                                                                    \
        bool now = fails(#name, EIO);                                                    \
        int result = __real_##name(what);                                                \
        if (now)                                                                         \
            errno = EIO;                                                                 \
        return now ? (failure) : result;                                                 \
    }

CLOSING(close, int, -1)
CLOSING(fclose, FILE *, EOF)

INSTEAD(FILE *, fopen, (const char *path, const char *mode), (path, mode), EMFILE, NULL)
INSTEAD(size_t, fread, (void *p, size_t size, size_t n, FILE *f), (p, size, n, f), EIO, 0)
INSTEAD(int, fflush, (FILE * f), (f), ENOSPC, EOF)
INSTEAD(FILE *, fdopen, (int fd, const char *mode), (fd, mode), EMFILE, NULL)
INSTEAD(FILE *, open_memstream, (char **text, size_t *size), (text, size), ENOMEM, NULL)

/* A stream remembers that it failed.  What is said to a person is not kept from him. */
static bool stream_fails(const char *what, FILE *f)
{
    if (f == stderr || !fails(what, ENOSPC))
        return false;
    f->_flags |= _IO_ERR_SEEN;
    return true;
}

#define STREAM(type, name, arguments, passed, f, failure)                                \
    type __real_##name arguments;                                                        \
    type __wrap_##name arguments;                                                        \
    type __wrap_##name arguments                                                         \
    {                                                                                    \
        return stream_fails(#name, f) ? (failure) : __real_##name passed;                \
    }

STREAM(size_t, fwrite, (const void *p, size_t size, size_t n, FILE *f), (p, size, n, f),
       f, 0)
STREAM(int, fputs, (const char *text, FILE *f), (text, f), f, EOF)
STREAM(int, puts, (const char *text), (text), stdout, EOF)
STREAM(int, fputc, (int c, FILE *f), (c, f), f, EOF)
STREAM(int, putc, (int c, FILE *f), (c, f), f, EOF)
STREAM(int, putchar, (int c), (c), stdout, EOF)
STREAM(int, vfprintf, (FILE * f, const char *format, va_list args), (f, format, args), f,
       -1)

int __wrap_fprintf(FILE *f, const char *format, ...);
int __wrap_fprintf(FILE *f, const char *format, ...)
{
    va_list args;

    va_start(args, format);
    int n = stream_fails("fprintf", f) ? -1 : vfprintf(f, format, args);
    va_end(args);
    return n;
}

int __wrap_printf(const char *format, ...);
int __wrap_printf(const char *format, ...)
{
    va_list args;

    va_start(args, format);
    int n = stream_fails("printf", stdout) ? -1 : vfprintf(stdout, format, args);
    va_end(args);
    return n;
}

/* Of files and pipes: to wake a thread by an eventfd, which is neither, does not fail. */
ssize_t __real_write(int fd, const void *p, size_t n);
ssize_t __wrap_write(int fd, const void *p, size_t n);
ssize_t __wrap_write(int fd, const void *p, size_t n)
{
    struct stat st;
    bool wakes = !fstatat(fd, "", &st, AT_EMPTY_PATH) && !(st.st_mode & S_IFMT);

    return !wakes && fails("write", ENOSPC) ? -1 : __real_write(fd, p, n);
}
INSTEAD(ssize_t, pwrite, (int fd, const void *p, size_t n, off_t at), (fd, p, n, at),
        ENOSPC, -1)
INSTEAD(ssize_t, pread, (int fd, void *p, size_t n, off_t at), (fd, p, n, at), EIO, -1)
INSTEAD(int, mkostemp, (char *path, int flags), (path, flags), ENOSPC, -1)

/* A test needs nothing on the disk. */
int __wrap_fsync(int fd);
int __wrap_fsync(int fd)
{
    (void)fd;
    return fails("fsync", EIO) ? -1 : 0;
}

int __wrap_fdatasync(int fd);
int __wrap_fdatasync(int fd)
{
    (void)fd;
    return fails("fdatasync", EIO) ? -1 : 0;
}

INSTEAD(int, ftruncate, (int fd, off_t size), (fd, size), EIO, -1)
INSTEAD(int, fallocate, (int fd, int mode, off_t at, off_t n), (fd, mode, at, n), ENOSPC,
        -1)
INSTEAD(int, rename, (const char *from, const char *to), (from, to), EACCES, -1)
INSTEAD(int, renameat2,
        (int of, const char *from, int in, const char *to, unsigned flags),
        (of, from, in, to, flags), EACCES, -1)
INSTEAD(int, flock, (int fd, int what), (fd, what), ENOLCK, -1)
INSTEAD(int, chmod, (const char *path, mode_t mode), (path, mode), EPERM, -1)
INSTEAD(int, fchmod, (int fd, mode_t mode), (fd, mode), EPERM, -1)
INSTEAD(char *, mkdtemp, (char *path), (path), ENOSPC, NULL)
INSTEAD(void *, opendir, (const char *path), (path), EMFILE, NULL)
INSTEAD(int, scandir, (const char *path, void *list, void *choose, void *compare),
        (path, list, choose, compare), EMFILE, -1)
INSTEAD(char *, realpath, (const char *path, char *out), (path, out), EACCES, NULL)
INSTEAD(int, mkdir, (const char *path, mode_t mode), (path, mode), EACCES, -1)
INSTEAD(int, fstat, (int fd, struct stat *st), (fd, st), EIO, -1)
INSTEAD(int, pipe2, (int fds[2], int flags), (fds, flags), EMFILE, -1)
INSTEAD(int, eventfd, (unsigned n, int flags), (n, flags), EMFILE, -1)
INSTEAD(int, signalfd, (int fd, const void *set, int flags), (fd, set, flags), EMFILE, -1)
/* The environment keeps what was ever in it. */
int __real_setenv(const char *name, const char *value, int over);
int __wrap_setenv(const char *name, const char *value, int over);
int __wrap_setenv(const char *name, const char *value, int over)
{
    if (fails("setenv", ENOMEM))
        return -1;
    lasting = true;
    int result = __real_setenv(name, value, over);
    lasting = false;
    return result;
}
INSTEAD(int, inotify_init1, (int flags), (flags), EMFILE, -1)
INSTEAD(int, inotify_add_watch, (int fd, const char *path, uint32_t events),
        (fd, path, events), ENOSPC, -1)
INSTEAD(int, timerfd_create, (int clock, int flags), (clock, flags), EMFILE, -1)
INSTEAD(int, socket, (int domain, int type, int protocol), (domain, type, protocol),
        EMFILE, -1)
INSTEAD(int, bind, (int fd, const void *to, unsigned size), (fd, to, size), EADDRINUSE,
        -1)
INSTEAD(int, listen, (int fd, int n), (fd, n), EADDRINUSE, -1)
INSTEAD(ssize_t, send, (int fd, const void *p, size_t n, int flags), (fd, p, n, flags),
        ENOBUFS, -1)
INSTEAD(int, posix_spawn,
        (void *pid, const char *path, const void *files, const void *attributes,
         char *const *argv, char *const *environment),
        (pid, path, files, attributes, argv, environment), EAGAIN, EAGAIN)

INSTEAD(int, pthread_create,
        (pthread_t * thread, const void *attributes, void *(*run)(void *),
         void *argument),
        (thread, attributes, run, argument), EAGAIN, EAGAIN)

/* -- the bus, where it is linked
 * ---------------------------------------------------------
 */

/* What the C library takes for them is theirs: without it they end the process. */
#define BUS(type, name, arguments, passed, number, failure)                              \
    type __real_##name arguments __attribute__((weak));                                  \
    type __wrap_##name arguments;                                                        \
    type __wrap_##name arguments                                                         \
    {                                                                                    \
        if (fails(#name, number))                                                        \
            return failure;                                                              \
        lasting = true;                                                                  \
        type result = __real_##name passed;                                              \
        lasting = false;                                                                 \
        return result;                                                                   \
    }

BUS(int, nn_socket, (int domain, int protocol), (domain, protocol), EMFILE, -1)
BUS(int, nn_bind, (int s, const char *to), (s, to), EADDRINUSE, -1)
BUS(int, nn_connect, (int s, const char *to), (s, to), EMFILE, -1)
BUS(int, nn_setsockopt, (int s, int level, int what, const void *p, size_t n),
    (s, level, what, p, n), EINVAL, -1)
BUS(int, nn_getsockopt, (int s, int level, int what, void *p, size_t *n),
    (s, level, what, p, n), EINVAL, -1)
BUS(void *, nn_allocmsg, (size_t n, int type), (n, type), ENOMEM, NULL)
BUS(int, nn_send, (int s, const void *p, size_t n, int flags), (s, p, n, flags), EAGAIN,
    -1)
BUS(void *, zmq_ctx_new, (void), (), EMFILE, NULL)
BUS(void *, zmq_socket, (void *context, int type), (context, type), EMFILE, NULL)
BUS(int, zmq_bind, (void *s, const char *to), (s, to), EADDRINUSE, -1)
BUS(int, zmq_connect, (void *s, const char *to), (s, to), EMFILE, -1)
BUS(int, zmq_setsockopt, (void *s, int what, const void *p, size_t n), (s, what, p, n),
    EINVAL, -1)
BUS(int, zmq_getsockopt, (void *s, int what, void *p, size_t *n), (s, what, p, n), EINVAL,
    -1)
BUS(int, zmq_socket_monitor, (void *s, const char *at, int events), (s, at, events),
    EMFILE, -1)
BUS(int, zmq_send, (void *s, const void *p, size_t n, int flags), (s, p, n, flags),
    EAGAIN, -1)
BUS(int, zmq_msg_send, (void *m, void *s, int flags), (m, s, flags), EAGAIN, -1)

/* -- FFTW, where it is linked: plans are memory too
 * --------------------------------------
 */

#define FFTW_MEMORY(name, arguments, passed)                                             \
    void *__real_##name arguments __attribute__((weak));                                 \
    MEMORY(name, arguments, passed)

#define FFTW_RELEASE(name)                                                               \
    void __real_##name(void *p) __attribute__((weak));                                   \
    void __wrap_##name(void *p);                                                         \
    void __wrap_##name(void *p)                                                          \
    {                                                                                    \
        forget(p);                                                                       \
        __real_##name(p);                                                                \
    }

FFTW_MEMORY(fftwf_malloc, (size_t size), (size))
FFTW_MEMORY(fftwf_alloc_complex, (size_t n), (n))
FFTW_MEMORY(fftwf_plan_dft_1d, (int n, void *in, void *out, int sign, unsigned flags),
            (n, in, out, sign, flags))
FFTW_MEMORY(fftwf_plan_dft_c2r_1d, (int n, void *in, void *out, unsigned flags),
            (n, in, out, flags))
FFTW_MEMORY(fftwf_plan_dft_r2c_1d, (int n, void *in, void *out, unsigned flags),
            (n, in, out, flags))
FFTW_MEMORY(fftwf_plan_many_dft,
            (int rank, const int *n, int many, void *in, const int *inembed, int istride,
             int idist, void *out, const int *onembed, int ostride, int odist, int sign,
             unsigned flags),
            (rank, n, many, in, inembed, istride, idist, out, onembed, ostride, odist,
             sign, flags))
FFTW_MEMORY(fftwf_plan_many_dft_c2r,
            (int rank, const int *n, int many, void *in, const int *inembed, int istride,
             int idist, void *out, const int *onembed, int ostride, int odist,
             unsigned flags),
            (rank, n, many, in, inembed, istride, idist, out, onembed, ostride, odist,
             flags))
FFTW_MEMORY(fftwf_plan_many_dft_r2c,
            (int rank, const int *n, int many, void *in, const int *inembed, int istride,
             int idist, void *out, const int *onembed, int ostride, int odist,
             unsigned flags),
            (rank, n, many, in, inembed, istride, idist, out, onembed, ostride, odist,
             flags))
FFTW_RELEASE(fftwf_free)
FFTW_RELEASE(fftwf_destroy_plan)

/* -- what libraries take on our behalf: those that say so when there is none.  nanomsg
 * and C++ end the process instead, libsndfile crashes.  With AddressSanitizer the
 * allocator is its own
 * ---------------------------------------------------------------------------------------
 */

#ifdef __has_feature
#if __has_feature(address_sanitizer)
#define __SANITIZE_ADDRESS__ 1
#endif
#endif
#ifndef __SANITIZE_ADDRESS__

enum { MAX_LIBRARIES = 16 };

static struct library {
    uintptr_t from, to; /* its code */
    bool loses;         /* memory of its own, when there is no more */
    char what[64];
} libraries[MAX_LIBRARIES];
static size_t n_libraries;

/* One of ours: its code, and how its calls are named. */
static int find_code(struct dl_phdr_info *info, size_t size, void *context)
{
    static const char *const names[] = {"libc.so",     "libprotobuf-c.", "libyaml-",
                                        "libcyaml.",   "libzstd.",       "liblz4.",
                                        "libjansson.", "libdeflate."};
    const char *slash = strrchr(info->dlpi_name, '/');
    const char *name = slash ? slash + 1 : info->dlpi_name;

    (void)size;
    (void)context;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        if (strncmp(name, names[i], strlen(names[i])))
            continue;
        for (int k = 0; k < info->dlpi_phnum && n_libraries < MAX_LIBRARIES; k++) {
            const ElfW(Phdr) *part = &info->dlpi_phdr[k];
            struct library *l = &libraries[n_libraries];
            if (part->p_type != PT_LOAD || !(part->p_flags & PF_X))
                continue;
            l->from = info->dlpi_addr + part->p_vaddr;
            l->to = l->from + part->p_memsz;
            l->loses = !strcmp(names[i], "libyaml-");
            snprintf(l->what, sizeof l->what, "memory for %.40s", name);
            n_libraries++;
        }
    }
    return 0;
}

static void find_libraries(void)
{
    if (n_libraries)
        return;
    tzset(); /* what the C library keeps of it is nobody's leak */
    dl_iterate_phdr(find_code, NULL);
}

/* NULL: not called by any of them. */
static const struct library *library_of(const void *caller)
{
    for (size_t i = 0; counting && working && !lasting && i < n_libraries; i++)
        if ((uintptr_t)caller - libraries[i].from < libraries[i].to - libraries[i].from)
            return &libraries[i];
    return NULL;
}

#define LIBRARY_MEMORY(name, arguments, passed)                                          \
    void *__libc_##name arguments;                                                       \
    void *name arguments                                                                 \
    {                                                                                    \
        const struct library *of = library_of(__builtin_return_address(0));              \
                                                                                         \
        if (of && fails(of->what, ENOMEM))                                               \
            return NULL;                                                                 \
        void *p = __libc_##name passed;                                                  \
        return of && !of->loses ? keep(p) : p;                                           \
    }

LIBRARY_MEMORY(malloc, (size_t size), (size))
LIBRARY_MEMORY(calloc, (size_t n, size_t size), (n, size))

void *__libc_realloc(void *p, size_t size);
void *realloc(void *p, size_t size)
{
    const struct library *of = library_of(__builtin_return_address(0));

    if (of && fails(of->what, ENOMEM))
        return NULL;
    forget(p);
    p = __libc_realloc(p, size);
    return of && !of->loses ? keep(p) : p;
}

void __libc_free(void *p);
void free(void *p)
{
    forget(p);
    __libc_free(p);
}

static size_t count_left(void)
{
    return n_live;
}

#else

static void find_libraries(void)
{
}

/* What libraries free of ours is not seen: LeakSanitizer has the last word at the end. */
static size_t count_left(void)
{
    return 0;
}

#endif

/* -- one run after the other
 * -------------------------------------------------------------
 */

static size_t count_descriptors(void)
{
    DIR *folder = opendir("/proc/self/fd");
    size_t n = 0;

    assert_non_null(folder);
    while (readdir(folder))
        n++;
    closedir(folder);
    return n;
}

static void begin(size_t this_turn)
{
    find_libraries();
    working = true;
    pthread_mutex_lock(&mutex);
    turn = this_turn;
    calls = n_live = 0;
    failed = NULL;
    memset(live, 0, sizeof live);
    counting = true;
    pthread_mutex_unlock(&mutex);
}

static void end(void)
{
    pthread_mutex_lock(&mutex);
    counting = false;
    pthread_mutex_unlock(&mutex);
}

/* The first time nothing fails: what is made once, and stays, is no leak. */
size_t failing_each(const struct failing_work *work)
{
    for (size_t n = 0;; n++) {
        struct error why = {""};
        size_t descriptors = count_descriptors();
        begin(n);
        int err = work->run(work->context, &why);
        end();
        const char *what = failed ? failed : "none";
        if (getenv("FAILING_VERBOSE")) /* for where an assertion of the work fails */
            print_message("%s, call %zu (%s): %s\n", work->name, n, what,
                          err ? why.text : "done");
        if (n && (count_left() || count_descriptors() != descriptors))
            fail_msg("%s, where call %zu fails (%s): %zu blocks of memory and %zd "
                     "descriptors are left behind",
                     work->name, n, what, count_left(),
                     (ssize_t)count_descriptors() - (ssize_t)descriptors);
        if (err && (work->wordless ? err != -ENOMEM : !strchr(why.text, ' ')))
            fail_msg("%s, where call %zu fails (%s): %s, without a sentence: \"%s\"",
                     work->name, n, what, strerror(-err), why.text);
        if (err && !failed)
            fail_msg("%s: %s, though nothing failed", work->name, why.text);
        if (work->check)
            work->check(work->context, err);
        if (n && !failed)
            return calls;
    }
}
