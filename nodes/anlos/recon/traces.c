#include "nodes/anlos/recon/traces.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hal/survey/file.h"
#include "nodes/anlos/interrupt.h"

/* A survey of the traces: places, band, speed of sound, and nothing of a recording. */
static int fill_survey(struct recon_job *job, struct error *why)
{
    const struct traces_file *t = &job->traces;
    struct survey *s = &job->survey;
    s->source = SURVEY_REPLAY;
    s->sound_speed_m_s = t->sound_speed_m_s;
    s->temperature_c = NAN;
    s->chirp_start_hz = t->band_hz[0];
    s->chirp_stop_hz = t->band_hz[1];
    s->sample_rate_hz = t->format.rate_hz;
    s->n_speakers = s->n_microphones = 1;
    s->n_positions = t->n_pings;
    s->stage_axis[0] = 1.0;
    s->speakers_m = calloc(1, sizeof *s->speakers_m);
    s->microphones_m = calloc(1, sizeof *s->microphones_m);
    s->stage_positions_m = calloc(t->n_pings, sizeof *s->stage_positions_m);
    s->pings_m = malloc(t->n_pings * sizeof *s->pings_m);
    if (!s->speakers_m || !s->microphones_m || !s->stage_positions_m || !s->pings_m)
        return error_say(why, -ENOMEM, "out of memory");
    memcpy(s->pings_m, t->pings_m, t->n_pings * sizeof *s->pings_m);
    return 0;
}

static double end_s(const struct trace_format *f)
{
    return f->t0_s + (double)(f->n_samples - 1) / f->rate_hz;
}

/* Takes away what is outside of the survey's gate.  delays_s: of the volume. */
static int apply_gate(struct recon_job *job, const double delays_s[2], struct error *why)
{
    const struct survey *s = &job->survey;
    const struct trace_format *f = &job->traces.format;
    const char *survey = job->options->survey;
    double half_c = 0.5 * s->sound_speed_m_s;
    const double gate_s[2] = {s->gate_m[0] / half_c, s->gate_m[1] / half_c};
    if (delays_s[1] <= gate_s[0] || delays_s[0] >= gate_s[1])
        return error_say(why, -EINVAL,
                         "%s: volume: it lies %.2f to %.2f m away, outside the gate of "
                         "%.2f to %.2f m; change gate_m or volume",
                         survey, half_c * delays_s[0], half_c * delays_s[1], s->gate_m[0],
                         s->gate_m[1]);
    if (!traces_cut(&job->traces, gate_s))
        return 0;
    return error_say(why, -EINVAL,
                     "%s: gate_m: %.2f to %.2f m, but the traces of %s last from %.2f to "
                     "%.2f m; change gate_m",
                     survey, s->gate_m[0], s->gate_m[1], job->options->traces,
                     half_c * f->t0_s, half_c * end_s(f));
}

static int plan(struct recon_job *job, struct error *why)
{
    const struct recon_options *o = job->options;
    const struct survey *s = &job->survey;
    const struct trace_format *f = &job->traces.format;
    struct processing *p = &job->processing;
    double half_c = 0.5 * s->sound_speed_m_s, delays_s[2];

    memset(p, 0, sizeof *p);
    processing_geometry(&p->geometry, s);
    memcpy(p->band_hz, job->traces.band_hz, sizeof p->band_hz);
    int err = grid_from_limits(&p->grid, (const double(*)[3])s->volume_m);
    if (err)
        return error_say(why, err, "volume: too many voxels; expected at most 2^28");
    grid_delays(&p->grid, &p->geometry, delays_s);
    if (s->has_gate)
        err = apply_gate(job, delays_s, why);
    if (err)
        return err;
    p->gate_m[0] = s->has_gate ? s->gate_m[0] : half_c * fmax(f->t0_s, 0.0);
    p->gate_m[1] = s->has_gate ? s->gate_m[1] : half_c * end_s(f);
    p->gate_s[0] = fmax(delays_s[0], f->t0_s);
    p->gate_s[1] = fmin(delays_s[1], end_s(f));
    if (p->gate_s[0] >= p->gate_s[1])
        return error_say(why, -EINVAL,
                         "%s: its traces last from %g to %g s, but echoes of the volume "
                         "arrive from %g to %g s; change the volume",
                         o->traces, f->t0_s, end_s(f), delays_s[0], delays_s[1]);
    return 0;
}

int recon_traces_open(struct recon_job *job, struct error *why)
{
    const struct recon_options *o = job->options;
    struct survey *s = &job->survey;
    int err = o->survey ? survey_load_place(s, o->survey, why) : 0;
    if (!err && o->has_volume) {
        s->has_volume = true;
        memcpy(s->volume_m, o->volume_m, sizeof s->volume_m);
    }
    if (!err && !s->has_volume)
        err = error_say(why, -EINVAL,
                        o->survey ? "%s: expected the key volume, or --volume"
                                  : "%s: expected --volume, or --survey with a volume",
                        o->survey ? o->survey : o->traces);
    if (!err)
        err = traces_load(&job->traces, o->traces, o->has_band ? o->band_hz : NULL, why);
    if (!err)
        err = fill_survey(job, why);
    if (!err)
        err = plan(job, why);
    job->format = job->traces.format;
    return err;
}

struct adding {
    const struct recon_job *job;
    const struct recon_sink *sink;
};

static void add_ping(void *ctx, size_t item, size_t thread)
{
    const struct adding *a = ctx;
    const struct traces_file *t = &a->job->traces;
    (void)thread;
    if (t->masked[item] || interrupt_requested())
        return; /* lost, and counted as such */
    a->sink->take(a->sink->ctx, item, 0, t->traces + item * t->format.n_samples, NULL);
}

void recon_traces_add(struct recon_job *job, const struct recon_sink *sink)
{
    struct adding a = {job, sink};
    pool_run(job->pool, job->traces.n_pings, add_ping, &a);
}
