#include "nodes/anlos/recon/reader.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/drift.h"
#include "dsp/drift_track.h"
#include "nodes/anlos/interrupt.h"

#define LOOK_POSITIONS 3 /* whose air is looked at, spread over the scan */
#define LOOK_SPEAKERS  2 /* of each */

/* Stretches below the first cost less than 0.2 dB of sidelobes; those of less than so
 * many standard deviations are none. */
#define LEAST_STRETCH 5e-6
#define CERTAIN       3.0

struct worker {
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

struct recon_reader {
    struct recon_reader_config cfg;
    struct processing processing; /* with the length of pings that is needed */
    bool drifting;
    double stretch;         /* where the look has noticed it: what it is about */
    struct worker *workers; /* [threads] */
};

static void worker_clear(struct worker *w)
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

static int worker_create_drift(struct worker *w, const struct recon_reader *r,
                               const struct trace_format *format, struct complaint *why)
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
    return err ? complain(why, err, "drift of the background: %s", strerror(-err)) : 0;
}

static int worker_create(struct worker *w, const struct recon_reader *r,
                         struct complaint *why)
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
        return complain(why, -ENOMEM, "out of memory");
    return r->drifting ? worker_create_drift(w, r, &format, why) : 0;
}

/* -- one position -----------------------------------------------------------------------
 */

static int read_samples(const struct recon_reader *r, struct worker *w, size_t position,
                        bool check, struct complaint *why)
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
static void subtract_samples(const struct recon_reader *r, struct worker *w)
{
    size_t n = r->cfg.survey->n_microphones * recording_frames(r->cfg.recording);
    for (size_t i = 0; i < n; i++)
        w->samples[i] -= w->background[i];
}

/* The ping of a slot; one whose tail runs past the end of the recording is continued with
 * zeros in a buffer of its own. */
static const float *find_ping(const struct recon_reader *r, struct worker *w,
                              const float *samples, size_t speaker, size_t *stride)
{
    size_t frames = recording_frames(r->cfg.recording);
    size_t n = r->processing.ping_samples;
    size_t start = speaker * r->cfg.survey->slot_samples;
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

static void compress(const struct recon_reader *r, struct worker *w, const float *samples,
                     size_t speaker, float complex *traces)
{
    size_t stride;
    const float *ping = find_ping(r, w, samples, speaker, &stride);
    compressor_execute(w->compressor, ping, stride, traces);
}

static bool all_masked(const bool *masked, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (!masked[i])
            return false;
    return true;
}

/* The file ends with the last slot: what echoes of it would have come later is missing,
 * and that leaks like an emission that is cut off (dsp/drift.h). */
static bool is_cut(const struct recon_reader *r, const float *samples)
{
    size_t frames = recording_frames(r->cfg.recording);
    size_t slots = r->cfg.survey->n_speakers * r->cfg.survey->slot_samples;
    for (size_t i = 0; i < r->cfg.survey->n_microphones; i++)
        for (size_t n = slots; n < frames; n++)
            if (samples[i * frames + n] != 0.0f)
                return false;
    return frames > slots;
}

static void subtract_traces(const struct recon_reader *r, struct worker *w,
                            size_t speaker, struct drift_track *track)
{
    struct drift_measurement now;
    compress(r, w, w->background, speaker, w->background_traces);
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

static int look_at_position(struct recon_reader *r, struct worker *w, size_t position,
                            bool *changed, struct complaint *why)
{
    size_t speakers = r->cfg.survey->n_speakers;
    size_t usable = speakers > 1 ? speakers - 1 : 1;    /* the last one may be cut */
    int err = read_samples(r, w, position, false, why); /* they are checked later */
    for (size_t i = 0; !err && i < LOOK_SPEAKERS && !*changed; i++) {
        struct drift_measurement now;
        size_t speaker = (2 * i + 1) * usable / (2 * LOOK_SPEAKERS);
        compress(r, w, w->samples, speaker, w->traces);
        compress(r, w, w->background, speaker, w->background_traces);
        drift_measure(w->drift, w->background_traces, w->traces, w->masked, &now);
        *changed = is_noticeable(&now);
        r->stretch = now.stretch;
    }
    return err;
}

static int look_at_air(struct recon_reader *r, struct complaint *why)
{
    struct worker w = {0};
    size_t n = r->cfg.survey->n_positions;
    bool changed = false;
    r->drifting = true;
    int err = worker_create(&w, r, why);
    for (size_t i = 0; !err && !changed && i < LOOK_POSITIONS; i++)
        err = look_at_position(r, &w, (2 * i + 1) * n / (2 * LOOK_POSITIONS), &changed,
                               why);
    worker_clear(&w);
    r->drifting = changed;
    return err;
}

/* -- all of it --------------------------------------------------------------------------
 */

int recon_reader_create(struct recon_reader **out, const struct recon_reader_config *cfg,
                        struct complaint *why)
{
    struct recon_reader *r = calloc(1, sizeof *r);
    size_t threads = pool_threads(cfg->pool);
    int err = 0;
    if (!r)
        return complain(why, -ENOMEM, "out of memory");
    r->cfg = *cfg;
    r->processing = *cfg->processing;
    r->workers = calloc(threads, sizeof *r->workers);
    if (!r->workers)
        err = complain(why, -ENOMEM, "out of memory");
    if (!err && cfg->background && cfg->compression == COMPRESSION_MATCHED_FILTER)
        err = look_at_air(r, why);
    if (!r->drifting)
        r->processing.ping_samples = r->processing.echo_samples;
    for (size_t t = 0; !err && t < threads; t++)
        err = worker_create(&r->workers[t], r, why);
    if (err) {
        recon_reader_destroy(r);
        return err;
    }
    *out = r;
    return 0;
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
    struct complaint *why;
};

static void process_ping(struct run *run, struct worker *w, size_t position,
                         size_t speaker, struct drift_track *track, struct stopwatch *now)
{
    const struct recon_reader *r = run->reader;
    compress(r, w, w->samples, speaker, w->traces);
    if (r->drifting)
        subtract_traces(r, w, speaker, track);
    stopwatch_lap(&w->stages[RECON_COMPRESS], now, true);
    run->sink->take(run->sink->ctx, position, speaker, w->traces, w->masked);
    stopwatch_lap(&w->stages[RECON_STACK], now, true);
}

static void process_position(void *ctx, size_t position, size_t thread)
{
    struct run *run = ctx;
    struct recon_reader *r = run->reader;
    struct worker *w = &r->workers[thread];
    size_t speakers = r->cfg.survey->n_speakers;
    struct complaint why = {0};
    struct drift_track track;
    int none = 0;

    if (atomic_load(&run->err) || interrupt_requested())
        return;
    struct stopwatch now = stopwatch_now(true);
    int err = read_samples(r, w, position, true, &why);
    if (!err && r->cfg.background && !r->drifting)
        subtract_samples(r, w);
    stopwatch_lap(&w->stages[RECON_READ], &now, true);
    if (err) {
        if (atomic_compare_exchange_strong(&run->err, &none, err))
            *run->why = why;
        return;
    }
    if (all_masked(w->masked, r->cfg.survey->n_microphones))
        return; /* its pings are lost, and counted as such */
    if (r->drifting && is_cut(r, w->samples)) {
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
    size_t threads = pool_threads(r->cfg.pool);
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
                     struct stopwatch *stages, struct air *air, struct complaint *why)
{
    struct run run = {.reader = r, .sink = sink, .why = why};
    struct stopwatch phase = {0}, now = stopwatch_now(false);
    const struct survey *s = r->cfg.survey;

    atomic_init(&run.err, 0);
    pool_run(r->cfg.pool, s->n_positions, process_position, &run);
    stopwatch_lap(&phase, &now, false);
    share_times(r, phase.wall_s, stages);
    air_start(air, s->sound_speed_m_s, s->n_positions * s->n_speakers);
    for (size_t t = 0; t < pool_threads(r->cfg.pool); t++)
        air_join(air, &r->workers[t].air);
    if (interrupt_requested())
        return complain(why, -EINTR, "interrupted");
    return atomic_load(&run.err);
}

size_t recon_reader_cut(const struct recon_reader *r)
{
    size_t n = 0;
    for (size_t t = 0; t < pool_threads(r->cfg.pool); t++)
        n += r->workers[t].n_cut;
    return n;
}

void recon_reader_destroy(struct recon_reader *r)
{
    if (!r)
        return;
    for (size_t t = 0; r->workers && t < pool_threads(r->cfg.pool); t++)
        worker_clear(&r->workers[t]);
    free(r->workers);
    free(r);
}
