#include "nodes/anlos/can/decode.h"

#include <errno.h>
#include <poll.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "hal/can/socket.h"
#include "hal/clock.h"
#include "nodes/anlos/can/show.h"
#include "nodes/anlos/interrupt.h"

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

int decode_interface(struct decode *d, const char *interface, struct complaint *why)
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
        complain(why, err, "%s: %s", interface, strerror(-err));
    return err;
}
