#include "nodes/anlos/bag/import.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/usage.h"

static const char help[] =
    "anlos bag import -- make a bag of a recording\n"
    "\n"
    "usage: anlos bag import FOLDER -o OUT [--survey FILE] [--background FOLDER]\n"
    "                        [--ego FILE] [--compression C]\n"
    "       anlos bag import FILE.mat -o OUT [--compression C]\n"
    "\n"
    "FOLDER is what 'anlos sim' writes, or any folder of WAV files with a survey.yaml in "
    "it\n"
    "or beside it.  The bag has what the array would have sent: surveys and pings, the\n"
    "background first.  Of an array that stands, one file may go on without end: round\n"
    "after round of its speakers, or as an emissions.csv beside it says; "
    "launch/drive.md\n"
    "tells how to bring a drive of your own.  FILE.mat is an optical confocal scan "
    "(rect_data, width): each "
    "place\n"
    "becomes a ping, the ranges stay, and light becomes sound of 343 m/s.\n"
    "\n"
    "  -o, --out OUT         the bag; must not be there\n"
    "  --survey FILE         the survey of FOLDER\n"
    "  --background FOLDER   the recording without the hidden objects\n"
    "  --ego FILE            how the vehicle moved: time_s,speed_m_s,yaw_rate_rad_s; by\n"
    "                        default ego.csv in FOLDER or beside it, if there is one\n"
    "  --compression C       zstd (default), lz4 or none\n"
    "  --help                this text\n"
    "\n"
    "Times begin at 1970-01-01 00:00:01, unless emissions.csv says when it was: equal\n"
    "recordings become equal bags.\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments or files; 130 stopped by Ctrl-C (no "
    "OUT\n"
    "then)\n";

static const struct option options[] = {
    {"out", required_argument, NULL, 'o'},
    {"survey", required_argument, NULL, 's'},
    {"background", required_argument, NULL, 'b'},
    {"ego", required_argument, NULL, 'e'},
    {"compression", required_argument, NULL, 'c'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

static bool is_mat(const char *path)
{
    size_t n = strlen(path);

    return n > 4 && !strcmp(path + n - 4, ".mat");
}

static int run(const struct import_options *o)
{
    struct import_bag *bag;
    struct complaint why = {""};

    interrupt_catch();
    int err = import_bag_begin(&bag, o->out, o->compression, &why);
    if (err)
        return verb_end("import", err, &why);
    err = is_mat(o->from) ? import_mat(bag, o, &why) : import_recording(bag, o, &why);
    err = import_bag_end(bag, err, &why);
    if (err)
        return verb_end("import", err, &why);
    return usage_flush("bag import");
}

static int take_option(struct import_options *o, int code, char **argv)
{
    switch (code) {
    case 'o':
        o->out = optarg;
        return 0;
    case 's':
        o->survey = optarg;
        return 0;
    case 'b':
        o->background = optarg;
        return 0;
    case 'e':
        o->ego = optarg;
        return 0;
    case 'c':
        return verb_take_compression("bag import", optarg, &o->compression);
    default:
        return usage_option_error("bag import", code, argv, options);
    }
}

int bag_import(int argc, char **argv)
{
    struct import_options o = {.compression = BAG_ZSTD};
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
    code = verb_one_operand("bag import", "FOLDER or FILE.mat", argc, argv);
    if (code)
        return code;
    if (!o.out)
        return usage_error("bag import", "-o OUT is missing");
    o.from = argv[optind];
    if (is_mat(o.from) && (o.survey || o.background || o.ego))
        return usage_error("bag import",
                           "%s: a .mat has no survey, no background and no motion",
                           o.from);
    return run(&o);
}
