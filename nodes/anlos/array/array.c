/* nodes/anlos/array/array.c -- `anlos array`: which sound cards there are, and what they
 * can do. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/device.h"
#include "nodes/anlos/array/print.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"

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

static const struct option options[] = {
    {"json", no_argument, NULL, 'j'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
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
    struct complaint why = {""};
    const char *arg = device_arg(name, "alsa");
    char *device = strndup(arg ? arg : name, strcspn(arg ? arg : name, "?"));
    if (!device)
        return finish(-ENOMEM, "out of memory");
    int err = alsa_probe(&found, device, &why);
    if (!err && json) {
        err = array_print_probe_json(device, &found);
        complain(&why, err, "out of memory");
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
