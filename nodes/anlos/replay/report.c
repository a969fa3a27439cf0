#include "nodes/anlos/replay/report.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "msgs/convert.h"
#include "nodes/anlos/recon/report.h"
#include "nodes/rt/export.h"

static size_t pings_expected(const struct replay *r)
{
    if (r->chain.cfg.pipeline.is_static)
        return r->chain.volume.pings_expected;
    return r->survey.n_positions * r->survey.n_speakers;
}

/* As the image says: of an array that stands it is made of frames. */
static const char *method_of(const struct chain *c)
{
    return c->cfg.pipeline.is_static ? c->volume.method : c->cfg.pipeline.scan.method;
}

static void warn(json_t *warnings, json_t *text)
{
    fprintf(stderr, "anlos recon: %s\n", json_string_value(text));
    json_array_append_new(warnings, text);
}

static json_t *warnings_json(const struct replay *r)
{
    const struct chain *c = &r->chain;
    const struct air *air = pipeline_air(c->pipeline);
    size_t used = c->volume.pings_used, expected = pings_expected(r);
    json_t *warnings = json_array();

    for (size_t i = 0; i < c->n_notes; i++)
        warn(warnings,
             c->notes[i].times > 1
                 ? json_sprintf("%s (%zu times)", c->notes[i].text, c->notes[i].times)
                 : json_string(c->notes[i].text));
    if (c->n_more_notes)
        warn(warnings, json_sprintf("%zu more of other kinds", c->n_more_notes));
    if (c->n_unusable)
        warn(warnings, json_sprintf("%zu pings were of no use", c->n_unusable));
    if (used + c->volume.pings_blanked < expected)
        warn(warnings, json_sprintf("%zu of %zu pings are lost",
                                    expected - used - c->volume.pings_blanked, expected));
    if (c->clipped)
        warn(warnings,
             json_sprintf("%llu samples are clipped", (unsigned long long)c->clipped));
    if (air_is_distrusted(air))
        warn(warnings, json_sprintf("background: the air has changed by %.1f K since it "
                                    "was recorded: it does not fit any more",
                                    air_kelvin(air, air->largest)));
    if (!c->n_background_pings &&
        c->cfg.pipeline.frontend.background != BACKGROUND_ADAPTIVE)
        warn(warnings, json_string("no background recording: the room's own echoes stay "
                                   "in the image"));
    return warnings;
}

static json_t *recording_json(const struct replay *r)
{
    const struct settings *s = &r->settings;

    return json_pack(
        "{ss, ss?, ss?, sI, sI, sI, sI, sI, sb}", "bag", r->options->bag, "launch",
        s->name[0] ? s->name : NULL, "revision", s->revision[0] ? s->revision : NULL,
        "scan", (json_int_t)r->chain.detections->scan, "images",
        (json_int_t)r->chain.n_images, "positions", (json_int_t)r->survey.n_positions,
        "speakers", (json_int_t)r->survey.n_speakers, "microphones",
        (json_int_t)r->survey.n_microphones, "calibrated", r->survey.n_responses > 0);
}

static void add_pings(const struct replay *r, json_t *report)
{
    const struct chain *c = &r->chain;
    size_t expected = pings_expected(r), used = c->volume.pings_used;

    json_object_set_new(
        report, "compression",
        json_string(compression_name(c->cfg.pipeline.frontend.compression)));
    json_object_set_new(report, "window",
                        json_string(window_name(c->cfg.pipeline.frontend.window)));
    json_object_set_new(report, "pings",
                        json_pack("{sI, sI, sI, sI, sI}", "expected",
                                  (json_int_t)expected, "used", (json_int_t)used, "lost",
                                  (json_int_t)(expected - used), "unusable",
                                  (json_int_t)c->n_unusable, "background",
                                  (json_int_t)c->n_background_pings));
    json_object_set_new(report, "clipped_samples", json_integer((json_int_t)c->clipped));
    json_object_set_new(report, "microphones_masked",
                        json_integer((json_int_t)c->volume.microphones_masked));
    if (c->n_background_pings)
        json_object_set_new(report, "air", recon_report_air(pipeline_air(c->pipeline)));
    json_object_set_new(report, "sound_speed_m_s",
                        export_real(r->survey.sound_speed_m_s));
    json_object_set_new(report, "temperature_c", export_real(r->survey.temperature_c));
}

int replay_write(struct replay *r, const char *folder, const struct stopwatch *began,
                 struct error *why)
{
    const struct chain *c = &r->chain;
    struct recon_results results = {
        .options = r->options,
        .method = method_of(c),
        .imaging = c->cfg.pipeline.scan.options,
        .grid = &c->volume.grid,
        .intensity = c->volume.intensity,
        .detections = c->detections,
        .gate_m = r->processing.gate_m,
        .band_hz = r->processing.band_hz,
        .stages = r->stages,
        .total = &r->total,
    };
    int err = pool_create(&results.pool, r->options->threads);

    if (err)
        return error_say(why, err, "%zu threads: %s", r->options->threads,
                         strerror(-err));
    err = recon_results_write(&results, folder, began, why);
    if (!err) {
        json_t *report = recon_results_report(&results, recording_json(r));
        add_pings(r, report);
        err = recon_results_finish(report, warnings_json(r), folder, why);
    }
    pool_destroy(results.pool);
    return err;
}

void replay_print(const struct replay *r)
{
    const struct chain *c = &r->chain;

    recon_report_print_objects(c->detections, r->survey.pings_m != NULL, false);
    if (c->n_images > 1)
        printf("%zu images in the bag; the files are of the last, scan %u\n", c->n_images,
               c->detections->scan);
    printf("%zu of %zu pings, method %s, settings of %s, %zu thread%s: %.2f s",
           c->volume.pings_used, pings_expected(r), method_of(c),
           r->settings.name[0] ? r->settings.name : "no launch file (defaults)",
           r->options->threads, r->options->threads == 1 ? "" : "s", r->total.wall_s);
    recon_report_print_stages(r->stages);
    printf("%s: volume.nrrd, projection_{xy,xz,yz}.png, detections.json, " REPLAY_CAN_FILE
           ", report.json\n",
           r->options->out);
}
