/* SPDX-License-Identifier: MIT */
#include "hal/stage/zaber.h"

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
#include "hal/stage.h"
#include "hal/stage/worker.h"
#include "hal/stage/zaber_message.h"

/* -- a serial port, and questions over it ----------------------------------------------
 */

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

/* Questions to the device and their answers.  Each has a message id, so that a late
 * answer is not taken for that of a later question; one that stays away or is garbled is
 * asked for again. */

enum { TRIES = 3, N_IDS = 100 };

struct zaber_port {
    struct zaber_port_config cfg;
    struct serial *serial; /* NULL: the port is gone */
    int id;
    bool checksums; /* the device sends them */
    _Atomic uint64_t retries, checksum_errors, garbled, stale, reopened;
};

/* 0, or as serial_open. */
static int zaber_port_open(struct zaber_port *p, const struct zaber_port_config *cfg,
                           struct error *why)
{
    p->cfg = *cfg;
    return serial_open(&p->serial, cfg->path, cfg->baud, why);
}

/* After the port was gone; else nothing.  0, or as serial_open. */
static int zaber_port_reopen(struct zaber_port *p)
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

/* Sends the command and waits for its answer, three times at most, twice as long each
 * time.  0, -EPROTO (rejected: reply->data has why), -ETIMEDOUT, -ENODEV and others: the
 * port is gone. */
__attribute__((format(printf, 3, 4))) static int
zaber_port_ask(struct zaber_port *p, struct zaber_message *reply, const char *format, ...)
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

/* Sends, and waits for nothing: for a last "stop". */
static void zaber_port_shout(struct zaber_port *p, const char *command)
{
    if (p->serial && send(p, command))
        lose(p);
}

static void zaber_port_close(struct zaber_port *p)
{
    if (p->serial)
        lose(p);
}

/* -- what it is named by ---------------------------------------------------------------
 */

const char *const stage_zaber_option_keys[] = {
    "pitch_mm", "steps",  "resolution", "device", "axis",  "baud",   "timeout",
    "checksum", "settle", "min",        "max",    "speed", "homing", NULL};

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
        {"speed", 1e-4, 100, &o->speed_m_s},
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

/* -- the stage -------------------------------------------------------------------------
 */

/* A Zaber axis that homes, moves and is watched: metres, and faults in plain words.
 * Driven from one thread, a stage worker's. */

struct zaber_drive {
    struct zaber_port port;
    struct stage_worker
        *worker;       /* whom to tell the place, and to ask for newer commands */
    double m_per_step; /* of a microstep */
    double speed;      /* its own, as the device has it */
    bool slowed;       /* another one is set now */
    const struct clock_source *clock;
    bool homed;
    double rest_m;   /* where it was left */
    char warning[3]; /* the flag that was noted last */
    _Atomic uint64_t homings, limit_hits, warnings;
};

/* What the device says of itself; it may know its place from before. */
struct zaber_facts {
    double resolution; /* microsteps of a full step */
    double min, max;   /* microsteps */
    double position;   /* microsteps */
    double speed;      /* 1.6384 times microsteps/s */
    bool homed;
    bool fault; /* it has stopped by itself: a person has to look */
    bool moved; /* it was moving when it was asked */
};

#define POLL_MS     50  /* of a device that moves */
#define REST_MS     500 /* of one that does not */
#define TOLERANCE_M 2e-5
#define BRAKE_NS    INT64_C(10000000000) /* at most, from any speed */
#define SPEED_UNIT  1.6384               /* in a microstep per second */

/* Why a question came to nothing, for a person. */
static int error_say_of(int err, const char *command, const struct zaber_message *reply,
                        char text[STAGE_TEXT_SIZE])
{
    if (err == -EPROTO)
        snprintf(text, STAGE_TEXT_SIZE, "it refuses \"%s\": %s", command,
                 zaber_rejection(reply->data));
    else if (err == -ETIMEDOUT)
        snprintf(text, STAGE_TEXT_SIZE, "it does not answer");
    else
        snprintf(text, STAGE_TEXT_SIZE, "its serial port is gone: %s", strerror(-err));
    return err;
}

static int ask_number(struct zaber_port *p, const char *command, double *out,
                      struct zaber_message *reply, char text[STAGE_TEXT_SIZE])
{
    char *end;
    int err = zaber_port_ask(p, reply, "%s", command);

    if (err)
        return error_say_of(err, command, reply, text);
    *out = strtod(reply->data, &end);
    if (end != reply->data && (!*end || *end == ' '))
        return 0;
    snprintf(text, STAGE_TEXT_SIZE, "\"%s\": it answers \"%s\"", command, reply->data);
    return -EPROTO;
}

/* What a flag says, where it is more than a note. */
static int judge(struct zaber_drive *z, const struct zaber_message *m,
                 char text[STAGE_TEXT_SIZE])
{
    const char *words;

    switch (zaber_warning(m->warning, &words)) {
    case ZABER_FAULT:
        z->limit_hits += !strcmp(m->warning, "WL") || !strcmp(m->warning, "FE");
        snprintf(text, STAGE_TEXT_SIZE,
                 "%s (%s); its place is not known until it is homed", words, m->warning);
        return -EIO;
    case ZABER_UNHOMED:
        snprintf(text, STAGE_TEXT_SIZE, "it lost its place: %s (%s); was it restarted?",
                 words, m->warning);
        return -EIO;
    case ZABER_NOTE:
        z->warnings += strcmp(m->warning, z->warning) != 0;
        memcpy(z->warning, m->warning, sizeof z->warning);
        snprintf(text, STAGE_TEXT_SIZE, "%s (%s)", words, m->warning);
        stage_worker_note(z->worker, text);
        text[0] = '\0';
        return 0;
    default:
        z->warning[0] = '\0';
        stage_worker_note(z->worker, "");
        return 0;
    }
}

/* Where it is, and whether it moves.  It looks when it has been asked and before it
 * answers: in the middle, to half of what that takes. */
static int look(struct zaber_drive *z, struct zaber_message *m, double *position_m,
                char text[STAGE_TEXT_SIZE])
{
    double steps;
    int64_t asked_ns = clock_now_ns(z->clock);
    int err = ask_number(&z->port, "get pos", &steps, m, text);
    int64_t took_ns = clock_now_ns(z->clock) - asked_ns;

    if (err)
        return err;
    *position_m = steps * z->m_per_step;
    stage_worker_was_at(z->worker, *position_m, asked_ns + took_ns / 2);
    return 0;
}

static void pause_ms(int wake_fd, int ms)
{
    struct pollfd p = {.fd = wake_fd, .events = POLLIN};

    poll(&p, 1, ms);
}

/* Until it is at rest; a newer command stops it first.  homing: it may say that it has no
 * reference while it looks for one. */
static int follow(struct zaber_drive *z, bool homing, double *position_m,
                  char text[STAGE_TEXT_SIZE])
{
    struct zaber_message m;
    bool stopped = false;
    int err;

    for (;;) {
        if (!stopped && stage_worker_cancelled(z->worker)) {
            stopped = true;
            err = zaber_port_ask(&z->port, &m, "stop");
            if (err)
                return error_say_of(err, "stop", &m, text);
        }
        err = look(z, &m, position_m, text);
        const char *words;
        bool lost = !err && zaber_warning(m.warning, &words) == ZABER_UNHOMED;
        if (!err && !(homing && lost && (m.busy || stopped)))
            err = judge(z, &m, text);
        if (err || !m.busy)
            return err ? err : stopped ? -ECANCELED : 0;
        if (stopped)
            poll(NULL, 0, POLL_MS);
        else
            pause_ms(stage_worker_wake_fd(z->worker), POLL_MS);
    }
}

/* After a fault: nobody knows what it does, so it is told to stop. */
static int fail(struct zaber_drive *z, int err)
{
    z->homed = false;
    if (err != -ECANCELED)
        zaber_port_shout(&z->port, "stop");
    return err;
}

/* 0: its own.  The device keeps what is set, also when it is switched off: its own is set
 * again before anything else. */
static int set_speed(struct zaber_drive *z, double speed_m_s, char text[STAGE_TEXT_SIZE])
{
    struct zaber_message m;
    double speed = speed_m_s > 0 ? speed_m_s / z->m_per_step * SPEED_UNIT : z->speed;

    if (!z->slowed && !(speed_m_s > 0))
        return 0;
    z->slowed = true; /* also when its answer is lost */
    int err = zaber_port_ask(&z->port, &m, "set maxspeed %lld", llround(speed));
    if (err)
        return error_say_of(err, "set maxspeed", &m, text);
    z->slowed = speed_m_s > 0;
    return 0;
}

/* Its warnings of before are forgotten, or they would end this too. */
static int start_homing(struct zaber_drive *z, char text[STAGE_TEXT_SIZE])
{
    static const char *const commands[] = {"warnings clear", "home"};
    struct zaber_message m;
    int err = zaber_port_reopen(&z->port);

    if (!err && (err = set_speed(z, 0, text)))
        return err;
    for (int i = 0; i < 2 && !err; i++) {
        err = zaber_port_ask(&z->port, &m, "%s", commands[i]);
        if (err)
            return error_say_of(err, commands[i], &m, text);
    }
    return err ? error_say_of(err, "", &m, text) : 0;
}

/* The operations of a stage worker, with the drive as their device. */
static int zaber_drive_home(void *drive, char text[STAGE_TEXT_SIZE])
{
    struct zaber_drive *z = drive;
    int err = start_homing(z, text);

    z->homed = false;
    if (!err)
        err = follow(z, true, &z->rest_m, text);
    if (err)
        return fail(z, err);
    z->homed = true;
    z->homings++;
    return 0;
}

static int zaber_drive_move(void *drive, double target_m, double speed_m_s,
                            char text[STAGE_TEXT_SIZE])
{
    struct zaber_drive *z = drive;
    struct zaber_message m;
    long long steps = llround(target_m / z->m_per_step);
    int err = set_speed(z, speed_m_s, text);

    if (err)
        return fail(z, err);
    err = zaber_port_ask(&z->port, &m, "move abs %lld", steps);
    if (err)
        return fail(z, error_say_of(err, "move abs", &m, text));
    err = follow(z, false, &z->rest_m, text);
    if (!err || err == -ECANCELED) {
        int slow = set_speed(z, 0, text);
        if (slow)
            return fail(z, slow);
    }
    if (err == -ECANCELED)
        return err;
    if (!err && fabs(z->rest_m - target_m) > TOLERANCE_M + z->m_per_step) {
        snprintf(text, STAGE_TEXT_SIZE,
                 "stands at %.4f m instead of %.4f m: was it stopped by hand?", z->rest_m,
                 target_m);
        err = -EIO;
    }
    return err ? fail(z, err) : 0;
}

/* Is it where it was left, and well?  A place that is lost already is not lost again. */
static int zaber_drive_rest(void *drive, int wake_fd, char text[STAGE_TEXT_SIZE])
{
    struct zaber_drive *z = drive;
    struct zaber_message m;

    pause_ms(wake_fd, REST_MS);
    if (!z->homed || stage_worker_cancelled(z->worker))
        return 0;
    double position_m;
    int err = look(z, &m, &position_m, text);
    if (!err)
        err = judge(z, &m, text);
    if (!err && fabs(position_m - z->rest_m) > TOLERANCE_M + z->m_per_step) {
        snprintf(text, STAGE_TEXT_SIZE, "was moved from %.4f m to %.4f m, not by us",
                 z->rest_m, position_m);
        err = -EIO;
    }
    return err ? fail(z, err) : 0;
}

/* Nobody has told it to move yet: who did was killed, and it does not stop for that. */
static int bring_to_rest(struct zaber_drive *z, bool *moved, char text[STAGE_TEXT_SIZE])
{
    int64_t end_ns = clock_monotonic_ns() + BRAKE_NS;
    struct zaber_message m;
    double position;
    int err = ask_number(&z->port, "get pos", &position, &m, text);

    *moved = !err && m.busy;
    if (!*moved)
        return err;
    err = zaber_port_ask(&z->port, &m, "stop");
    if (err)
        return error_say_of(err, "stop", &m, text);
    while (!err && m.busy && clock_monotonic_ns() < end_ns) {
        poll(NULL, 0, POLL_MS);
        err = ask_number(&z->port, "get pos", &position, &m, text);
    }
    if (err || !m.busy)
        return err;
    snprintf(text, STAGE_TEXT_SIZE, "it moves and does not stop");
    return -EBUSY;
}

/* facts->resolution: 0 on entry asks the device.  0, or -errno with why in text. */
static int zaber_drive_ask(struct zaber_drive *z, struct zaber_facts *facts,
                           char text[STAGE_TEXT_SIZE])
{
    struct zaber_message m;
    const char *words;
    int err = 0;

    if (!facts->resolution)
        err = ask_number(&z->port, "get resolution", &facts->resolution, &m, text);
    if (!err && !(facts->resolution >= 1)) {
        snprintf(text, STAGE_TEXT_SIZE, "its resolution: %g microsteps",
                 facts->resolution);
        return -EPROTO;
    }
    if (!err)
        err = bring_to_rest(z, &facts->moved, text);
    if (!err)
        err = ask_number(&z->port, "get limit.min", &facts->min, &m, text);
    if (!err)
        err = ask_number(&z->port, "get limit.max", &facts->max, &m, text);
    if (!err)
        err = ask_number(&z->port, "get maxspeed", &facts->speed, &m, text);
    if (!err)
        err = ask_number(&z->port, "get pos", &facts->position, &m, text);
    facts->homed = !err && zaber_warning(m.warning, &words) < ZABER_UNHOMED;
    facts->fault = !err && zaber_warning(m.warning, &words) == ZABER_FAULT;
    return err;
}

struct stage_zaber {
    char *path;
    struct zaber_drive drive;
    double min_m, max_m;
    bool fault;         /* from before; nothing moves until a person has homed it */
    double left_at_m_s; /* this fast it was moving when it was opened; 0: it was not */
};

/* Without an answer there is no telling how far a microstep goes. */
static int introduce(struct stage_zaber *s, const struct stage_zaber_options *o,
                     struct error *why)
{
    char text[STAGE_TEXT_SIZE] = "";
    struct zaber_facts facts = {.resolution = o->resolution};
    int err = zaber_drive_ask(&s->drive, &facts, text);

    if (err)
        return error_say(why, err, "%s: %s", s->path, text);
    double m = 1e-3 * o->pitch_mm / (o->steps * facts.resolution);
    s->drive.m_per_step = m;
    s->drive.speed = o->speed_m_s > 0 ? o->speed_m_s / m * SPEED_UNIT : facts.speed;
    s->drive.slowed = llround(s->drive.speed) != llround(facts.speed);
    s->left_at_m_s = facts.moved ? facts.speed * m / SPEED_UNIT : 0;
    s->drive.rest_m = facts.position * m;
    s->drive.homed = facts.homed;
    s->fault = facts.fault;
    s->min_m = fmax(o->min_m, facts.min * m);
    s->max_m = fmin(o->max_m, facts.max * m);
    err = set_speed(&s->drive, 0, text);
    return err ? error_say(why, err, "%s: %s", s->path, text) : 0;
}

static void note_speed(struct stage_zaber *s)
{
    char text[STAGE_TEXT_SIZE];

    snprintf(text, sizeof text,
             "it was moving: who drove it was killed, and %.4f m/s may be the speed of "
             "that run; option speed sets its own",
             s->left_at_m_s);
    stage_worker_note(s->drive.worker, text);
}

static int start(struct stage_zaber *s, const struct stage_zaber_options *o,
                 const struct clock_source *clock, struct error *why)
{
    static const struct stage_worker_ops ops = {
        .home = zaber_drive_home, .move = zaber_drive_move, .rest = zaber_drive_rest};
    struct zaber_port_config port = o->port;

    s->path = strdup(o->port.path);
    if (!s->path)
        return error_say(why, -ENOMEM, "out of memory");
    s->drive.clock = clock;
    port.path = s->path;
    int err = zaber_port_open(&s->drive.port, &port, why);
    if (!err)
        err = introduce(s, o, why);
    const struct stage_worker_config cfg = {.settle_s = o->settle_s,
                                            .homed = s->drive.homed,
                                            .home_first = o->home_first && !s->fault,
                                            .position_m = s->drive.rest_m};
    if (!err)
        err = stage_worker_create(&s->drive.worker, &cfg, &ops, &s->drive, clock, why);
    if (!err && s->left_at_m_s > 0 && !(o->speed_m_s > 0))
        note_speed(s);
    return err;
}

static void zaber_close(void *state)
{
    struct stage_zaber *s = state;

    char text[STAGE_TEXT_SIZE];

    stage_worker_destroy(s->drive.worker);
    if (s->drive.worker)
        zaber_port_shout(&s->drive.port, "stop");
    set_speed(&s->drive, 0, text);
    zaber_port_close(&s->drive.port);
    free(s->path);
    free(s);
}

static int zaber_open(void **state, const char *arg, const struct clock_source *clock,
                      struct error *why)
{
    struct stage_zaber_options o;
    struct device d;
    int err = device_parse(&d, arg, stage_zaber_option_keys, why);

    if (err)
        return err;
    struct stage_zaber *s = calloc(1, sizeof *s);
    err = s ? stage_zaber_options_read(&o, &d, why)
            : error_say(why, -ENOMEM, "out of memory");
    if (!err)
        err = start(s, &o, clock, why);
    device_clear(&d);
    if (err && s)
        zaber_close(s);
    else
        *state = s;
    return err;
}

static int zaber_move(void *state, double target_m, double speed_m_s)
{
    struct stage_zaber *s = state;

    if (target_m < s->min_m || target_m > s->max_m)
        return -ERANGE;
    if (speed_m_s / s->drive.m_per_step * SPEED_UNIT > s->drive.speed)
        return -EDOM;
    return stage_worker_move(s->drive.worker, target_m, speed_m_s);
}

static int zaber_home(void *state)
{
    struct stage_zaber *s = state;

    return stage_worker_home(s->drive.worker);
}

static int zaber_stop(void *state)
{
    struct stage_zaber *s = state;

    return stage_worker_stop(s->drive.worker);
}

static void zaber_status(void *state, struct stage_status *out)
{
    struct stage_zaber *s = state;

    stage_worker_status(s->drive.worker, out);
    out->reach_m[0] = s->min_m;
    out->reach_m[1] = s->max_m;
}

static size_t zaber_counts(void *state, struct device_count out[DEVICE_MAX_COUNTS])
{
    const struct stage_zaber *s = state;
    const struct zaber_port *p = &s->drive.port;
    const struct device_count counts[] = {
        {"homings", s->drive.homings},
        {"limit_hits", s->drive.limit_hits},
        {"warnings", s->drive.warnings},
        {"retries", p->retries},
        {"checksum_errors", p->checksum_errors},
        {"garbled_lines", p->garbled},
        {"late_answers", p->stale},
        {"reopened", p->reopened},
    };

    memcpy(out, counts, sizeof counts);
    return sizeof counts / sizeof *counts;
}

const struct stage_ops stage_zaber_ops = {.scheme = "zaber",
                                          .open = zaber_open,
                                          .move = zaber_move,
                                          .home = zaber_home,
                                          .stop = zaber_stop,
                                          .status = zaber_status,
                                          .counts = zaber_counts,
                                          .close = zaber_close};
