#include "nodes/anlos/recon/options.h"

#include <string.h>

#include "nodes/anlos/confocal/job.h"
#include "nodes/anlos/recon/auto.h"
#include "nodes/anlos/usage.h"
#include "recon/imager.h"

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

int recon_options_check_all(struct recon_options *o)
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
    int code = o->confocal ? check_confocal(o)
               : o->bag    ? check_bag(o)
                           : recon_options_check(o, "recon");
    if (!code && (!o->out || !o->out[0]))
        return usage_error("recon", "--out DIR is missing");
    return code;
}
