/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/confocal/confocal.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "nodes/anlos/confocal/scan.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/stop.h"
#include "recon/coherent/fk.h"
#include "recon/detection/objects.h"
#include "recon/imaging/imager.h"
#include "recon/power/lightcone.h"
#include "recon/processing.h"

/* An optical scan to a volume: by the light-cone transform of its counts (Lindell 2019,
 * Eq. 9), or by f-k migration or back-projection of their square roots as a wave
 * (nodes/anlos/confocal/scan.h). */

#define FALLOFF     2.0 /* of a retroreflector's counts, as 1 / r^n */
#define LEVEL_BINS  8   /* that the level of darkness is the mean of */
#define DEPTH_STEPS 2.5 /* voxels in a pulse's width, c / 2 B */

/* -- light-cone transform ---------------------------------------------------------------
 */

/* What all bins hold: dark counts and light from everywhere.  The darkest bins of the
 * whole scan tell. */
static void remove_level(struct confocal_scan *s)
{
    size_t places = s->nx * s->ny, width = s->n < LEVEL_BINS ? s->n : LEVEL_BINS;
    double level = INFINITY, sum = 0.0;
    for (size_t i = 0; i < s->n; i++) {
        for (size_t q = 0; q < places; q++) {
            sum += s->counts[q * s->n + i];
            if (i >= width)
                sum -= s->counts[q * s->n + i - width];
        }
        if (i + 1 >= width)
            level = fmin(level, sum / (double)(places * width));
    }
    for (size_t i = 0; i < places * s->n; i++)
        s->counts[i] -= (float)level;
}

static int run_lightcone(struct confocal_job *job, struct confocal_scan *s,
                         struct error *why)
{
    const struct imager_options *o = job->options->imaging;
    struct lightcone_config cfg = {
        .nx = s->nx,
        .ny = s->ny,
        .pitch_x_m = s->pitch_x_m,
        .pitch_y_m = s->pitch_y_m,
        .nt = s->n,
        .range_m = s->range_m,
        .range_step_m = s->range_step_m,
        .falloff = FALLOFF,
        .snr = pow(10.0, 0.1 * (o ? o->snr_db : CONFOCAL_SNR_DB)),
        .pool = job->pool,
    };
    struct lightcone *l;
    struct stopwatch now = stopwatch_now(false);
    int err = lightcone_create(&l, &cfg);
    if (err)
        return error_say(why, err, "method 'lct': %s", strerror(-err));
    stopwatch_lap(&job->stages[RECON_PLAN], &now, false);
    if (!pool_stopped(job->pool))
        remove_level(s);
    lightcone_inverse(l, s->counts, job->intensity);
    lightcone_destroy(l);
    for (size_t v = 0; v < grid_size(&job->grid); v++)
        job->intensity[v] = job->intensity[v] > 0.0f ? job->intensity[v] : 0.0f;
    stopwatch_lap(&job->stages[RECON_IMAGE], &now, false);
    return 0;
}

/* -- waves ------------------------------------------------------------------------------
 */
static double *lines(double first_m, double pitch_m, size_t n)
{
    double *at = malloc(n * sizeof *at);
    for (size_t i = 0; at && i < n; i++)
        at[i] = first_m + (double)i * pitch_m;
    return at;
}

static int migrate(struct confocal_job *job, const struct confocal_scan *s,
                   const struct confocal_traces *t)
{
    struct stopwatch now = stopwatch_now(false);
    double *x_m = lines(job->grid.origin_m[0], s->pitch_x_m, s->nx);
    double *y_m = lines(job->grid.origin_m[1], s->pitch_y_m, s->ny);
    float *weight = malloc(s->nx * s->ny * sizeof *weight);
    struct fk_config cfg = {
        .sound_speed_m_s = CONFOCAL_LIGHT_M_S,
        .nx = s->nx,
        .ny = s->ny,
        .x_m = x_m,
        .y_m = y_m,
        .trace = t->format,
        .band_hz = {t->band_hz[0], t->band_hz[1]},
        .grid = job->grid,
        .pool = job->pool,
    };
    struct fk *m = NULL;
    int err = x_m && y_m && weight ? fk_create(&m, &cfg) : -ENOMEM;
    stopwatch_lap(&job->stages[RECON_PLAN], &now, false);
    if (!err) {
        for (size_t q = 0; q < s->nx * s->ny; q++)
            weight[q] = 1.0f;
        fk_migrate(m, t->traces, weight, job->intensity);
        stopwatch_lap(&job->stages[RECON_IMAGE], &now, false);
    }
    fk_destroy(m);
    free(weight);
    free(x_m);
    free(y_m);
    return err;
}

/* Back-projection expects echoes that fade as 1 / r^2; the root of a retroreflector's
 * counts fades as 1 / r. */
static void fade(struct confocal_traces *t, const struct confocal_scan *s)
{
    for (size_t q = 0; q < s->nx * s->ny; q++) {
        float *x = (float *)(t->traces + q * s->n);
        for (size_t i = 0; i < s->n; i++) {
            double range_m = s->range_m + (double)i * s->range_step_m;
            float gain = (float)(1.0 / fmax(range_m, s->range_step_m));
            x[2 * i] *= gain;
            x[2 * i + 1] *= gain;
        }
    }
}

static int backproject(struct confocal_job *job, const struct confocal_scan *s,
                       struct confocal_traces *t, const char **reason)
{
    struct stopwatch now = stopwatch_now(false);
    struct geometry geometry;
    struct imager *im;
    processing_geometry(&geometry, &job->survey);
    struct imager_config cfg = {
        .method = "backprojection",
        .geometry = &geometry,
        .format = t->format,
        .band_hz = {t->band_hz[0], t->band_hz[1]},
        .gate_m = {job->gate_m[0], job->gate_m[1]},
        .grid = job->grid,
        .pool = job->pool,
        .options = job->options->imaging,
    };
    int err = imager_create(&im, &cfg, reason);
    stopwatch_lap(&job->stages[RECON_PLAN], &now, false);
    if (err)
        return err;
    fade(t, s);
    for (size_t q = 0; q < s->nx * s->ny; q++)
        imager_add(im, q, 0, t->traces + q * s->n, NULL);
    stopwatch_lap(&job->stages[RECON_STACK], &now, false);
    err = imager_image(im, job->intensity);
    stopwatch_lap(&job->stages[RECON_IMAGE], &now, false);
    imager_destroy(im);
    return err;
}

/* -- any method -------------------------------------------------------------------------
 */

/* A ping at each place of the scan, [nx][ny], so that what works for sound knows where
 * light leaves and returns. */
static int fill_survey(struct survey *v, const struct confocal_scan *s,
                       const struct grid *g)
{
    size_t n = s->nx * s->ny;
    v->source = SURVEY_REPLAY;
    v->sound_speed_m_s = CONFOCAL_LIGHT_M_S;
    v->temperature_c = NAN;
    if (survey_make_pings(v, n))
        return -ENOMEM;
    for (size_t q = 0; q < n; q++) {
        for (int end = 0; end < 2; end++) {
            v->pings_m[q][end][0] = g->origin_m[0] + (double)(q / s->ny) * s->pitch_x_m;
            v->pings_m[q][end][1] = g->origin_m[1] + (double)(q % s->ny) * s->pitch_y_m;
        }
    }
    return 0;
}

static int plan_grid(struct confocal_job *job, const struct confocal_scan *s,
                     double step_m, struct error *why)
{
    double depth_m = (double)(s->n - 1) * s->range_step_m;
    job->grid = (struct grid){
        {-0.5 * (double)(s->nx - 1) * s->pitch_x_m,
         -0.5 * (double)(s->ny - 1) * s->pitch_y_m, s->range_m},
        {s->pitch_x_m, s->pitch_y_m, step_m},
        {s->nx, s->ny, (size_t)floor(depth_m / step_m + 1e-6) + 1},
    };
    if (job->grid.origin_m[2] < 0.5 * step_m) /* no voxel on the wall itself */
        job->grid.origin_m[2] = 0.5 * step_m;
    job->intensity = calloc(grid_size(&job->grid), sizeof *job->intensity);
    if (!job->intensity || fill_survey(&job->survey, s, &job->grid))
        return error_say(why, -ENOMEM, "out of memory");
    return 0;
}

static int run_waves(struct confocal_job *job, const struct confocal_scan *s,
                     struct error *why)
{
    struct confocal_traces t;
    struct stopwatch now = stopwatch_now(false);
    const char *reason = NULL;
    int err = confocal_traces_create(&t, s, why);
    stopwatch_lap(&job->stages[RECON_COMPRESS], &now, false);
    if (err)
        return err;
    double width_hz = t.band_hz[1] - t.band_hz[0];
    err = plan_grid(job, s, 0.5 * CONFOCAL_LIGHT_M_S / (width_hz * DEPTH_STEPS), why);
    if (!err) {
        memcpy(job->band_hz, t.band_hz, sizeof job->band_hz);
        job->survey.chirp_start_hz = t.band_hz[0];
        job->survey.chirp_stop_hz = t.band_hz[1];
        job->survey.sample_rate_hz = t.format.rate_hz;
        err = strcmp(job->options->method, "fk") ? backproject(job, s, &t, &reason)
                                                 : migrate(job, s, &t);
        if (err)
            error_say(why, err, "method '%s': %s", job->options->method,
                      reason && *reason ? reason : strerror(-err));
    }
    confocal_traces_clear(&t);
    return err;
}

/* By the job's options: sets its grid, intensity, survey and band_hz.  The scan's counts
 * may change.  0, -ENODATA (nothing changes over time), -ENOTSUP (the method cannot),
 * -ENOMEM. */
static int confocal_image(struct confocal_job *job, struct confocal_scan *s,
                          struct error *why)
{
    if (strcmp(job->options->method, "lct"))
        return run_waves(job, s, why);
    int err = plan_grid(job, s, s->range_step_m, why);
    if (err)
        return err;
    job->grid.origin_m[2] = s->range_m;
    job->survey.chirp_stop_hz = 0.5 * CONFOCAL_LIGHT_M_S / s->range_step_m;
    job->survey.sample_rate_hz = 2.0 * job->survey.chirp_stop_hz;
    return run_lightcone(job, s, why);
}

#define MAX_BINS      512
#define JITTER_STEP_M 4e-3 /* half of what 60 ps are in range: this kind of detector */
#define CLUSTER       4.0  /* places of the scan: bright ones closer are one */

const char *confocal_methods(void)
{
    return "lct\0fk\0backprojection\0";
}

bool confocal_has_method(const char *name)
{
    for (const char *m = confocal_methods(); *m; m += strlen(m) + 1)
        if (!strcmp(m, name))
            return true;
    return false;
}

static int read_scan(struct confocal_job *job, struct confocal_scan *s, struct error *why)
{
    const struct recon_options *o = job->options;
    struct confocal_file file;
    int err = confocal_file_load(&file, o->confocal, why);
    if (!err) {
        confocal_file_gate(&file, job->gate_m);
        if (o->has_gate)
            memcpy(job->gate_m, o->gate_m, sizeof job->gate_m);
        job->n_not_finite = file.n_not_finite;
        double least_m = strcmp(o->method, "lct") ? 0.0 : JITTER_STEP_M;
        err = confocal_scan_create(s, &file, job->gate_m, MAX_BINS, least_m, why);
        job->gate_m[1] = fmin(job->gate_m[1], (double)file.n_bins * file.bin_m);
    }
    confocal_file_clear(&file);
    return err;
}

static int detect(struct confocal_job *job, struct error *why)
{
    struct detect_config cfg;
    struct object_list list;
    struct stopwatch now = stopwatch_now(false);
    detect_config_default(&cfg);
    cfg.cluster_m = CLUSTER * fmax(job->grid.step_m[0], job->grid.step_m[1]);
    int err =
        objects_find(&list, &job->survey, NULL, &cfg, 0.0, &job->grid, job->intensity);
    if (!err)
        err = detections_from_objects(&job->detections, &list);
    stopwatch_lap(&job->stages[RECON_DETECT], &now, false);
    return err ? error_say(why, err, "detection: %s", strerror(-err)) : 0;
}

int confocal_job_run(struct confocal_job *job, const struct recon_options *options,
                     struct error *why)
{
    struct confocal_scan scan = {0};
    struct stopwatch now = stopwatch_now(false);
    memset(job, 0, sizeof *job);
    job->options = options;
    int err = read_scan(job, &scan, why); /* it forks: before there are threads */
    stopwatch_lap(&job->stages[RECON_READ], &now, false);
    if (!err) {
        err = pool_create(&job->pool, options->threads);
        if (err)
            error_say(why, err, "%zu threads: %s", options->threads, strerror(-err));
    }
    if (!err) {
        pool_stop_by(job->pool, interrupt_stops, NULL);
        if (!pool_stopped(job->pool))
            err = confocal_image(job, &scan, why);
    }
    if (interrupt_requested())
        err = error_say(why, -EINTR, "interrupted");
    if (!err)
        err = detect(job, why);
    confocal_scan_clear(&scan);
    return err;
}

void confocal_job_clear(struct confocal_job *job)
{
    detections_free(job->detections);
    free(job->intensity);
    pool_destroy(job->pool);
    survey_clear(&job->survey);
    memset(job, 0, sizeof *job);
}

/* -- files, and a line on the screen ----------------------------------------------------
 */

static json_t *warnings_json(const struct confocal_job *job)
{
    json_t *warnings = json_array();
    char text[128];
    if (job->n_not_finite) {
        snprintf(text, sizeof text, "rect_data: %zu samples are not finite: taken as 0",
                 job->n_not_finite);
        json_array_append_new(warnings, json_string(text));
        fprintf(stderr, "anlos recon: %s\n", text);
    }
    return warnings;
}

static int write_results(struct confocal_job *job, const char *folder,
                         const struct stopwatch *began, struct error *why)
{
    struct recon_results r = {
        .options = job->options,
        .method = job->options->method,
        .imaging = job->options->imaging,
        .pool = job->pool,
        .grid = &job->grid,
        .intensity = job->intensity,
        .detections = job->detections,
        .gate_m = job->gate_m,
        .band_hz = job->band_hz[1] > 0.0 ? job->band_hz : NULL,
        .stages = job->stages,
        .total = &job->total,
    };
    int err = recon_results_write(&r, folder, began, why);
    if (err)
        return err;
    json_t *recording = json_pack("{ss}", "confocal", job->options->confocal);
    json_t *report = recon_results_report(&r, recording);
    json_object_set_new(report, "light_speed_m_s", export_real(CONFOCAL_LIGHT_M_S));
    return recon_results_finish(report, warnings_json(job), folder, why);
}

static void print_summary(const struct confocal_job *job)
{
    printf("%zu bright places, gate %.3f to %.3f m from the wall, method %s: %.2f s "
           "(read %.2f, image %.2f)\n"
           "%s: volume.nrrd, projection_{xy,xz,yz}.png, detections.json, report.json\n",
           job->detections->n_detections, job->gate_m[0], job->gate_m[1],
           job->options->method, job->total.wall_s, job->stages[RECON_READ].wall_s,
           job->stages[RECON_IMAGE].wall_s, job->options->out);
}

int confocal_run(const struct recon_options *options, const struct stopwatch *began)
{
    struct confocal_job job;
    struct export_stage stage;
    struct error why = {0};
    bool bad_input = true;

    interrupt_catch();
    int err = export_stage_begin(&stage, options->out, &why);
    if (err) {
        fprintf(stderr, "anlos recon: %s\n", why.text);
        return EXIT_BAD_INPUT;
    }
    err = confocal_job_run(&job, options, &why);
    bad_input = err != -ENOMEM && err != -EAGAIN;
    if (!err) {
        bad_input = false;
        err = write_results(&job, stage.path, began, &why);
    }
    if (!err && interrupt_requested())
        err = error_say(&why, -EINTR, "interrupted");
    err = export_stage_end(&stage, err, &why);
    if (err)
        fprintf(stderr, "anlos recon: %s\n", why.text);
    else
        print_summary(&job);
    confocal_job_clear(&job);
    if (!err)
        return EXIT_WORKED;
    return err == -EINTR ? EXIT_INTERRUPTED : bad_input ? EXIT_BAD_INPUT : EXIT_FAILED;
}
