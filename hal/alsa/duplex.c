#include "hal/alsa/duplex.h"

#include <errno.h>
#include <poll.h>

#include "hal/alsa/capability.h"

enum { MAX_FDS = 16, STALL_MS = 1000, STALL_PERIODS = 4 };

int alsa_duplex_open(struct alsa_duplex *out, const char *device, const struct rig *rig,
                     struct complaint *why)
{
    *out = (struct alsa_duplex){.linked = false};
    int err = alsa_stream_open(&out->playback, device, false, rig, why);
    if (!err)
        err = alsa_stream_open(&out->capture, device, true, rig, why);
    if (err) {
        alsa_duplex_close(out);
        return err;
    }
    out->linked = !snd_pcm_link(out->capture.pcm, out->playback.pcm);
    int cards[] = {alsa_card(out->playback.pcm), alsa_card(out->capture.pcm)};
    out->on_cards = cards[0] >= 0 && cards[1] >= 0;
    out->one_clock = out->linked && out->on_cards && cards[0] == cards[1];
    return 0;
}

/* What a transfer needs to know of its place. */
struct transfer {
    const struct alsa_duplex_ends *ends;
    const struct alsa_stream *stream;
    uint64_t frame;
};

static void hand_over(void *ctx, const snd_pcm_channel_area_t *areas, size_t offset,
                      size_t n)
{
    struct transfer *t = ctx;
    if (t->stream->capture)
        t->ends->take(t->ends->ctx, t->stream, areas, offset, t->frame, n);
    else
        t->ends->fill(t->ends->ctx, t->stream, areas, offset, t->frame, n);
    t->frame += n;
}

static int move(struct alsa_stream *s, uint64_t *count, size_t n,
                const struct alsa_duplex_ends *ends)
{
    struct transfer t = {.ends = ends, .stream = s, .frame = *count};
    long moved = n ? alsa_stream_move(s, n, hand_over, &t) : 0;
    if (moved < 0)
        return (int)moved;
    *count += (uint64_t)moved;
    return 0;
}

/* At most a buffer ahead of what was heard: so it is for every card, whose two counts run
 * together, and so it stays where nothing paces the playback. */
static int fill_up(struct alsa_duplex *d, const struct alsa_duplex_ends *ends)
{
    uint64_t full = d->heard + d->playback.buffer;
    return move(&d->playback, &d->played, full > d->played ? full - d->played : 0, ends);
}

static int start(struct alsa_stream *s)
{
    /* It may run already, started with the other one. */
    return snd_pcm_state(s->pcm) == SND_PCM_STATE_PREPARED ? snd_pcm_start(s->pcm) : 0;
}

int alsa_duplex_start(struct alsa_duplex *d, const struct alsa_duplex_ends *ends)
{
    d->played = d->heard = 0;
    snd_pcm_drop(d->capture.pcm);
    snd_pcm_drop(d->playback.pcm);
    int err = snd_pcm_prepare(d->playback.pcm);
    if (!err)
        err = snd_pcm_prepare(d->capture.pcm);
    if (!err)
        err = fill_up(d, ends);
    if (!err)
        err = start(&d->playback);
    return err ? err : start(&d->capture);
}

/* A card that was unplugged or put to sleep still counts frames, but no more of them. */
static int check_running(const struct alsa_stream *s)
{
    int state = (int)snd_pcm_state(s->pcm); /* or a negative errno */
    switch (state) {
    case SND_PCM_STATE_RUNNING:
        return 0;
    case SND_PCM_STATE_XRUN:
        return -EPIPE;
    case SND_PCM_STATE_SUSPENDED:
        return -ESTRPIPE;
    case SND_PCM_STATE_DISCONNECTED:
        return -ENODEV;
    default:
        return state < 0 ? state : -EBADFD;
    }
}

static int wait_for_sound(struct alsa_duplex *d, int stop_fd)
{
    struct pollfd fds[MAX_FDS + 1] = {{.fd = stop_fd, .events = POLLIN}};
    unsigned short events = 0;
    snd_pcm_t *pcm = d->capture.pcm;
    size_t stall_ms = STALL_MS +
                      STALL_PERIODS * 1000 * d->capture.period / d->capture.rate_hz;
    int n = snd_pcm_poll_descriptors(pcm, fds + 1, MAX_FDS);
    if (n < 0)
        return n;
    int ready = poll(fds, (nfds_t)n + 1, (int)stall_ms);
    if (ready < 0)
        return errno == EINTR ? 0 : -errno;
    if (!ready)
        return -ETIMEDOUT;
    if (fds[0].revents)
        return -ECANCELED;
    int err = snd_pcm_poll_descriptors_revents(pcm, fds + 1, (unsigned)n, &events);
    return err < 0 ? err : 0;
}

int alsa_duplex_cycle(struct alsa_duplex *d, const struct alsa_duplex_ends *ends,
                      int stop_fd)
{
    int err = wait_for_sound(d, stop_fd);
    if (!err)
        err = check_running(&d->capture);
    if (!err)
        err = check_running(&d->playback);
    if (!err)
        err = move(&d->capture, &d->heard, d->capture.buffer, ends);
    if (!err)
        err = fill_up(d, ends);
    if (!err && d->heard > d->played) /* capture goes on alone: playback stands still */
        err = -ETIMEDOUT;
    if (err)
        return err;
    /* What was read while the card wrote over it is no sound. */
    snd_pcm_sframes_t there = snd_pcm_avail_update(d->capture.pcm);
    return there < 0 ? (int)there : 0;
}

/* The side that had nothing left: all of a buffer waits to be read, or to be written. */
static bool ran_out(const struct alsa_stream *s)
{
    snd_pcm_status_t *status;
    snd_pcm_status_alloca(&status);
    return !snd_pcm_status(s->pcm, status) &&
           snd_pcm_status_get_avail(status) >= s->buffer;
}

void alsa_duplex_broken(const struct alsa_duplex *d, bool *overrun, bool *underrun)
{
    *overrun = ran_out(&d->capture);
    *underrun = ran_out(&d->playback);
    if (!*overrun && !*underrun) /* drivers round it to their periods */
        *overrun = true;
}

void alsa_duplex_close(struct alsa_duplex *d)
{
    if (d->linked)
        snd_pcm_unlink(d->capture.pcm);
    alsa_stream_close(&d->playback);
    alsa_stream_close(&d->capture);
    *d = (struct alsa_duplex){.linked = false};
}
