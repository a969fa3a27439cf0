/* SPDX-License-Identifier: MIT */
/* hal/can/log.c -- a file in the format of `candump -L` (can-utils, lib.c). */
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdio_ext.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "hal/canbus.h"
#include "hal/device.h"

enum { INTERFACE_SIZE = 16 }; /* IFNAMSIZ */
enum { LINE_SIZE = 200 };

struct canbus_log {
    FILE *file;
    long whole; /* bytes on the disk, to the end of a line; under 0: it is no file */
    char interface[INTERFACE_SIZE];
};

/* Who was killed while he wrote may have left a part of a line, which is no frame. */
static int cut_part(FILE *f)
{
    char end[LINE_SIZE];
    long size = fseek(f, 0, SEEK_END) ? 0 : ftell(f);
    size_t n = size < (long)sizeof end ? (size_t)(size > 0 ? size : 0) : sizeof end, keep;

    if (!n) /* or a pipe */
        return 0;
    if (fseek(f, -(long)n, SEEK_END) || fread(end, 1, n, f) != n)
        return -1;
    for (keep = n; keep && end[keep - 1] != '\n'; keep--)
        ;
    return ftruncate(fileno(f), size - (long)(n - keep));
}

/* Never through a link, soft or hard, that somebody has put there to have another file
 * overwritten; /dev/stdout is one by nature. */
static int open_descriptor(const char *path, bool append)
{
    int links = strncmp(path, "/dev/", 5) ? O_NOFOLLOW : 0;
    int fd = open(path,
                  O_CREAT | O_CLOEXEC | links | (append ? O_RDWR | O_APPEND : O_WRONLY),
                  0666);
    struct stat st;
    if (fd < 0)
        return -1;
    int err = fstat(fd, &st)                                       ? errno
              : S_ISREG(st.st_mode) && st.st_nlink > 1             ? EMLINK
              : S_ISREG(st.st_mode) && !append && ftruncate(fd, 0) ? errno
                                                                   : 0;
    if (!err)
        return fd;
    close(fd);
    errno = err;
    return -1;
}

static FILE *open_file(const char *path, bool append)
{
    int fd = open_descriptor(path, append);
    FILE *f = fd < 0 ? NULL : fdopen(fd, append ? "a+" : "w");

    if (fd >= 0 && !f)
        close(fd);
    if (f && append && cut_part(f)) {
        fclose(f);
        return NULL;
    }
    return f;
}

static const char *explain(int error)
{
    return error == ELOOP ? "it is a link, which might lead to a file of somebody else: "
                            "remove it, or name the file itself"
           : error == EMLINK ? "it is one file under several names: remove it first"
                             : strerror(error);
}

/* What the options say.  Clear *d with device_clear, after an error too. */
static int read_arg(struct device *d, const char *arg, const char **interface,
                    bool *append, struct error *why)
{
    static const char *const known[] = {"interface", "append", NULL};
    static const char *const answers[] = {"no", "yes", NULL};
    int err = device_parse(d, arg, known, why);
    if (err)
        return err;
    *interface = device_option(d, "interface");
    if (!*interface)
        *interface = "can0";
    if (!**interface || strlen(*interface) >= INTERFACE_SIZE ||
        strpbrk(*interface, " /\t"))
        return error_say(why, -EINVAL,
                         "interface \"%s\": expected a name of 1..%d letters", *interface,
                         INTERFACE_SIZE - 1);
    int answer = device_choice(d, "append", answers, why);
    if (answer < 0)
        return answer;
    *append = answer;
    return *d->path
               ? 0
               : error_say(why, -EINVAL, "expected the name of a file, log:out.candump");
}

/* Nothing there is as good as a file that may be written; 0 or an errno. */
static int look_at_place(const char *path)
{
    struct stat st;
    if (lstat(path, &st))
        return errno == ENOENT ? 0 : errno;
    if (S_ISLNK(st.st_mode))
        return strncmp(path, "/dev/", 5) ? ELOOP : 0;
    return S_ISDIR(st.st_mode)                      ? EISDIR
           : S_ISREG(st.st_mode) && st.st_nlink > 1 ? EMLINK
           : access(path, W_OK)                     ? errno
                                                    : 0;
}

static int log_check(const char *arg, struct error *why)
{
    struct device d;
    const char *interface;
    bool append;
    int err = read_arg(&d, arg, &interface, &append, why);
    int in_the_way = err ? 0 : look_at_place(d.path);
    if (in_the_way)
        err = error_say(why, -in_the_way, "%s cannot be written: %s", d.path,
                        explain(in_the_way));
    device_clear(&d);
    return err;
}

static int log_open(void **state, const char *arg, struct error *why)
{
    struct device d;
    struct canbus_log *l = NULL;
    const char *interface;
    bool append;
    int err = read_arg(&d, arg, &interface, &append, why);
    if (err)
        goto log;
    l = calloc(1, sizeof *l);
    if (!l) {
        err = error_say(why, -ENOMEM, "out of memory");
        goto log;
    }
    strcpy(l->interface, interface);
    l->file = open_file(d.path, append);
    if (!l->file) {
        err = error_say(why, -errno, "%s cannot be written: %s", d.path, explain(errno));
        goto log;
    }
    l->whole = fseek(l->file, 0, SEEK_END) ? -1 : ftell(l->file);
    *state = l;
    l = NULL;
log:
    free(l);
    device_clear(&d);
    return err;
}

/* What a full disk did not take is gone, and the part of a line that it took: when there
 * is room again, the next line begins as one.  Returns err. */
static int give_up(struct canbus_log *l, int err)
{
    __fpurge(l->file);
    clearerr(l->file);
    if (l->whole >= 0 && !ftruncate(fileno(l->file), l->whole))
        fseek(l->file, 0, SEEK_END);
    return err;
}

/* "##" and the flags of an FD frame; 1: its data goes at the second bit rate. */
static int log_send(void *state, const struct can_frame_data *f, int64_t stamp_ns)
{
    struct canbus_log *l = state;
    char line[LINE_SIZE], *p = line;
    int64_t us = stamp_ns / 1000;
    p += sprintf(p, "(%010" PRId64 ".%06" PRId64 ") %s ", us / 1000000, us % 1000000,
                 l->interface);
    p += sprintf(p, f->id > 0x7ff ? "%08" PRIX32 "%s" : "%03" PRIX32 "%s", f->id,
                 f->fd ? "##1" : "#");
    for (size_t i = 0; i < f->size; i++)
        p += sprintf(p, "%02X", f->data[i]);
    *p++ = '\n';
    size_t n = (size_t)(p - line);
    errno = 0;
    if (fwrite(line, 1, n, l->file) != n)
        return give_up(l, errno ? -errno : -EIO);
    return 0;
}

static int log_flush(void *state)
{
    struct canbus_log *l = state;
    if (fflush(l->file))
        return give_up(l, -errno);
    if (l->whole >= 0)
        l->whole = ftell(l->file);
    return 0;
}

/* What close could still lose was flushed with the last list. */
static void log_close(void *state)
{
    struct canbus_log *l = state;
    fclose(l->file);
    free(l);
}

const struct canbus_ops canbus_log_ops = {.scheme = "log",
                                          .open = log_open,
                                          .check = log_check,
                                          .send = log_send,
                                          .flush = log_flush,
                                          .close = log_close};
