#include "hal/alsa/devices.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <alsa/asoundlib.h>

struct list {
    struct alsa_device *all;
    size_t n, room;
};

static int add(struct list *l, const struct alsa_device *device)
{
    if (l->n == l->room) {
        size_t room = l->room ? 2 * l->room : 16;
        struct alsa_device *all = realloc(l->all, room * sizeof *all);
        if (!all)
            return -ENOMEM;
        l->all = all;
        l->room = room;
    }
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

int alsa_devices_complain(const char *device, bool capture, struct complaint *why)
{
    struct alsa_device *all = NULL;
    char names[512] = "";
    size_t n = 0, used = 0;
    if (!alsa_devices_list(&all, &n))
        for (size_t i = 0; i < n && used < sizeof names; i++)
            if (all[i].is_card && (capture ? all[i].capture : all[i].playback))
                used += (size_t)snprintf(names + used, sizeof names - used, "%s%s",
                                         used ? ", " : "there are ", all[i].name);
    free(all);
    return complain(why, -ENOENT, "%s: %s: no such device; %s", device,
                    capture ? "capture" : "playback",
                    names[0] ? names : "there is no sound card");
}
