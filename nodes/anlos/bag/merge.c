#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/bag/selection.h"
#include "nodes/anlos/bag/verb.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/usage.h"

static const char help[] =
    "anlos bag merge -- several bags into one\n"
    "\n"
    "usage: anlos bag merge FILE... -o OUT [--compression C]\n"
    "\n"
    "Messages come in the order of their times; attachments and metadata that are the "
    "same\n"
    "in several bags come once.\n"
    "\n"
    "  -o, --out OUT     the new bag; must not be there\n"
    "  --compression C   zstd (default), lz4 or none\n"
    "  --help            this text\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments or files; 130 stopped by Ctrl-C (no "
    "OUT\n"
    "then)\n";

static const struct option options[] = {
    {"out", required_argument, NULL, 'o'},
    {"compression", required_argument, NULL, 'c'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

static int run(const struct selection *s)
{
    struct selection_result result;
    struct error why = {""};

    interrupt_catch();
    int err = selection_write(s, &result, &why);
    if (err)
        return verb_end("merge", err, &why);
    printf("%s: %" PRIu64 " messages of %zu bags\n", s->out, result.n_written,
           s->n_files);
    return usage_flush("bag merge");
}

static int take_option(struct selection *s, int code, char **argv)
{
    switch (code) {
    case 'o':
        s->out = optarg;
        return 0;
    case 'c':
        return verb_take_compression("bag merge", optarg, &s->compression);
    default:
        return usage_option_error("bag merge", code, argv, options);
    }
}

int bag_merge(int argc, char **argv)
{
    struct selection s = {.end_s = INFINITY, .compression = BAG_ZSTD};
    int code;

    opterr = 0;
    optind = 1;
    while ((code = getopt_long(argc, argv, ":ho:", options, NULL)) != -1) {
        if (code == 'h')
            return fputs(help, stdout) < 0 ? EXIT_FAILED : EXIT_WORKED;
        code = take_option(&s, code, argv);
        if (code)
            return code;
    }
    if (optind == argc)
        return usage_error("bag merge", "FILE is missing");
    if (!s.out)
        return usage_error("bag merge", "-o OUT is missing");
    s.files = argv + optind;
    s.n_files = (size_t)(argc - optind);
    return run(&s);
}
