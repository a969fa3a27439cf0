/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/can/can.h"

#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <net/if.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "hal/can/socket.h"
#include "hal/clock.h"
#include "msgs/can/frames.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/stop.h"

/* -- one frame as a line -------------------------------------------------------------
 */

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

/* -- lines of candump, and an interface ----------------------------------------------
 */

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

/* Until d->seconds or interrupt_requested.  0, -EINTR, -ENODEV, ... */
static int decode_interface(struct decode *d, const char *interface, struct error *why)
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

/* -- the command line ----------------------------------------------------------------
 */

#define FIRST_BASE   0x100 /* as can.base_id of a launch file */
#define LAST_BASE    (0x7ff - CAN_SENSOR_STEP + 1)
#define MOST_SENSORS (0x800 / CAN_SENSOR_STEP) /* 128 */

enum { MAX_IDS = 32 };

static const char help[] =
    "anlos can -- what the frames on the vehicle's bus say\n"
    "\n"
    "usage: anlos can decode FILE|INTERFACE [--base ID] [--sensor N] [--id ID|NAME]...\n"
    "                        [--interface NAME] [--seconds S] [--json]\n"
    "\n"
    "  decode           prints each frame of a sensor, and of the vehicle to it: time,\n"
    "                   identifier, name, whether its end-to-end protection holds, and\n"
    "                   every signal in its unit.  At the end: how many came of each,\n"
    "                   how often, what was wrong, how many lists were not whole\n"
    "  FILE             lines of candump, of -L or for the screen; '-': standard input\n"
    "  INTERFACE        a CAN interface such as can0, listened to until Ctrl-C\n"
    "\n"
    "  --base ID        identifier at which those of sensor 0 begin (default 400); each\n"
    "                   further sensor has the next 10.  In hexadecimal, with or "
    "without\n"
    "                   0x; what is too large for that is decimal, as can.base_id of a\n"
    "                   launch file may be: 1024 is 400\n"
    "  --sensor N       the sensor, from 0\n"
    "  --id ID|NAME     print only these, such as 404 or ObjectState; count all\n"
    "  --interface NAME of a file with frames of several interfaces: only this one\n"
    "  --seconds S      of an interface: stop after S seconds\n"
    "  --json           an object a line, the last one the summary; a value that is not\n"
    "                   available is null\n"
    "  --help           this text\n"
    "\n"
    "The protection of a frame is: ok; some lost (up to two before it did not come);\n"
    "repeated; wrong sequence (more were lost, it is late, or its sender began anew:\n"
    "what follows is compared with it); wrong CRC (damaged, or of another sensor).\n"
    "Only the first two may be used.  Writes no files.\n"
    "\n"
    "examples\n"
    "  anlos can decode out/demo/can.candump --id ObjectState\n"
    "  anlos can decode can0 --sensor 1\n"
    "  candump -L can0 | anlos can decode - --json | jq 'select(.name == \"Status\")'\n"
    "\n"
    "exit codes: 0 done; 1 a frame was wrong (not one that lost others before it), a\n"
    "list was cut, a line is no frame, nothing came of this sensor, or failed; 2 bad\n"
    "arguments or file; 130 stopped by Ctrl-C\n";

struct can_options {
    unsigned base;
    size_t sensor;
    const char *ids[MAX_IDS];
    size_t n_ids;
    const char *interface;
    double seconds;
    bool json;
};

static const struct usage_option options[] = {
    {"base", USAGE_VALUE('b')},
    {"sensor", USAGE_COUNT(struct can_options, sensor, 0, MOST_SENSORS),
     .expected = "a whole number up to 128"},
    {"id", USAGE_VALUE('i')},
    {"interface", USAGE_TEXT(struct can_options, interface)},
    {"seconds", USAGE_NUMBER(struct can_options, seconds, USAGE_ABOVE_0, USAGE_ANY),
     .expected = "a number above 0"},
    {"json", USAGE_FLAG(struct can_options, json)},
    {.name = NULL},
};

/* Hexadecimal, with or without 0x. */
static bool read_id(const char *text, unsigned *out)
{
    char *end;
    unsigned long id = strtoul(text, &end, 16);

    *out = (unsigned)id;
    return *text && !strchr("+- \t", *text) && !*end && id <= 0x7ff;
}

static bool read_base(const char *text, unsigned *out)
{
    size_t decimal;

    if (read_id(text, out) && *out <= LAST_BASE)
        return *out >= FIRST_BASE;
    if (usage_count(text, FIRST_BASE, LAST_BASE, &decimal))
        return false;
    *out = (unsigned)decimal;
    return true;
}

static int take_option(struct can_options *o, int code)
{
    if (code == 'b' && !read_base(optarg, &o->base))
        return usage_error("can", "--base %s: expected a hexadecimal number, %x to %x",
                           optarg, FIRST_BASE, LAST_BASE);
    if (code == 'b')
        return 0;
    if (o->n_ids == MAX_IDS)
        return usage_error("can", "--id %s: no more than %d", optarg, MAX_IDS);
    o->ids[o->n_ids++] = optarg;
    return 0;
}

/* Returns 0 or an exit code. */
static int show_only(struct decode *d, const struct can_options *o)
{
    size_t n;
    const struct can_message *m = can_messages(&n);
    unsigned id;

    d->shown = o->n_ids ? 0 : UINT16_MAX;
    for (size_t i = 0; i < o->n_ids; i++) {
        const struct can_message *found =
            read_id(o->ids[i], &id) ? can_message_find(d->tally.checks.base, id) : NULL;
        for (size_t k = 0; k < n && !found; k++)
            if (!strcmp(o->ids[i], m[k].name))
                found = &m[k];
        if (!found)
            return usage_error("can",
                               "--id %s: no frame of this sensor; the first is %s, "
                               "%03x",
                               o->ids[i], m[0].name, d->tally.checks.base);
        d->shown |= (uint16_t)(1u << found->id);
    }
    return 0;
}

static int sum_up(const struct decode *d)
{
    int err = 0;

    if (d->json)
        err = tally_print_json(&d->tally, stdout);
    else
        tally_print(&d->tally, stdout);
    int unwritten = usage_flush("can");
    if (unwritten || err)
        return unwritten ? unwritten : EXIT_FAILED;
    bool foreign = d->tally.unknown || d->tally.other;
    if (!tally_frames(&d->tally) && !foreign && d->tally.no_frames) {
        fprintf(stderr, "anlos can: no line of it is a frame; expected lines as candump "
                        "or candump -L writes them\n");
        return EXIT_BAD_INPUT;
    }
    if (!tally_frames(&d->tally))
        fprintf(stderr, "anlos can: no frame of a sensor at %03x%s\n",
                d->tally.checks.base,
                foreign ? "; see --base, --sensor" : ", nor any other");
    return tally_frames(&d->tally) && !tally_wrong(&d->tally) ? EXIT_WORKED : EXIT_FAILED;
}

static int finish(const struct decode *d, int err, const struct error *why)
{
    if (err && err != -EINTR && ferror(stdout)) {
        return err == -EIO ? usage_flush("can") /* which tells why */
                           : usage_unwritten("can", err);
    }
    if (err && err != -EINTR) {
        if (tally_frames(&d->tally)) /* what came before is not lost */
            sum_up(d);
        fprintf(stderr, "anlos can: %s\n", why->text[0] ? why->text : strerror(-err));
        return err == -EISDIR ? EXIT_BAD_INPUT : EXIT_FAILED;
    }
    int code = sum_up(d);
    return err == -EINTR ? EXIT_INTERRUPTED : code;
}

/* As a launch file names buses; here the file or the interface is enough. */
static const char *behind_scheme(const char *source)
{
    static const char *const schemes[] = {"log:", "socketcan:"};

    for (size_t i = 0; i < sizeof schemes / sizeof *schemes; i++)
        if (!strncmp(source, schemes[i], strlen(schemes[i])))
            return source + strlen(schemes[i]);
    return NULL;
}

static int refuse(const char *source, int err)
{
    if (err != ENOENT)
        return usage_error("can", "%s: %s", source, strerror(err));
    if (behind_scheme(source))
        return usage_error("can", "%s: expected the file or the interface alone, %s",
                           source, behind_scheme(source));
    return usage_error(
        "can",
        "%s: there is no such file, and no interface of that name. A launch "
        "with a log writes can.candump into its folder (--out); `ip link` "
        "shows the interfaces",
        source);
}

static int decode(struct decode *d, const char *source)
{
    struct error why = {""};
    bool is_stdin = !strcmp(source, "-");
    FILE *f = is_stdin ? stdin : fopen(source, "re");
    int err = f ? 0 : errno;

    if (err == ENOENT && if_nametoindex(source)) {
        if (d->interface)
            return usage_error("can", "--interface: %s is one", source);
        interrupt_catch();
        err = decode_interface(d, source, &why);
        return finish(d, err, &why);
    }
    if (!f)
        return refuse(source, err);
    if (d->seconds > 0) {
        if (!is_stdin)
            fclose(f);
        return usage_error("can", "--seconds: %s is no interface", source);
    }
    interrupt_catch();
    err = decode_file(d, f);
    if (err && err != -EINTR && !ferror(stdout))
        error_say(&why, err, "%s: %s", source, strerror(-err));
    if (!is_stdin)
        fclose(f);
    return finish(d, err, &why);
}

int command_can(int argc, char **argv)
{
    struct can_options o = {.base = CAN_BASE_DEFAULT};
    struct usage usage = {.command = "can", .help = help, .options = options, .into = &o};
    struct decode d = {0};
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        if ((code = take_option(&o, code)))
            return code;
    if (code)
        return ~code;
    if (optind == argc || strcmp(argv[optind], "decode"))
        return usage_error("can",
                           optind == argc ? "%sdecode is missing"
                                          : "%s: expected decode FILE|INTERFACE",
                           optind == argc ? "" : argv[optind]);
    if (argc - optind != 2)
        return usage_error("can", "decode: expected one file or interface");
    unsigned base = o.base + (unsigned)o.sensor * CAN_SENSOR_STEP;
    if (base > LAST_BASE)
        return usage_error("can", "--sensor %zu: its identifiers would end above 7ff",
                           o.sensor);
    d.tally.checks.base = base;
    d.interface = o.interface;
    d.json = o.json;
    d.seconds = o.seconds;
    code = show_only(&d, &o);
    return code ? code : decode(&d, argv[optind + 1]);
}
