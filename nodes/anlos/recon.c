#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/confocal.h"
#include "nodes/anlos/confocal_job.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/recon_job.h"
#include "nodes/anlos/recon_report.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"

#define MAX_THREADS 256

static const char default_method[] = "fast";

static const char help[] =
    "anlos recon -- turn a recording into an image of what is hidden\n"
    "\n"
    "usage: anlos recon --survey FILE --wav DIR [--background DIR] --out DIR [options]\n"
    "       anlos recon --confocal FILE.mat --out DIR [--method lct|fk|backprojection]\n"
    "       anlos recon --traces FILE.mat --volume ... --out DIR [options]\n"
    "\n"
    "Reads one multichannel WAV for each stage position (in name order; slot j of a file "
    "is\n"
    "the emission of speaker j), compresses the chirps, images the scene behind the "
    "wall\n"
    "and lists the objects in it.  One process; no nodes need to run.\n"
    "\n"
    "  --survey FILE        geometry and timing of the recording (survey.yaml); with\n"
    "                       'pings: FILE.csv' any array and motion, ping by ping\n"
    "  --wav DIR            the recording\n"
    "  --traces FILE.mat    in place of a recording: compressed traces (MATLAB v5, "
    "v7.3):\n"
    "                       traces [ping][sample] complex or real, tx_m and rx_m "
    "[ping][3],\n"
    "                       fs_hz, t0_s (of sample 0), fc_hz (carrier, or 0), c_m_s;\n"
    "                       --survey may name volume, wall, mount and gate_m for it\n"
    "  --volume X,Y,Z       what to image, in place of the survey's: minimum, maximum "
    "and\n"
    "                       step of each axis in m, nine numbers with commas\n"
    "  --confocal FILE.mat  in place of sound: an optical confocal scan (MATLAB v5, "
    "v7.3):\n"
    "                       rect_data [place][place][time bin] photon counts, width "
    "(half\n"
    "                       the side, m), bin_s (4e-12 when missing); methods lct "
    "(default),\n"
    "                       fk, backprojection\n"
    "  --gate-m NEAR,FAR    of it, from the wall, m; by default from where the direct "
    "light\n"
    "                       has died away to the end\n"
    "  --background DIR     the same room without the hidden objects, subtracted with "
    "its\n"
    "                       phase; without it the room's own echoes stay in the image\n"
    "  --out DIR            where the results go; made when missing\n"
    "  --method NAME        fast (default): moveout and f-k migration, for arrays on a\n"
    "                       regular grid; backprojection: any geometry, slower; to\n"
    "                       compare: confocal, lct, paper, incoherent, iterative,\n"
    "                       sparse (README.md says what each is)\n"
    "  --threads N          1..256, default: one for each processor\n"
    "  --window NAME        of the spectrum: hann (default), hamming, rectangular "
    "(finer,\n"
    "                       with sidelobes in depth)\n"
    "  --compression NAME   matched_filter (default), deramp (the paper's)\n"
    "  --help               this text\n"
    "\n"
    "files written, all or none\n"
    "  volume.nrrd          intensity, float32, x fastest, in metres (3D Slicer, "
    "ParaView)\n"
    "  projection_xy.png    the volume's maxima seen from the front; _xz from above,\n"
    "                       _yz from the side; crosses are the objects, as mirrored\n"
    "  detections.json      the objects where they really are, with covariance\n"
    "  report.json          time and memory of each stage, pings, channels, warnings\n"
    "\n"
    "example\n"
    "  anlos sim launch/scenes/corner.yaml --out /tmp/corner\n"
    "  anlos recon --survey /tmp/corner/survey.yaml --wav /tmp/corner/scene \\\n"
    "      --background /tmp/corner/background --method fast --out /tmp/corner/image\n"
    "\n"
    "exit codes: 0 done; 1 failed (no memory, full disk); 2 bad arguments or input;\n"
    "130 stopped by Ctrl-C, nothing written\n";

enum option_code {
    OPTION_SURVEY = 256,
    OPTION_WAV,
    OPTION_TRACES,
    OPTION_VOLUME,
    OPTION_CONFOCAL,
    OPTION_GATE,
    OPTION_BACKGROUND,
    OPTION_METHOD,
    OPTION_OUT,
    OPTION_THREADS,
    OPTION_WINDOW,
    OPTION_COMPRESSION,
};

static const struct option options[] = {
    {"survey", required_argument, NULL, OPTION_SURVEY},
    {"wav", required_argument, NULL, OPTION_WAV},
    {"traces", required_argument, NULL, OPTION_TRACES},
    {"volume", required_argument, NULL, OPTION_VOLUME},
    {"confocal", required_argument, NULL, OPTION_CONFOCAL},
    {"gate-m", required_argument, NULL, OPTION_GATE},
    {"background", required_argument, NULL, OPTION_BACKGROUND},
    {"method", required_argument, NULL, OPTION_METHOD},
    {"out", required_argument, NULL, OPTION_OUT},
    {"threads", required_argument, NULL, OPTION_THREADS},
    {"window", required_argument, NULL, OPTION_WINDOW},
    {"compression", required_argument, NULL, OPTION_COMPRESSION},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

/* X_MIN,X_MAX,STEP,Y_MIN,... */
static int take_volume(struct recon_options *o, const char *text)
{
    const char *at = text;
    for (int i = 0; i < 9; i++) {
        char *end;
        double value = strtod(at, &end);
        if (end == at || *end != (i < 8 ? ',' : 0))
            return usage_error("recon",
                               "--volume %s: expected nine numbers with commas: minimum, "
                               "maximum and step of x, of y and of z, in m",
                               text);
        o->volume_m[i / 3][i % 3] = value;
        at = end + 1;
    }
    for (int a = 0; a < 3; a++) {
        const double *v = o->volume_m[a];
        if (!(fabs(v[0]) <= 1000.0 && fabs(v[1]) <= 1000.0 && v[0] <= v[1] && v[2] > 0.0))
            return usage_error("recon",
                               "--volume: %c is %g, %g, %g; expected minimum <= maximum "
                               "within +-1000 m and a step above 0",
                               "xyz"[a], v[0], v[1], v[2]);
    }
    o->has_volume = true;
    return 0;
}

/* NEAR,FAR */
static int take_gate(struct recon_options *o, const char *text)
{
    char *end, *last;
    double near_m = strtod(text, &end);
    double far_m = *end == ',' ? strtod(end + 1, &last) : NAN;
    if (!isfinite(far_m) || *last || end == text || !(near_m >= 0.0 && near_m < far_m))
        return usage_error("recon", "--gate-m %s: expected NEAR,FAR with 0 <= near < far",
                           text);
    o->gate_m[0] = near_m;
    o->gate_m[1] = far_m;
    o->has_gate = true;
    return 0;
}

static int take_option(struct recon_options *o, int code, char **argv)
{
    switch (code) {
    case OPTION_SURVEY:
        o->survey = optarg;
        return 0;
    case OPTION_WAV:
        o->wav = optarg;
        return 0;
    case OPTION_TRACES:
        o->traces = optarg;
        return 0;
    case OPTION_VOLUME:
        return take_volume(o, optarg);
    case OPTION_CONFOCAL:
        o->confocal = optarg;
        return 0;
    case OPTION_GATE:
        return take_gate(o, optarg);
    case OPTION_BACKGROUND:
        o->background = optarg;
        return 0;
    case OPTION_METHOD:
        o->method = optarg;
        return 0;
    case OPTION_OUT:
        o->out = optarg;
        return 0;
    case OPTION_THREADS:
        if (!usage_count(optarg, 1, MAX_THREADS, &o->threads))
            return 0;
        return usage_error("recon", "--threads %s: expected a number from 1 to %d",
                           optarg, MAX_THREADS);
    case OPTION_WINDOW:
        if (!window_from_name(optarg, &o->window))
            return 0;
        return usage_error("recon", "--window %s: expected hann, hamming or rectangular",
                           optarg);
    case OPTION_COMPRESSION:
        if (!compression_from_name(optarg, &o->compression))
            return 0;
        return usage_error("recon", "--compression %s: expected matched_filter or deramp",
                           optarg);
    default:
        return usage_option_error("recon", code, argv, options);
    }
}

/* Of an optical scan, which has its own methods. */
static int check_confocal(struct recon_options *o)
{
    if (o->survey || o->wav || o->background || o->traces || o->has_volume)
        return usage_error("recon", "--confocal stands in place of %s; expected one",
                           o->survey       ? "--survey"
                           : o->wav        ? "--wav"
                           : o->background ? "--background"
                           : o->traces     ? "--traces"
                                           : "--volume");
    if (!o->out || !o->out[0])
        return usage_error("recon", "--out DIR is missing");
    if (o->method == default_method)
        o->method = "lct";
    for (const char *m = confocal_methods(); *m; m += strlen(m) + 1)
        if (!strcmp(m, o->method))
            return 0;
    return usage_error("recon",
                       "--method %s: expected lct, fk or backprojection with --confocal",
                       o->method);
}

static int check_options(struct recon_options *o, int argc, char **argv)
{
    if (optind < argc)
        return usage_error("recon", "%s: unexpected argument", argv[optind]);
    if (o->confocal)
        return check_confocal(o);
    if (o->has_gate)
        return usage_error("recon", "--gate-m belongs to --confocal; a survey names its "
                                    "own gate_m");
    if (o->traces && (o->wav || o->background))
        return usage_error("recon", "--traces stands in place of %s; expected one",
                           o->wav ? "--wav" : "--background");
    if (!o->survey && !o->traces)
        return usage_error("recon", "--survey FILE is missing");
    if (!o->wav && !o->traces)
        return usage_error("recon", "--wav DIR is missing");
    if (!o->out || !o->out[0])
        return usage_error("recon", "--out DIR is missing");
    for (const char *m = imager_methods(); *m; m += strlen(m) + 1)
        if (!strcmp(m, o->method))
            return 0;
    return usage_error("recon", "--method %s: no such method; see the list there",
                       o->method);
}

/* The large files, drawn and written side by side. */
struct writing {
    const struct recon_job *job;
    const char *folder;
    atomic_int err; /* the first */
    struct complaint *why;
};

static void write_item(void *ctx, size_t item, size_t thread)
{
    struct writing *w = ctx;
    const struct recon_job *job = w->job;
    struct complaint why = {0};
    int err, none = 0;
    (void)thread;
    if (item < EXPORT_PROJECTIONS)
        err = export_projection(w->folder, item, &job->processing.grid, job->intensity,
                                job->detections, &why);
    else
        err = export_nrrd(w->folder, "volume.nrrd", &job->processing.grid, job->intensity,
                          &why);
    if (err && atomic_compare_exchange_strong(&w->err, &none, err))
        *w->why = why;
}

static int write_report(struct recon_job *job, const char *folder, json_t *warnings,
                        struct complaint *why)
{
    json_t *report = recon_report_create(job, warnings);
    int err = export_json(folder, "report.json", report, why);
    json_decref(report);
    return err;
}

/* began: when the command started, the write times are put into the report. */
static int write_results(struct recon_job *job, const char *folder, json_t *warnings,
                         const struct stopwatch *began, struct complaint *why)
{
    struct writing w = {.job = job, .folder = folder, .why = why};
    struct stopwatch now = stopwatch_now(false), since = *began;

    atomic_init(&w.err, 0);
    pool_run(job->pool, EXPORT_PROJECTIONS + 1, write_item, &w);
    int err = atomic_load(&w.err);
    if (!err)
        err = export_detections(folder, job->detections, why);
    stopwatch_lap(&job->stages[RECON_WRITE], &now, false);
    stopwatch_lap(&job->total, &since, false);
    if (!err)
        return write_report(job, folder, warnings, why);
    json_decref(warnings);
    return err;
}

/* Plans, runs and writes, with the output folder open. */
static int run_in_stage(struct recon_job *job, struct export_stage *stage,
                        const struct stopwatch *began, bool *bad_input,
                        struct complaint *why)
{
    int err = recon_job_plan(job, why);
    if (!err)
        err = recon_job_run(job, why);
    *bad_input = err && err != -ENOMEM && err != -EINTR && err != -EAGAIN;
    if (err)
        return err;
    json_t *warnings = recon_report_warnings(job), *text;
    size_t i;
    json_array_foreach(warnings, i, text)
        fprintf(stderr, "anlos recon: %s\n", json_string_value(text));
    err = write_results(job, stage->path, warnings, began, why);
    if (!err && interrupt_requested())
        err = complain(why, -EINTR, "interrupted");
    return err ? err : export_stage_commit(stage, why);
}

int command_recon(int argc, char **argv)
{
    struct recon_options o = {.method = default_method,
                              .window = WINDOW_HANN,
                              .compression = COMPRESSION_MATCHED_FILTER,
                              .threads = usage_default_threads()};
    struct stopwatch began = stopwatch_now(false);
    struct recon_job job;
    struct export_stage stage;
    struct complaint why = {0};
    bool bad_input = true;
    int code;

    opterr = 0;
    optind = 1;
    while ((code = getopt_long(argc, argv, ":h", options, NULL)) != -1) {
        if (code == 'h')
            return fputs(help, stdout) < 0 ? EXIT_FAILED : EXIT_WORKED;
        code = take_option(&o, code, argv);
        if (code)
            return code;
    }
    code = check_options(&o, argc, argv);
    if (code)
        return code;
    if (o.confocal)
        return confocal_run(&o, &began);

    interrupt_catch();
    int err = recon_job_open(&job, &o, &why);
    if (err == -ENOMEM)
        bad_input = false;
    if (!err)
        err = export_stage_begin(&stage, o.out, &why);
    if (!err) {
        err = run_in_stage(&job, &stage, &began, &bad_input, &why);
        if (err)
            export_stage_abandon(&stage);
        else
            recon_report_print(&job);
    }
    recon_job_clear(&job);
    if (!err)
        return EXIT_WORKED;
    fprintf(stderr, "anlos recon: %s\n", why.text);
    return err == -EINTR ? EXIT_INTERRUPTED : bad_input ? EXIT_BAD_INPUT : EXIT_FAILED;
}
