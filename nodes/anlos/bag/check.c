#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "msgs/bag/check.h"
#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/bag/verb.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/usage.h"

static const char help[] =
    "anlos bag check -- is a bag what it says it is?\n"
    "\n"
    "usage: anlos bag check FILE...\n"
    "\n"
    "Reads all of each file: every checksum, every record, the indexes and statistics\n"
    "against what is really there.  Prints a line for each fault: file, byte, what is\n"
    "wrong.\n"
    "\n"
    "  --help          this text\n"
    "\n"
    "exit codes: 0 no fault; 1 faults were found; 2 bad arguments, or no bag; 130 "
    "stopped\n"
    "by Ctrl-C\n";

static const struct option options[] = {
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

static void print_fault(void *context, uint64_t offset, const char *what)
{
    printf("%s: byte %" PRIu64 ": %s\n", (const char *)context, offset, what);
}

static int check_file(char *path)
{
    const struct bag_check_watch watch = {
        .fault = print_fault, .stop = interrupt_requested, .context = path};
    struct error why = {""};
    uint64_t n_faults;
    int err = bag_check(&n_faults, path, &watch, &why);

    if (err)
        return verb_end("check", err, &why);
    if (n_faults)
        printf("%s: %" PRIu64 " fault%s\n", path, n_faults, n_faults == 1 ? "" : "s");
    else
        printf("%s: no fault\n", path);
    return n_faults ? EXIT_FAILED : EXIT_WORKED;
}

int bag_check_command(int argc, char **argv)
{
    int code, worst = EXIT_WORKED;

    opterr = 0;
    optind = 1;
    while ((code = getopt_long(argc, argv, ":h", options, NULL)) != -1) {
        if (code != 'h')
            return usage_option_error("bag check", code, argv, options);
        return fputs(help, stdout) < 0 ? EXIT_FAILED : EXIT_WORKED;
    }
    if (optind == argc)
        return usage_error("bag check", "FILE is missing");
    interrupt_catch();
    for (; optind < argc && worst != EXIT_INTERRUPTED; optind++) {
        code = check_file(argv[optind]);
        worst = code > worst ? code : worst;
    }
    code = usage_flush("bag check");
    return code ? code : worst;
}
