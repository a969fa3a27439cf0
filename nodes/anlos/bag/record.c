#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/bag/record_job.h"
#include "nodes/anlos/bag/verb.h"
#include "nodes/anlos/usage.h"

static const char help[] =
    "anlos bag record -- record what goes over the bus of a running system\n"
    "\n"
    "usage: anlos bag record -o FILE [TOPICS...] [options]\n"
    "\n"
    "  TOPICS            names or patterns, also with commas between; default all\n"
    "  -o, --out FILE    the bag; must not be there\n"
    "  --exclude T       all but these: names or patterns with commas between\n"
    "  --duration-s S    ends after S seconds; default: when Ctrl-C is pressed\n"
    "  --split-mb N      begins a new file whenever one has N MB: FILE_0001.mcap,\n"
    "                    FILE_0002.mcap and so on, each of use by itself\n"
    "  --split-s S       and whenever S seconds are over\n"
    "  --quota-mb N      keeps the files of this recording within N MB: the oldest go;\n"
    "                    without --split-mb each has an eighth of that\n"
    "  --compression C   none (default), lz4 or zstd\n"
    "  --flush-ms MS     a message is on the disk after that long at the latest; "
    "default\n"
    "                    1000\n"
    "  --launch FILE     the system's launch file, to be kept with its inputs\n"
    "  --run-dir DIR     where the system's sockets are, default "
    "$XDG_RUNTIME_DIR/anlos,\n"
    "                    else /tmp/anlos-UID\n"
    "  --help            this text\n"
    "\n"
    "May start before the system does.  Messages that get lost are counted, shown, and\n"
    "written into the bag.  A full disk ends the recording, and the bag is whole; after "
    "a\n"
    "crash 'anlos bag recover' gets all but the last moments (--flush-ms).\n"
    "\n"
    "examples\n"
    "  anlos bag record -o scan.mcap\n"
    "  anlos bag record -o drive.mcap 'scan/*' survey ping --split-s 60 --quota-mb "
    "20000\n"
    "\n"
    "exit codes: 0 done, also by Ctrl-C; 1 failed, or messages got lost; 2 bad "
    "arguments\n"
    "or files\n";

static const struct option options[] = {
    {"out", required_argument, NULL, 'o'},
    {"exclude", required_argument, NULL, 'x'},
    {"duration-s", required_argument, NULL, 'd'},
    {"split-mb", required_argument, NULL, 'm'},
    {"split-s", required_argument, NULL, 's'},
    {"quota-mb", required_argument, NULL, 'q'},
    {"compression", required_argument, NULL, 'c'},
    {"flush-ms", required_argument, NULL, 'f'},
    {"launch", required_argument, NULL, 'l'},
    {"run-dir", required_argument, NULL, 'r'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

/* max: what still fits the integers that it becomes. */
static int take_number(const char *name, double max, double *out)
{
    if (!usage_positive(optarg, out) && *out <= max)
        return 0;
    return usage_error("bag record", "--%s %s: expected a number above 0 and up to %g",
                       name, optarg, max);
}

static int take_option(struct record_options *o, int code, char **argv)
{
    switch (code) {
    case 'o':
        o->out = optarg;
        return 0;
    case 'x':
        return verb_add_patterns("bag record", optarg, o->exclude_room, &o->exclude);
    case 'd':
        return take_number("duration-s", 1e9, &o->duration_s);
    case 'm':
        return take_number("split-mb", 1e9, &o->split_mb);
    case 's':
        return take_number("split-s", 1e9, &o->split_s);
    case 'q':
        return take_number("quota-mb", 1e9, &o->quota_mb);
    case 'c':
        return verb_take_compression("bag record", optarg, &o->compression);
    case 'f':
        return take_number("flush-ms", 3600e3, &o->flush_ms);
    case 'l':
        o->launch = optarg;
        return 0;
    case 'r':
        o->run_dir = optarg;
        return 0;
    default:
        return usage_option_error("bag record", code, argv, options);
    }
}

/* Words with commas between.  NULL: no memory. */
static char *join(char **words, int n)
{
    size_t size = 2;

    for (int i = 0; i < n; i++)
        size += strlen(words[i]) + 1;
    char *out = malloc(size), *end = out;
    if (!out)
        return NULL;
    strcpy(out, n ? "" : "*");
    for (int i = 0; i < n; i++) {
        if (i)
            *end++ = ',';
        end = stpcpy(end, words[i]);
    }
    return out;
}

static int run(struct record_options *o, char **words, int n)
{
    struct complaint why = {""};
    bool began = false;

    o->topics = join(words, n);
    int result = o->topics ? record_run(o, &began, &why)
                           : complain(&why, -ENOMEM, "out of memory");
    free(o->topics);
    int code = result < 0 ? verb_end("record", result, &why) : EXIT_WORKED;
    return result && began ? EXIT_FAILED : code;
}

int bag_record(int argc, char **argv)
{
    struct record_options o = {
        .flush_ms = 1000.0, .duration_s = INFINITY, .compression = BAG_NONE};
    int code;

    opterr = 0;
    optind = 1;
    while ((code = getopt_long(argc, argv, ":ho:", options, NULL)) != -1) {
        if (code == 'h')
            return fputs(help, stdout) < 0 ? EXIT_FAILED : EXIT_WORKED;
        code = take_option(&o, code, argv);
        if (code)
            return code;
    }
    if (!o.out)
        return usage_error("bag record", "-o FILE is missing");
    if (o.split_mb > o.quota_mb / 2 && o.quota_mb > 0.0)
        return usage_error("bag record",
                           "--split-mb %g: expected no more than half of --quota-mb %g",
                           o.split_mb, o.quota_mb);
    return run(&o, argv + optind, argc - optind);
}
