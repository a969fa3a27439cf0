#include "nodes/anlos/speed_error/table.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/utsname.h>

#include "nodes/anlos/speed_error/results.h"
#include "nodes/anlos/recon/auto.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export_file.h"

/* What figures were measured on. */

#ifdef __clang__
#define COMPILER __VERSION__ /* says its name itself */
#else
#define COMPILER "gcc " __VERSION__
#endif

static void find_processor(char *text, size_t size)
{
    FILE *f = fopen("/proc/cpuinfo", "r");
    char line[256];
    snprintf(text, size, "unknown processor");
    while (f && fgets(line, sizeof line, f)) {
        const char *value = strchr(line, ':');
        if (strncmp(line, "model name", 10) || !value)
            continue;
        value += 1 + strspn(value + 1, " \t");
        snprintf(text, size, "%.*s", (int)strcspn(value, "\n"), value);
        break;
    }
    if (f)
        fclose(f);
}

/* "AMD EPYC 7763, 2 processors, Linux 6.1; gcc 12.2.0; FFTW 3.3.10". */
static void bench_machine(char *text, size_t size)
{
    char processor[128];
    struct utsname system = {.sysname = "?"};
    size_t n = usage_default_threads();
    find_processor(processor, sizeof processor);
    uname(&system);
    snprintf(text, size, "%s, %zu processor%s, %s %s; %s; %s", processor, n,
             n == 1 ? "" : "s", system.sysname, system.release, COMPILER, fftwf_version);
}

#define WORSE 1.1 /* times the error of fast: more, and auto has chosen badly */

void bench_table_setting(const struct bench_case *c, char *text, size_t size)
{
    size_t used = 0;
    if (c->in_time_of_fast && !(c->budget_s > 0.0))
        used = (size_t)snprintf(text, size, "in the time of fast");
    else if (c->in_time_of_fast)
        used = (size_t)snprintf(text, size, "in the time of fast, %.0f ms",
                                1e3 * c->budget_s);
    else if (c->budget_s > 0.0)
        used = (size_t)snprintf(text, size, "within %g ms", 1e3 * c->budget_s);
    else if (c->error_m > 0.0)
        used = (size_t)snprintf(text, size, "error %g cm", 100.0 * c->error_m);
    else if (!strcmp(c->method, recon_auto_name))
        used = (size_t)snprintf(text, size, "no goal");
    else
        used = (size_t)snprintf(text, size, "step %.2f", c->step);
    if (c->speaker_stride > 1 && used < size)
        used += (size_t)snprintf(text + used, size - used, ", 1/%zu of the speakers",
                                 c->speaker_stride);
    if (c->position_stride > 1 && used < size)
        used += (size_t)snprintf(text + used, size - used, ", 1/%zu of the positions",
                                 c->position_stride);
    if (c->band_hz[1] > 0.0 && used < size)
        used += (size_t)snprintf(text + used, size - used, ", %g-%g kHz",
                                 1e-3 * c->band_hz[0], 1e-3 * c->band_hz[1]);
    if (c->iterations && used < size)
        used +=
            (size_t)snprintf(text + used, size - used, ", %zu iterations", c->iterations);
    if (used < size)
        snprintf(text + used, size - used, ", %zu thread%s", c->threads,
                 c->threads == 1 ? "" : "s");
}

static void put_row(FILE *f, const struct bench_result *r)
{
    const struct bench_score *s = &r->score;
    char setting[160];
    bench_table_setting(&r->c, setting, sizeof setting);
    fprintf(f, "| `%s` | %s | %.3f | %.3f |", r->c.method, setting, r->cost.total_s,
            r->cost.plan_s);
    if (isfinite(r->cost.memory_bytes))
        fprintf(f, " %.0f |", 1e-6 * r->cost.memory_bytes);
    else
        fputs(" |", f);
    if (isnan(s->iou))
        fprintf(f, " %.3f | %.1f x %.1f x %.1f | %.1f |\n", 100.0 * s->lateral_m,
                100.0 * s->width_m[0], 100.0 * s->width_m[1], 100.0 * s->width_m[2],
                s->sidelobe_db);
    else
        fprintf(f, " %.3f | %.3f |\n", s->iou, s->correlation);
}

static void put_head(FILE *f, bool points)
{
    fputs("| method | parameters | time s | planning s | memory MB |", f);
    fputs(points ? " lateral cm | widths cm | sidelobe dB |\n" : " IoU | correlation |\n",
          f);
    fputs("|---|---|---|---|---|---|---|", f);
    fputs(points ? "---|\n" : "\n", f);
}

static int by_time(const void *a, const void *b)
{
    const struct bench_result *x = *(const struct bench_result *const *)a;
    const struct bench_result *y = *(const struct bench_result *const *)b;
    return (x->cost.total_s > y->cost.total_s) - (x->cost.total_s < y->cost.total_s);
}

static int put_front(FILE *f, const struct bench_results *b, const char *scene)
{
    bool *front = calloc(b->n, sizeof *front);
    const struct bench_result **sorted = calloc(b->n, sizeof(void *));
    size_t n = 0;
    if (front && sorted) {
        bench_results_front(b, scene, front);
        for (size_t i = 0; i < b->n; i++)
            if (front[i])
                sorted[n++] = &b->r[i];
        qsort(sorted, n, sizeof *sorted, by_time);
        fputs("\nNothing is both faster and less wrong than these (Pareto front):\n\n",
              f);
        put_head(f, n && isnan(sorted[0]->score.iou));
        for (size_t i = 0; i < n; i++)
            put_row(f, sorted[i]);
    }
    int err = front && sorted ? 0 : -ENOMEM;
    free(front);
    free(sorted);
    return err;
}

/* In the unit of bench_score_error. */
static void put_error(FILE *f, const struct bench_result *r)
{
    fprintf(f, isnan(r->score.iou) ? " %.3f cm |" : " %.3f |",
            bench_score_error(&r->score));
}

/* The error that was allowed, in the unit of bench_score_error; of letters it is none. */
static double goal_of(const struct bench_result *r)
{
    return isnan(r->score.iou) ? 100.0 * r->c.error_m : 0.0;
}

/* Is auto worth it?  What is less exact than fast was asked to be no more exact. */
static void put_automatic(FILE *f, const struct bench_results *b, const char *scene)
{
    bool headed = false;
    for (size_t i = 0; i < b->n; i++) {
        const struct bench_result *r = &b->r[i];
        char setting[160];
        if (!bench_result_counts(r, scene) || strcmp(r->c.method, recon_auto_name))
            continue;
        if (!headed)
            fprintf(f,
                    "\n`auto` in the time that `fast` takes (plan and image) beside "
                    "`fast`; with other\ngoals beside the best that any parameters of "
                    "`fast` gave in the time it took, picked\nby those who know the "
                    "truth (error: %s):\n\n"
                    "| goal | chose | time s | error | fast: time s | error | worse by "
                    "10%% |\n|---|---|---|---|---|---|---|\n",
                    isnan(r->score.iou) ? "mean lateral" : "1 - IoU");
        headed = true;
        bench_table_setting(&r->c, setting, sizeof setting);
        fprintf(f, "| %s | %s | %.3f |", setting, r->note, r->cost.total_s);
        put_error(f, r);
        const struct bench_result *rival = bench_results_rival(b, r);
        if (!rival) {
            fputs(" none so soon | | no |\n", f);
            continue;
        }
        fprintf(f, " %.3f |", rival->cost.total_s);
        put_error(f, rival);
        double limit = fmax(WORSE * bench_score_error(&rival->score), goal_of(r));
        fputs(bench_score_error(&r->score) > limit ? " yes |\n" : " no |\n", f);
    }
}

static void put_not_done(FILE *f, const struct bench_results *b, const char *scene)
{
    bool any = false;
    for (size_t i = 0; i < b->n; i++) {
        const struct bench_result *r = &b->r[i];
        char setting[160];
        if (r->state == BENCH_DONE || strcmp(r->scene, scene))
            continue;
        if (!any)
            fputs("\nNot done:\n\n", f);
        any = true;
        bench_table_setting(&r->c, setting, sizeof setting);
        fprintf(f, "- `%s`, %s: %s\n", r->c.method, setting, r->note);
    }
}

static int put_scene(FILE *f, const struct bench_results *b, const char *scene)
{
    bool headed = false;
    fprintf(f, "\n## %s\n\nThe base point of each method:\n\n", scene);
    for (size_t i = 0; i < b->n; i++) {
        const struct bench_result *r = &b->r[i];
        if (!bench_result_counts(r, scene) || strcmp(r->c.varied, "base"))
            continue;
        if (!headed)
            put_head(f, isnan(r->score.iou));
        headed = true;
        put_row(f, r);
    }
    put_automatic(f, b, scene);
    int err = put_front(f, b, scene);
    put_not_done(f, b, scene);
    return err;
}

static void put_growth(FILE *f, const struct bench_results *b)
{
    bool headed = false;
    for (size_t i = 0; i < b->n; i++) {
        const struct bench_result *r = &b->r[i];
        if (strncmp(r->c.varied, "growth", 6) || r->state != BENCH_DONE)
            continue;
        if (!headed)
            fputs("\n## Growth\n\n"
                  "| method | of | work | voxels | pairs | time s | memory MB |\n"
                  "|---|---|---|---|---|---|---|\n",
                  f);
        headed = true;
        fprintf(f, "| `%s` | %s | %.0f | %zu | %zu | %.3f | %.0f |\n", r->c.method,
                r->c.varied + strlen("growth, "), bench_plan_work(&r->c), r->voxels,
                r->pairs, r->cost.total_s, 1e-6 * r->cost.memory_bytes);
    }
}

static void put_noise(FILE *f, const struct bench_noise *noise)
{
    const char *m = noise->methods;
    fprintf(f,
            "\n## Noise\n\nOne point, lateral error in cm, rms over %zu seeds, over raw "
            "signal to noise:\n\n| method |",
            noise->n_seeds);
    for (size_t k = 0; k < noise->n_levels; k++)
        fprintf(f, " %g dB |", noise->snr_db[k]);
    fputs("\n|---|", f);
    for (size_t k = 0; k < noise->n_levels; k++)
        fputs("---|", f);
    for (size_t i = 0; i < noise->n_methods; i++, m += strlen(m) + 1) {
        fprintf(f, "\n| `%s` |", m);
        for (size_t k = 0; k < noise->n_levels; k++)
            fprintf(f, " %.3g |", 100.0 * noise->lateral_m[i][k]);
    }
    fputs("\n| Cramer-Rao bound |", f);
    for (size_t k = 0; k < noise->n_levels; k++)
        fprintf(f, " %.3g |", 100.0 * noise->unknown[k].lateral_m);
    fputs("\n", f);
}

int bench_table_write(const struct bench_results *b, const struct bench_noise *noise,
                      const char *remark, const char *folder, struct error *why)
{
    struct export_file e;
    char machine[512];
    int err = export_file_open(&e, folder, "speed-error.md", why);
    if (err)
        return err;
    bench_machine(machine, sizeof machine);
    fprintf(e.f,
            "# Speed against error\n\n%s\n\nTime is from both recordings in memory to "
            "the volume, the fastest of some runs; step is the grid's, in -6 dB widths "
            "of a point. Every run is in speed-error.csv.\n",
            machine);
    if (remark)
        fprintf(e.f, "\n**%s**\n", remark);
    for (size_t i = 0; !err && i < b->n; i++) {
        bool seen = false;
        for (size_t k = 0; k < i; k++)
            seen = seen || !strcmp(b->r[k].scene, b->r[i].scene);
        if (!seen)
            err = put_scene(e.f, b, b->r[i].scene);
    }
    put_growth(e.f, b);
    if (noise && noise->n_seeds)
        put_noise(e.f, noise);
    return err ? export_file_abandon(&e, err, why) : export_file_commit(&e, why);
}
