/* SPDX-License-Identifier: MIT */
#include "zaber_device.h"

#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define LIMIT 500000 /* microsteps */

struct zaber_insides {
    int master, slave, quit[2];
    pthread_t thread;
    char flag[3];
    bool homing;
    double x, before_s;
    char line[200];
    size_t n;
    char late[128];
};

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static bool between(double x, double a, double b)
{
    return (a <= x && x <= b) || (b <= x && x <= a);
}

/* What befalls it on its way from x to where it is now. */
static double obstacle(struct zaber_device *d, double from, double to)
{
    struct zaber_insides *in = d->insides;
    if (d->stall_at && between((double)d->stall_at, from, to)) {
        strcpy(in->flag, "FS");
        d->target = d->stall_at;
        return (double)d->stall_at;
    }
    if (d->blocked_at && between((double)d->blocked_at, from, to)) {
        d->target = d->blocked_at;
        return (double)d->blocked_at;
    }
    if (d->reboot_at && between((double)d->reboot_at, from, to)) {
        strcpy(in->flag, "WR");
        d->reboot_at = 0;
        d->target = 0;
        return 0;
    }
    return to;
}

static void travel(struct zaber_device *d)
{
    struct zaber_insides *in = d->insides;
    long shift = atomic_exchange(&d->shift, 0);
    in->x += (double)shift;
    d->target += shift;
    double t = now_s(), way = (double)d->target - in->x;
    double most = (t - in->before_s) * d->speed;
    in->before_s = t;
    double to = in->x + copysign(fmin(fabs(way), most), way);
    in->x = way != 0 ? obstacle(d, in->x, to) : in->x;
    d->position = lround(in->x);
    if (in->homing && in->x == (double)d->target) {
        in->homing = false;
        d->homings++;
        strcpy(in->flag, d->homeless ? "WR" : "--");
    }
}

static unsigned sum_of(const char *text)
{
    unsigned sum = 0;
    for (; *text; text++)
        sum += (unsigned char)*text;
    return (256 - sum % 256) % 256;
}

/* Does as it is told; the data of its answer. */
static bool obey(struct zaber_device *d, const char *command, char *data)
{
    struct zaber_insides *in = d->insides;
    long value;
    strcpy(data, "0");
    if (!strcmp(command, "get pos"))
        sprintf(data, "%ld", (long)d->position);
    else if (!strcmp(command, "get maxspeed"))
        sprintf(data, "%ld", lround(1.6384 * d->speed));
    else if (sscanf(command, "set maxspeed %ld", &value) == 1)
        d->speed = (int)lround((double)value / 1.6384);
    else if (!strcmp(command, "get resolution"))
        strcpy(data, "64");
    else if (!strcmp(command, "get limit.max"))
        sprintf(data, "%d", LIMIT);
    else if (!strcmp(command, "get limit.min"))
        strcpy(data, "0");
    else if (!strcmp(command, "warnings clear")) {
        if (!strcmp(in->flag, "FS"))
            strcpy(in->flag, "WR");
    } else if (!strcmp(command, "home")) {
        in->homing = true;
        d->target = 0;
    } else if (!strcmp(command, "stop")) {
        d->target = d->position;
        in->x = (double)d->position;
        in->homing = false;
        d->stops++;
    } else if (sscanf(command, "move abs %ld", &value) == 1) {
        if (value < 0 || value > LIMIT || !strcmp(in->flag, "WR")) {
            strcpy(data, "BADDATA");
            return false;
        }
        d->target = value;
    } else {
        strcpy(data, "BADCOMMAND");
        return false;
    }
    return true;
}

static void say(struct zaber_device *d, const char *text)
{
    size_t n = strlen(text);
    if (write(d->insides->master, text, n) != (ssize_t)n)
        d->wrong++;
}

static void answer(struct zaber_device *d, const char *text)
{
    int trick = d->times > 0 ? d->trick : TRICK_NONE;
    char half[200];
    d->times -= d->times > 0;
    if (d->insides->late[0])
        say(d, d->insides->late);
    d->insides->late[0] = '\0';
    switch (trick) {
    case TRICK_GARBAGE:
        say(d, "\xff\x7f@@!x\x01\r\n@01 1 OK ID\n\x80\x90 ");
        break;
    case TRICK_SILENCE:
        return;
    case TRICK_HALF:
        snprintf(half, sizeof half, "%.*s", (int)strlen(text) / 2, text);
        say(d, half);
        return;
    case TRICK_CHECKSUM:
        snprintf(half, sizeof half, "%.*s:00\r\n", (int)strcspn(text, ":\r"), text);
        say(d, half);
        return;
    case TRICK_LATE:
        snprintf(d->insides->late, sizeof d->insides->late, "%s", text);
        return;
    case TRICK_ENDLESS:
        for (int i = 0; i < 20; i++)
            say(d, "all work and no play ");
        say(d, "\n");
        break;
    case TRICK_STRANGER:
        say(d, "@02 1 00 OK IDLE -- 999\r\n!01 1 IDLE --\r\n");
        break;
    default:
        break;
    }
    say(d, text);
}

static void take_line(struct zaber_device *d, char *line)
{
    char text[100], data[32], command[80] = "";
    unsigned device, axis, id;
    char *colon = strrchr(line, ':');
    if (colon) {
        *colon = '\0';
        d->checked += strtoul(colon + 1, NULL, 16) == sum_of(line + 1);
    }
    if (sscanf(line, "/%u %u %u %79[^\n]", &device, &axis, &id, command) < 4) {
        d->wrong++;
        return;
    }
    d->commands++;
    travel(d);
    bool good = obey(d, command, data);
    bool warns = d->hot && !strcmp(d->insides->flag, "--");
    bool busy = d->insides->x != (double)d->target || d->insides->homing;
    snprintf(text, sizeof text, "%02u %u %02u %s %s %s %s", device, axis, id,
             good ? "OK" : "RJ", busy ? "BUSY" : "IDLE", warns ? "WT" : d->insides->flag,
             data);
    char whole[120];
    if (d->checksums)
        snprintf(whole, sizeof whole, "@%s:%02X\r\n", text, sum_of(text));
    else
        snprintf(whole, sizeof whole, "@%s\r\n", text);
    answer(d, whole);
}

static void *live(void *arg)
{
    struct zaber_device *d = arg;
    struct zaber_insides *in = d->insides;
    for (;;) {
        struct pollfd fds[] = {{.fd = in->master, .events = POLLIN},
                               {.fd = in->quit[0], .events = POLLIN}};
        char bytes[100];
        poll(fds, 2, -1);
        if (fds[1].revents)
            return NULL;
        ssize_t n = read(in->master, bytes, sizeof bytes);
        for (ssize_t i = 0; i < n; i++) {
            if (bytes[i] != '\n' && in->n + 1 < sizeof in->line) {
                in->line[in->n++] = bytes[i];
                continue;
            }
            in->line[in->n] = '\0';
            in->n = 0;
            take_line(d, in->line);
        }
    }
}

struct zaber_device *zaber_device_start(bool referenced)
{
    struct zaber_device *d = calloc(1, sizeof *d);
    struct zaber_insides *in = calloc(1, sizeof *in);
    struct termios t;
    if (!d || !in)
        abort();
    d->insides = in;
    d->speed = 400000;
    strcpy(in->flag, referenced ? "--" : "WR");
    in->x = 70000;
    d->position = d->target = 70000;
    in->before_s = now_s();
    in->master = posix_openpt(O_RDWR | O_NOCTTY);
    if (in->master < 0 || grantpt(in->master) || unlockpt(in->master) ||
        ptsname_r(in->master, d->path, sizeof d->path) || pipe(in->quit))
        abort();
    /* Held open, so that the port can be opened and closed. */
    in->slave = open(d->path, O_RDWR | O_NOCTTY);
    if (in->slave < 0 || tcgetattr(in->slave, &t))
        abort();
    cfmakeraw(&t);
    tcsetattr(in->slave, TCSANOW, &t);
    if (pthread_create(&in->thread, NULL, live, d))
        abort();
    return d;
}

void zaber_device_shift(struct zaber_device *d, long by)
{
    d->shift += by;
}

void zaber_device_unplug(struct zaber_device *d)
{
    struct zaber_insides *in = d->insides;
    if (write(in->quit[1], "", 1) != 1)
        abort();
    pthread_join(in->thread, NULL);
    close(in->quit[0]);
    close(in->quit[1]);
    close(in->slave);
    close(in->master);
    free(in);
    d->insides = NULL;
}
