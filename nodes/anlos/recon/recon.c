/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <stdio.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/confocal/confocal.h"
#include "nodes/anlos/recon/job.h"
#include "nodes/anlos/recon/report.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/stop.h"

/* began: when the command started, the write times are put into the report. */
static int write_results(struct recon_job *job, const char *folder, json_t *warnings,
                         const struct stopwatch *began, struct error *why)
{
    struct recon_results r = {
        .options = job->options,
        .method = job->method,
        .imaging = &job->imaging,
        .pool = job->pool,
        .grid = &job->processing.grid,
        .intensity = job->intensity,
        .detections = job->detections,
        .gate_m = job->processing.gate_m,
        .band_hz = job->processing.band_hz,
        .outcome = &job->outcome,
        .stages = job->stages,
        .total = &job->total,
    };
    int err = recon_results_write(&r, folder, began, why);
    if (!err)
        return recon_results_finish(recon_report_create(job, &r), warnings, folder, why);
    json_decref(warnings);
    return err;
}

/* Plans, runs and writes, with the output folder open. */
static int run_in_stage(struct recon_job *job, struct export_stage *stage,
                        const struct stopwatch *began, bool *bad_input, struct error *why)
{
    int err = recon_job_check_background(job, why);
    if (!err)
        err = recon_job_plan(job, why);
    if (!err)
        err = recon_job_run(job, why);
    *bad_input = err && err != -ENOMEM && err != -EINTR && err != -EAGAIN;
    if (err)
        return export_stage_end(stage, err, why);
    json_t *warnings = recon_report_warnings(job), *text;
    size_t i;
    json_array_foreach(warnings, i, text)
        fprintf(stderr, "anlos recon: %s\n", json_string_value(text));
    err = write_results(job, stage->path, warnings, began, why);
    if (!err && interrupt_requested())
        err = error_say(why, -EINTR, "interrupted");
    return export_stage_end(stage, err, why);
}

static int run(const struct recon_options *o, const struct stopwatch *began)
{
    struct recon_job job;
    struct export_stage stage;
    struct error why = {0};
    bool bad_input = true;

    interrupt_catch();
    int err = recon_job_open(&job, o, &why);
    if (err == -ENOMEM)
        bad_input = false;
    if (!err)
        err = export_stage_begin(&stage, o->out, &why);
    if (!err)
        err = run_in_stage(&job, &stage, began, &bad_input, &why);
    if (!err)
        recon_report_print(&job);
    recon_job_clear(&job);
    if (!err)
        return EXIT_WORKED;
    fprintf(stderr, "anlos recon: %s\n", why.text);
    return err == -EINTR ? EXIT_INTERRUPTED : bad_input ? EXIT_BAD_INPUT : EXIT_FAILED;
}

int command_recon(int argc, char **argv)
{
    struct stopwatch began = stopwatch_now(false);
    struct imager_options imaging;
    struct recon_options o;
    int exit_code;

    recon_options_default(&o, &imaging);
    if (!recon_options_parse(&o, argc, argv, &exit_code))
        return exit_code;
    if (o.bag)
        return replay_run(&o, &began);
    return o.confocal ? confocal_run(&o, &began) : run(&o, &began);
}
