/* SPDX-License-Identifier: MIT */
/* nodes/anlos/array.c -- `anlos array`: which sound cards there are, and what they
 * can do. */
#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/alsa/devices.h"
#include "hal/device.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/json_whole.h"

/* Sound cards as tables and as JSON, to standard output. */

static const char *yes(bool b)
{
    return b ? "yes" : "-";
}

static void array_print_list(const struct alsa_device *devices, size_t n)
{
    int width = (int)strlen("device");
    for (size_t i = 0; i < n; i++)
        width = (int)strlen(devices[i].name) > width ? (int)strlen(devices[i].name)
                                                     : width;
    printf("%-*s  %-6s %-8s %s\n", width, "device", "plays", "records", "what it is");
    for (size_t i = 0; i < n; i++)
        printf("%-*s  %-6s %-8s %s\n", width, devices[i].name, yes(devices[i].playback),
               yes(devices[i].capture), devices[i].description);
    if (!n || !devices[0].is_card)
        printf("There is no sound card, or no right to use it (group audio).\n");
}

enum { ROWS = 6, CELL = 96 };

/* A cell for each direction. */
struct row {
    const char *name;
    char cells[2][CELL];
};

static void print_row(const struct row *r, int width)
{
    printf("%-9s %-*s  %s\n", r->name, width, r->cells[0], r->cells[1]);
}

static void describe(const struct alsa_capability *c, struct row rows[ROWS], int side)
{
    char *cells[ROWS];
    for (int i = 0; i < ROWS; i++)
        cells[i] = rows[i].cells[side];
    alsa_formats_text(c, cells[0], CELL);
    snprintf(cells[1], CELL, "%u..%u", c->channels_min, c->channels_max);
    alsa_rates_text(c, cells[2], CELL);
    snprintf(cells[3], CELL, "%s%s", c->mmap ? "mmap " : "", c->rw ? "rw" : "");
    snprintf(cells[4], CELL, "%zu..%zu frames", c->period_min, c->period_max);
    snprintf(cells[5], CELL, "%zu..%zu frames", c->buffer_min, c->buffer_max);
}

static void array_print_probe(const char *device, const struct alsa_probe *p)
{
    const struct alsa_capability *sides[] = {&p->playback, &p->capture};
    const bool has[] = {p->has_playback, p->has_capture};
    struct row head = {"", {"playback", "capture"}};
    struct row rows[ROWS] = {{.name = "formats"}, {.name = "channels"},
                             {.name = "rates"},   {.name = "access"},
                             {.name = "period"},  {.name = "buffer"}};
    int width = (int)strlen(head.cells[0]);
    for (int side = 0; side < 2; side++) {
        if (has[side])
            describe(sides[side], rows, side);
        for (int i = 0; i < ROWS; i++)
            if (!has[side])
                strcpy(rows[i].cells[side], "-");
    }
    for (int i = 0; i < ROWS; i++)
        width = (int)strlen(rows[i].cells[0]) > width ? (int)strlen(rows[i].cells[0])
                                                      : width;
    printf("%s\n", device);
    print_row(&head, width);
    for (int i = 0; i < ROWS; i++)
        print_row(&rows[i], width);
    printf("%-9s %s: %s\n", "one clock", p->one_clock ? "yes" : "no", p->clock_reason);
}

static int dump(json_t *root)
{
    int err = !json_whole(root) || json_dumpf(root, stdout, JSON_INDENT(2)) ? -ENOMEM : 0;
    json_decref(root);
    printf("\n");
    return err;
}

/* 0, -ENOMEM. */
static int array_print_list_json(const struct alsa_device *devices, size_t n)
{
    json_t *root = json_array();
    for (size_t i = 0; i < n; i++)
        json_array_append_new(
            root,
            json_pack("{s:s, s:b, s:b, s:b, s:s}", "device", devices[i].name, "playback",
                      devices[i].playback, "capture", devices[i].capture, "card",
                      devices[i].is_card, "description", devices[i].description));
    return dump(root);
}

static json_t *side_json(const struct alsa_capability *c)
{
    json_t *formats = json_array(), *rates = json_array(), *access = json_array();
    for (int f = 0; f < SAMPLE_FORMATS; f++)
        if (c->formats[f])
            json_array_append_new(formats,
                                  json_string(sample_format_name((enum sample_format)f)));
    for (int i = 0; i < ALSA_RATES; i++)
        if (c->rates[i])
            json_array_append_new(rates, json_integer(alsa_rates_hz[i]));
    if (c->mmap)
        json_array_append_new(access, json_string("mmap"));
    if (c->rw)
        json_array_append_new(access, json_string("rw"));
    return json_pack(
        "{s:o, s:[i,i], s:o, s:[i,i], s:o, s:[I,I], s:[I,I]}", "formats", formats,
        "channels", (int)c->channels_min, (int)c->channels_max, "rates_hz", rates,
        "rate_range_hz", (int)c->rate_min_hz, (int)c->rate_max_hz, "access", access,
        "period_frames", (json_int_t)c->period_min, (json_int_t)c->period_max,
        "buffer_frames", (json_int_t)c->buffer_min, (json_int_t)c->buffer_max);
}

static int array_print_probe_json(const char *device, const struct alsa_probe *p)
{
    json_t *root = json_pack("{s:s, s:b, s:s, s:o, s:o}", "device", device, "one_clock",
                             p->one_clock, "clock_reason", p->clock_reason, "playback",
                             p->has_playback ? side_json(&p->playback) : json_null(),
                             "capture",
                             p->has_capture ? side_json(&p->capture) : json_null());
    return dump(root);
}

/* `anlos array`: which sound cards there are, and what they can do. */

static const char help[] =
    "anlos array -- look at the sound cards of this machine\n"
    "\n"
    "usage: anlos array list [--json]\n"
    "       anlos array probe DEVICE [--json]\n"
    "\n"
    "  list      every sound device: those of the cards first, then the plugins that "
    "the\n"
    "            configuration names\n"
    "  probe     what a device can do by itself: formats, channels, rates in Hz, "
    "access,\n"
    "            periods and buffers, and whether playback and capture share a clock, "
    "as\n"
    "            an array needs.  DEVICE: hw:2,0, or a launch file's "
    "alsa:hw:2,0?rig=FILE\n"
    "\n"
    "  --json    as JSON\n"
    "  --help    this text\n"
    "\n"
    "Writes no files.  A device that another program has open cannot be probed.\n"
    "\n"
    "examples\n"
    "  anlos array list\n"
    "  anlos array probe hw:CARD=Loopback,DEV=0\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments, no such device\n";

static const struct usage_option options[] = {
    {"json", USAGE_SWITCH('j')},
    {.name = NULL},
};

static int finish(int err, const char *text)
{
    if (err) {
        fprintf(stderr, "anlos array: %s\n", text);
        return err == -ENOENT || err == -EINVAL ? EXIT_BAD_INPUT : EXIT_FAILED;
    }
    return usage_flush("array");
}

static int list(bool json)
{
    struct alsa_device *devices = NULL;
    size_t n;
    int err = alsa_devices_list(&devices, &n);
    if (!err && json)
        err = array_print_list_json(devices, n);
    else if (!err)
        array_print_list(devices, n);
    free(devices);
    return finish(err, strerror(-err));
}

static int probe(const char *name, bool json)
{
    struct alsa_probe found;
    struct error why = {""};
    const char *arg = device_arg(name, "alsa");
    char *device = strndup(arg ? arg : name, strcspn(arg ? arg : name, "?"));
    if (!device)
        return finish(-ENOMEM, "out of memory");
    int err = alsa_probe(&found, device, &why);
    if (!err && json) {
        err = array_print_probe_json(device, &found);
        error_say(&why, err, "out of memory");
    } else if (!err) {
        array_print_probe(device, &found);
    }
    free(device);
    return finish(err, why.text);
}

int command_array(int argc, char **argv)
{
    struct usage usage = {.command = "array", .help = help, .options = options};
    bool json = false;
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        json = true;
    if (code)
        return ~code;
    const char *verb = optind < argc ? argv[optind] : "";
    int n_names = argc - optind - 1;
    if (!strcmp(verb, "list") && n_names == 0)
        return list(json);
    if (!strcmp(verb, "probe") && n_names == 1)
        return probe(argv[optind + 1], json);
    if (!strcmp(verb, "probe"))
        return usage_error("array", "probe: expected one device; 'anlos array list' has "
                                    "their names");
    return usage_error("array", "%s%sexpected list or probe DEVICE", verb,
                       *verb ? ": " : "");
}
