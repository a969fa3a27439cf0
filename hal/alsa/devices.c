/* SPDX-License-Identifier: MIT */
#include "hal/alsa/devices.h"

#include <alsa/asoundlib.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/error.h"
#include "dsp/list.h"

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

struct list {
    struct alsa_device *all;
    size_t n, room;
};

static int add(struct list *l, const struct alsa_device *device)
{
    if (list_grow(&l->all, l->n, &l->room, sizeof *l->all))
        return -ENOMEM;
    l->all[l->n++] = *device;
    return 0;
}

static void look_at(struct alsa_device *d, snd_ctl_t *ctl, snd_ctl_card_info_t *card,
                    int number)
{
    static const snd_pcm_stream_t streams[] = {SND_PCM_STREAM_CAPTURE,
                                               SND_PCM_STREAM_PLAYBACK};
    bool *const has[] = {&d->capture, &d->playback};
    snd_pcm_info_t *info;
    snd_pcm_info_alloca(&info);
    snprintf(d->name, sizeof d->name, "hw:CARD=%s,DEV=%d", snd_ctl_card_info_get_id(card),
             number);
    for (int i = 0; i < 2; i++) {
        snd_pcm_info_set_device(info, (unsigned)number);
        snd_pcm_info_set_stream(info, streams[i]);
        *has[i] = !snd_ctl_pcm_info(ctl, info);
        if (*has[i])
            snprintf(d->description, sizeof d->description, "%s: %s",
                     snd_ctl_card_info_get_name(card), snd_pcm_info_get_name(info));
    }
}

static int add_card_devices(struct list *l, snd_ctl_t *ctl, snd_ctl_card_info_t *card)
{
    int number = -1, err = 0;
    while (!err && !snd_ctl_pcm_next_device(ctl, &number) && number >= 0) {
        struct alsa_device d = {.is_card = true};
        look_at(&d, ctl, card, number);
        err = add(l, &d);
    }
    return err;
}

static int add_cards(struct list *l)
{
    snd_ctl_card_info_t *card;
    int number = -1, err = 0;
    snd_ctl_card_info_alloca(&card);
    while (!err && !snd_card_next(&number) && number >= 0) {
        char name[32];
        snd_ctl_t *ctl;
        snprintf(name, sizeof name, "hw:%d", number);
        if (snd_ctl_open(&ctl, name, SND_CTL_NONBLOCK))
            continue; /* it went just now */
        if (!snd_ctl_card_info(ctl, card))
            err = add_card_devices(l, ctl, card);
        snd_ctl_close(ctl);
    }
    return err;
}

static bool is_listed(const struct list *l, const char *name)
{
    for (size_t i = 0; i < l->n; i++)
        if (!strcmp(l->all[i].name, name))
            return true;
    return false;
}

/* The last one of a hint's fields: its lines become one. */
static void take_hint(struct alsa_device *d, const void *hint)
{
    char *name = snd_device_name_get_hint(hint, "NAME");
    char *text = snd_device_name_get_hint(hint, "DESC");
    char *direction = snd_device_name_get_hint(hint, "IOID");
    snprintf(d->name, sizeof d->name, "%s", name ? name : "");
    snprintf(d->description, sizeof d->description, "%s", text ? text : "");
    for (char *c = d->description; *c; c++)
        *c = *c == '\n' ? ' ' : *c;
    d->playback = !direction || !strcmp(direction, "Output");
    d->capture = !direction || !strcmp(direction, "Input");
    free(name);
    free(text);
    free(direction);
}

static int add_hints(struct list *l)
{
    void **hints;
    int err = snd_device_name_hint(-1, "pcm", &hints);
    if (err)
        return err == -ENOENT ? 0 : err;
    for (void **h = hints; *h && !err; h++) {
        struct alsa_device d = {.is_card = false};
        take_hint(&d, *h);
        if (d.name[0] && !is_listed(l, d.name))
            err = add(l, &d);
    }
    snd_device_name_free_hint(hints);
    return err;
}

int alsa_devices_list(struct alsa_device **out, size_t *n)
{
    struct list l = {.all = NULL};
    int err = add_cards(&l);
    if (!err)
        err = add_hints(&l);
    if (err) {
        free(l.all);
        return err;
    }
    *out = l.all;
    *n = l.n;
    return 0;
}

int alsa_devices_error_say(const char *device, bool capture, struct error *why)
{
    struct alsa_device *all = NULL;
    char names[512] = "";
    size_t n = 0;
    if (!alsa_devices_list(&all, &n))
        for (size_t i = 0; i < n; i++)
            if (all[i].is_card && (capture ? all[i].capture : all[i].playback))
                text_add(names, sizeof names, ", ", "%s%s", names[0] ? "" : "there are ",
                         all[i].name);
    free(all);
    return error_say(why, -ENOENT, "%s: %s: no such device; %s", device,
                     capture ? "capture" : "playback",
                     names[0] ? names : "there is no sound card");
}

/* Only a device with parameters can be linked: any will do, the same for both. */
static int set_any(snd_pcm_t *pcm)
{
    snd_pcm_hw_params_t *params;
    unsigned rate_hz = 48000;
    snd_pcm_hw_params_alloca(&params);
    int err = alsa_any(pcm, params);
    if (!err)
        err = snd_pcm_hw_params_set_rate_near(pcm, params, &rate_hz, NULL);
    return err < 0 ? err : snd_pcm_hw_params(pcm, params);
}

static void judge_clock(struct alsa_probe *out, snd_pcm_t *playback, snd_pcm_t *capture)
{
    char *text = out->clock_reason;
    size_t size = sizeof out->clock_reason;
    int cards[2] = {alsa_card(playback), alsa_card(capture)};
    int err = set_any(playback);
    if (err >= 0)
        err = set_any(capture);
    if (err >= 0)
        err = snd_pcm_link(playback, capture);
    if (cards[0] < 0 || cards[1] < 0)
        snprintf(text, size, "it is no card's own device");
    else if (cards[0] != cards[1])
        snprintf(text, size, "playback is on card %d, capture on card %d", cards[0],
                 cards[1]);
    else if (err < 0)
        snprintf(text, size, "both are on card %d, but cannot be linked: %s", cards[0],
                 snd_strerror(err));
    else
        snprintf(text, size, "both are on card %d, and one call starts both", cards[0]);
    out->one_clock = err >= 0 && cards[0] >= 0 && cards[0] == cards[1];
}

static int look(snd_pcm_t **pcm, struct alsa_capability *out, bool *has,
                const char *device, bool capture)
{
    int err = alsa_open(pcm, device, capture);
    if (!err)
        err = alsa_capability_read(out, *pcm);
    *has = !err;
    return err;
}

int alsa_probe(struct alsa_probe *out, const char *device, struct error *why)
{
    snd_pcm_t *playback = NULL, *capture = NULL;
    *out = (struct alsa_probe){.one_clock = false};
    int err = look(&playback, &out->playback, &out->has_playback, device, false);
    int other = look(&capture, &out->capture, &out->has_capture, device, true);
    err = err == -EBUSY || other == -EBUSY        ? -EBUSY
          : out->has_playback || out->has_capture ? 0
                                                  : err;
    if (!err && playback && capture)
        judge_clock(out, playback, capture);
    else if (!err)
        snprintf(out->clock_reason, sizeof out->clock_reason, "there is no %s",
                 out->has_playback ? "capture" : "playback");
    if (playback)
        snd_pcm_close(playback);
    if (capture)
        snd_pcm_close(capture);
    if (err == -EBUSY)
        return error_say(why, err, "%s: another program uses it", device);
    if (err == -ENOENT || err == -ENODEV || err == -ENXIO)
        return alsa_devices_error_say(device, false, why);
    return err ? error_say(why, err, "%s: %s", device, snd_strerror(err)) : 0;
}
