#include "nodes/anlos/confocal.h"

#include <errno.h>
#include <fftw3.h>
#include <stdatomic.h>
#include <stdio.h>
#include <sys/resource.h>

#include "nodes/anlos/confocal_job.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"

/* The large files, drawn and written side by side. */
struct writing {
    const struct confocal_job *job;
    const char *folder;
    atomic_int err; /* the first */
    struct complaint *why;
};

static void write_item(void *ctx, size_t item, size_t thread)
{
    struct writing *w = ctx;
    const struct confocal_job *job = w->job;
    struct complaint why = {0};
    int err, none = 0;
    (void)thread;
    if (item < EXPORT_PROJECTIONS)
        err = export_projection(w->folder, item, &job->grid, job->intensity,
                                job->detections, &why);
    else
        err = export_nrrd(w->folder, "volume.nrrd", &job->grid, job->intensity, &why);
    if (err && atomic_compare_exchange_strong(&w->err, &none, err))
        *w->why = why;
}

static json_t *reals(const double *v, size_t n)
{
    json_t *a = json_array();
    for (size_t i = 0; i < n; i++)
        json_array_append_new(a, export_real(v[i]));
    return a;
}

static json_t *stages_json(const struct confocal_job *job)
{
    static const char *const names[RECON_STAGES] = {
        "plan", "read", "compress", "stack", "image", "detect", "write"};
    json_t *o = json_object();
    for (int i = 0; i <= RECON_STAGES; i++) {
        const struct stopwatch *t = i < RECON_STAGES ? &job->stages[i] : &job->total;
        json_object_set_new(o, i < RECON_STAGES ? names[i] : "total",
                            json_pack("{so, so}", "wall_s", export_real(t->wall_s),
                                      "cpu_s", export_real(t->cpu_s)));
    }
    return o;
}

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

static json_t *report_json(const struct confocal_job *job)
{
    const struct recon_options *o = job->options;
    const struct grid *g = &job->grid;
    struct rusage usage = {0};
    getrusage(RUSAGE_SELF, &usage);
    return json_pack(
        "{ss, si, s{ss}, so, sI, s{so, so, s[iii]}, so, so, so, sI, s{ss, ss, ss}, so}",
        "method", o->method, "threads", (int)o->threads, "recording", "confocal",
        o->confocal, "stages", stages_json(job), "peak_memory_bytes",
        (json_int_t)(1024LL * usage.ru_maxrss), "grid", "origin_m", reals(g->origin_m, 3),
        "step_m", reals(g->step_m, 3), "size", (int)g->n[0], (int)g->n[1], (int)g->n[2],
        "gate_m", reals(job->gate_m, 2), "band_hz", reals(job->band_hz, 2),
        "light_speed_m_s", export_real(CONFOCAL_LIGHT_M_S), "objects",
        (json_int_t)job->detections->n_detections, "versions", "anlos", ANLOS_VERSION,
        "fftw", fftwf_version, "compiler", __VERSION__, "warnings", warnings_json(job));
}

static int write_results(struct confocal_job *job, const char *folder,
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
    if (err)
        return err;
    json_t *report = report_json(job);
    if (!report)
        return complain(why, -ENOMEM, "out of memory");
    err = export_json(folder, "report.json", report, why);
    json_decref(report);
    return err;
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
    struct complaint why = {0};
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
        err = complain(&why, -EINTR, "interrupted");
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
