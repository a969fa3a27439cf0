/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/recon/results.h"

#include <errno.h>
#include <fftw3.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <sys/resource.h>

#include "nodes/rt/export.h"
#include "nodes/rt/export_projection.h"

const char *recon_stage_name(enum recon_stage stage)
{
    static const char *const names[RECON_STAGES] = {
        "plan", "read", "compress", "look", "stack", "image", "detect", "write"};
    return names[stage];
}

/* The large files, drawn and written side by side. */
struct writing {
    const struct recon_results *results;
    const char *folder;
    atomic_int err; /* the first */
    struct error *why;
};

static void write_item(void *ctx, size_t item, size_t thread)
{
    struct writing *w = ctx;
    const struct recon_results *r = w->results;
    struct error why = {0};
    int err, none = 0;
    (void)thread;
    if (item < EXPORT_PROJECTIONS)
        err = export_projection(w->folder, item, r->grid, r->intensity, r->detections,
                                &why);
    else
        err = export_nrrd(w->folder, "volume.nrrd", r->grid, r->intensity, &why);
    if (err && atomic_compare_exchange_strong(&w->err, &none, err))
        *w->why = why;
}

int recon_results_write(struct recon_results *r, const char *folder,
                        const struct stopwatch *began, struct error *why)
{
    struct writing w = {.results = r, .folder = folder, .why = why};
    struct stopwatch now = stopwatch_now(false), since = *began;
    atomic_init(&w.err, 0);
    if (!r->options->no_image)
        pool_run(r->pool, EXPORT_PROJECTIONS + 1, write_item, &w);
    int err = atomic_load(&w.err);
    if (!err)
        err = export_detections(folder, r->detections, why);
    stopwatch_lap(&r->stages[RECON_WRITE], &now, false);
    stopwatch_lap(r->total, &since, false);
    return err;
}

/* -- report.json ------------------------------------------------------------------------
 */

static json_t *times_json(const struct stopwatch *t)
{
    return json_pack("{so, so}", "wall_s", export_real(t->wall_s), "cpu_s",
                     export_real(t->cpu_s));
}

static json_t *stages_json(const struct recon_results *r)
{
    json_t *o = json_object();
    for (int i = 0; i < RECON_STAGES; i++)
        json_object_set_new(o, recon_stage_name(i), times_json(&r->stages[i]));
    json_object_set_new(o, "total", times_json(r->total));
    return o;
}

static json_t *grid_json(const struct grid *g)
{
    return json_pack("{so, so, s[iii]}", "origin_m", export_reals(g->origin_m, 3),
                     "step_m", export_reals(g->step_m, 3), "size", (int)g->n[0],
                     (int)g->n[1], (int)g->n[2]);
}

static json_t *option_json(const struct imager_option *option,
                           const struct imager_options *o)
{
    char text[64];
    imager_option_value(option, o, text, sizeof text);
    switch (option->kind) {
    case IMAGER_OPTION_REAL:
        return json_real(strtod(text, NULL));
    case IMAGER_OPTION_COUNT:
        return json_integer(strtoll(text, NULL, 10));
    case IMAGER_OPTION_SWITCH:
        return json_boolean(text[0] == 'y');
    default:
        return json_string(text);
    }
}

/* Those that the method goes by, given or by default. */
static json_t *options_json(const struct recon_results *r)
{
    const struct imager_options *o = r->imaging;
    json_t *all = json_object();
    for (const struct imager_option *i = imager_option_table; i->name; i++)
        if (imager_option_concerns(i, o, r->method))
            json_object_set_new(all, i->name, option_json(i, o));
    return all;
}

/* What the method decided on by itself, and how it ended. */
static json_t *outcome_json(const struct imager_outcome *out)
{
    json_t *o = json_object();
    if (out->choice)
        json_object_set_new(o, out->choice,
                            json_string(out->chosen ? "always" : "never"));
    if (out->iterates) {
        json_object_set_new(o, "iterations", json_integer((json_int_t)out->iterations));
        json_object_set_new(o, "residual", export_real(out->residual));
        json_object_set_new(o, "converged", json_boolean(out->converged));
    }
    return o;
}

json_t *recon_results_report(const struct recon_results *r, json_t *recording)
{
    struct rusage usage = {0};
    getrusage(RUSAGE_SELF, &usage);
    json_t *report = json_pack(
        "{ss, so, sI, so, so, sI, so, so, so, sI, s{ss, ss, ss}}", "method", r->method,
        "options", options_json(r), "threads", (json_int_t)r->options->threads,
        "recording", recording, "stages", stages_json(r), "peak_memory_bytes",
        (json_int_t)(1024LL * usage.ru_maxrss), "grid", grid_json(r->grid), "gate_m",
        export_reals(r->gate_m, 2), "band_hz",
        r->band_hz ? export_reals(r->band_hz, 2) : json_null(), "objects",
        (json_int_t)r->detections->n_detections, "versions", "anlos", ANLOS_VERSION,
        "fftw", fftwf_version, "compiler", __VERSION__);
    if (r->outcome && (r->outcome->choice || r->outcome->iterates))
        json_object_set_new(report, "result", outcome_json(r->outcome));
    return report;
}

int recon_results_finish(json_t *report, json_t *warnings, const char *folder,
                         struct error *why)
{
    if (json_object_set_new(report, "warnings", warnings)) {
        json_decref(report);
        return error_say(why, -ENOMEM, "out of memory");
    }
    int err = export_json(folder, "report.json", report, why);
    json_decref(report);
    return err;
}
