#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/bag/info_print.h"
#include "nodes/anlos/bag/verb.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/usage.h"

static const char help[] =
    "anlos bag info -- what is in a bag\n"
    "\n"
    "usage: anlos bag info FILE [--json]\n"
    "\n"
    "Prints times, size and compression; each topic with its type, messages, rate, size\n"
    "before compression and the nodes that it is from; attachments and metadata.\n"
    "\n"
    "  --json          the same as JSON\n"
    "  --help          this text\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments, or no bag, or a damaged one; 130 "
    "stopped\n"
    "by Ctrl-C\n";

static const struct option options[] = {
    {"json", no_argument, NULL, 'j'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

static int print(const char *path, bool json)
{
    struct bag_catalog *catalog = NULL;
    struct contents *contents = malloc(sizeof *contents);
    struct complaint why = {""};

    if (!contents)
        return verb_end("info", -ENOMEM, &why);
    interrupt_catch();
    int err = bag_catalog_open(&catalog, path, &why);
    if (!err) {
        err = contents_read(contents, catalog, &why);
        if (!err)
            err = json ? info_print_json(catalog, contents, &why)
                       : info_print(catalog, contents, &why);
        contents_clear(contents);
    }
    bag_catalog_close(catalog);
    free(contents);
    return verb_end("info", err, &why);
}

int bag_info(int argc, char **argv)
{
    bool json = false;
    int code;

    opterr = 0;
    optind = 1;
    while ((code = getopt_long(argc, argv, ":h", options, NULL)) != -1) {
        if (code == 'h')
            return fputs(help, stdout) < 0 ? EXIT_FAILED : EXIT_WORKED;
        if (code != 'j')
            return usage_option_error("bag info", code, argv, options);
        json = true;
    }
    code = verb_one_operand("bag info", "FILE", argc, argv);
    if (code)
        return code;
    return print(argv[optind], json);
}
