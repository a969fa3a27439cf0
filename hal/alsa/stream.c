/* SPDX-License-Identifier: MIT */
#include "hal/alsa/stream.h"

#include <errno.h>
#include <limits.h>
#include <stdlib.h>

#include "hal/alsa/devices.h"

/* What is being set, and for whom. */
struct setting {
    struct alsa_stream *stream;
    snd_pcm_hw_params_t *params;
    const char *device;
    const struct rig *rig;
    struct error *why;
};

static const char *direction(const struct alsa_stream *s)
{
    return s->capture ? "capture" : "playback";
}

static int refuse(const struct setting *s, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

static int refuse(const struct setting *s, const char *format, ...)
{
    struct alsa_capability c;
    char has[256] = "nothing", asked[128];
    va_list args;
    va_start(args, format);
    vsnprintf(asked, sizeof asked, format, args);
    va_end(args);
    if (!alsa_capability_read(&c, s->stream->pcm))
        alsa_capability_text(&c, has, sizeof has);
    return error_say(s->why, -EINVAL, "%s: %s has no %s; it has %s", s->device,
                     direction(s->stream), asked, has);
}

static bool try_access(const struct setting *s, snd_pcm_access_t access)
{
    return !snd_pcm_hw_params_set_access(s->stream->pcm, s->params, access);
}

static int set_access(const struct setting *s)
{
    struct alsa_stream *stream = s->stream;
    stream->mapped = s->rig->access != RIG_ACCESS_RW &&
                     (try_access(s, SND_PCM_ACCESS_MMAP_INTERLEAVED) ||
                      try_access(s, SND_PCM_ACCESS_MMAP_NONINTERLEAVED));
    if (stream->mapped)
        return 0;
    if (s->rig->access == RIG_ACCESS_MMAP)
        return refuse(s, "mmap access");
    return try_access(s, SND_PCM_ACCESS_RW_INTERLEAVED) ? 0 : refuse(s, "rw access");
}

static int set_format(const struct setting *s)
{
    for (int f = 0; f < SAMPLE_FORMATS; f++) {
        if (s->rig->has_format && s->rig->format != (enum sample_format)f)
            continue;
        s->stream->format = (enum sample_format)f;
        if (!snd_pcm_hw_params_set_format(s->stream->pcm, s->params,
                                          alsa_format(s->stream->format)))
            return 0;
    }
    return refuse(s, "format %s",
                  s->rig->has_format ? sample_format_name(s->rig->format) : "known here");
}

static int set_channels(const struct setting *s)
{
    size_t least = s->stream->capture ? rig_input_channels(s->rig)
                                      : rig_output_channels(s->rig);
    unsigned n = (unsigned)least;
    if (snd_pcm_hw_params_set_channels_min(s->stream->pcm, s->params, &n) ||
        snd_pcm_hw_params_set_channels_first(s->stream->pcm, s->params, &n))
        return refuse(s, "%zu channels", least);
    s->stream->n_channels = n;
    return 0;
}

static int set_rate(const struct setting *s)
{
    double rate_hz = s->rig->survey.sample_rate_hz;
    unsigned rate = rate_hz < UINT_MAX ? (unsigned)rate_hz : 0;
    if (rate != rate_hz || snd_pcm_hw_params_set_rate(s->stream->pcm, s->params, rate, 0))
        return refuse(s, "rate of %g Hz", rate_hz);
    s->stream->rate_hz = rate;
    return 0;
}

static int set_hardware(const struct setting *s)
{
    struct alsa_stream *stream = s->stream;
    snd_pcm_uframes_t period = s->rig->period_frames, buffer = s->rig->buffer_frames;
    int exact = 0, err = set_access(s);
    if (!err)
        err = set_format(s);
    if (!err)
        err = set_channels(s);
    if (!err)
        err = set_rate(s);
    if (err)
        return err;
    err = snd_pcm_hw_params_set_buffer_size_near(stream->pcm, s->params, &buffer);
    if (err >= 0)
        err = snd_pcm_hw_params_set_period_size_near(stream->pcm, s->params, &period,
                                                     &exact);
    if (err >= 0)
        err = snd_pcm_hw_params(stream->pcm, s->params);
    if (err < 0)
        return error_say(s->why, err, "%s: %s takes no buffer of %lu frames: %s",
                         s->device, direction(stream), (unsigned long)buffer,
                         snd_strerror(err));
    stream->period = period;
    stream->buffer = buffer;
    return 0;
}

/* Nothing starts by itself. */
static int set_software(const struct setting *s)
{
    snd_pcm_sw_params_t *params;
    snd_pcm_uframes_t boundary = 0;
    snd_pcm_t *pcm = s->stream->pcm;
    snd_pcm_sw_params_alloca(&params);
    int err = snd_pcm_sw_params_current(pcm, params);
    if (err >= 0)
        err = snd_pcm_sw_params_get_boundary(params, &boundary);
    if (err >= 0)
        err = snd_pcm_sw_params_set_start_threshold(pcm, params, boundary);
    if (err >= 0)
        err = snd_pcm_sw_params_set_avail_min(pcm, params, s->stream->period);
    if (err >= 0)
        err = snd_pcm_sw_params(pcm, params);
    if (err < 0)
        return error_say(s->why, err, "%s: %s: %s", s->device, direction(s->stream),
                         snd_strerror(err));
    return 0;
}

static int make_areas(struct alsa_stream *s, struct error *why)
{
    size_t bytes = sample_format_bytes(s->format);
    if (s->mapped)
        return 0;
    s->interleaved = calloc(s->buffer * s->n_channels, bytes);
    s->interleaved_areas = calloc(s->n_channels, sizeof *s->interleaved_areas);
    if (!s->interleaved || !s->interleaved_areas)
        return error_say(why, -ENOMEM, "out of memory");
    for (size_t c = 0; c < s->n_channels; c++)
        s->interleaved_areas[c] =
            (snd_pcm_channel_area_t){.addr = s->interleaved,
                                     .first = (unsigned)(8 * bytes * c),
                                     .step = (unsigned)(8 * bytes * s->n_channels)};
    return 0;
}

static int open_pcm(const struct setting *s)
{
    int err = alsa_open(&s->stream->pcm, s->device, s->stream->capture);
    if (!err)
        return 0;
    s->stream->pcm = NULL;
    if (err == -ENOENT || err == -ENODEV || err == -ENXIO)
        return alsa_devices_error_say(s->device, s->stream->capture, s->why);
    return error_say(s->why, err, "%s: %s: %s", s->device, direction(s->stream),
                     err == -EBUSY ? "another program uses it" : snd_strerror(err));
}

int alsa_stream_open(struct alsa_stream *out, const char *device, bool capture,
                     const struct rig *rig, struct error *why)
{
    struct setting s = {.stream = out, .device = device, .rig = rig, .why = why};
    snd_pcm_hw_params_alloca(&s.params);
    *out = (struct alsa_stream){.capture = capture};
    int err = open_pcm(&s);
    if (!err && (err = alsa_any(out->pcm, s.params)))
        error_say(why, err, "%s: %s: %s", device, direction(out), snd_strerror(err));
    if (!err)
        err = set_hardware(&s);
    if (!err)
        err = set_software(&s);
    if (!err)
        err = make_areas(out, why);
    if (err)
        alsa_stream_close(out);
    return err;
}

static long move_mapped(struct alsa_stream *s, size_t n, alsa_frames_fn *fn, void *ctx)
{
    const snd_pcm_channel_area_t *areas;
    size_t moved = 0;
    while (moved < n) { /* twice where the buffer ends in between */
        snd_pcm_uframes_t offset, frames = n - moved;
        int err = snd_pcm_mmap_begin(s->pcm, &areas, &offset, &frames);
        if (err < 0 || !frames)
            return err < 0 ? err : (long)moved;
        fn(ctx, areas, offset, frames);
        snd_pcm_sframes_t done = snd_pcm_mmap_commit(s->pcm, offset, frames);
        if (done < 0 || (snd_pcm_uframes_t)done != frames)
            return done < 0 ? done : -EPIPE;
        moved += frames;
    }
    return (long)moved;
}

static long move_copied(struct alsa_stream *s, size_t n, alsa_frames_fn *fn, void *ctx)
{
    snd_pcm_sframes_t done;
    n = n < s->buffer ? n : s->buffer;
    if (s->capture) {
        done = snd_pcm_readi(s->pcm, s->interleaved, n);
        if (done > 0)
            fn(ctx, s->interleaved_areas, 0, (size_t)done);
    } else {
        fn(ctx, s->interleaved_areas, 0, n);
        done = snd_pcm_writei(s->pcm, s->interleaved, n);
    }
    return done == -EAGAIN ? 0 : done;
}

long alsa_stream_move(struct alsa_stream *s, size_t n, alsa_frames_fn *fn, void *ctx)
{
    /* Asks the hardware: its last interrupt may be a period ago. */
    snd_pcm_sframes_t there = snd_pcm_avail(s->pcm);
    if (there < 0)
        return there;
    n = n < (size_t)there ? n : (size_t)there;
    if (!n)
        return 0;
    return s->mapped ? move_mapped(s, n, fn, ctx) : move_copied(s, n, fn, ctx);
}

void alsa_stream_close(struct alsa_stream *s)
{
    if (s->pcm) {
        snd_pcm_drop(s->pcm);
        snd_pcm_close(s->pcm);
    }
    free(s->interleaved);
    free(s->interleaved_areas);
    *s = (struct alsa_stream){.pcm = NULL};
}
