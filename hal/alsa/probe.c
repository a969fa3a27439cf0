#include "hal/alsa/probe.h"

#include <errno.h>
#include <stdio.h>

#include "hal/alsa/devices.h"

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

int alsa_probe(struct alsa_probe *out, const char *device, struct complaint *why)
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
        return complain(why, err, "%s: another program uses it", device);
    if (err == -ENOENT || err == -ENODEV || err == -ENXIO)
        return alsa_devices_complain(device, false, why);
    return err ? complain(why, err, "%s: %s", device, snd_strerror(err)) : 0;
}
