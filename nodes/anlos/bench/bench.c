#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "nodes/anlos/bench/bench.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/usage.h"

#define MAX_THREADS 256
#define MAX_SEEDS   1000000
#define LIMIT_S     20.0

static const char help[] =
    "anlos bench -- what error costs in time, measured\n"
    "\n"
    "usage: anlos bench speed-error [--scenes NAME,...] [--methods NAME,...]\n"
    "                   [--recordings DIR] [--out DIR] [--quick] ...\n"
    "       anlos bench detection [--methods NAME,...] [--seeds N] [--out DIR] "
    "[--quick]\n"
    "       anlos bench drive [--scenes FILE,...] [--launch FILE] [--seeds N | --hours "
    "H]\n"
    "                   [--rounds N] [--jobs N] [--out DIR]\n"
    "       anlos bench drive --bag FILE,... --truth FILE [--out DIR]\n"
    "\n"
    "speed-error images scenes whose truth is known by every method, with all and with\n"
    "fewer speakers and positions, on finer and coarser grids, in other bands, with "
    "other\n"
    "numbers of iterations and threads: one parameter at a time, of fast also some\n"
    "together; of auto, goals in time and error, each held against the best of fast\n"
    "in that time.  Then it measures how time and memory grow with the work, and how "
    "exactly\n"
    "one point is placed in noise beside what is possible at all (Cramer-Rao).\n"
    "detection measures how often one point is found in how much noise.\n"
    "drive tracks what hides in simulated drives, at simulated time, and tells how far\n"
    "the tracks are from the truth: of all drives of a scene, and of the worst for each\n"
    "figure.  Clutter, noise and unknown errors of each drive are its own.  With --bag "
    "it\n"
    "takes the tracks of recorded drives as they were recorded.\n"
    "\n"
    "  --scenes NAME,...    points, corner_reflectors, letter_H, letters_LT (these four "
    "by\n"
    "                       default), or files as `anlos sim` takes; with --recordings,\n"
    "                       what is in there (by default all)\n"
    "  --methods NAME,...   as of `anlos recon`; default: all and auto, of detection "
    "fast\n"
    "  --recordings DIR     takes scenes from a folder, in place of the simulator: NAME "
    "as\n"
    "                       `anlos sim` wrote it (points and corners), or NAME.json,\n"
    "                       NAME_wav/ and NAME_bg_wav/ of the reference simulator\n"
    "  --calibration DIR    the curves of the latter's microphones, with\n"
    "                       channel_mapping.txt\n"
    "  --out DIR            default: out/bench\n"
    "  --limit-s SECONDS    skips a run that is predicted to take longer; default 20\n"
    "  --threads N          at most; default: one for each processor; of drive: for "
    "each\n"
    "                       drive, 1\n"
    "  --seeds N            of noise; default 32, 0: no noise; of detection 400; of "
    "drive:\n"
    "                       drives of each scene, 3 or (--quick) 1, the first as its "
    "file\n"
    "                       says\n"
    "  --launch FILE        of drive: settings, and the scene where --scenes has none;\n"
    "                       default: a recorded background, the wall as the vehicle "
    "tells\n"
    "                       it\n"
    "  --hours H            of drive: as many drives of each scene as take so long\n"
    "  --rounds N           of drive: times that each goes through its scene, with the "
    "same\n"
    "                       clutter; default 1\n"
    "  --jobs N             of drive: side by side; default: one for each processor\n"
    "  --bag FILE,...       of drive: recorded ones, in place of --launch\n"
    "  --truth FILE         who was there: lines of time_s,id,kind,x_m,y_m, which is "
    "the\n"
    "                       first line; Unix time, vehicle frame; of a recorded "
    "simulation\n"
    "                       --scenes FILE says it\n"
    "  --quick              few methods and parameters: under a minute\n"
    "  --help               this text\n"
    "\n"
    "files written\n"
    "  speed-error.csv      a line for each run, as soon as it is done\n"
    "  speed-error.md       the same in tables, with machine, compiler and FFTW\n"
    "  speed-error-SCENE    charts, .svg and .png: error over time, Pareto front marked\n"
    "  noise-lateral, noise-depth, noise.csv\n"
    "  growth-time, growth-memory\n"
    "  detection.csv        of detection\n"
    "  drives.csv           of drive: a line for each, as soon as it is done\n"
    "  drive.json           all figures of each scene or bag\n"
    "  NAME.csv, .svg, .png     GOSPA and OSPA over time, of its first drive\n"
    "  scenes/              what was simulated, or the surveys of what was read\n"
    "\n"
    "example\n"
    "  anlos bench speed-error --quick --out /tmp/bench\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments or input; 130 stopped by Ctrl-C, "
    "what\n"
    "was done until then is written\n";

enum option_code {
    OPTION_SCENES = 256,
    OPTION_METHODS,
    OPTION_RECORDINGS,
    OPTION_CALIBRATION,
    OPTION_OUT,
    OPTION_LIMIT,
    OPTION_THREADS,
    OPTION_SEEDS,
    OPTION_LAUNCH,
    OPTION_HOURS,
    OPTION_ROUNDS,
    OPTION_JOBS,
    OPTION_BAG,
    OPTION_TRUTH,
    OPTION_QUICK,
};

static const struct option options[] = {
    {"scenes", required_argument, NULL, OPTION_SCENES},
    {"methods", required_argument, NULL, OPTION_METHODS},
    {"recordings", required_argument, NULL, OPTION_RECORDINGS},
    {"calibration", required_argument, NULL, OPTION_CALIBRATION},
    {"out", required_argument, NULL, OPTION_OUT},
    {"limit-s", required_argument, NULL, OPTION_LIMIT},
    {"threads", required_argument, NULL, OPTION_THREADS},
    {"seeds", required_argument, NULL, OPTION_SEEDS},
    {"launch", required_argument, NULL, OPTION_LAUNCH},
    {"hours", required_argument, NULL, OPTION_HOURS},
    {"rounds", required_argument, NULL, OPTION_ROUNDS},
    {"jobs", required_argument, NULL, OPTION_JOBS},
    {"bag", required_argument, NULL, OPTION_BAG},
    {"truth", required_argument, NULL, OPTION_TRUTH},
    {"quick", no_argument, NULL, OPTION_QUICK},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

static int take_option(struct bench_options *o, int code)
{
    switch (code) {
    case OPTION_SCENES:
        o->scenes = optarg;
        return 0;
    case OPTION_METHODS:
        o->methods = optarg;
        return 0;
    case OPTION_RECORDINGS:
        o->recordings = optarg;
        return 0;
    case OPTION_CALIBRATION:
        o->calibration = optarg;
        return 0;
    case OPTION_OUT:
        o->out = optarg;
        return *optarg ? 0 : usage_error("bench", "--out: expected a folder");
    case OPTION_LAUNCH:
        o->launch = optarg;
        return 0;
    case OPTION_BAG:
        o->bags = optarg;
        return *optarg ? 0 : usage_error("bench", "--bag: expected files");
    case OPTION_TRUTH:
        o->truth = optarg;
        return 0;
    case OPTION_HOURS:
        return usage_positive(optarg, &o->hours)
                   ? usage_error("bench", "--hours %s: expected hours above 0", optarg)
                   : 0;
    case OPTION_ROUNDS:
        return usage_count(optarg, 1, MAX_SEEDS, &o->rounds)
                   ? usage_error("bench", "--rounds %s: expected a number from 1 to %d",
                                 optarg, MAX_SEEDS)
                   : 0;
    case OPTION_JOBS:
        return usage_count(optarg, 1, MAX_THREADS, &o->jobs)
                   ? usage_error("bench", "--jobs %s: expected a number from 1 to %d",
                                 optarg, MAX_THREADS)
                   : 0;
    case OPTION_LIMIT:
        return usage_positive(optarg, &o->limit_s)
                   ? usage_error("bench", "--limit-s %s: expected seconds above 0",
                                 optarg)
                   : 0;
    case OPTION_THREADS:
        return usage_count(optarg, 1, MAX_THREADS, &o->threads)
                   ? usage_error("bench", "--threads %s: expected a number from 1 to %d",
                                 optarg, MAX_THREADS)
                   : 0;
    default:
        o->quick = true;
        return 0;
    }
}

static int run(const struct bench_options *o,
               int (*bench)(const struct bench_options *, struct error *))
{
    struct error why = {0};
    interrupt_catch();
    int err = bench(o, &why);
    if (!err)
        return EXIT_WORKED;
    fprintf(stderr, "anlos bench: %s\n", why.text);
    return err == -EINTR ? EXIT_INTERRUPTED
           : err == -ENOENT || err == -EINVAL || err == -ENOTSUP || err == -ENOTDIR
               ? EXIT_BAD_INPUT
               : EXIT_FAILED;
}

enum kind { SPEED = 1, DETECTION = 2, DRIVE = 4, BAG = 8 };

/* Only speed-error goes without noise.  text: NULL, not given. */
static int take_seeds(struct bench_options *o, const char *text, enum kind kind)
{
    int least = kind == SPEED ? 0 : 1;

    return text && usage_count(text, (size_t)least, MAX_SEEDS, &o->seeds)
               ? usage_error("bench", "--seeds %s: expected a number from %d to %d", text,
                             least, MAX_SEEDS)
               : 0;
}

/* What only some of them take. */
static int check_kind(const struct bench_options *o, enum kind kind)
{
    const struct {
        bool given;
        const char *name;
        unsigned of;
    } rules[] = {
        {o->scenes, "scenes", SPEED | DRIVE | BAG},
        {o->methods, "methods", SPEED | DETECTION},
        {o->recordings, "recordings", SPEED},
        {o->calibration, "calibration", SPEED},
        {o->limit_s > 0.0, "limit-s", SPEED},
        {o->threads, "threads", SPEED | DETECTION | DRIVE},
        {o->seeds != BENCH_USUAL_SEEDS, "seeds", SPEED | DETECTION | DRIVE},
        {o->quick, "quick", SPEED | DETECTION | DRIVE},
        {o->launch, "launch", DRIVE},
        {o->hours > 0.0, "hours", DRIVE},
        {o->rounds, "rounds", DRIVE},
        {o->jobs, "jobs", DRIVE},
        {o->bags, "bag", BAG},
        {o->truth, "truth", BAG},
    };
    for (size_t i = 0; i < sizeof rules / sizeof *rules; i++)
        if (rules[i].given && !(rules[i].of & kind))
            return usage_error("bench", "--%s is not for %s", rules[i].name,
                               kind == SPEED       ? "speed-error"
                               : kind == DETECTION ? "detection"
                               : kind == DRIVE     ? "drive without --bag"
                                                   : "drive --bag");
    if (o->hours > 0.0 && o->seeds != BENCH_USUAL_SEEDS)
        return usage_error("bench", "--hours and --seeds: expected one of them");
    return 0;
}

static void set_defaults(struct bench_options *o, enum kind kind)
{
    if (!(o->limit_s > 0.0))
        o->limit_s = LIMIT_S;
    if (!o->threads)
        o->threads = kind == DRIVE ? 1 : usage_default_threads();
    if (!o->rounds)
        o->rounds = 1;
    if (!o->jobs)
        o->jobs = usage_default_threads();
}

int command_bench(int argc, char **argv)
{
    struct bench_options o = {.out = "out/bench", .seeds = BENCH_USUAL_SEEDS};
    struct usage usage = {.command = "bench", .help = help, .options = options};
    const char *seeds = NULL; /* how many there may be is said by what comes after them */
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        if (code == OPTION_SEEDS)
            seeds = optarg;
        else if ((code = take_option(&o, code)) != 0)
            return code;
    if (code)
        return ~code;
    if (optind >= argc)
        return usage_error("bench", "expected speed-error, detection or drive");
    const char *what = argv[optind];
    bool speed = !strcmp(what, "speed-error"), drive = !strcmp(what, "drive");
    if (optind + 1 < argc)
        return usage_error("bench", "%s: unexpected argument", argv[optind + 1]);
    if (!speed && !drive && strcmp(what, "detection"))
        return usage_error("bench", "%s: expected speed-error, detection or drive", what);
    enum kind kind = speed ? SPEED : !drive ? DETECTION : o.bags ? BAG : DRIVE;
    code = take_seeds(&o, seeds, kind);
    if (code || (code = check_kind(&o, kind)) != 0)
        return code;
    set_defaults(&o, kind);
    return run(&o, speed ? bench_speed : drive ? bench_drive : bench_detection);
}
