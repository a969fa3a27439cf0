#include "nodes/anlos/recon/options.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "nodes/anlos/confocal/job.h"
#include "nodes/anlos/recon/auto.h"
#include "nodes/anlos/recon/help.h"
#include "nodes/anlos/usage.h"
#include "dsp/nearest.h"
#include "recon/imager.h"

#define MAX_THREADS 256
#define FARTHEST_M  1000.0
#define MOST_GOAL   1e7

static const struct option options[] = {
    {"survey", required_argument, NULL, RECON_OPTION_SURVEY},
    {"wav", required_argument, NULL, RECON_OPTION_WAV},
    {"traces", required_argument, NULL, RECON_OPTION_TRACES},
    {"volume", required_argument, NULL, RECON_OPTION_VOLUME},
    {"confocal", required_argument, NULL, RECON_OPTION_CONFOCAL},
    {"gate-m", required_argument, NULL, RECON_OPTION_GATE},
    {"band-hz", required_argument, NULL, RECON_OPTION_BAND},
    {"bag", required_argument, NULL, RECON_OPTION_BAG},
    {"launch", required_argument, NULL, RECON_OPTION_LAUNCH},
    {"background", required_argument, NULL, RECON_OPTION_BACKGROUND},
    {"method", required_argument, NULL, RECON_OPTION_METHOD},
    {"set", required_argument, NULL, RECON_OPTION_SET},
    {"psf", required_argument, NULL, RECON_OPTION_PSF},
    {"budget-ms", required_argument, NULL, RECON_OPTION_BUDGET},
    {"error-cm", required_argument, NULL, RECON_OPTION_ERROR},
    {"out", required_argument, NULL, RECON_OPTION_OUT},
    {"threads", required_argument, NULL, RECON_OPTION_THREADS},
    {"window", required_argument, NULL, RECON_OPTION_WINDOW},
    {"compression", required_argument, NULL, RECON_OPTION_COMPRESSION},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
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

/* What auto may spend: a time in ms, an error in cm. */
static int take_goal(struct recon_options *o, const char *command, int code)
{
    bool time = code == RECON_OPTION_BUDGET;
    double value, unit = time ? 1e-3 : 1e-2;
    if (usage_numbers(optarg, 1, &value) || !(value > 0.0) || !(value <= MOST_GOAL))
        return usage_error(command, "--%s %s: expected a number above 0, up to %.0f",
                           time ? "budget-ms" : "error-cm", optarg, MOST_GOAL);
    *(time ? &o->budget_s : &o->error_m) = unit * value;
    return 0;
}

static int take_method(struct recon_options *o, const char *command)
{
    char known[256] = "auto", hint[NEAREST_HINT_SIZE];
    o->method = optarg;
    if (imager_has_method(optarg) || confocal_has_method(optarg) ||
        !strcmp(optarg, recon_auto_name))
        return 0;
    for (const char *m = imager_methods(); *m; m += strlen(m) + 1) {
        size_t used = strlen(known);
        snprintf(known + used, sizeof known - used, "%s%s", used ? ", " : "", m);
    }
    return usage_error(command, "--method %s: no such method; expected one of %s%s",
                       optarg, known, nearest_hint(hint, optarg, imager_methods()));
}

static const char **find_text(struct recon_options *o, int code)
{
    switch (code) {
    case RECON_OPTION_SURVEY:
        return &o->survey;
    case RECON_OPTION_WAV:
        return &o->wav;
    case RECON_OPTION_TRACES:
        return &o->traces;
    case RECON_OPTION_CONFOCAL:
        return &o->confocal;
    case RECON_OPTION_BAG:
        return &o->bag;
    case RECON_OPTION_LAUNCH:
        return &o->launch;
    case RECON_OPTION_BACKGROUND:
        return &o->background;
    case RECON_OPTION_PSF:
        return &o->psf;
    default:
        return &o->out;
    }
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
    case RECON_OPTION_BUDGET:
    case RECON_OPTION_ERROR:
        return take_goal(o, command, code);
    case RECON_OPTION_METHOD:
        return take_method(o, command);
    case RECON_OPTION_THREADS:
        if (!usage_count(optarg, 1, MAX_THREADS, &o->threads))
            return 0;
        return usage_error(command, "--threads %s: expected a number from 1 to %d",
                           optarg, MAX_THREADS);
    case RECON_OPTION_WINDOW:
        o->has_window = true;
        if (!window_from_name(optarg, &o->window))
            return 0;
        return usage_error(command, "--window %s: expected hann, hamming or rectangular",
                           optarg);
    case RECON_OPTION_COMPRESSION:
        o->has_compression = true;
        if (!compression_from_name(optarg, &o->compression))
            return 0;
        return usage_error(command, "--compression %s: expected matched_filter or deramp",
                           optarg);
    default:
        *find_text(o, code) = optarg;
        return 0;
    }
}

bool recon_options_parse(struct recon_options *o, int argc, char **argv, int *exit_code)
{
    int code;
    opterr = 0;
    optind = 1;
    while ((code = getopt_long(argc, argv, ":h", options, NULL)) != -1) {
        if (code == 'h')
            *exit_code = recon_help_print(stdout) ? EXIT_FAILED : EXIT_WORKED;
        else if (code == '?' || code == ':')
            *exit_code = usage_option_error("recon", code, argv, options);
        else
            *exit_code = recon_options_take(o, "recon", code);
        if (code == 'h' || *exit_code)
            return false;
    }
    *exit_code = optind < argc
                     ? usage_error("recon", "%s: unexpected argument", argv[optind])
                     : recon_options_check_all(o);
    return !*exit_code;
}
