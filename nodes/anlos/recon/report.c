/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/recon/report.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "nodes/anlos/recon/auto.h"
#include "nodes/rt/export.h"
#include "nodes/rt/export_projection.h"
#include "recon/detection/objects.h"

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

/* -- report.json, of sound or of light --------------------------------------------------
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

/* -- of sound ---------------------------------------------------------------------------
 */

#define COARSEST_STEP 0.6 /* of a point's width: coarser, and positions suffer */
#define FINE_STEP     0.4
#define LOUDER_DB     1.0  /* what is hidden adds to what was there before */
#define SAME_BAND     0.01 /* of its top, that another may be off */

static size_t pings_expected(const struct recon_job *job)
{
    return job->survey.n_positions * job->survey.n_speakers;
}

/* Of the speakers, as auto has decided. */
static size_t stride(const struct recon_job *job)
{
    return job->automatic ? job->automatic->plan.stride : 1;
}

/* Pings of speakers that are left out to save time. */
static size_t pings_saved(const struct recon_job *job)
{
    size_t speakers = job->survey.n_speakers;
    size_t kept = (speakers + stride(job) - 1) / stride(job);
    return job->survey.n_positions * (speakers - kept);
}

/* On purpose: these, and of the others the last speaker's that end before their echoes.
 */
static size_t pings_left_out(const struct recon_job *job)
{
    size_t speakers = job->survey.n_speakers;
    bool last = speakers > 1 && (speakers - 1) % stride(job) == 0;
    return pings_saved(job) + (job->reader && last ? recon_reader_cut(job->reader) : 0);
}

static void warn(json_t *warnings, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

static void warn(json_t *warnings, const char *format, ...)
{
    char text[512];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    json_array_append_new(warnings, json_string(text));
}

static void warn_microphones(json_t *warnings, const struct channel_check *check,
                             const struct survey *s, const char *prefix)
{
    for (size_t i = 0; check && i < s->n_microphones; i++) {
        struct channel_summary c;
        channel_check_summary(check, i, &c);
        if (c.silent)
            warn(warnings,
                 "%smicrophone %zu: silent in %zu of %zu positions: left out there",
                 prefix, i + 1, c.silent, s->n_positions);
        if (c.damaged)
            warn(warnings,
                 "%smicrophone %zu: %llu samples not finite in %zu of %zu positions: "
                 "left out "
                 "there",
                 prefix, i + 1, (unsigned long long)c.not_finite_samples, c.damaged,
                 s->n_positions);
        if (c.clipped_samples)
            warn(warnings,
                 "%smicrophone %zu: %llu samples clipped; left out of %zu of %zu "
                 "positions",
                 prefix, i + 1, (unsigned long long)c.clipped_samples, c.clipped,
                 s->n_positions);
    }
}

/* Around an object a point is a fraction of a wavelength wide. */
static void warn_steps(json_t *warnings, const struct recon_job *job)
{
    const struct processing *p = &job->processing;
    double middle[3], width_m[3];
    for (int a = 0; a < 3; a++)
        middle[a] = p->grid.origin_m[a] +
                    0.5 * (double)(p->grid.n[a] - 1) * p->grid.step_m[a];
    geometry_resolution_at(&p->geometry, p->band_hz, middle, width_m);
    for (int a = 0; a < 3; a++)
        if (p->grid.n[a] > 1 && p->grid.step_m[a] > COARSEST_STEP * width_m[a])
            warn(warnings,
                 "volume: a step of %.3g m along %c is coarse for images of points that "
                 "are %.3g m wide; positions want %.2g m",
                 p->grid.step_m[a], "xyz"[a], width_m[a], FINE_STEP * width_m[a]);
}

/* Sharpened with a function of other images. */
static void warn_psf(json_t *warnings, const struct recon_job *job)
{
    const struct psf_file *p = &job->psf;
    const double *band_hz = job->processing.band_hz;
    if (p->measured && strcmp(p->method, job->imaging.base))
        warn(warnings, "%s: of an image by %s, but the base is %s", job->options->psf,
             p->method, job->imaging.base);
    for (int i = 0; i < 2; i++) {
        if (fabs(p->band_hz[i] - band_hz[i]) <= SAME_BAND * band_hz[1])
            continue;
        warn(warnings, "%s: of a band of %g to %g Hz, but the recording's is %g to %g",
             job->options->psf, p->band_hz[0], p->band_hz[1], band_hz[0], band_hz[1]);
        break;
    }
}

static void warn_lost(json_t *warnings, const struct recon_job *job)
{
    size_t expected = pings_expected(job), saved = pings_saved(job);
    size_t lost = expected - job->n_pings - pings_left_out(job);
    if (saved)
        warn(warnings,
             "%zu of %zu pings are left out to save time: of the speakers only every "
             "%zuth is used",
             saved, expected, stride(job));
    if (lost)
        warn(warnings, "%zu of %zu pings are lost: no usable microphone", lost, expected);
}

/* Only in other air than the background's it matters. */
static void warn_cut(json_t *warnings, const struct recon_job *job)
{
    size_t cut = job->reader ? recon_reader_cut(job->reader) : 0;
    if (cut && job->survey.n_speakers > 1)
        warn(warnings,
             "%zu of %zu pings are left out: their files end with the slot, before the "
             "echoes do, and the background of other air cannot be subtracted from that",
             cut, pings_expected(job));
    else if (cut)
        warn(warnings,
             "%zu of %zu pings end with their slot, before their echoes do: how far the "
             "air has changed since the background does not show well",
             cut, pings_expected(job));
}

static void warn_unconverged(json_t *warnings, const struct recon_job *job)
{
    const struct imager_outcome *o = &job->outcome;
    if (o->iterates && !o->converged)
        warn(warnings,
             "%s has not converged: after %zu iterations a relative residual of %.2g is "
             "left",
             job->method, o->iterations, o->residual);
}

/* A line that is missing between others gives all later pings the wrong places. */
static void warn_spare(json_t *warnings, const struct recon_job *job)
{
    size_t named = job->survey.n_positions;
    size_t spare = job->recording ? recording_spare_slots(job->recording) : 0;
    if (spare)
        warn(warnings,
             "%s holds %zu slots, but pings names %zu: the last are left alone, and "
             "places are wrong if it is not theirs that are missing",
             job->options->wav, named + spare, named);
}

/* Noise that was cut off the traces, or may be in them. */
static void warn_band(json_t *warnings, const struct traces_file *t)
{
    char islands[(TRACES_MAX_CUT + 1) * 32] = "";

    for (size_t i = 0; i < t->n_cut && i < TRACES_MAX_CUT; i++)
        text_add(islands, sizeof islands, ", ", "%.3g to %.3g", 1e-3 * t->cut[i].from_hz,
                 1e-3 * t->cut[i].to_hz);
    if (t->n_cut > TRACES_MAX_CUT)
        text_add(islands, sizeof islands, " ", "and more");
    if (t->n_cut)
        warn(warnings,
             "%.0f %% of the power is at %s kHz and as loud at all times, as noise is: "
             "cut; "
             "the band is %.3g to %.3g kHz, --band-hz LOW,HIGH takes another",
             100.0 * t->cut_share, islands, 1e-3 * t->band_hz[0], 1e-3 * t->band_hz[1]);
    if (t->unsure)
        warn(
            warnings,
            "the band, %.3g to %.3g kHz, may be of noise: at no frequency is the sound "
            "surely louder at one time than at others, as echoes are; --band-hz LOW,HIGH "
            "takes another",
            1e-3 * t->band_hz[0], 1e-3 * t->band_hz[1]);
}

json_t *recon_report_warnings(const struct recon_job *job)
{
    json_t *warnings = json_array();
    warn_spare(warnings, job);
    warn_microphones(warnings, job->scene_check, &job->survey, "");
    warn_microphones(warnings, job->background_check, &job->survey, "background: ");
    if (job->reader && recon_reader_background_db(job->reader) > LOUDER_DB)
        warn(warnings,
             "the background %s is %.1f dB louder within the gate than the recording %s: "
             "have the two been swapped?",
             job->options->background, recon_reader_background_db(job->reader),
             job->options->wav);
    if (job->traces.n_not_finite)
        warn(warnings, "%zu traces have samples that are not finite: left out",
             job->traces.n_not_finite);
    if (job->traces.n_silent)
        warn(warnings, "%zu traces are silent: left out", job->traces.n_silent);
    if (job->traces.n_too_loud)
        warn(warnings, "%zu traces are louder than any echo: left out",
             job->traces.n_too_loud);
    warn_band(warnings, &job->traces);
    if (!job->options->traces)
        warn_lost(warnings, job);
    warn_cut(warnings, job);
    warn_unconverged(warnings, job);
    if (job->processing.geometry.pings_m)
        warn_steps(warnings, job);
    if (job->options->psf)
        warn_psf(warnings, job);
    if (air_is_distrusted(&job->air))
        warn(warnings,
             "background: the air has changed by %.1f K since it was recorded: "
             "it does not fit any more",
             air_kelvin(&job->air, job->air.largest));
    if (!job->background && !job->options->traces)
        warn(warnings,
             "no background recording: the room's own echoes stay in the image");
    return warnings;
}

static json_t *check_json(const struct channel_check *check, size_t n_microphones)
{
    json_t *masked = json_array(), *clipped = json_array(), *bad = json_array();
    json_t *silent = json_array();
    for (size_t i = 0; i < n_microphones; i++) {
        struct channel_summary c;
        channel_check_summary(check, i, &c);
        json_array_append_new(clipped, json_integer((json_int_t)c.clipped_samples));
        json_array_append_new(bad, json_integer((json_int_t)c.not_finite_samples));
        json_array_append_new(silent, json_integer((json_int_t)c.silent));
        if (c.silent || c.damaged || c.clipped)
            json_array_append_new(masked, json_integer((json_int_t)i + 1));
    }
    return json_pack("{so, so, so, so}", "microphones_masked", masked, "clipped_samples",
                     clipped, "not_finite_samples", bad, "silent_positions", silent);
}

static json_t *recording_json(const struct recon_job *job)
{
    const struct recon_options *o = job->options;
    json_t *r = json_pack("{ss?, ss?, ss?, ss?}", "survey", o->survey, "wav", o->wav,
                          "traces", o->traces, "background", o->background);
    json_object_set_new(r, "positions",
                        json_integer((json_int_t)job->survey.n_positions));
    json_object_set_new(r, "speakers", json_integer((json_int_t)job->survey.n_speakers));
    json_object_set_new(r, "microphones",
                        json_integer((json_int_t)job->survey.n_microphones));
    json_object_set_new(r, "calibrated", json_boolean(job->survey.n_responses));
    return r;
}

static json_t *channels_json(const struct recon_job *job)
{
    json_t *channels = json_object();
    size_t n = job->survey.n_microphones;
    if (job->scene_check)
        json_object_set_new(channels, "scene", check_json(job->scene_check, n));
    if (job->background_check)
        json_object_set_new(channels, "background", check_json(job->background_check, n));
    return channels;
}

/* Since the background was recorded. */
json_t *recon_report_air(const struct air *a)
{
    double mean = a->pings ? a->sum / (double)a->pings : 0.0;
    return json_pack("{sI, so, so}", "pings_corrected", (json_int_t)a->corrected,
                     "mean_k", export_real(0.0 + air_kelvin(a, mean)), /* no -0 */
                     "largest_k", export_real(0.0 + air_kelvin(a, a->largest)));
}

json_t *recon_report_create(const struct recon_job *job, const struct recon_results *r)
{
    const struct recon_options *o = job->options;
    size_t expected = pings_expected(job), used = job->n_pings;
    size_t left_out = pings_left_out(job);
    json_t *report = recon_results_report(r, recording_json(job));

    if (job->method_because)
        json_object_set_new(report, "method_because", json_string(job->method_because));
    if (job->automatic)
        json_object_set_new(report, "plan", recon_auto_report(job->automatic, job));
    if (job->background)
        json_object_set_new(report, "air", recon_report_air(&job->air));
    if (o->psf)
        json_object_set_new(report, "psf", json_string(o->psf));
    if (!o->traces) {
        json_object_set_new(report, "compression",
                            json_string(compression_name(o->compression)));
        json_object_set_new(report, "window", json_string(window_name(o->window)));
    }
    json_object_set_new(report, "pings",
                        json_pack("{sI, sI, sI, sI}", "expected", (json_int_t)expected,
                                  "used", (json_int_t)used, "left_out",
                                  (json_int_t)left_out, "lost",
                                  (json_int_t)(expected - used - left_out)));
    json_object_set_new(report, "channels", channels_json(job));
    json_object_set_new(report, "sound_speed_m_s",
                        export_real(job->survey.sound_speed_m_s));
    json_object_set_new(report, "temperature_c", export_real(job->survey.temperature_c));
    return report;
}

/* -- what a person reads on the screen --------------------------------------------------
 */

/* Of the worst axis that is told. */
static double sigma_m(const Anlos__DetectionList *list, const Anlos__Detection *d)
{
    static const int diagonal[3] = {0, 3, 5};
    int height = list->in_vehicle_frame ? 2 : 1;
    double worst = NAN;

    for (int a = 0; d->n_covariance_m2 == 6 && a < 3; a++) {
        double sigma = sqrt(d->covariance_m2[diagonal[a]]);
        if (sigma < OBJECTS_KNOWN_M && !(d->height_assumed && a == height))
            worst = fmax(worst, sigma);
    }
    return worst;
}

static void print_multipath(const Anlos__Detection *d)
{
    static const char *const names[] = {[ANLOS__MULTIPATH__OF_A_PAIR] = "by bounces of",
                                        [ANLOS__MULTIPATH__BY_A_FACE] = "mirror image of",
                                        [ANLOS__MULTIPATH__IN_A_SHADOW] = "echo behind"};

    if (d->multipath <= 0 || d->multipath > ANLOS__MULTIPATH__IN_A_SHADOW)
        return;
    printf("   multipath: %s", names[d->multipath]);
    for (size_t i = 0; i < d->n_multipath_of; i++)
        printf("%s %u", i ? " and" : "", d->multipath_of[i]);
}

static void print_object(const Anlos__DetectionList *list, const Anlos__Detection *d)
{
    static const char *const borders[6] = {"x-", "x+", "y-", "y+", "z-", "z+"};
    double sigma_cm = 100.0 * sigma_m(list, d);

    if (d->position_m)
        printf("%4u %9.3f %8.3f %8.3f ", d->id, d->position_m->x, d->position_m->y,
               d->position_m->z);
    else
        printf("%4u %9s %8s %8s ", d->id, "unknown", "", "");
    if (isnan(sigma_cm))
        printf("%9s", "unknown");
    else
        printf("%9.1f", sigma_cm);
    printf(" %8.1f %9.0f %%", d->level_db, 100.0 * d->existence);
    if (d->extent_m && fmax(fmax(d->extent_m->x, d->extent_m->y), d->extent_m->z) > 0.0)
        printf("   %.2f x %.2f x %.2f", d->extent_m->x, d->extent_m->y, d->extent_m->z);
    if (d->at_border)
        printf("   where the image ends:");
    for (int i = 0; i < 6; i++)
        if (d->at_border >> i & 1u)
            printf(" %s", borders[i]);
    print_multipath(d);
    printf("\n");
}

/* In whose terms the places are. */
static const char *frame_text(const Anlos__DetectionList *list, bool own_places,
                              bool traces)
{
    if (list->mirrored)
        return list->in_vehicle_frame ? "positions in the vehicle frame"
                                      : "positions in the array frame";
    if (own_places) /* may stand around the objects */
        return list->in_vehicle_frame ? "positions in the vehicle frame, as imaged"
               : traces               ? "positions as tx_m and rx_m have them"
                                      : "positions in the frame of the pings";
    return list->in_vehicle_frame
               ? "positions in the vehicle frame, as mirrored by the wall (the survey "
                 "names no wall)"
               : "positions in the array frame, as mirrored by the wall (the survey "
                 "names no wall)";
}

void recon_report_print_objects(const Anlos__DetectionList *list, bool own_places,
                                bool traces)
{
    printf("%zu %s%s, %s\n", list->n_detections, own_places ? "object" : "hidden object",
           list->n_detections == 1 ? "" : "s", frame_text(list, own_places, traces));
    if (list->n_detections)
        printf("   # %9s %8s %8s %9s %8s %11s   %s\n", "x m", "y m", "z m", "sigma cm",
               "SNR dB", "existence", "extent m");
    for (size_t i = 0; i < list->n_detections; i++)
        print_object(list, list->detections[i]);
    for (size_t i = 0; i < list->n_detections; i++) {
        if (!list->detections[i]->height_assumed)
            continue;
        printf("(the array hears no heights: they are assumed, to half a metre)\n");
        break;
    }
}

void recon_report_print_stages(const struct stopwatch stages[RECON_STAGES])
{
    for (int i = 0; i < RECON_STAGES; i++)
        printf("%s%s %.2f", i ? ", " : " (", recon_stage_name(i), stages[i].wall_s);
    printf(")\n");
}

static void print_air(const struct recon_job *job)
{
    char text[128];
    air_text(&job->air, text, sizeof text);
    if (text[0])
        printf("%s: corrected\n", text);
}

/* What the method was left to decide, and how it ended. */
static void print_outcome(const struct recon_job *job)
{
    const struct imager_outcome *o = &job->outcome;
    if (o->choice)
        printf("%s %s%s", o->choice, o->chosen ? "always" : "never",
               o->iterates ? "; " : "\n");
    if (o->iterates)
        printf("%zu iterations, residual %.2g%s\n", o->iterations, o->residual,
               o->converged ? "" : ": not converged");
}

void recon_report_print(const struct recon_job *job)
{
    size_t expected = job->survey.n_positions * job->survey.n_speakers;

    recon_report_print_objects(job->detections, job->processing.geometry.pings_m != NULL,
                               job->options->traces != NULL);
    print_air(job);
    print_outcome(job);
    if (job->automatic)
        recon_auto_print(job->automatic, job);
    printf("%zu of %zu pings, method %s%s%s%s, %zu thread%s: %.2f s", job->n_pings,
           expected, job->method, job->method_because ? " (" : "",
           job->method_because ? job->method_because : "", job->method_because ? ")" : "",
           job->options->threads, job->options->threads == 1 ? "" : "s",
           job->total.wall_s);
    recon_report_print_stages(job->stages);
    printf("%s: volume.nrrd, projection_{xy,xz,yz}.png, detections.json, report.json\n",
           job->options->out);
}
