/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/recon/reader.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/drift.h"
#include "nodes/rt/stop.h"

/* Inside the reader: what one thread needs to make traces of one stage position, and the
 * steps of it. */

struct reader_setup { /* the same for all threads */
    struct recon_reader_config cfg;
    struct processing processing; /* with the length of pings that is needed */
    bool drifting;                /* traces are subtracted, not samples */
};

struct reader_worker {
    struct compressor *compressor;
    struct drift *drift;         /* only while drifting, as are background_traces */
    float *samples, *background; /* [n_microphones][frames] */
    float *ping;                 /* [n_microphones][ping_samples] */
    float complex *traces, *background_traces; /* [n_microphones][format.n_samples] */
    uint32_t *clipped, *not_finite;
    bool *masked; /* all [n_microphones] */
    struct stopwatch stages[RECON_STAGES];
    struct air air;
    size_t n_cut; /* positions whose last ping breaks off */
};

static void reader_worker_clear(struct reader_worker *w)
{
    compressor_destroy(w->compressor);
    drift_destroy(w->drift);
    free(w->samples);
    free(w->background);
    free(w->ping);
    free(w->traces);
    free(w->background_traces);
    free(w->clipped);
    free(w->not_finite);
    free(w->masked);
    memset(w, 0, sizeof *w);
}

static int create_drift(struct reader_worker *w, const struct reader_setup *r,
                        const struct trace_format *format, struct error *why)
{
    const struct drift_config cfg = {
        .format = *format,
        .band_hz = {r->processing.band_hz[0], r->processing.band_hz[1]},
        .n_channels = r->cfg.survey->n_microphones,
    };
    int err = drift_create(&w->drift, &cfg);
    w->background_traces =
        malloc(cfg.n_channels * format->n_samples * sizeof *w->background_traces);
    if (!err && !w->background_traces)
        err = -ENOMEM;
    return err ? error_say(why, err, "drift of the background: %s", strerror(-err)) : 0;
}

/* 0, -EINVAL, -ENOMEM; clear it also after a failure. */
static int reader_worker_create(struct reader_worker *w, const struct reader_setup *r,
                                struct error *why)
{
    const struct recon_reader_config *cfg = &r->cfg;
    size_t n_mics = cfg->survey->n_microphones;
    size_t frames = recording_frames(cfg->recording);
    struct trace_format format;
    int err = compressor_create(&w->compressor, &r->processing, cfg->survey,
                                cfg->compression, cfg->window, why);
    if (err)
        return err;
    compressor_format(w->compressor, &format);
    air_start(&w->air, cfg->survey->sound_speed_m_s,
              cfg->survey->n_positions * cfg->survey->n_speakers);
    w->samples = malloc(n_mics * frames * sizeof *w->samples);
    if (cfg->background)
        w->background = malloc(n_mics * frames * sizeof *w->background);
    w->ping = malloc(n_mics * r->processing.ping_samples * sizeof *w->ping);
    w->traces = malloc(n_mics * format.n_samples * sizeof *w->traces);
    w->clipped = malloc(n_mics * sizeof *w->clipped);
    w->not_finite = malloc(n_mics * sizeof *w->not_finite);
    w->masked = malloc(n_mics * sizeof *w->masked);
    if (!w->samples || (cfg->background && !w->background) || !w->ping || !w->traces ||
        !w->clipped || !w->not_finite || !w->masked)
        return error_say(why, -ENOMEM, "out of memory");
    return r->drifting ? create_drift(w, r, &format, why) : 0;
}

/* Samples and background of a position; check: its channels are judged, counted and
 * masked.  0, -EIO, -EINVAL. */
static int reader_worker_read(const struct reader_setup *r, struct reader_worker *w,
                              size_t position, bool check, struct error *why)
{
    const struct recon_reader_config *cfg = &r->cfg;
    size_t frames = recording_frames(cfg->recording);
    memset(w->masked, 0, cfg->survey->n_microphones * sizeof *w->masked);
    int err = recording_read(cfg->recording, position, w->samples, w->clipped,
                             w->not_finite, why);
    if (!err && check)
        channel_check_position(cfg->scene_check, position, frames, w->samples, w->clipped,
                               w->not_finite, w->masked);
    if (err || !cfg->background)
        return err;
    err = recording_read(cfg->background, position, w->background, w->clipped,
                         w->not_finite, why);
    if (!err && check)
        channel_check_position(cfg->background_check, position, frames, w->background,
                               w->clipped, w->not_finite, w->masked);
    return err;
}

/* Scene minus background sample by sample halves the compressions. */
static void reader_worker_subtract(const struct reader_setup *r, struct reader_worker *w)
{
    size_t n = r->cfg.survey->n_microphones * recording_frames(r->cfg.recording);
    for (size_t i = 0; i < n; i++)
        w->samples[i] -= w->background[i];
}

/* The ping of a slot; one whose tail runs past the end of the recording is continued with
 * zeros in a buffer of its own. */
static const float *find_ping(const struct reader_setup *r, struct reader_worker *w,
                              const float *samples, size_t speaker, size_t *stride)
{
    size_t frames = recording_frames(r->cfg.recording);
    size_t n = r->processing.ping_samples;
    size_t start = survey_slot_of(r->cfg.survey, speaker) * r->cfg.survey->slot_samples;
    *stride = frames;
    if (start + n <= frames)
        return samples + start;
    size_t there = frames - start;
    for (size_t i = 0; i < r->cfg.survey->n_microphones; i++) {
        memcpy(w->ping + i * n, samples + i * frames + start, there * sizeof(float));
        memset(w->ping + i * n + there, 0, (n - there) * sizeof(float));
    }
    *stride = n;
    return w->ping;
}

/* samples (the worker's, or its background) of one speaker's ping to traces. */
static void reader_worker_compress(const struct reader_setup *r, struct reader_worker *w,
                                   const float *samples, size_t speaker,
                                   float complex *traces)
{
    size_t stride;
    const float *ping = find_ping(r, w, samples, speaker, &stride);
    compressor_execute(w->compressor, survey_is_down(r->cfg.survey, speaker), ping,
                       stride, traces);
}

/* The file ends with the last slot: what echoes of it would have come later is missing,
 * and that leaks like an emission that is cut off (dsp/drift.h). */
static bool reader_worker_is_cut(const struct reader_setup *r,
                                 const struct reader_worker *w)
{
    size_t frames = recording_frames(r->cfg.recording);
    size_t slots = survey_slots(r->cfg.survey, r->cfg.survey->n_speakers) *
                   r->cfg.survey->slot_samples;
    for (size_t i = 0; i < r->cfg.survey->n_microphones; i++)
        for (size_t n = slots; n < frames; n++)
            if (w->samples[i * frames + n] != 0.0f)
                return false;
    return frames > slots;
}

#define LOOK_POSITIONS 3 /* whose air is looked at, spread over the scan */
#define LOOK_SPEAKERS  2 /* of each */

/* Stretches below the first cost less than 0.2 dB of sidelobes; those of less than so
 * many standard deviations are none. */
#define LEAST_STRETCH 5e-6
#define CERTAIN       3.0

struct recon_reader {
    struct reader_setup setup;
    double stretch;                /* where the look has noticed it: what it is about */
    double scene, background;      /* energy in the gate, of the pings looked at */
    struct reader_worker *workers; /* [threads] */
};

static bool all_masked(const bool *masked, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (!masked[i])
            return false;
    return true;
}

static void subtract_traces(const struct recon_reader *r, struct reader_worker *w,
                            size_t speaker, struct drift_track *track)
{
    struct drift_measurement now;
    reader_worker_compress(&r->setup, w, w->background, speaker, w->background_traces);
    drift_measure(w->drift, w->background_traces, w->traces, w->masked, &now);
    double stretch = drift_track_update(track, &now);
    air_add(&w->air, stretch,
            drift_subtract(w->drift, stretch, w->background_traces, w->traces));
}

/* -- has the air changed? ---------------------------------------------------------------
 */
static bool is_noticeable(const struct drift_measurement *m)
{
    return isfinite(m->variance) &&
           fabs(m->stretch) > fmax(LEAST_STRETCH, CERTAIN * sqrt(m->variance));
}

static double energy_in_gate(const struct reader_setup *r, struct reader_worker *w,
                             const float complex *traces)
{
    struct trace_format f;
    double sum = 0.0, c = r->cfg.survey->sound_speed_m_s;
    compressor_format(w->compressor, &f);
    double first = (2.0 * r->processing.gate_m[0] / c - f.t0_s) * f.rate_hz;
    double end = (2.0 * r->processing.gate_m[1] / c - f.t0_s) * f.rate_hz;
    for (size_t m = 0; m < r->cfg.survey->n_microphones; m++)
        for (size_t i = 0; i < f.n_samples && !w->masked[m]; i++)
            if ((double)i >= first && (double)i <= end) {
                float complex x = traces[m * f.n_samples + i];
                sum += (double)(crealf(x) * crealf(x) + cimagf(x) * cimagf(x));
            }
    return sum;
}

static int look_at_position(struct recon_reader *r, struct reader_worker *w,
                            size_t position, bool *changed, struct error *why)
{
    size_t speakers = r->setup.cfg.survey->n_speakers;
    size_t usable = speakers > 1 ? speakers - 1 : 1; /* the last one may be cut */
    int err = reader_worker_read(&r->setup, w, position, false,
                                 why); /* they are checked later */
    for (size_t i = 0; !err && i < LOOK_SPEAKERS && !*changed; i++) {
        struct drift_measurement now;
        size_t speaker = (2 * i + 1) * usable / (2 * LOOK_SPEAKERS);
        reader_worker_compress(&r->setup, w, w->samples, speaker, w->traces);
        reader_worker_compress(&r->setup, w, w->background, speaker,
                               w->background_traces);
        r->scene += energy_in_gate(&r->setup, w, w->traces);
        r->background += energy_in_gate(&r->setup, w, w->background_traces);
        drift_measure(w->drift, w->background_traces, w->traces, w->masked, &now);
        *changed = is_noticeable(&now);
        r->stretch = now.stretch;
    }
    return err;
}

static int look_at_air(struct recon_reader *r, struct error *why)
{
    struct reader_worker w = {0};
    size_t n = r->setup.cfg.survey->n_positions;
    bool changed = false;
    r->setup.drifting = true;
    int err = reader_worker_create(&w, &r->setup, why);
    for (size_t i = 0; !err && !changed && i < LOOK_POSITIONS; i++)
        err = look_at_position(r, &w, (2 * i + 1) * n / (2 * LOOK_POSITIONS), &changed,
                               why);
    reader_worker_clear(&w);
    r->setup.drifting = changed;
    return err;
}

/* -- all of it --------------------------------------------------------------------------
 */
int recon_reader_create(struct recon_reader **out, const struct recon_reader_config *cfg,
                        struct error *why)
{
    struct recon_reader *r = calloc(1, sizeof *r);
    size_t threads = pool_threads(cfg->pool);
    int err = 0;
    if (!r)
        return error_say(why, -ENOMEM, "out of memory");
    r->setup.cfg = *cfg;
    r->setup.processing = *cfg->processing;
    r->workers = calloc(threads, sizeof *r->workers);
    if (!r->workers)
        err = error_say(why, -ENOMEM, "out of memory");
    if (!err && cfg->background && cfg->compression == COMPRESSION_MATCHED_FILTER)
        err = look_at_air(r, why);
    if (cfg->background && !r->setup.drifting) /* takes the next emission away, too */
        r->setup.processing.ping_samples = r->setup.processing.echo_samples;
    for (size_t t = 0; !err && t < threads; t++)
        err = reader_worker_create(&r->workers[t], &r->setup, why);
    if (err) {
        recon_reader_destroy(r);
        return err;
    }
    *out = r;
    return 0;
}

double recon_reader_background_db(const struct recon_reader *r)
{
    return r->scene > 0.0 ? 10.0 * log10(r->background / r->scene) : NAN;
}

void recon_reader_format(const struct recon_reader *r, struct trace_format *out)
{
    compressor_format(r->workers[0].compressor, out);
}

/* What all threads of a run share. */
struct run {
    struct recon_reader *reader;
    const struct recon_sink *sink;
    atomic_int err; /* the first */
    struct error *why;
};

static void process_ping(struct run *run, struct reader_worker *w, size_t position,
                         size_t speaker, struct drift_track *track, struct stopwatch *now)
{
    const struct recon_reader *r = run->reader;
    if (run->sink->wants && !run->sink->wants(run->sink->ctx, position, speaker))
        return;
    reader_worker_compress(&r->setup, w, w->samples, speaker, w->traces);
    if (r->setup.drifting)
        subtract_traces(r, w, speaker, track);
    stopwatch_lap(&w->stages[RECON_COMPRESS], now, true);
    run->sink->take(run->sink->ctx, position, speaker, w->traces, w->masked);
    stopwatch_lap(&w->stages[RECON_STACK], now, true);
}

static void process_position(void *ctx, size_t position, size_t thread)
{
    struct run *run = ctx;
    struct recon_reader *r = run->reader;
    struct reader_worker *w = &r->workers[thread];
    size_t speakers = r->setup.cfg.survey->n_speakers;
    struct error why = {0};
    struct drift_track track;
    int none = 0;

    if (atomic_load(&run->err) || interrupt_requested())
        return;
    struct stopwatch now = stopwatch_now(true);
    int err = reader_worker_read(&r->setup, w, position, true, &why);
    if (!err && r->setup.cfg.background && !r->setup.drifting)
        reader_worker_subtract(&r->setup, w);
    stopwatch_lap(&w->stages[RECON_READ], &now, true);
    if (err) {
        if (atomic_compare_exchange_strong(&run->err, &none, err))
            *run->why = why;
        return;
    }
    if (all_masked(w->masked, r->setup.cfg.survey->n_microphones))
        return; /* its pings are lost, and counted as such */
    if (r->setup.drifting && reader_worker_is_cut(&r->setup, w)) {
        w->n_cut++;
        if (speakers > 1)
            speakers--;
    }
    drift_track_start(&track); /* of each position, so that threads change nothing */
    track.stretch = r->stretch;
    for (size_t j = 0; j < speakers; j++)
        process_ping(run, w, position, j, &track, &now);
}

/* Stages that ran side by side on several threads share the wall time by their parts. */
static void share_times(const struct recon_reader *r, double wall_s,
                        struct stopwatch *stages)
{
    size_t threads = pool_threads(r->setup.cfg.pool);
    double busy_s = 0.0;
    for (size_t t = 0; t < threads; t++)
        for (int i = 0; i < RECON_STAGES; i++)
            busy_s += r->workers[t].stages[i].wall_s;
    for (size_t t = 0; t < threads; t++) {
        for (int i = 0; i < RECON_STAGES; i++) {
            const struct stopwatch *part = &r->workers[t].stages[i];
            stages[i].cpu_s += part->cpu_s;
            if (busy_s > 0.0)
                stages[i].wall_s += wall_s * part->wall_s / busy_s;
        }
    }
}

int recon_reader_run(struct recon_reader *r, const struct recon_sink *sink,
                     struct stopwatch *stages, struct air *air, struct error *why)
{
    struct run run = {.reader = r, .sink = sink, .why = why};
    struct stopwatch phase = {0}, now = stopwatch_now(false);
    const struct survey *s = r->setup.cfg.survey;

    atomic_init(&run.err, 0);
    for (size_t t = 0; t < pool_threads(r->setup.cfg.pool); t++) {
        memset(r->workers[t].stages, 0, sizeof r->workers[t].stages);
        r->workers[t].n_cut = 0;
    }
    pool_run(r->setup.cfg.pool, s->n_positions, process_position, &run);
    stopwatch_lap(&phase, &now, false);
    share_times(r, phase.wall_s, stages);
    air_start(air, s->sound_speed_m_s, s->n_positions * s->n_speakers);
    for (size_t t = 0; t < pool_threads(r->setup.cfg.pool); t++)
        air_join(air, &r->workers[t].air);
    if (interrupt_requested())
        return error_say(why, -EINTR, "interrupted");
    return atomic_load(&run.err);
}

size_t recon_reader_cut(const struct recon_reader *r)
{
    size_t n = 0;
    for (size_t t = 0; t < pool_threads(r->setup.cfg.pool); t++)
        n += r->workers[t].n_cut;
    return n;
}

void recon_reader_destroy(struct recon_reader *r)
{
    if (!r)
        return;
    for (size_t t = 0; r->workers && t < pool_threads(r->setup.cfg.pool); t++)
        reader_worker_clear(&r->workers[t]);
    free(r->workers);
    free(r);
}
