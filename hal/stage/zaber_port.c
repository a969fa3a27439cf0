/* SPDX-License-Identifier: MIT */
#include "hal/stage/zaber_port.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "hal/clock.h"

/* Lines of text over a serial port: 8 data bits, no parity, one stop bit, no flow
 * control. */

enum { SERIAL_LINE_SIZE = 128 };

#define WRITE_MS 1000

struct serial {
    int fd;
    char line[SERIAL_LINE_SIZE];
    size_t n;
    bool too_long;
    char bytes[64]; /* read and not looked at yet */
    size_t next, end;
};

static speed_t speed_of(unsigned baud)
{
    switch (baud) {
    case 9600:
        return B9600;
    case 19200:
        return B19200;
    case 38400:
        return B38400;
    case 57600:
        return B57600;
    case 115200:
        return B115200;
    default:
        return B0;
    }
}

static int set_up(int fd, speed_t speed)
{
    struct termios t;

    if (ioctl(fd, TIOCEXCL) || tcgetattr(fd, &t))
        return -errno;
    cfmakeraw(&t);
    t.c_cflag &= ~(tcflag_t)(CSTOPB | PARENB | CRTSCTS | CSIZE);
    t.c_cflag |= CS8 | CLOCAL | CREAD;
    t.c_cc[VMIN] = 0;
    t.c_cc[VTIME] = 0;
    if (cfsetispeed(&t, speed) || cfsetospeed(&t, speed) || tcsetattr(fd, TCSANOW, &t))
        return -errno;
    return tcflush(fd, TCIOFLUSH) ? -errno : 0;
}

static void serial_close(struct serial *s)
{
    if (!s)
        return;
    if (s->fd >= 0)
        close(s->fd);
    free(s);
}

/* Takes the port for itself.  baud: 9600, 19200, 38400, 57600 or 115200.  0, -EINVAL,
 * -ENOENT, -EACCES, -EBUSY, -ENOTTY, other -errno. */
static int serial_open(struct serial **out, const char *path, unsigned baud,
                       struct error *why)
{
    speed_t speed = speed_of(baud);

    if (speed == B0)
        return error_say(why, -EINVAL,
                         "%u baud: expected 9600, 19200, 38400, 57600 or 115200", baud);
    struct serial *s = calloc(1, sizeof *s);
    if (!s)
        return error_say(why, -ENOMEM, "out of memory");
    s->fd = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
    int err = s->fd < 0 ? -errno : set_up(s->fd, speed);
    if (!err) {
        *out = s;
        return 0;
    }
    serial_close(s);
    if (err == -ENOTTY)
        return error_say(why, err, "%s: is no serial port", path);
    if (err == -EACCES)
        return error_say(why, err, "%s: may not be used: its group is usually dialout",
                         path);
    return error_say(why, err, "%s: %s", path, strerror(-err));
}

/* Until the port is ready for `events`.  0, -ETIMEDOUT, -ENODEV. */
static int wait_for(const struct serial *s, short events, int64_t deadline_ns)
{
    for (;;) {
        struct pollfd p = {.fd = s->fd, .events = events};
        int64_t left_ms = (deadline_ns - clock_monotonic_ns() + 999999) / 1000000;
        int n = poll(&p, 1, left_ms > 0 ? (int)left_ms : 0);
        if (n < 0 && errno != EINTR)
            return -errno;
        if (n > 0 && (p.revents & events))
            return 0;
        if (n > 0)
            return -ENODEV;
        if (clock_monotonic_ns() >= deadline_ns)
            return -ETIMEDOUT;
    }
}

/* 0, -EIO, -ENODEV (unplugged), -ETIMEDOUT (the other end takes nothing). */
static int serial_write(struct serial *s, const char *text, size_t n)
{
    int64_t deadline_ns = clock_monotonic_ns() + WRITE_MS * INT64_C(1000000);

    while (n) {
        int err = wait_for(s, POLLOUT, deadline_ns);
        if (err)
            return err;
        ssize_t written = write(s->fd, text, n);
        if (written < 0 && errno != EAGAIN && errno != EINTR)
            return -errno;
        if (written > 0) {
            text += written;
            n -= (size_t)written;
        }
    }
    return 0;
}

/* An end of file is an unplugged adapter. */
static int fill(struct serial *s, int64_t deadline_ns)
{
    int err = wait_for(s, POLLIN, deadline_ns);

    if (err)
        return err;
    ssize_t n = read(s->fd, s->bytes, sizeof s->bytes);
    if (n == 0)
        return -ENODEV;
    if (n < 0)
        return errno == EAGAIN || errno == EINTR ? 0 : -errno;
    s->next = 0;
    s->end = (size_t)n;
    return 0;
}

/* Takes a byte into the line.  1: the line is whole; -EMSGSIZE: it was too long. */
static int take(struct serial *s, char c)
{
    bool too_long = s->too_long;

    if (c != '\r' && c != '\n') {
        if (s->n + 1 < sizeof s->line)
            s->line[s->n++] = c >= ' ' && c <= '~' ? c : '?';
        else
            s->too_long = true;
        return 0;
    }
    if (!s->n)
        return 0;
    s->line[s->n] = '\0';
    s->n = 0;
    s->too_long = false;
    return too_long ? -EMSGSIZE : 1;
}

/* The next line without its end (CR, LF or both); empty ones are ignored, bytes that
 * are no printable text become '?'.  deadline_ns of CLOCK_MONOTONIC.  0, -ETIMEDOUT (what
 * came of the line is kept), -EMSGSIZE (a longer one: it is dropped), -EIO, -ENODEV. */
static int serial_read_line(struct serial *s, char line[SERIAL_LINE_SIZE],
                            int64_t deadline_ns)
{
    for (;;) {
        while (s->next < s->end) {
            int whole = take(s, s->bytes[s->next++]);
            if (whole < 0)
                return whole;
            if (whole) {
                memcpy(line, s->line, sizeof s->line);
                return 0;
            }
        }
        int err = fill(s, deadline_ns);
        if (err)
            return err;
    }
}

enum { TRIES = 3, N_IDS = 100 };

int zaber_port_open(struct zaber_port *p, const struct zaber_port_config *cfg,
                    struct error *why)
{
    p->cfg = *cfg;
    return serial_open(&p->serial, cfg->path, cfg->baud, why);
}

int zaber_port_reopen(struct zaber_port *p)
{
    struct error why = {.text = ""};

    if (p->serial)
        return 0;
    int err = serial_open(&p->serial, p->cfg.path, p->cfg.baud, &why);
    if (!err)
        p->reopened++;
    return err;
}

static int send(struct zaber_port *p, const char *command)
{
    char text[ZABER_COMMAND_SIZE];
    bool checksum = p->cfg.checksum == ZABER_CHECKSUM_ON ||
                    (p->cfg.checksum == ZABER_CHECKSUM_AUTO && p->checksums);

    p->id = (p->id + 1) % N_IDS;
    int n = zaber_format(text, p->cfg.device, p->cfg.axis, p->id, command, checksum);
    return n < 0 ? n : serial_write(p->serial, text, (size_t)n);
}

/* Is the line the answer?  What is not is counted. */
static bool is_answer(struct zaber_port *p, struct zaber_message *m, const char *line)
{
    int err = zaber_parse(m, line);
    bool lacks = !err && !m->has_checksum && p->cfg.checksum == ZABER_CHECKSUM_ON;

    if (err == -EILSEQ || lacks) {
        p->checksum_errors++;
        return false;
    }
    if (err) {
        p->garbled++;
        return false;
    }
    if (m->device != p->cfg.device || m->kind != ZABER_REPLY)
        return false;
    if (m->id != p->id) {
        p->stale++;
        return false;
    }
    p->checksums = m->has_checksum;
    return true;
}

static int await(struct zaber_port *p, double timeout_s, struct zaber_message *reply)
{
    int64_t deadline_ns = clock_monotonic_ns() + (int64_t)(1e9 * timeout_s);
    char line[SERIAL_LINE_SIZE];

    for (;;) {
        int err = serial_read_line(p->serial, line, deadline_ns);
        if (err == -EMSGSIZE)
            p->garbled++;
        else if (err)
            return err;
        else if (is_answer(p, reply, line))
            return 0;
    }
}

static void lose(struct zaber_port *p)
{
    serial_close(p->serial);
    p->serial = NULL;
}

int zaber_port_ask(struct zaber_port *p, struct zaber_message *reply, const char *format,
                   ...)
{
    char command[ZABER_COMMAND_SIZE];
    va_list args;
    int err = -ENODEV;

    va_start(args, format);
    vsnprintf(command, sizeof command, format, args);
    va_end(args);
    /* Twice as long each time: it may be this machine that is late. */
    for (int i = 0; i < TRIES && p->serial; i++) {
        p->retries += i > 0;
        err = send(p, command);
        if (!err)
            err = await(p, ldexp(p->cfg.timeout_s, i), reply);
        if (!err)
            return reply->accepted ? 0 : -EPROTO;
        if (err != -ETIMEDOUT)
            lose(p);
    }
    return err;
}

void zaber_port_shout(struct zaber_port *p, const char *command)
{
    if (p->serial && send(p, command))
        lose(p);
}

void zaber_port_close(struct zaber_port *p)
{
    if (p->serial)
        lose(p);
}

const char *const stage_zaber_option_keys[] = {
    "pitch_mm", "steps",  "resolution", "device", "axis",   "baud", "timeout",
    "checksum", "settle", "min",        "max",    "homing", NULL};

static int read_numbers(struct stage_zaber_options *o, const struct device *d,
                        struct error *why)
{
    double device = 1, axis = 1, baud = 115200;
    struct {
        const char *key;
        double min, max, *value;
    } numbers[] = {
        {"pitch_mm", 1e-3, 1000, &o->pitch_mm},
        {"steps", 1, 10000, &o->steps},
        {"resolution", 1, 1024, &o->resolution},
        {"settle", 0, 60, &o->settle_s},
        {"min", -100, 100, &o->min_m},
        {"max", -100, 100, &o->max_m},
        {"timeout", 0.01, 10, &o->port.timeout_s},
        {"device", 1, 99, &device},
        {"axis", 1, 9, &axis},
        {"baud", 9600, 115200, &baud},
    };

    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        int err = device_number(d, numbers[i].key, numbers[i].min, numbers[i].max,
                                numbers[i].value, why);
        if (err)
            return err;
    }
    o->port.device = (unsigned)device;
    o->port.axis = (unsigned)axis;
    o->port.baud = (unsigned)baud;
    return 0;
}

int stage_zaber_options_read(struct stage_zaber_options *o, const struct device *d,
                             struct error *why)
{
    static const char *const checksums[] = {"auto", "on", "off", NULL};
    static const char *const homings[] = {"first-move", "manual", NULL};

    *o = (struct stage_zaber_options){.port = {.path = d->path, .timeout_s = 0.3},
                                      .steps = 200,
                                      .settle_s = 0.15,
                                      .min_m = -INFINITY,
                                      .max_m = INFINITY};
    if (!*d->path)
        return error_say(why, -EINVAL,
                         "no serial port is named; expected "
                         "zaber:/dev/ttyUSB0?pitch_mm=...");
    if (!device_option(d, "pitch_mm"))
        return error_say(why, -EINVAL,
                         "option pitch_mm is missing: the travel of a turn of the motor "
                         "in mm, from the stage's data sheet");
    int err = read_numbers(o, d, why);
    int checksum = err ? err : device_choice(d, "checksum", checksums, why);
    int homing = checksum < 0 ? checksum : device_choice(d, "homing", homings, why);
    if (homing < 0)
        return homing;
    o->port.checksum = (enum zaber_checksum)checksum;
    o->home_first = homing == 0;
    if (o->min_m >= o->max_m)
        return error_say(why, -EINVAL, "option min=%g is not under max=%g", o->min_m,
                         o->max_m);
    return 0;
}
