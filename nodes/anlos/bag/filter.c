#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/bag/selection.h"
#include "nodes/anlos/bag/verb.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/usage.h"

static const char help[] =
    "anlos bag filter -- some of a bag's topics, or some of its time\n"
    "\n"
    "usage: anlos bag filter FILE -o OUT [--topics T] [--exclude T] [--start S] [--end "
    "S]\n"
    "                        [--compression C]\n"
    "\n"
    "  -o, --out OUT     the new bag; must not be there\n"
    "  --topics T        only these: names or patterns with commas between, "
    "survey,scan/*\n"
    "  --exclude T       all but these; both may be given several times\n"
    "  --start S         from S seconds after the first message on\n"
    "  --end S           up to S seconds after the first message\n"
    "  --compression C   zstd (default), lz4 or none\n"
    "  --help            this text\n"
    "\n"
    "Attachments and metadata stay.\n"
    "\n"
    "example\n"
    "  anlos bag filter scan.mcap -o sound.mcap --topics survey,ping --end 20\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments or files; 130 stopped by Ctrl-C (no "
    "OUT\n"
    "then)\n";

static const struct option options[] = {
    {"out", required_argument, NULL, 'o'},
    {"topics", required_argument, NULL, 't'},
    {"exclude", required_argument, NULL, 'x'},
    {"start", required_argument, NULL, 's'},
    {"end", required_argument, NULL, 'e'},
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
        return verb_end("filter", err, &why);
    printf("%s: %" PRIu64 " of %" PRIu64 " messages\n", s->out, result.n_written,
           result.n_messages);
    return usage_flush("bag filter");
}

static int take_seconds(const char *name, double *out)
{
    if (!usage_numbers(optarg, 1, out) && *out >= 0.0)
        return 0;
    return usage_error("bag filter", "--%s %s: expected seconds, 0 or more", name,
                       optarg);
}

static int take_option(struct selection *s, int code, char **argv)
{
    switch (code) {
    case 'o':
        s->out = optarg;
        return 0;
    case 't':
        return verb_add_patterns("bag filter", optarg, s->topics_room, &s->topics);
    case 'x':
        return verb_add_patterns("bag filter", optarg, s->exclude_room, &s->exclude);
    case 's':
        return take_seconds("start", &s->start_s);
    case 'e':
        return take_seconds("end", &s->end_s);
    case 'c':
        return verb_take_compression("bag filter", optarg, &s->compression);
    default:
        return usage_option_error("bag filter", code, argv, options);
    }
}

int bag_filter(int argc, char **argv)
{
    struct selection s = {.end_s = INFINITY, .compression = BAG_ZSTD, .n_files = 1};
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
    code = verb_one_operand("bag filter", "FILE", argc, argv);
    if (code)
        return code;
    if (!s.out)
        return usage_error("bag filter", "-o OUT is missing");
    if (s.end_s < s.start_s)
        return usage_error("bag filter", "--end %g comes before --start %g", s.end_s,
                           s.start_s);
    s.files = argv + optind;
    return run(&s);
}
