/* hal/can/log.c -- a file in the format of `candump -L` (can-utils, lib.c). */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/can/backends.h"
#include "hal/device.h"

enum { INTERFACE_SIZE = 16 }; /* IFNAMSIZ */

struct canbus_log {
    FILE *file;
    char interface[INTERFACE_SIZE];
};

static int log_open(void **state, const char *arg, struct complaint *why)
{
    static const char *const known[] = {"interface", NULL};
    struct device d;
    int err = device_parse(&d, arg, known, why);
    if (err)
        return err;
    struct canbus_log *l = calloc(1, sizeof *l);
    const char *interface = device_option(&d, "interface");
    if (!l) {
        err = complain(why, -ENOMEM, "out of memory");
        goto device;
    }
    if (!interface)
        interface = "can0";
    if (!*interface || strlen(interface) >= INTERFACE_SIZE ||
        strpbrk(interface, " /\t")) {
        err = complain(why, -EINVAL, "interface \"%s\": expected a name of 1..%d letters",
                       interface, INTERFACE_SIZE - 1);
        goto log;
    }
    strcpy(l->interface, interface);
    if (!*d.path) {
        err = complain(why, -EINVAL, "expected the name of a file, log:out.candump");
        goto log;
    }
    l->file = fopen(d.path, "we");
    if (!l->file) {
        err = complain(why, -errno, "%s cannot be written: %s", d.path, strerror(errno));
        goto log;
    }
    *state = l;
    l = NULL;
log:
    free(l);
device:
    device_clear(&d);
    return err;
}

/* "##" and the flags of an FD frame; 1: its data goes at the second bit rate. */
static int log_send(void *state, const struct can_frame_data *f, int64_t stamp_ns)
{
    struct canbus_log *l = state;
    char line[200], *p = line;
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
        return errno ? -errno : -EIO;
    return 0;
}

static int log_flush(void *state)
{
    struct canbus_log *l = state;
    return fflush(l->file) ? -errno : 0;
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
                                          .send = log_send,
                                          .flush = log_flush,
                                          .close = log_close};
