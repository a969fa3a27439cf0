/* SPDX-License-Identifier: MIT */
#include "tests/failing.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>

#include <cmocka.h>

enum { MAX_LIVE = 1 << 14 };

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static bool counting;
static size_t calls, turn; /* the turn-th call fails */
static const char *failed; /* what it was; NULL: its turn did not come */
static void *live[MAX_LIVE];
static size_t n_live;

/* Is it the turn of this call? */
static bool fails(const char *what, int number)
{
    pthread_mutex_lock(&mutex);
    bool now = counting && ++calls == turn;
    if (now)
        failed = what;
    pthread_mutex_unlock(&mutex);
    if (now)
        errno = number;
    return now;
}

static void *keep(void *p)
{
    pthread_mutex_lock(&mutex);
    if (counting && p) {
        if (n_live == MAX_LIVE)
            abort();
        live[n_live++] = p;
    }
    pthread_mutex_unlock(&mutex);
    return p;
}

static void forget(const void *p)
{
    pthread_mutex_lock(&mutex);
    for (size_t i = n_live; p && i-- > 0;) {
        if (live[i] == p) {
            live[i] = live[--n_live];
            break;
        }
    }
    pthread_mutex_unlock(&mutex);
}

/* -- in the place of the real ones
 * -------------------------------------------------------
 */

#define INSTEAD(type, name, arguments, passed, number, failure)                          \
    type __real_##name arguments;                                                        \
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
INSTEAD(size_t, fwrite, (const void *p, size_t size, size_t n, FILE *f), (p, size, n, f),
        ENOSPC, 0)
INSTEAD(size_t, fread, (void *p, size_t size, size_t n, FILE *f), (p, size, n, f), EIO, 0)
INSTEAD(int, fflush, (FILE * f), (f), ENOSPC, EOF)

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
INSTEAD(int, fsync, (int fd), (fd), EIO, -1)
INSTEAD(int, fdatasync, (int fd), (fd), EIO, -1)
INSTEAD(int, ftruncate, (int fd, off_t size), (fd, size), EIO, -1)
INSTEAD(int, fallocate, (int fd, int mode, off_t at, off_t n), (fd, mode, at, n), ENOSPC,
        -1)
INSTEAD(int, rename, (const char *from, const char *to), (from, to), EACCES, -1)
INSTEAD(int, mkdir, (const char *path, mode_t mode), (path, mode), EACCES, -1)
INSTEAD(int, fstat, (int fd, struct stat *st), (fd, st), EIO, -1)
INSTEAD(int, pipe2, (int fds[2], int flags), (fds, flags), EMFILE, -1)
INSTEAD(int, eventfd, (unsigned n, int flags), (n, flags), EMFILE, -1)
INSTEAD(int, signalfd, (int fd, const void *set, int flags), (fd, set, flags), EMFILE, -1)
INSTEAD(int, posix_spawn,
        (void *pid, const char *path, const void *files, const void *attributes,
         char *const *argv, char *const *environment),
        (pid, path, files, attributes, argv, environment), EAGAIN, EAGAIN)

INSTEAD(int, pthread_create,
        (pthread_t * thread, const void *attributes, void *(*run)(void *),
         void *argument),
        (thread, attributes, run, argument), EAGAIN, EAGAIN)

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
    pthread_mutex_lock(&mutex);
    turn = this_turn;
    calls = n_live = 0;
    failed = NULL;
    counting = true;
    pthread_mutex_unlock(&mutex);
}

static void end(void)
{
    pthread_mutex_lock(&mutex);
    counting = false;
    pthread_mutex_unlock(&mutex);
}

size_t failing_each(const struct failing_work *work)
{
    for (size_t n = 1;; n++) {
        struct error why = {""};
        size_t descriptors = count_descriptors();
        begin(n);
        int err = work->run(work->context, &why);
        end();
        const char *what = failed ? failed : "none";
        if (n_live || count_descriptors() != descriptors)
            fail_msg("%s, where call %zu fails (%s): %zu blocks of memory and %zd "
                     "descriptors are left behind",
                     work->name, n, what, n_live,
                     (ssize_t)count_descriptors() - (ssize_t)descriptors);
        if (err && (work->wordless ? err != -ENOMEM : !strchr(why.text, ' ')))
            fail_msg("%s, where call %zu fails (%s): %s, without a sentence: \"%s\"",
                     work->name, n, what, strerror(-err), why.text);
        if (err && !failed)
            fail_msg("%s: %s, though nothing failed", work->name, why.text);
        if (work->check)
            work->check(work->context, err);
        if (!failed)
            return calls;
    }
}
