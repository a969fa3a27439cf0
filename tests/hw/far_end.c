/* SPDX-License-Identifier: MIT */
#include "tests/hw/far_end.h"

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct far_end {
    struct far_end_config cfg;
    snd_pcm_t *capture, *playback;
    size_t period, frame_bytes;
    unsigned char *heard, *answer; /* [period] frames */
    atomic_bool stop, broke;
    pthread_t thread;
};

static void check(int err, const char *what)
{
    if (err >= 0)
        return;
    fprintf(stderr, "far end: %s: %s\n", what, snd_strerror(err));
    abort();
}

static snd_pcm_t *open_side(struct far_end *f, snd_pcm_stream_t stream)
{
    char name[32];
    snd_pcm_t *pcm;
    snd_pcm_hw_params_t *hw;
    snd_pcm_sw_params_t *sw;
    snd_pcm_uframes_t buffer = f->cfg.buffer_frames, period = f->period, boundary;
    snprintf(name, sizeof name, "hw:Loopback,1,%u", f->cfg.substream);
    check(snd_pcm_open(&pcm, name, stream, 0), name);
    snd_pcm_hw_params_alloca(&hw);
    snd_pcm_sw_params_alloca(&sw);
    check(snd_pcm_hw_params_any(pcm, hw), "any");
    check(snd_pcm_hw_params_set_access(pcm, hw, SND_PCM_ACCESS_RW_INTERLEAVED), "access");
    check(snd_pcm_hw_params_set_format(pcm, hw, f->cfg.format), "format");
    check(snd_pcm_hw_params_set_channels(pcm, hw, f->cfg.n_channels), "channels");
    check(snd_pcm_hw_params_set_rate(pcm, hw, f->cfg.rate_hz, 0), "rate");
    check(snd_pcm_hw_params_set_period_size_near(pcm, hw, &period, NULL), "period");
    check(snd_pcm_hw_params_set_buffer_size_near(pcm, hw, &buffer), "buffer");
    check(snd_pcm_hw_params(pcm, hw), "parameters");
    f->period = period;
    f->cfg.buffer_frames = buffer;
    check(snd_pcm_sw_params_current(pcm, sw), "software");
    check(snd_pcm_sw_params_get_boundary(sw, &boundary), "boundary");
    check(snd_pcm_sw_params_set_start_threshold(pcm, sw, boundary), "start");
    check(snd_pcm_sw_params(pcm, sw), "software");
    return pcm;
}

static int start(struct far_end *f)
{
    memset(f->answer, 0, f->period * f->frame_bytes);
    for (size_t n = 0; n < f->cfg.ahead_frames; n += f->period) {
        snd_pcm_sframes_t done = snd_pcm_writei(f->playback, f->answer, f->period);
        if (done < 0)
            return (int)done;
    }
    return snd_pcm_start(f->capture);
}

static int restart(struct far_end *f)
{
    atomic_store(&f->broke, true);
    snd_pcm_drop(f->capture);
    int err = snd_pcm_prepare(f->playback);
    if (!err)
        err = snd_pcm_prepare(f->capture);
    return err ? err : start(f);
}

static void *run(void *arg)
{
    struct far_end *f = arg;
    uint64_t frame = 0;
    check(start(f), "start");
    while (!atomic_load(&f->stop)) {
        snd_pcm_sframes_t n = snd_pcm_readi(f->capture, f->heard, f->period);
        if (n > 0) {
            memset(f->answer, 0, (size_t)n * f->frame_bytes);
            f->cfg.answer(f->cfg.ctx, frame, f->heard, f->answer, (size_t)n);
            frame += (uint64_t)n;
            n = snd_pcm_writei(f->playback, f->answer, (snd_pcm_uframes_t)n);
        }
        if (n < 0 && restart(f))
            return NULL; /* the card is gone */
    }
    return NULL;
}

/* As hardware does, it answers in time however busy the system is. */
static void start_thread(struct far_end *f)
{
    const struct sched_param urgent = {.sched_priority = 40};
    pthread_attr_t attributes;
    pthread_attr_init(&attributes);
    pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
    pthread_attr_setschedpolicy(&attributes, SCHED_FIFO);
    pthread_attr_setschedparam(&attributes, &urgent);
    check(-pthread_create(&f->thread, &attributes, run, f), "thread");
    pthread_attr_destroy(&attributes);
}

struct far_end *far_end_start(const struct far_end_config *cfg)
{
    struct far_end *f = calloc(1, sizeof *f);
    if (!f)
        abort();
    f->cfg = *cfg;
    f->period = cfg->ahead_frames / 8;
    f->frame_bytes = (size_t)snd_pcm_format_physical_width(cfg->format) / 8 *
                     cfg->n_channels;
    f->capture = open_side(f, SND_PCM_STREAM_CAPTURE);
    f->playback = open_side(f, SND_PCM_STREAM_PLAYBACK);
    check(snd_pcm_link(f->capture, f->playback), "link");
    f->heard = calloc(f->period, f->frame_bytes);
    f->answer = calloc(f->period, f->frame_bytes);
    if (!f->heard || !f->answer)
        abort();
    start_thread(f);
    return f;
}

bool far_end_broke(const struct far_end *f)
{
    return atomic_load(&f->broke);
}

void far_end_stop(struct far_end *f)
{
    atomic_store(&f->stop, true);
    snd_pcm_abort(f->capture);
    pthread_join(f->thread, NULL);
    snd_pcm_close(f->capture);
    snd_pcm_close(f->playback);
    free(f->heard);
    free(f->answer);
    free(f);
}
