/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/survey/file.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/psf/file.h"
#include "nodes/anlos/recon/job.h"
#include "nodes/anlos/recon/options.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/export_projection.h"
#include "nodes/rt/stop.h"
#include "recon/grid.h"

/* The point spread function of an array: a Gaussian with rotation fitted to the image of
 * a small corner reflector (Lindell 2019, 3.3), or to that of a point which the geometry
 * alone gives (recon/inverse/psf.h). */

struct psf_job {
    struct psf_file file;
    struct grid grid; /* around the point */
    float *intensity; /* [nz][ny][nx] */
    double
        expected_m[3]; /* widths of a coherent image, from the geometry; measured only */
    size_t n_others;   /* objects nearly as bright as the one that was fitted */
    size_t pings, pings_expected;
};

#define HALF_WIDTHS  2.0 /* of a point's image, on each side of it in fine steps */
#define FINE_STEPS   8.0 /* in a width */
#define OTHER_DB     6.0 /* below the brightest: another object, not a sidelobe */
#define MAX_DETAIL_M 0.5 /* wider is no point whatever the method */

/* A whole reconstruction. */
static int image(struct recon_job *job, const struct recon_options *o, struct error *why)
{
    int err = recon_job_open(job, o, why);
    if (!err)
        err = recon_job_plan(job, why);
    return err ? err : recon_job_run(job, why);
}

static size_t brightest(const struct grid *g, const float *v)
{
    size_t best = 0;
    for (size_t i = 0; i < grid_size(g); i++)
        if (v[i] > v[best])
            best = i;
    return best;
}

static void place(const struct grid *g, size_t voxel, size_t at[3], double at_m[3])
{
    at[0] = voxel % g->n[0];
    at[1] = voxel / g->n[0] % g->n[1];
    at[2] = voxel / (g->n[0] * g->n[1]);
    for (int a = 0; a < 3; a++)
        at_m[a] = g->origin_m[a] + g->step_m[a] * (double)at[a];
}

static size_t count_others(const Anlos__DetectionList *list)
{
    size_t others = 0;
    for (size_t i = 1; i < list->n_detections; i++)
        others += list->detections[i]->level_db >
                  list->detections[0]->level_db - OTHER_DB;
    return others;
}

/* Voxels above half the amplitude along an axis, in m: coarse, but never wild. */
static double seen_width(const struct grid *g, const float *v, const size_t at[3], int a)
{
    size_t stride = a == 0 ? 1 : a == 1 ? g->n[0] : g->n[0] * g->n[1];
    const float *peak = v + at[0] + g->n[0] * (at[1] + g->n[1] * at[2]);
    size_t up = 0, down = 0;
    while (at[a] + up + 1 < g->n[a] && peak[(up + 1) * stride] > 0.25f * *peak)
        up++;
    while (at[a] > down && *(peak - (down + 1) * stride) > 0.25f * *peak)
        down++;
    return (double)(up + down) * g->step_m[a];
}

/* How wide the point's image is there, more or less: as the geometry has it, or as the
 * image has when that is wider (powers, a wrong speed of sound). */
static void guess_widths(const struct recon_job *found, const size_t at[3],
                         const double at_m[3], double width_m[3])
{
    geometry_resolution_at(&found->processing.geometry, found->processing.band_hz, at_m,
                           width_m);
    for (int a = 0; a < 3; a++) {
        double seen_m = seen_width(&found->processing.grid, found->intensity, at, a);
        width_m[a] =
            fmax(isfinite(width_m[a]) ? width_m[a] : 0.0, fmin(seen_m, MAX_DETAIL_M));
    }
}

/* Where the point is, and fine steps around it as the volume of *fine. */
static int find_point(struct psf_job *job, const struct recon_job *found,
                      struct recon_options *fine, struct error *why)
{
    const struct grid *g = &found->processing.grid;
    size_t voxel = brightest(g, found->intensity), at[3];
    double at_m[3], width_m[3];
    place(g, voxel, at, at_m);
    if (!(found->intensity[voxel] > 0.0f))
        return error_say(why, -EINVAL, "the image is empty");
    for (int a = 0; a < 3; a++)
        if (g->n[a] > 1 && (at[a] == 0 || at[a] + 1 == g->n[a]))
            return error_say(
                why, -EINVAL,
                "the brightest place, %.3f, %.3f, %.3f m, lies on the rim of "
                "the volume; expected a corner reflector inside",
                at_m[0], at_m[1], at_m[2]);
    guess_widths(found, at, at_m, width_m);
    for (int a = 0; a < 3; a++) {
        bool extends = g->n[a] > 1 && width_m[a] > 0.0;
        double half_m = extends ? HALF_WIDTHS * width_m[a] : 0.0;
        fine->volume_m[a][0] = at_m[a] - half_m;
        fine->volume_m[a][1] = at_m[a] + half_m;
        fine->volume_m[a][2] = extends ? width_m[a] / FINE_STEPS : g->step_m[a];
    }
    fine->has_volume = true;
    job->n_others = count_others(found->detections);
    return 0;
}

static int fit(struct psf_job *job, struct recon_job *fine, struct error *why)
{
    struct psf_file *f = &job->file;
    job->grid = fine->processing.grid;
    int err = psf_fit(&f->psf, &job->grid, fine->intensity,
                      brightest(&job->grid, fine->intensity));
    if (err)
        return error_say(why, err,
                         err == -ENOMEM ? "out of memory"
                                        : "the brightest place is no point: no "
                                          "Gaussian fits it");
    geometry_resolution_at(&fine->processing.geometry, fine->processing.band_hz,
                           f->psf.centre_m, job->expected_m);
    f->measured = true;
    snprintf(f->method, sizeof f->method, "%s", fine->method);
    memcpy(f->band_hz, fine->processing.band_hz, sizeof f->band_hz);
    job->pings = imager_pings(fine->imager);
    job->pings_expected = fine->survey.n_positions * fine->survey.n_speakers;
    job->intensity = fine->intensity;
    fine->intensity = NULL;
    return 0;
}

/* Images the recording, then the surroundings of its brightest place in fine steps, and
 * fits there.  psf_job_clear it, also after a failure.  0, as recon_job_run, -EINVAL
 * (nothing stands out, or on the volume's rim), -ERANGE (no peak to fit). */
static int psf_job_measure(struct psf_job *job, const struct recon_options *options,
                           struct error *why)
{
    struct recon_job found, near;
    struct recon_options fine = *options;
    memset(job, 0, sizeof *job);
    int err = image(&found, options, why);
    if (!err)
        err = find_point(job, &found, &fine, why);
    recon_job_clear(&found);
    if (err)
        return err;
    err = image(&near, &fine, why);
    if (!err)
        err = fit(job, &near, why);
    recon_job_clear(&near);
    return err;
}

static int check_before(const struct geometry *g, const double at_m[3], struct error *why)
{
    double least_m[3], most_m[3];
    geometry_aperture(g, least_m, most_m);
    return at_m[2] > most_m[2]
               ? 0
               : error_say(why, -EINVAL,
                           "--at %g,%g,%g: not before the array; expected z above %g m",
                           at_m[0], at_m[1], at_m[2], most_m[2]);
}

/* From the survey's geometry and band for a point in the array frame, behind the wall.
 * 0, as survey_load, -ERANGE (the aperture resolves fewer than two axes), -ENOMEM. */
static int psf_job_compute(struct psf_job *job, const char *survey_path,
                           const double at_m[3], struct error *why)
{
    struct survey survey;
    struct geometry geometry;
    memset(job, 0, sizeof *job);
    int err = survey_load(&survey, survey_path, why);
    if (err)
        return err;
    processing_geometry(&geometry, &survey);
    if (!geometry.pings_m) /* those have no front */
        err = check_before(&geometry, at_m, why);
    if (err) {
        survey_clear(&survey);
        return err;
    }
    struct psf_config cfg = {
        .geometry = &geometry,
        .band_hz = {fmin(survey.chirp_start_hz, survey.chirp_stop_hz),
                    fmax(survey.chirp_start_hz, survey.chirp_stop_hz)},
        .at_m = {at_m[0], at_m[1], at_m[2]},
        .stop = interrupt_stops,
    };
    err = psf_compute(&job->file.psf, &cfg, &job->grid, &job->intensity);
    if (err == -ERANGE)
        error_say(why, err,
                  "%s: its aperture resolves fewer than two axes at %g, %g, %g m",
                  survey_path, at_m[0], at_m[1], at_m[2]);
    else if (err == -ECANCELED)
        err = error_say(why, -EINTR, "interrupted");
    else if (err)
        error_say(why, err, "%s", strerror(-err));
    memcpy(job->file.band_hz, cfg.band_hz, sizeof cfg.band_hz);
    strcpy(job->file.method, "geometry");
    survey_clear(&survey);
    return err;
}

static void psf_job_clear(struct psf_job *job)
{
    free(job->intensity);
    memset(job, 0, sizeof *job);
}

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

struct request {
    struct recon_options recon;
    struct imager_options imaging;
    bool has_at;
    double at_m[3];
};

static const struct usage_option options[] = {
    {"survey", USAGE_TEXT(struct request, recon.survey)},
    {"wav", USAGE_TEXT(struct request, recon.wav)},
    {"background", USAGE_TEXT(struct request, recon.background)},
    {"at", USAGE_VALUE(OPTION_AT)},
    {"out", USAGE_TEXT(struct request, recon.out)},
    {"volume", USAGE_VALUE(RECON_OPTION_VOLUME)},
    {"method", USAGE_NAME(RECON_OPTION_METHOD, recon_sound_method_name)},
    {"set", USAGE_VALUE(RECON_OPTION_SET)},
    {"window", USAGE_NAME(RECON_OPTION_WINDOW, recon_window_name)},
    {"compression", USAGE_NAME(RECON_OPTION_COMPRESSION, recon_compression_name)},
    {"threads", USAGE_COUNT(struct request, recon.threads, 1, RECON_MAX_THREADS)},
    {.name = NULL},
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
    struct usage usage = {.command = "psf", .help = help, .options = options, .into = q};
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

static int write_files(const struct psf_job *job, const char *folder, struct error *why)
{
    int err = psf_file_write(folder, &job->file, why);
    if (!err)
        err = export_projections(folder, &job->grid, job->intensity, NULL, why);
    if (!err && interrupt_requested())
        err = error_say(why, -EINTR, "interrupted");
    return err;
}

static int run(const struct request *q)
{
    const struct recon_options *o = &q->recon;
    struct export_stage stage;
    struct error why = {0};
    struct psf_job job = {0};
    bool bad_input = true;

    interrupt_catch();
    int err = o->out ? export_stage_begin(&stage, o->out, &why) : 0;
    if (!err) {
        err = q->has_at ? psf_job_compute(&job, o->survey, q->at_m, &why)
                        : psf_job_measure(&job, o, &why);
        bad_input = err && err != -ENOMEM && err != -EAGAIN;
        if (!err && o->out)
            err = write_files(&job, stage.path, &why);
        if (o->out)
            err = export_stage_end(&stage, err, &why);
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
