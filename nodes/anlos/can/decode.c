/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/can/decode.h"

#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "hal/can/socket.h"
#include "hal/clock.h"
#include "msgs/can/frames.h"
#include "nodes/anlos/can/tally.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/usage.h"

/* One decoded frame as a line, for a person or as JSON. */

#define SECOND_NS INT64_C(1000000000)

/* As many digits as a step needs. */
static int decimals(double step)
{
    int n = 0;

    while (n < 6 && step < 1 - 1e-9) {
        step *= 10;
        n++;
    }
    return n;
}

/* Bit 0 first: their names, numbers where there are none, or "none". */
static void show_bits(const struct can_signal *s, int64_t raw, FILE *to)
{
    const char *between = "";

    if (!raw)
        fputs("none", to);
    for (unsigned i = 0; i < s->length; i++) {
        const char *name = can_signal_name(s, i);
        if (!(raw >> i & 1))
            continue;
        if (name)
            fprintf(to, "%s%s", between, name);
        else
            fprintf(to, "%sbit %u", between, i);
        between = "+";
    }
}

static void show_signal(const struct can_signal *s, const struct can_frame_data *f,
                        FILE *to)
{
    int64_t raw = can_signal_raw(s, f);
    const char *name = can_signal_name(s, raw);

    fprintf(to, " %s ", s->name);
    if (s->kind == CAN_SIGNAL_BITS)
        show_bits(s, raw, to);
    else if (can_signal_is_missing(s, f))
        fputs("NotAvailable", to);
    else if (s->kind == CAN_SIGNAL_CHOICE && name)
        fputs(name, to);
    else if (s->kind == CAN_SIGNAL_CHOICE)
        fprintf(to, "%" PRId64, raw);
    else if (s->kind == CAN_SIGNAL_FLOAT)
        fprintf(to, "%.7g", can_signal_physical(s, f));
    else
        fprintf(to, "%.*f", decimals(s->factor), can_signal_physical(s, f));
    if (*s->unit && !can_signal_is_missing(s, f))
        fprintf(to, " %s", s->unit);
}

/* f: of a message of ours. */
static void show_frame(const struct can_line *l, const struct tally_frame *f, FILE *to)
{
    const char *between = "";

    if (l->dated)
        fprintf(to, "%" PRId64 ".%06" PRId64 "  ", l->stamp_ns / SECOND_NS,
                l->stamp_ns % SECOND_NS / 1000);
    fprintf(to, "%s  %03" PRIX32 " %-14s  %-14s ", l->interface, l->frame.id, f->m->name,
            tally_verdict_text(f));
    for (size_t i = 0; !f->wrong_size && i < f->m->n_signals; i++) {
        if (f->m->signals[i].member.type == CAN_MEMBER_NONE) /* the verdict says it */
            continue;
        fputs(between, to);
        show_signal(&f->m->signals[i], &l->frame, to);
        between = ",";
    }
    if (f->wrong_size)
        fprintf(to, " %d bytes%s, expected %d%s", l->frame.size,
                l->frame.fd ? " of FD" : "", f->m->size, f->m->fd ? " of FD" : "");
    putc('\n', to);
}

static json_t *bits_json(const struct can_signal *s, int64_t raw)
{
    json_t *o = json_array();

    for (unsigned i = 0; i < s->length; i++)
        if (raw >> i & 1) {
            const char *name = can_signal_name(s, i);
            json_array_append_new(o, name ? json_string(name) : json_integer(i));
        }
    return o;
}

static json_t *signal_json(const struct can_signal *s, const struct can_frame_data *f)
{
    int64_t raw = can_signal_raw(s, f);
    const char *name = can_signal_name(s, raw);
    double value = can_signal_physical(s, f);

    if (s->kind == CAN_SIGNAL_BITS)
        return bits_json(s, raw);
    if (can_signal_is_missing(s, f) || !isfinite(value))
        return json_null();
    if (s->kind == CAN_SIGNAL_CHOICE)
        return name ? json_string(name) : json_integer(raw);
    if (s->kind != CAN_SIGNAL_FLOAT && s->factor == 1)
        return json_integer(raw + (json_int_t)s->offset);
    return json_real(value);
}

/* 0, -ENOMEM. */
static int show_frame_json(const struct can_line *l, const struct tally_frame *f,
                           FILE *to)
{
    json_t *signals = json_object();

    for (size_t i = 0; !f->wrong_size && i < f->m->n_signals; i++)
        json_object_set_new(signals, f->m->signals[i].name,
                            signal_json(&f->m->signals[i], &l->frame));
    json_t *o = json_pack("{ss, sI, ss, ss, so}", "interface", l->interface, "id",
                          (json_int_t)l->frame.id, "name", f->m->name, "e2e",
                          tally_verdict_text(f), "signals", signals);
    if (o && l->dated)
        json_object_set_new(o, "time_ns", json_integer(l->stamp_ns));
    return usage_json_line(o, to);
}

#define LOOK_UP_MS 100 /* between looks at Ctrl-C and the clock */

static int take(struct decode *d, const struct can_line *l)
{
    struct tally_frame f = tally_take(&d->tally, l);

    if (!f.m || !(d->shown >> f.m->id & 1))
        return 0;
    if (d->json)
        return show_frame_json(l, &f, stdout);
    show_frame(l, &f, stdout);
    return ferror(stdout) ? -EIO : 0;
}

static bool is_blank(const char *text)
{
    return text[strspn(text, " \t\r\n")] == '\0';
}

static int take_text(struct decode *d, const char *text, uint64_t number)
{
    struct can_line l;

    if (can_line_parse(&l, text)) {
        tally_no_frame(&d->tally, number);
        return 0;
    }
    if (d->interface && strcmp(d->interface, l.interface))
        return 0;
    return take(d, &l);
}

/* The next line without what is more than CAN_LINE_SIZE of it, and without what a byte 0
 * hides; *whole: there was neither.  0, -ENODATA (the end), a negative errno. */
static int read_line(FILE *f, char text[static CAN_LINE_SIZE], bool *whole)
{
    size_t n = 0;
    int c;

    *whole = true;
    errno = 0;
    while ((c = getc(f)) != EOF && c != '\n') {
        if (n + 1 == CAN_LINE_SIZE || !c)
            *whole = false;
        else
            text[n++] = (char)c;
    }
    text[n] = '\0';
    if (c == EOF && ferror(f))
        return errno ? -errno : -EIO;
    return c == EOF && !n && *whole ? -ENODATA : 0;
}

/* What comes through a pipe comes bit by bit: each line is shown when it is there. */
static bool is_slow(FILE *f)
{
    struct stat st;

    return fstat(fileno(f), &st) || !S_ISREG(st.st_mode);
}

int decode_file(struct decode *d, FILE *f)
{
    char text[CAN_LINE_SIZE];
    bool slow = is_slow(f);
    uint64_t number = 0;
    bool whole;
    int err;

    while (!(err = read_line(f, text, &whole))) {
        number++;
        if (!whole)
            tally_no_frame(&d->tally, number);
        else if (!is_blank(text))
            err = take_text(d, text, number);
        if (!err && slow && fflush(stdout))
            err = -errno;
        if (!err && interrupt_requested())
            err = -EINTR;
        if (err)
            return err;
    }
    return err == -ENODATA ? 0 : err;
}

/* What the kernel holds. */
static int drain(struct decode *d, int fd, const char *interface, int64_t now_ns)
{
    struct can_event event;
    int err = 0;

    while (!interrupt_requested() && !(err = can_socket_receive(fd, &event))) {
        struct can_line l = {.dated = true,
                             .stamp_ns = now_ns - event.held_ns,
                             .data = true,
                             .frame = event.frame};
        snprintf(l.interface, sizeof l.interface, "%s", interface);
        err = take(d, &l);
        if (err)
            return err;
    }
    if (err == -EAGAIN)
        err = fflush(stdout) ? -errno : 0;
    return err;
}

static int listen_to(struct decode *d, int fd, const char *interface)
{
    const struct clock_source *clock = clock_system();
    int64_t start_ns = clock_now_ns(clock);
    struct pollfd wait = {.fd = fd, .events = POLLIN};
    int err = 0;

    while (!err) {
        int64_t now_ns = clock_now_ns(clock);
        if (interrupt_requested())
            return -EINTR;
        if (d->seconds > 0 && 1e-9 * (double)(now_ns - start_ns) >= d->seconds)
            return 0;
        if (poll(&wait, 1, LOOK_UP_MS) < 0 && errno != EINTR)
            return -errno;
        err = drain(d, fd, interface, clock_now_ns(clock));
    }
    return err;
}

int decode_interface(struct decode *d, const char *interface, struct error *why)
{
    uint32_t ids[CAN_SENSOR_STEP];
    int fd, err = can_socket_open(&fd, interface, 0, why);

    if (err)
        return err;
    for (unsigned i = 0; i < CAN_SENSOR_STEP; i++)
        ids[i] = d->tally.checks.base + i;
    err = can_socket_filter(fd, ids, CAN_SENSOR_STEP);
    if (!err)
        err = listen_to(d, fd, interface);
    close(fd);
    if (err && err != -EINTR)
        error_say(why, err, "%s: %s", interface, strerror(-err));
    return err;
}
