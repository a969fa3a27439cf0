#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/psf/job.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"

#define LARGEST_RESIDUAL 0.1 /* of a fit to a point's image: such are 0.01 to 0.05 */
#define WIDEST           1.6 /* times what the geometry gives a point */

static const char help[] =
    "anlos psf -- how wide, and how turned, the image of a point is\n"
    "\n"
    "usage: anlos psf --survey FILE --wav DIR [--background DIR] [--out DIR] [options]\n"
    "       anlos psf --survey FILE --at X,Y,Z [--out DIR]\n"
    "\n"
    "Measures the point spread function from a recording of one small corner reflector,\n"
    "or computes it from the geometry alone: a Gaussian with rotation is fitted around\n"
    "the brightest place (Lindell 2019, 3.3).  `anlos recon --method iterative --psf\n"
    "FILE` sharpens images with it.\n"
    "\n"
    "  --survey FILE        the array and the recording, as for anlos recon\n"
    "  --wav DIR            a recording of one corner reflector\n"
    "  --background DIR     the same room without it\n"
    "  --at X,Y,Z           in place of a recording: where the point is, in m, in the\n"
    "                       array frame and as mirrored behind the wall\n"
    "  --out DIR            writes psf.json, and the image of the point as\n"
    "                       projection_xy.png, _xz.png, _yz.png\n"
    "  --volume X,Y,Z       where to look for it: minimum, maximum and step of each\n"
    "                       axis in m, nine numbers with commas; default: the survey's\n"
    "  --method NAME        of the image: that which will be sharpened (default: fast;\n"
    "                       backprojection for pings)\n"
    "  --set NAME=VALUE     an option of the method, see anlos recon --help\n"
    "  --window NAME        hann (default), hamming, rectangular\n"
    "  --compression NAME   matched_filter (default), deramp\n"
    "  --threads N          1..256, default: one for each processor\n"
    "  --help               this text\n"
    "\n"
    "example\n"
    "  anlos psf --survey /tmp/corner/survey.yaml --at 0.5,0.5,2.7 --out /tmp/psf\n"
    "  anlos recon --survey /tmp/corner/survey.yaml --wav /tmp/corner/scene \\\n"
    "      --background /tmp/corner/background --method iterative \\\n"
    "      --psf /tmp/psf/psf.json --out /tmp/corner/sharp\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments, survey or recording; 130 stopped by\n"
    "Ctrl-C, nothing written\n";

enum { OPTION_AT = RECON_OPTION_OTHER };

static const struct option options[] = {
    {"survey", required_argument, NULL, RECON_OPTION_SURVEY},
    {"wav", required_argument, NULL, RECON_OPTION_WAV},
    {"background", required_argument, NULL, RECON_OPTION_BACKGROUND},
    {"at", required_argument, NULL, OPTION_AT},
    {"out", required_argument, NULL, RECON_OPTION_OUT},
    {"volume", required_argument, NULL, RECON_OPTION_VOLUME},
    {"method", required_argument, NULL, RECON_OPTION_METHOD},
    {"set", required_argument, NULL, RECON_OPTION_SET},
    {"window", required_argument, NULL, RECON_OPTION_WINDOW},
    {"compression", required_argument, NULL, RECON_OPTION_COMPRESSION},
    {"threads", required_argument, NULL, RECON_OPTION_THREADS},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

struct request {
    struct recon_options recon;
    struct imager_options imaging;
    bool has_at;
    double at_m[3];
};

static int check(const struct request *q, int argc, char **argv)
{
    const struct recon_options *o = &q->recon;
    if (optind < argc)
        return usage_error("psf", "%s: unexpected argument", argv[optind]);
    if (o->out && !o->out[0])
        return usage_error("psf", "--out: expected the name of a folder");
    if (!q->has_at && !o->wav && o->survey)
        return usage_error("psf", "--wav DIR or --at X,Y,Z is missing");
    if (!q->has_at)
        return recon_options_check(o, "psf");
    if (!o->survey)
        return usage_error("psf", "--survey FILE is missing");
    const char *other = o->wav               ? "--wav"
                        : o->background      ? "--background"
                        : o->has_volume      ? "--volume"
                        : o->method          ? "--method"
                        : q->imaging.given   ? "--set"
                        : o->has_window      ? "--window"
                        : o->has_compression ? "--compression"
                                             : NULL;
    return other ? usage_error("psf", "--at stands in place of %s; expected one", other)
                 : 0;
}

/* true: go on; false: end with *exit_code. */
static bool parse(struct request *q, int argc, char **argv, int *exit_code)
{
    struct usage usage = {.command = "psf", .help = help, .options = options};
    int code;
    *exit_code = 0;
    while ((code = usage_next(&usage, argc, argv)) > 0) {
        if (code != OPTION_AT)
            *exit_code = recon_options_take(&q->recon, "psf", code);
        else if (usage_numbers(optarg, 3, q->at_m))
            *exit_code = usage_error("psf", "--at %s: expected X,Y,Z in m", optarg);
        q->has_at |= code == OPTION_AT;
        if (*exit_code)
            return false;
    }
    *exit_code = code ? ~code : check(q, argc, argv);
    return !code && !*exit_code;
}

static void print(const struct psf_job *job, const char *out)
{
    const struct psf *p = &job->file.psf;
    double width_m[3], along_m[3], axes[3][3];
    psf_widths(p, width_m);
    psf_axes(p, along_m, axes);
    printf("point at %.4f, %.4f, %.4f m in the array frame, %s\n", p->centre_m[0],
           p->centre_m[1], p->centre_m[2],
           job->file.measured ? "as recorded" : "from the geometry");
    if (job->file.measured)
        printf("%zu of %zu pings, method %s\n", job->pings, job->pings_expected,
               job->file.method);
    printf("-6 dB widths through it: x %.2f, y %.2f, z %.2f cm\n", 100.0 * width_m[0],
           100.0 * width_m[1], 100.0 * width_m[2]);
    printf("axes of the Gaussian: -6 dB width cm, direction x y z\n");
    for (int a = 0; a < 3; a++)
        printf("  %6.2f   %7.4f %7.4f %7.4f\n", 100.0 * along_m[a], axes[a][0],
               axes[a][1], axes[a][2]);
    printf("residual of the fit: %.1f %% of the peak's amplitude, %zu voxels\n",
           100.0 * p->residual, p->n_voxels);
    if (out)
        printf("%s: psf.json, projection_{xy,xz,yz}.png\n", out);
}

/* Of an image that keeps the phase: something larger than a point, or out of focus. */
static void warn_width(const struct psf_job *job)
{
    double width_m[3];
    const char *method = job->file.method;
    psf_widths(&job->file.psf, width_m);
    if (strcmp(method, "fast") && strcmp(method, "backprojection"))
        return;
    for (int a = 0; a < 3; a++) {
        double expected_m = job->expected_m[a];
        if (width_m[a] > WIDEST * expected_m)
            fprintf(stderr,
                    "anlos psf: %.1f cm wide along %c, and of a point it would be %.1f: "
                    "no small corner reflector, or wrong places of the elements\n",
                    100.0 * width_m[a], "xyz"[a], 100.0 * expected_m);
    }
}

static void warn(const struct psf_job *job)
{
    if (job->file.measured)
        warn_width(job);
    if (job->n_others)
        fprintf(stderr,
                "anlos psf: %zu more place%s nearly as bright: expected one corner "
                "reflector and nothing else\n",
                job->n_others, job->n_others == 1 ? " is" : "s are");
    if (job->file.psf.residual > LARGEST_RESIDUAL)
        fprintf(stderr,
                "anlos psf: the brightest place is no point: the fit is off by %.0f %% "
                "of its peak\n",
                100.0 * job->file.psf.residual);
}

static int write_files(const struct psf_job *job, struct export_stage *stage,
                       struct complaint *why)
{
    int err = psf_file_write(stage->path, &job->file, why);
    if (!err)
        err = export_projections(stage->path, &job->grid, job->intensity, NULL, why);
    if (!err && interrupt_requested())
        err = complain(why, -EINTR, "interrupted");
    return err ? err : export_stage_commit(stage, why);
}

static int run(const struct request *q)
{
    const struct recon_options *o = &q->recon;
    struct export_stage stage;
    struct complaint why = {0};
    struct psf_job job = {0};
    bool bad_input = true;

    interrupt_catch();
    int err = o->out ? export_stage_begin(&stage, o->out, &why) : 0;
    if (!err) {
        err = q->has_at ? psf_job_compute(&job, o->survey, q->at_m, &why)
                        : psf_job_measure(&job, o, &why);
        bad_input = err && err != -ENOMEM && err != -EAGAIN;
        if (!err && o->out)
            err = write_files(&job, &stage, &why);
        if (err && o->out)
            export_stage_abandon(&stage);
    }
    if (!err) {
        warn(&job);
        print(&job, o->out);
    }
    psf_job_clear(&job);
    if (!err)
        return usage_flush("psf");
    fprintf(stderr, "anlos psf: %s\n", why.text);
    return err == -EINTR ? EXIT_INTERRUPTED : bad_input ? EXIT_BAD_INPUT : EXIT_FAILED;
}

int command_psf(int argc, char **argv)
{
    struct request q = {0};
    int exit_code;
    recon_options_default(&q.recon, &q.imaging);
    return parse(&q, argc, argv, &exit_code) ? run(&q) : exit_code;
}
