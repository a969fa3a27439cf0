#include "nodes/anlos/bag/bag.h"

#include <stdio.h>
#include <string.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"

struct verb {
    const char *name;
    const char *what;
    int (*run)(int argc, char **argv);
};

static const struct verb verbs[] = {
    {"record", "what goes over the bus of a running system", bag_record},
    {"play", "a recording onto the bus, as if it happened now", bag_play},
    {"info", "what is in a bag: topics, times, sizes, attachments", bag_info},
    {"check", "every checksum, every index against the content", bag_check_command},
    {"recover", "save what is whole in a bag that was cut or damaged",
     bag_recover_command},
    {"merge", "several bags into one", bag_merge},
    {"filter", "some topics, or some of the time", bag_filter},
    {"export", "as WAV, CSV, JSON, NRRD or PNG", bag_export},
    {"import", "make a bag of WAV files or of a MATLAB file", bag_import},
};

#define N_VERBS (sizeof verbs / sizeof *verbs)

static int print_help(void)
{
    printf("anlos bag -- recordings: look at them, check them, cut them, convert them\n\n"
           "usage: anlos bag VERB [arguments]\n\n");
    for (size_t i = 0; i < N_VERBS; i++)
        printf("  %-9s %s\n", verbs[i].name, verbs[i].what);
    printf("\n`anlos bag VERB --help` explains a verb.  Bags are MCAP files, which\n"
           "Foxglove, Lichtblick, PlotJuggler and Rerun open too.\n\n"
           "exit codes: 0 done; 1 failed, or something was lost or is wrong; 2 bad\n"
           "arguments or input; 130 stopped by Ctrl-C\n");
    return usage_flush("bag");
}

int command_bag(int argc, char **argv)
{
    const char *name = argc > 1 ? argv[1] : "";

    if (!strcmp(name, "--help") || !strcmp(name, "-h"))
        return print_help();
    for (size_t i = 0; i < N_VERBS; i++)
        if (!strcmp(name, verbs[i].name))
            return verbs[i].run(argc - 1, argv + 1);
    if (name[0] == '-')
        return usage_error("bag", "%s: no such option; a verb comes first", name);
    return usage_error(
        "bag",
        *name ? "%s: no such verb; expected record, play, info, check, recover, merge, "
                "filter, export or import"
              : "%srecord, play, info, check, recover, merge, filter, export or import "
                "is missing",
        name);
}
