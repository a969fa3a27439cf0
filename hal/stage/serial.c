#include "hal/stage/serial.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define WRITE_MS 1000

struct serial {
    int fd;
    char line[SERIAL_LINE_SIZE];
    size_t n;
    bool too_long;
    char bytes[64]; /* read and not looked at yet */
    size_t next, end;
};

int64_t serial_now_ns(void)
{
    struct timespec t;

    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

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

int serial_open(struct serial **out, const char *path, unsigned baud,
                struct complaint *why)
{
    speed_t speed = speed_of(baud);

    if (speed == B0)
        return complain(why, -EINVAL,
                        "%u baud: expected 9600, 19200, 38400, 57600 or 115200", baud);
    struct serial *s = calloc(1, sizeof *s);
    if (!s)
        return complain(why, -ENOMEM, "out of memory");
    s->fd = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
    int err = s->fd < 0 ? -errno : set_up(s->fd, speed);
    if (!err) {
        *out = s;
        return 0;
    }
    serial_close(s);
    if (err == -ENOTTY)
        return complain(why, err, "%s: is no serial port", path);
    if (err == -EACCES)
        return complain(why, err, "%s: may not be used: its group is usually dialout",
                        path);
    return complain(why, err, "%s: %s", path, strerror(-err));
}

/* Until the port is ready for `events`.  0, -ETIMEDOUT, -ENODEV. */
static int wait_for(const struct serial *s, short events, int64_t deadline_ns)
{
    for (;;) {
        struct pollfd p = {.fd = s->fd, .events = events};
        int64_t left_ms = (deadline_ns - serial_now_ns() + 999999) / 1000000;
        int n = poll(&p, 1, left_ms > 0 ? (int)left_ms : 0);
        if (n < 0 && errno != EINTR)
            return -errno;
        if (n > 0 && (p.revents & events))
            return 0;
        if (n > 0)
            return -ENODEV;
        if (serial_now_ns() >= deadline_ns)
            return -ETIMEDOUT;
    }
}

int serial_write(struct serial *s, const char *text, size_t n)
{
    int64_t deadline_ns = serial_now_ns() + WRITE_MS * INT64_C(1000000);

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

int serial_read_line(struct serial *s, char line[SERIAL_LINE_SIZE], int64_t deadline_ns)
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

void serial_close(struct serial *s)
{
    if (!s)
        return;
    if (s->fd >= 0)
        close(s->fd);
    free(s);
}
