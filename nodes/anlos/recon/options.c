/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/recon/options.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "nodes/anlos/confocal/confocal.h"
#include "nodes/anlos/recon/auto.h"
#include "nodes/anlos/usage.h"
#include "recon/imaging/imager.h"
#include "recon/imaging/imager_options.h"

/* What `anlos recon --help` says. */

#define COLUMN 23

static const char head[] =
    "anlos recon -- turn a recording into an image of what is hidden\n"
    "\n"
    "usage: anlos recon RECORDING --out DIR [options]\n"
    "       anlos recon --survey FILE --wav DIR [--background DIR] --out DIR [options]\n"
    "       anlos recon --traces FILE.mat --volume ... --out DIR [options]\n"
    "       anlos recon --bag FILE.mcap --out DIR [options]\n"
    "       anlos recon --confocal FILE.mat --out DIR [--method lct|fk|backprojection]\n"
    "\n"
    "Reads one multichannel WAV for each stage position (in name order; slot j of a "
    "file\n"
    "is the emission of speaker j), compresses the chirps, images the scene behind the\n"
    "wall and lists the objects in it.  One process; no nodes need to run.\n"
    "\n"
    "  RECORDING            a folder with survey.yaml, scene and, if there is one,\n"
    "                       background, as anlos sim and bag export make it; or a bag\n"
    "  --survey FILE        geometry and timing of the recording (survey.yaml); with\n"
    "                       'pings: FILE.csv' any array and motion, ping by ping\n"
    "  --wav DIR            the recording\n"
    "  --background DIR     the same room without the hidden objects, subtracted with\n"
    "                       its phase; without it the room's own echoes stay in the\n"
    "                       image\n"
    "  --traces FILE.mat    in place of a recording: compressed traces (MATLAB v5,\n"
    "                       v7.3): traces [ping][sample] complex or real, tx_m and rx_m\n"
    "                       [ping][3], fs_hz, t0_s (of sample 0), fc_hz (carrier, or "
    "0),\n"
    "                       c_m_s; --survey may name volume, wall, mount and gate_m\n"
    "  --band-hz LOW,HIGH   of them: where the echoes are; by default what the file\n"
    "                       says (band_hz), or what stands out of the spectrum and is\n"
    "                       not as loud at all times, as noise is\n"
    "  --volume X,Y,Z       what to image, in place of the survey's: minimum, maximum\n"
    "                       and step of each axis in m, nine numbers with commas\n"
    "  --bag FILE.mcap      in place of a recording: a recorded scan (anlos bag record,\n"
    "                       import), by the same steps and to the same objects and CAN\n"
    "                       frames as when the nodes hear it; settings are those of the\n"
    "                       launch file in the bag and of the options below\n"
    "  --launch FILE        of a bag: these settings in place of those in the bag\n"
    "  --record             of a bag: lists.mcap too, with survey, motion, walls and "
    "the\n"
    "                       lists of objects as they are now, for `anlos score`\n"
    "  --no-image           of a bag: neither volume.nrrd nor projections\n"
    "  --confocal FILE.mat  in place of sound: an optical confocal scan (MATLAB v5,\n"
    "                       v7.3): rect_data [place][place][time bin] photon counts,\n"
    "                       width (half the side, m), bin_s (4e-12 when missing);\n"
    "                       methods lct (default), fk, backprojection\n"
    "  --gate-m NEAR,FAR    of it, from the wall, m; by default from where the direct\n"
    "                       light has died away to the end\n"
    "  --out DIR            where the results go; made when missing\n"
    "  --method NAME        fast: moveout and f-k migration, for arrays on a regular\n"
    "                       grid (default); backprojection: any geometry, slower\n"
    "                       (default with pings and --traces); to compare: confocal,\n"
    "                       lct, paper, incoherent, iterative, sparse (what each is\n"
    "                       says launch/imaging.md); auto: looks at the recording,\n"
    "                       chooses method, pairs, band, depth and steps, and says\n"
    "                       why (not of a bag, nor in a launch file)\n"
    "  --budget-ms N        auto: the time it may take, files not counted; it leaves "
    "out\n"
    "                       pairs and takes coarser steps to keep it\n"
    "  --error-cm X         auto: an error of positions that is good enough; the\n"
    "                       cheapest way that keeps it is taken\n"
    "  --set NAME=VALUE     an option of the method, see below; again for another one\n"
    "  --psf FILE           iterative: the point spread function as `anlos psf` "
    "measured\n"
    "                       it (psf.json); by default from the geometry\n"
    "  --threads N          1..256, default: one for each processor\n"
    "  --window NAME        of the spectrum: hann (default), hamming, rectangular\n"
    "                       (finer, with sidelobes in depth)\n"
    "  --compression NAME   matched_filter (default), deramp (the paper's)\n"
    "  --help               this text\n"
    "\n"
    "options of methods, with their defaults\n";

static const char tail[] =
    "iterative takes those of its base too.  With --confocal lct, snr_db is 3.\n"
    "\n"
    "files written, all or none\n"
    "  volume.nrrd          intensity, float32, x fastest, in metres (3D Slicer,\n"
    "                       ParaView)\n"
    "  projection_xy.png    the volume's maxima seen from the front; _xz from above,\n"
    "                       _yz from the side; crosses are the objects, as imaged\n"
    "  detections.json      the objects where they really are, with covariance\n"
    "  report.json          method and options, time and memory of each stage, pings,\n"
    "                       channels, warnings; of auto the plan: what was seen, what\n"
    "                       each way would take and how exact it would be, and why not\n"
    "  can.candump          of a bag: the frames of the lists of objects\n"
    "  lists.mcap           of a bag, with --record\n"
    "\n"
    "examples\n"
    "  anlos sim launch/scenes/corner.yaml --out /tmp/corner\n"
    "  anlos recon /tmp/corner --out /tmp/corner/image\n"
    "  the same with --method iterative --set l1=0.02 --set tv=0.005\n"
    "  the same with --method auto --error-cm 0.5\n"
    "\n"
    "exit codes: 0 done; 1 failed (no memory, full disk); 2 bad arguments or input;\n"
    "130 stopped by Ctrl-C, nothing written\n";

/* The methods' options with their defaults, a line or two each. */
static void recon_help_settings(FILE *to)
{
    struct imager_options defaults;
    imager_options_default(&defaults);
    for (const struct imager_option *i = imager_option_table; i->name; i++) {
        char value[32], range[128];
        imager_option_value(i, &defaults, value, sizeof value);
        imager_option_range(i, range, sizeof range);
        if (i->kind == IMAGER_OPTION_METHOD)
            strcpy(range, "a method"); /* the list stands above */
        int used = fprintf(to, "  %s=%s", i->name, value);
        fprintf(to, "%*s%s\n%*s", used < COLUMN ? COLUMN - used : 1, "", i->help, COLUMN,
                "");
        for (const char *m = i->methods; *m; m += strlen(m) + 1)
            fprintf(to, "%s%s", m == i->methods ? "" : ", ", m);
        fprintf(to, "; %s\n", range);
    }
}

/* 0, or -EIO. */
static int recon_help_print(FILE *to)
{
    fputs(head, to);
    recon_help_settings(to);
    fputs(tail, to);
    return ferror(to) ? -EIO : 0;
}

/* Of compression, which what comes compressed has behind it. */
static const char *compression_option(const struct recon_options *o)
{
    return o->has_window ? "--window" : o->has_compression ? "--compression" : NULL;
}

/* What belongs to a recording and has no place beside an optical scan or a bag. */
static const char *recording_option(const struct recon_options *o)
{
    return o->survey       ? "--survey"
           : o->wav        ? "--wav"
           : o->background ? "--background"
           : o->traces     ? "--traces"
           : o->has_volume ? "--volume"
           : o->psf        ? "--psf"
                           : NULL;
}

/* A bag goes the way of the nodes, and these image what a survey says, with a method that
 * is named. */
static int check_bag(const struct recon_options *o)
{
    const char *other = recording_option(o);
    if (other)
        return usage_error("recon",
                           "--bag stands in place of %s; expected one (anlos bag "
                           "export --format wav makes a recording of a bag)",
                           other);
    if (o->budget_s > 0.0 || o->error_m > 0.0 ||
        (o->method && !strcmp(o->method, recon_auto_name)))
        return usage_error("recon", "--method auto needs a recording: anlos bag export "
                                    "--format wav makes one of a bag");
    if (o->method && !imager_has_method(o->method))
        return usage_error("recon", "--method %s: only for --confocal", o->method);
    return 0;
}

/* An optical scan has its own methods and nothing of a recording. */
static int check_confocal(struct recon_options *o)
{
    char why[256];
    const char *other = recording_option(o);
    if (other)
        return usage_error("recon", "--confocal stands in place of %s; expected one",
                           other);
    if (compression_option(o))
        return usage_error("recon", "%s is for chirps, which --confocal has not",
                           compression_option(o));
    if (o->budget_s > 0.0 || o->error_m > 0.0)
        return usage_error("recon", "--%s is for --method auto, which --confocal has not",
                           o->budget_s > 0.0 ? "budget-ms" : "error-cm");
    if (!o->method)
        o->method = confocal_methods();
    if (!confocal_has_method(o->method))
        return usage_error(
            "recon", "--method %s: expected lct, fk or backprojection with --confocal",
            o->method);
    if (imager_options_check(o->imaging, o->method, why, sizeof why))
        return usage_error("recon", "--set %s", why);
    if (!imager_option_is_given(o->imaging, "snr_db"))
        o->imaging->snr_db = CONFOCAL_SNR_DB;
    return 0;
}

/* It chooses by itself. */
static int check_automatic(const struct recon_options *o, const char *command)
{
    if (o->imaging->given)
        return usage_error(command, "--set belongs to a method; auto chooses one itself");
    if (o->psf)
        return usage_error(command, "--psf is for --method iterative");
    return 0;
}

int recon_options_check(const struct recon_options *o, const char *command)
{
    char why[256];
    if (o->traces && (o->wav || o->background))
        return usage_error(command, "--traces stands in place of %s; expected one",
                           o->wav ? "--wav" : "--background");
    if (o->traces && compression_option(o))
        return usage_error(command, "%s is for --wav; --traces are compressed already",
                           compression_option(o));
    if (!o->survey && !o->traces && !o->wav && !strcmp(command, "recon"))
        return usage_error(command, "a RECORDING is missing: its folder or bag, or "
                                    "--survey, --bag, --traces or --confocal");
    if (!o->survey && !o->traces)
        return usage_error(command, "--survey FILE is missing");
    if (!o->wav && !o->traces)
        return usage_error(command, "--wav DIR is missing");
    bool automatic = o->method && !strcmp(o->method, recon_auto_name);
    if (!automatic && (o->budget_s > 0.0 || o->error_m > 0.0))
        return usage_error(command, "--%s is for --method auto",
                           o->budget_s > 0.0 ? "budget-ms" : "error-cm");
    if (automatic)
        return check_automatic(o, command);
    if (o->method && !imager_has_method(o->method))
        return usage_error(command, "--method %s: only for --confocal", o->method);
    if (o->method && imager_options_check(o->imaging, o->method, why, sizeof why))
        return usage_error(command, "--set %s", why);
    if (o->psf && (!o->method || strcmp(o->method, "iterative")))
        return usage_error(command, "--psf is for --method iterative");
    if (o->psf && !strcmp(o->imaging->base, "lct"))
        return usage_error(command, "--psf sharpens an image; with --set base=lct there "
                                    "is none");
    return 0;
}

/* The same of all of `anlos recon`, also of a bag or an optical scan, whose defaults it
 * sets. */
static int recon_options_check_all(struct recon_options *o)
{
    if (o->has_gate && !o->confocal)
        return usage_error("recon", "--gate-m belongs to --confocal; a survey names its "
                                    "own gate_m");
    if (o->has_band && !o->traces)
        return usage_error("recon", "--band-hz belongs to --traces; the band of a "
                                    "recording is that of its chirp");
    if (o->confocal && o->bag)
        return usage_error("recon", "--confocal stands in place of --bag; expected one");
    if (o->launch && !o->bag)
        return usage_error("recon", "--launch belongs to --bag");
    if ((o->records || o->no_image) && !o->bag)
        return usage_error("recon", "--%s belongs to --bag",
                           o->records ? "record" : "no-image");
    int code = o->confocal ? check_confocal(o)
               : o->bag    ? check_bag(o)
                           : recon_options_check(o, "recon");
    if (!code && (!o->out || !o->out[0]))
        return usage_error("recon", "--out DIR is missing");
    return code;
}

#define FARTHEST_M 1000.0

const char *recon_sound_method_name(size_t i)
{
    const char *m = imager_methods();

    if (!i)
        return recon_auto_name;
    while (*m && --i)
        m += strlen(m) + 1;
    return *m ? m : NULL;
}

/* Those of sound, and what only light has. */
const char *recon_method_name(size_t i)
{
    size_t n = 0;

    while (recon_sound_method_name(n))
        n++;
    if (i < n)
        return recon_sound_method_name(i);
    for (const char *m = confocal_methods(); *m; m += strlen(m) + 1)
        if (!imager_has_method(m) && i-- == n)
            return m;
    return NULL;
}

const char *recon_window_name(size_t i)
{
    return window_name((enum window)i);
}

const char *recon_compression_name(size_t i)
{
    return compression_name((enum compression)i);
}

/* What auto may spend. */
#define GOAL(field)                                                                      \
    USAGE_NUMBER(struct recon_options, field, USAGE_ABOVE_0, 1e7),                       \
        .expected = "a number above 0, up to 10000000"

static const struct usage_option options[] = {
    {"survey", USAGE_TEXT(struct recon_options, survey)},
    {"wav", USAGE_TEXT(struct recon_options, wav)},
    {"traces", USAGE_TEXT(struct recon_options, traces)},
    {"volume", USAGE_VALUE(RECON_OPTION_VOLUME)},
    {"confocal", USAGE_TEXT(struct recon_options, confocal)},
    {"gate-m", USAGE_VALUE(RECON_OPTION_GATE)},
    {"band-hz", USAGE_VALUE(RECON_OPTION_BAND)},
    {"bag", USAGE_TEXT(struct recon_options, bag)},
    {"launch", USAGE_TEXT(struct recon_options, launch)},
    {"record", USAGE_FLAG(struct recon_options, records)},
    {"no-image", USAGE_FLAG(struct recon_options, no_image)},
    {"background", USAGE_TEXT(struct recon_options, background)},
    {"method", USAGE_NAME(RECON_OPTION_METHOD, recon_method_name)},
    {"set", USAGE_VALUE(RECON_OPTION_SET)},
    {"psf", USAGE_TEXT(struct recon_options, psf)},
    {"budget-ms", GOAL(budget_s), .unit = 1e-3},
    {"error-cm", GOAL(error_m), .unit = 1e-2},
    {"out", USAGE_TEXT(struct recon_options, out)},
    {"threads", USAGE_COUNT(struct recon_options, threads, 1, RECON_MAX_THREADS)},
    {"window", USAGE_NAME(RECON_OPTION_WINDOW, recon_window_name)},
    {"compression", USAGE_NAME(RECON_OPTION_COMPRESSION, recon_compression_name)},
    {.name = NULL},
};

void recon_options_default(struct recon_options *o, struct imager_options *imaging)
{
    imager_options_default(imaging);
    *o = (struct recon_options){.window = WINDOW_HANN,
                                .compression = COMPRESSION_MATCHED_FILTER,
                                .threads = usage_default_threads(),
                                .imaging = imaging};
}

/* -- one argument -----------------------------------------------------------------------
 */
static int take_volume(struct recon_options *o, const char *command)
{
    if (usage_numbers(optarg, 9, o->volume_m[0]))
        return usage_error(command,
                           "--volume %s: expected nine numbers with commas: minimum, "
                           "maximum and step of x, of y and of z, in m",
                           optarg);
    for (int a = 0; a < 3; a++) {
        const double *v = o->volume_m[a];
        if (!(fabs(v[0]) <= FARTHEST_M && fabs(v[1]) <= FARTHEST_M && v[0] <= v[1] &&
              v[2] > 0.0))
            return usage_error(command,
                               "--volume: %c is %g, %g, %g; expected minimum <= maximum "
                               "within +-%g m and a step above 0",
                               "xyz"[a], v[0], v[1], v[2], FARTHEST_M);
    }
    o->has_volume = true;
    return 0;
}

static int take_gate(struct recon_options *o, const char *command)
{
    if (usage_numbers(optarg, 2, o->gate_m) ||
        !(o->gate_m[0] >= 0.0 && o->gate_m[0] < o->gate_m[1]))
        return usage_error(command, "--gate-m %s: expected NEAR,FAR with 0 <= near < far",
                           optarg);
    o->has_gate = true;
    return 0;
}

static int take_band(struct recon_options *o, const char *command)
{
    if (usage_numbers(optarg, 2, o->band_hz) ||
        !(o->band_hz[0] >= 0.0 && o->band_hz[0] < o->band_hz[1]))
        return usage_error(
            command, "--band-hz %s: expected LOW,HIGH with 0 <= low < high", optarg);
    o->has_band = true;
    return 0;
}

static int take_setting(struct recon_options *o, const char *command)
{
    char why[512];
    if (!imager_option_set(o->imaging, optarg, why, sizeof why))
        return 0;
    return usage_error(command, "--set %s", why);
}

int recon_options_take(struct recon_options *o, const char *command, int code)
{
    switch (code) {
    case RECON_OPTION_VOLUME:
        return take_volume(o, command);
    case RECON_OPTION_GATE:
        return take_gate(o, command);
    case RECON_OPTION_BAND:
        return take_band(o, command);
    case RECON_OPTION_SET:
        return take_setting(o, command);
    case RECON_OPTION_METHOD:
        o->method = optarg;
        return 0;
    case RECON_OPTION_WINDOW:
        o->has_window = true;
        o->window = (enum window)choice_index(recon_window_name, optarg);
        return 0;
    default:
        o->has_compression = true;
        o->compression = (enum compression)choice_index(recon_compression_name, optarg);
        return 0;
    }
}

/* Where the parts of a folder are: options borrow their texts. */
static char survey_path[PATH_MAX], wav_path[PATH_MAX], background_path[PATH_MAX];

static bool join(char out[PATH_MAX], const char *folder, const char *name)
{
    size_t n = strlen(folder);

    while (n > 1 && folder[n - 1] == '/')
        n--;
    return snprintf(out, PATH_MAX, "%.*s/%s", (int)n, folder, name) < PATH_MAX;
}

static int take_folder(struct recon_options *o, const char *folder)
{
    if (!join(survey_path, folder, "survey.yaml") || !join(wav_path, folder, "scene") ||
        !join(background_path, folder, "background"))
        return usage_error("recon", "%.100s...: path too long", folder);
    if (access(survey_path, F_OK) || access(wav_path, F_OK))
        return usage_error(
            "recon",
            "%s: expected survey.yaml and scene in it, as anlos sim and bag "
            "export --format wav make them; others are named by --survey "
            "and --wav",
            folder);
    o->survey = survey_path;
    o->wav = wav_path;
    if (!o->background && !access(background_path, F_OK))
        o->background = background_path;
    return 0;
}

/* A recording by itself, and not by its parts. */
static int take_recording(struct recon_options *o, const char *path)
{
    const char *other = o->survey     ? "--survey"
                        : o->wav      ? "--wav"
                        : o->traces   ? "--traces"
                        : o->confocal ? "--confocal"
                        : o->bag      ? "--bag"
                                      : NULL;
    size_t n = strlen(path);
    struct stat st;

    if (other)
        return usage_error("recon", "%s: unexpected argument beside %s", path, other);
    if (stat(path, &st))
        return usage_error("recon", "%s: %s", path, strerror(errno));
    if (S_ISDIR(st.st_mode))
        return take_folder(o, path);
    if (n > 4 && !strcmp(path + n - 4, ".mat"))
        return usage_error(
            "recon", "%s: say what it has: --traces (sound) or --confocal (light)", path);
    o->bag = path;
    return 0;
}

bool recon_options_parse(struct recon_options *o, int argc, char **argv, int *exit_code)
{
    struct usage usage = {.command = "recon",
                          .print_help = recon_help_print,
                          .options = options,
                          .into = o};
    int code;
    while ((code = usage_next(&usage, argc, argv)) > 0)
        if ((*exit_code = recon_options_take(o, "recon", code)) != 0)
            return false;
    if (code) {
        *exit_code = ~code;
        return false;
    }
    *exit_code = optind + 1 < argc
                     ? usage_error("recon", "%s: unexpected argument", argv[optind + 1])
                 : optind < argc ? take_recording(o, argv[optind])
                                 : 0;
    if (!*exit_code)
        *exit_code = recon_options_check_all(o);
    return !*exit_code;
}
