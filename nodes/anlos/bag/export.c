#include "nodes/anlos/bag/export.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/bag/verb.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/usage.h"

static const char help[] =
    "anlos bag export -- what is in a bag, in the formats of other programs\n"
    "\n"
    "usage: anlos bag export FILE --format F -o OUT [--topic T]... [--scan N] [--full]\n"
    "\n"
    "  format  from topic      OUT\n"
    "  wav     survey, ping    a folder: survey.yaml, scene and background as WAV "
    "files,\n"
    "                          which 'anlos recon' reads; retaken pings come once, a "
    "ping\n"
    "                          that was lost is silence; of an array that stands all\n"
    "                          that it heard, with emissions.csv, and ego.csv of a "
    "vehicle\n"
    "                          that moved: 'anlos bag import' takes them back\n"
    "  csv     detections      a file with a line for each detection; positions in m, "
    "the\n"
    "                          covariance in m2, what is not known empty\n"
    "  json    any             a file with a message on each line, as 'anlos topic "
    "echo'\n"
    "                          prints it\n"
    "  nrrd    volume          a file: float32, x fastest, in m\n"
    "  png     volume          a folder: the maxima along x, y and z, with the "
    "detections\n"
    "  foxglove  all           a bag: this one, and in Foxglove's own schemas the image "
    "as a\n"
    "                          cloud, voxels and pictures, the objects, wall, vehicle, "
    "frames\n"
    "                          and log, under view/: Foxglove and Lichtblick draw them\n"
    "\n"
    "  --format F      wav, csv, json, nrrd, png or foxglove\n"
    "  -o, --out OUT   must not be there; csv and json: - is stdout\n"
    "  --topic T       json: only these, names or patterns with commas between, or "
    "several\n"
    "                  times; all by default\n"
    "  --scan N        wav, nrrd, png: this scan; by default the last one\n"
    "  --full          json: every number of sound and images\n"
    "  --help          this text\n"
    "\n"
    "examples\n"
    "  anlos bag export scan.mcap --format wav -o recording\n"
    "  anlos recon --survey recording/survey.yaml --wav recording/scene \\\n"
    "      --background recording/background --out image\n"
    "\n"
    "exit codes: 0 done; 1 failed, or pings are missing in OUT; 2 bad arguments or "
    "files,\n"
    "or nothing of that is in the bag; 130 stopped by Ctrl-C (no OUT then)\n";

static const struct option options[] = {
    {"format", required_argument, NULL, 'f'},
    {"out", required_argument, NULL, 'o'},
    {"topic", required_argument, NULL, 't'},
    {"scan", required_argument, NULL, 's'},
    {"full", no_argument, NULL, 'u'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

struct format {
    const char *name;
    const char *needs, *wants; /* topics that must be there, and that are taken if so */
    int (*write)(struct stream *, const struct export_options *, struct complaint *);
};

static const struct format formats[] = {
    {"wav", "ping", "survey,ping", NULL},
    {"csv", "detections", "detections", export_csv},
    {"json", NULL, NULL, export_lines},
    {"nrrd", "volume", "volume,detections", export_nrrd_file},
    {"png", "volume", "volume,detections", export_png},
    {"foxglove", "survey", NULL, export_foxglove},
};

static const struct format *find_format(const char *name)
{
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++)
        if (!strcmp(name, formats[i].name))
            return &formats[i];
    return NULL;
}

static int open_stream(struct stream **out, const struct format *f,
                       const struct export_options *o, struct complaint *why)
{
    int err = stream_open(out, o->file, why);

    if (err)
        return err;
    err = stream_require(*out, f->needs ? f->needs : o->topics, why);
    if (err)
        stream_close(*out);
    else
        stream_select(*out, f->wants ? f->wants : o->topics);
    return err;
}

static int run(const struct format *f, const struct export_options *o)
{
    struct stream *s;
    struct complaint why = {""};
    size_t n_missing = 0;

    interrupt_catch();
    int err = open_stream(&s, f, o, &why);
    if (err)
        return verb_end("export", err, &why);
    err = f->write ? f->write(s, o, &why) : export_wav(s, o, &n_missing, &why);
    stream_close(s);
    if (err == -ENODATA) /* not what was asked for */
        err = -EINVAL;
    if (err)
        return verb_end("export", err, &why);
    if (n_missing)
        fprintf(stderr,
                "anlos bag export: %s: %zu pings are missing; silence stands for "
                "them\n",
                o->file, n_missing);
    return fflush(stdout) || n_missing ? EXIT_FAILED : EXIT_WORKED;
}

static int take_option(struct export_options *o, const struct format **f, int code,
                       char **argv)
{
    switch (code) {
    case 'f':
        *f = find_format(optarg);
        if (*f)
            return 0;
        return usage_error("bag export",
                           "--format %s: expected wav, csv, json, nrrd, png or foxglove",
                           optarg);
    case 'o':
        o->out = optarg;
        return 0;
    case 't':
        return verb_add_patterns("bag export", optarg, o->topics_room, &o->topics);
    case 's':
        if (!usage_count(optarg, 1, UINT32_MAX, &o->scan))
            return 0;
        return usage_error("bag export", "--scan %s: expected a whole number above 0",
                           optarg);
    case 'u':
        o->full = true;
        return 0;
    default:
        return usage_option_error("bag export", code, argv, options);
    }
}

static int check(const struct export_options *o, const struct format *f)
{
    bool json = f && !f->needs;

    if (!f)
        return usage_error("bag export", "--format is missing");
    if (!o->out)
        return usage_error("bag export", "-o OUT is missing");
    if (o->full && !json)
        return usage_error("bag export", "--full: only with --format json");
    if (o->scan && (json || !strcmp(f->name, "csv") || !f->wants))
        return usage_error("bag export", "--scan: only with --format wav, nrrd or png");
    if (o->topics && !json && strcmp(o->topics, f->needs))
        return usage_error("bag export", "--topic %s: --format %s is made of %s",
                           o->topics, f->name, f->wants ? f->needs : "all topics");
    return 0;
}

int bag_export(int argc, char **argv)
{
    struct export_options o = {.file = NULL};
    const struct format *format = NULL;
    int code;

    opterr = 0;
    optind = 1;
    while ((code = getopt_long(argc, argv, ":ho:", options, NULL)) != -1) {
        if (code == 'h')
            return fputs(help, stdout) < 0 ? EXIT_FAILED : EXIT_WORKED;
        code = take_option(&o, &format, code, argv);
        if (code)
            return code;
    }
    code = verb_one_operand("bag export", "FILE", argc, argv);
    if (!code)
        code = check(&o, format);
    if (code)
        return code;
    o.file = argv[optind];
    return run(format, &o);
}
