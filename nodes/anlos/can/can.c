/* SPDX-License-Identifier: MIT */
/* nodes/anlos/can/can.c -- `anlos can`: what the frames on the vehicle's bus say. */
#include <errno.h>
#include <net/if.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "msgs/can/frames.h"
#include "nodes/anlos/can/decode.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/usage.h"

#define FIRST_BASE   0x100 /* as can.base_id of a launch file */
#define LAST_BASE    (0x7ff - CAN_SENSOR_STEP + 1)
#define MOST_SENSORS (0x800 / CAN_SENSOR_STEP)

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

static const struct option options[] = {
    {"base", required_argument, NULL, 'b'},
    {"sensor", required_argument, NULL, 's'},
    {"id", required_argument, NULL, 'i'},
    {"interface", required_argument, NULL, 'n'},
    {"seconds", required_argument, NULL, 't'},
    {"json", no_argument, NULL, 'j'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

struct can_options {
    unsigned base;
    size_t sensor;
    const char *ids[MAX_IDS];
    size_t n_ids;
    const char *interface;
    double seconds;
    bool json;
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
    switch (code) {
    case 'b':
        if (read_base(optarg, &o->base))
            return 0;
        return usage_error("can", "--base %s: expected a hexadecimal number, %x to %x",
                           optarg, FIRST_BASE, LAST_BASE);
    case 's':
        if (!usage_count(optarg, 0, MOST_SENSORS, &o->sensor))
            return 0;
        return usage_error("can", "--sensor %s: expected a whole number up to %d", optarg,
                           MOST_SENSORS);
    case 'i':
        if (o->n_ids < MAX_IDS) {
            o->ids[o->n_ids++] = optarg;
            return 0;
        }
        return usage_error("can", "--id %s: no more than %d", optarg, MAX_IDS);
    case 'n':
        o->interface = optarg;
        return 0;
    case 't':
        if (!usage_positive(optarg, &o->seconds))
            return 0;
        return usage_error("can", "--seconds %s: expected a number above 0", optarg);
    default:
        o->json = true;
        return 0;
    }
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
    if (!tally_frames(&d->tally))
        fprintf(stderr, "anlos can: no frame of a sensor at %03x; see --base, --sensor\n",
                d->tally.checks.base);
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
    struct usage usage = {.command = "can", .help = help, .options = options};
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
