#include "nodes/anlos/confocal/confocal.h"

#include <errno.h>
#include <stdio.h>

#include "nodes/anlos/confocal/job.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"

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
    if (!err)
        err = export_stage_commit(&stage, &why);
    if (err) {
        export_stage_abandon(&stage);
        fprintf(stderr, "anlos recon: %s\n", why.text);
    } else {
        print_summary(&job);
    }
    confocal_job_clear(&job);
    if (!err)
        return EXIT_WORKED;
    return err == -EINTR ? EXIT_INTERRUPTED : bad_input ? EXIT_BAD_INPUT : EXIT_FAILED;
}
