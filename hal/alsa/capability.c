/* SPDX-License-Identifier: MIT */
#include "hal/alsa/capability.h"

#include <stdio.h>

#include "dsp/error.h"

const unsigned alsa_rates_hz[ALSA_RATES] = {44100, 48000,  64000,  88200,
                                            96000, 128000, 176400, 192000};

snd_pcm_format_t alsa_format(enum sample_format f)
{
    static const snd_pcm_format_t formats[SAMPLE_FORMATS] = {
        [SAMPLE_FORMAT_S32] = SND_PCM_FORMAT_S32,
        [SAMPLE_FORMAT_S24] = SND_PCM_FORMAT_S24,
        [SAMPLE_FORMAT_S24_3] = SND_PCM_FORMAT_S24_3LE,
        [SAMPLE_FORMAT_FLOAT] = SND_PCM_FORMAT_FLOAT,
        [SAMPLE_FORMAT_S16] = SND_PCM_FORMAT_S16};
    return formats[f];
}

/* alsa-lib prints what it returns as an error too. */
static void be_quiet(const char *file, int line, const char *function, int err,
                     const char *format, ...)
{
    (void)file, (void)line, (void)function, (void)err, (void)format;
}

int alsa_open(snd_pcm_t **out, const char *device, bool capture)
{
    snd_lib_error_set_handler(be_quiet);
    return snd_pcm_open(out, device,
                        capture ? SND_PCM_STREAM_CAPTURE : SND_PCM_STREAM_PLAYBACK,
                        SND_PCM_NONBLOCK | SND_PCM_NO_AUTO_RESAMPLE |
                            SND_PCM_NO_AUTO_CHANNELS | SND_PCM_NO_AUTO_FORMAT);
}

int alsa_card(snd_pcm_t *pcm)
{
    snd_pcm_info_t *info;
    snd_pcm_info_alloca(&info);
    return snd_pcm_info(pcm, info) ? -1 : snd_pcm_info_get_card(info);
}

int alsa_any(snd_pcm_t *pcm, snd_pcm_hw_params_t *params)
{
    int err = snd_pcm_hw_params_any(pcm, params);
    if (err >= 0)
        err = snd_pcm_hw_params_set_rate_resample(pcm, params, 0);
    return err < 0 ? err : 0;
}

static bool has_access(snd_pcm_t *pcm, snd_pcm_hw_params_t *params,
                       snd_pcm_access_t access)
{
    return !snd_pcm_hw_params_test_access(pcm, params, access);
}

static void read_frames(struct alsa_capability *c, const snd_pcm_hw_params_t *params)
{
    snd_pcm_uframes_t frames[4] = {0};
    int direction = 0;
    snd_pcm_hw_params_get_period_size_min(params, &frames[0], &direction);
    snd_pcm_hw_params_get_period_size_max(params, &frames[1], &direction);
    snd_pcm_hw_params_get_buffer_size_min(params, &frames[2]);
    snd_pcm_hw_params_get_buffer_size_max(params, &frames[3]);
    c->period_min = frames[0];
    c->period_max = frames[1];
    c->buffer_min = frames[2];
    c->buffer_max = frames[3];
}

int alsa_capability_read(struct alsa_capability *out, snd_pcm_t *pcm)
{
    snd_pcm_hw_params_t *params;
    int direction = 0;
    struct alsa_capability c = {.mmap = false};
    snd_pcm_hw_params_alloca(&params);
    int err = alsa_any(pcm, params);
    if (err)
        return err;
    for (int f = 0; f < SAMPLE_FORMATS; f++)
        c.formats[f] = !snd_pcm_hw_params_test_format(pcm, params,
                                                      alsa_format((enum sample_format)f));
    c.mmap = has_access(pcm, params, SND_PCM_ACCESS_MMAP_INTERLEAVED) ||
             has_access(pcm, params, SND_PCM_ACCESS_MMAP_NONINTERLEAVED);
    c.rw = has_access(pcm, params, SND_PCM_ACCESS_RW_INTERLEAVED);
    snd_pcm_hw_params_get_channels_min(params, &c.channels_min);
    snd_pcm_hw_params_get_channels_max(params, &c.channels_max);
    snd_pcm_hw_params_get_rate_min(params, &c.rate_min_hz, &direction);
    snd_pcm_hw_params_get_rate_max(params, &c.rate_max_hz, &direction);
    for (int i = 0; i < ALSA_RATES; i++)
        c.rates[i] = !snd_pcm_hw_params_test_rate(pcm, params, alsa_rates_hz[i], 0);
    read_frames(&c, params);
    *out = c;
    return 0;
}

char *alsa_formats_text(const struct alsa_capability *c, char *out, size_t size)
{
    out[0] = 0;
    for (int f = 0; f < SAMPLE_FORMATS; f++)
        if (c->formats[f])
            text_add(out, size, " ", "%s", sample_format_name((enum sample_format)f));
    if (!out[0])
        text_add(out, size, " ", "no format known here");
    return out;
}

char *alsa_rates_text(const struct alsa_capability *c, char *out, size_t size)
{
    char word[32];
    out[0] = 0;
    for (int i = 0; i < ALSA_RATES; i++) {
        snprintf(word, sizeof word, "%u", alsa_rates_hz[i]);
        if (c->rates[i])
            text_add(out, size, " ", "%s", word);
    }
    snprintf(word, sizeof word, "%u..%u", c->rate_min_hz, c->rate_max_hz);
    if (!out[0])
        text_add(out, size, " ", "%s", word);
    return out;
}

char *alsa_capability_text(const struct alsa_capability *c, char *out, size_t size)
{
    char formats[64], rates[128];
    snprintf(out, size, "%s, %u..%u channels, %s Hz",
             alsa_formats_text(c, formats, sizeof formats), c->channels_min,
             c->channels_max, alsa_rates_text(c, rates, sizeof rates));
    return out;
}
