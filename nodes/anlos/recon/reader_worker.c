#include "nodes/anlos/recon/reader_worker.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

void reader_worker_clear(struct reader_worker *w)
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

int reader_worker_create(struct reader_worker *w, const struct reader_setup *r,
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
    return r->drifting ? create_drift(w, r, &format, why) : 0;
}

int reader_worker_read(const struct reader_setup *r, struct reader_worker *w,
                       size_t position, bool check, struct complaint *why)
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

void reader_worker_subtract(const struct reader_setup *r, struct reader_worker *w)
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

void reader_worker_compress(const struct reader_setup *r, struct reader_worker *w,
                            const float *samples, size_t speaker, float complex *traces)
{
    size_t stride;
    const float *ping = find_ping(r, w, samples, speaker, &stride);
    compressor_execute_either(w->compressor, survey_is_down(r->cfg.survey, speaker), ping,
                              stride, traces);
}

bool reader_worker_is_cut(const struct reader_setup *r, const struct reader_worker *w)
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
