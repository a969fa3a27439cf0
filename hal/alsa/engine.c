/* SPDX-License-Identifier: MIT */
#include "hal/alsa/engine.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "hal/alsa/devices.h"
#include "hal/alsa/stream.h"
#include "hal/realtime.h"
#include "hal/survey/firing.h"
#include "recon/tail.h"

/* Playback and capture of one device, started together: playback frame n and capture
 * frame n, counted from the start, are of the same moment. */

struct alsa_duplex {
    struct alsa_stream playback, capture;
    bool linked;            /* one call starts both; else one right after the other */
    bool on_cards;          /* else nothing may pace them */
    bool one_clock;         /* they are of one card and linked */
    uint64_t played, heard; /* frames written and read since the start */
};

/* What is read and written. */
struct alsa_duplex_ends {
    /* The n playback frames from number `frame` on. */
    void (*fill)(void *ctx, const struct alsa_stream *s,
                 const snd_pcm_channel_area_t *areas, size_t offset, uint64_t frame,
                 size_t n);
    void (*take)(void *ctx, const struct alsa_stream *s,
                 const snd_pcm_channel_area_t *areas, size_t offset, uint64_t frame,
                 size_t n);
    void *ctx;
};

static int alsa_report_create(struct alsa_report *out)
{
    memset(out, 0, sizeof *out);
    return -pthread_mutex_init(&out->mutex, NULL);
}

uint64_t alsa_report_count(struct alsa_report *r, enum alsa_count what, uint64_t n)
{
    return atomic_fetch_add(&r->counts[what], n) + n;
}

size_t alsa_report_counts(struct alsa_report *r,
                          struct device_count out[DEVICE_MAX_COUNTS])
{
    static const char *const names[ALSA_COUNTS] = {
        [ALSA_OVERRUNS] = "overruns",
        [ALSA_UNDERRUNS] = "underruns",
        [ALSA_STALLS] = "stalls",
        [ALSA_SLOTS_INVALID] = "slots_invalid",
        [ALSA_RESTARTS] = "restarts",
        [ALSA_REOPENED] = "reopened",
        [ALSA_SLOTS_SKIPPED] = "slots_skipped"};
    for (size_t i = 0; i < ALSA_COUNTS; i++)
        out[i] =
            (struct device_count){.name = names[i], .value = atomic_load(&r->counts[i])};
    return ALSA_COUNTS;
}

__attribute__((format(printf, 2, 3))) static void
alsa_report_notice(struct alsa_report *r, const char *format, ...)
{
    va_list args;
    pthread_mutex_lock(&r->mutex);
    if (r->n == ALSA_NOTICES) {
        r->first = (r->first + 1) % ALSA_NOTICES;
        r->n--;
    }
    struct error *notice = &r->notices[(r->first + r->n++) % ALSA_NOTICES];
    va_start(args, format);
    vsnprintf(notice->text, sizeof notice->text, format, args);
    va_end(args);
    pthread_mutex_unlock(&r->mutex);
}

bool alsa_report_take(struct alsa_report *r, struct error *out)
{
    pthread_mutex_lock(&r->mutex);
    bool there = r->n > 0;
    if (there) {
        *out = r->notices[r->first];
        r->first = (r->first + 1) % ALSA_NOTICES;
        r->n--;
    }
    pthread_mutex_unlock(&r->mutex);
    return there;
}

/* err 0: all is well, and the text stays empty. */
__attribute__((format(printf, 3, 4))) static void
alsa_report_set(struct alsa_report *r, int err, const char *format, ...)
{
    va_list args;
    pthread_mutex_lock(&r->mutex);
    r->away = err;
    va_start(args, format);
    vsnprintf(r->condition.text, sizeof r->condition.text, format, args);
    va_end(args);
    pthread_mutex_unlock(&r->mutex);
}

int alsa_report_condition(struct alsa_report *r, struct error *why)
{
    pthread_mutex_lock(&r->mutex);
    int err = r->away;
    if (err)
        error_say(why, err, "%s", r->condition.text);
    pthread_mutex_unlock(&r->mutex);
    return err;
}

static void alsa_report_destroy(struct alsa_report *r)
{
    pthread_mutex_destroy(&r->mutex);
}

enum { RING_S = 1, NUMBER_BITS = 16 };
#define VOID_SLOT INT64_MIN

static int allocate(struct alsa_shot *s)
{
    const struct survey *v = &s->rig->survey;
    size_t n = s->plan.max_slots;
    for (int down = 0; down < 2; down++)
        s->emissions[down] = firing_emission(v, down, &s->n_emission);
    s->ordered.speakers = calloc(v->n_speakers, sizeof *s->ordered.speakers);
    s->under_way.speakers = calloc(v->n_speakers, sizeof *s->under_way.speakers);
    s->recording = calloc(v->n_microphones * s->n_frames, sizeof *s->recording);
    s->t0_ns = calloc(n, sizeof *s->t0_ns);
    return s->emissions[0] && s->emissions[1] && s->ordered.speakers &&
                   s->under_way.speakers && s->recording && s->t0_ns
               ? 0
               : -ENOMEM;
}

static void alsa_shot_clear(struct alsa_shot *s)
{
    slot_plan_clear(&s->plan);
    pthread_mutex_destroy(&s->mutex);
    free(s->emissions[0]);
    free(s->emissions[1]);
    free(s->ordered.speakers);
    free(s->under_way.speakers);
    free(s->recording);
    free(s->t0_ns);
    memset(s, 0, sizeof *s);
}

/* rig is not copied; slots: of endless shots.  0, -ENOMEM. */
static int alsa_shot_create(struct alsa_shot *out, const struct rig *rig,
                            const struct firing_slots *slots)
{
    const struct survey *s = &rig->survey;
    size_t tail = tail_samples(s), whole = s->n_speakers * s->slot_samples + tail;
    size_t endless = RING_S * (size_t)s->sample_rate_hz + 2 * rig->buffer_frames +
                     s->slot_samples + slots->jitter_samples + tail;
    *out = (struct alsa_shot){.rig = rig};
    if (pthread_mutex_init(&out->mutex, NULL))
        return -ENOMEM;
    out->n_frames = whole > endless ? whole : endless;
    int err = slot_plan_create(&out->plan, s->slot_samples, tail,
                               out->n_frames / s->slot_samples + 1);
    out->plan.endless = *slots;
    if (!err)
        err = allocate(out);
    if (err)
        alsa_shot_clear(out);
    return err;
}

/* Counts belong to an order. */
static uint64_t with_number(uint16_t number, size_t n)
{
    return (uint64_t)n << NUMBER_BITS | number;
}

static size_t of_number(uint64_t count, uint16_t number)
{
    return (uint16_t)count == number ? (size_t)(count >> NUMBER_BITS) : 0;
}

void alsa_shot_fire(struct alsa_shot *s, const struct array_shot *shot)
{
    pthread_mutex_lock(&s->mutex);
    struct alsa_order *o = &s->ordered;
    memcpy(o->speakers, shot->speakers, shot->n_speakers * sizeof *o->speakers);
    o->number++;
    o->n_speakers = shot->n_speakers;
    o->endless = shot->endless;
    o->n_rounds = shot->n_rounds;
    o->start_ns = shot->n_rounds ? shot->start_ns : 0;
    s->ordered_anew = true;
    pthread_mutex_unlock(&s->mutex);
}

void alsa_shot_halt(struct alsa_shot *s)
{
    pthread_mutex_lock(&s->mutex);
    s->ordered.number++;
    s->ordered.n_speakers = 0;
    s->ordered.silence_first = true;
    s->ordered_anew = true;
    pthread_mutex_unlock(&s->mutex);
}

/* Slots of the shot that was fired last whose fate is known. */
static size_t alsa_shot_settled(const struct alsa_shot *s)
{
    return of_number(atomic_load(&s->settled), s->ordered.number);
}

size_t alsa_shot_newest(const struct alsa_shot *s, size_t k)
{
    size_t settled = alsa_shot_settled(s);
    return s->ordered.endless && settled > k + s->plan.max_slots / 2 ? settled - 1 : k;
}

bool alsa_shot_read(const struct alsa_shot *s, size_t k, int64_t *t0_ns)
{
    int64_t t0 = atomic_load(&s->t0_ns[k % s->plan.max_slots]);
    *t0_ns = t0 != VOID_SLOT ? t0 : 0;
    return t0 != VOID_SLOT;
}

void alsa_shot_copy(const struct alsa_shot *s, size_t k, float *out)
{
    size_t n = s->plan.slot_samples + s->plan.tail_samples;
    size_t at = slot_plan_offset(&s->plan, k) % s->n_frames;
    size_t head = n < s->n_frames - at ? n : s->n_frames - at;
    for (size_t m = 0; m < s->rig->survey.n_microphones; m++) {
        const float *x = s->recording + m * s->n_frames;
        memcpy(out + m * n, x + at, head * sizeof *out);
        memcpy(out + m * n + head, x, (n - head) * sizeof *out);
    }
}

void alsa_shot_release(struct alsa_shot *s, size_t k)
{
    atomic_store(&s->released, with_number(s->ordered.number, k));
}

/* What is ordered anew begins with this call, or with the next one. */
static bool take_order(struct alsa_shot *s)
{
    if (pthread_mutex_trylock(&s->mutex))
        return false;
    struct alsa_order *o = &s->ordered, *now = &s->under_way;
    bool anew = s->ordered_anew;
    if (anew) {
        memcpy(now->speakers, o->speakers, o->n_speakers * sizeof *now->speakers);
        *now = (struct alsa_order){.number = o->number,
                                   .speakers = now->speakers,
                                   .n_speakers = o->n_speakers,
                                   .endless = o->endless,
                                   .silence_first = o->silence_first,
                                   .n_rounds = o->n_rounds,
                                   .start_ns = o->start_ns};
        o->silence_first = o->silence_first && !o->n_speakers;
        s->ordered_anew = false;
    }
    pthread_mutex_unlock(&s->mutex);
    return anew;
}

/* A shot that was fired, or the rest of one that broke, begins at this frame, or at a
 * later one that is its time; frame 0 was at origin_ns. */
static void alsa_shot_place(struct alsa_shot *s, uint64_t frame, int64_t origin_ns)
{
    const struct alsa_order *o = &s->under_way;
    if (take_order(s)) {
        size_t slots = survey_slots(&s->rig->survey, o->n_speakers);
        slot_plan_load(&s->plan, o->endless && slots
                                     ? SLOT_PLAN_ENDLESS
                                     : slots * (o->n_rounds ? o->n_rounds : 1));
        if (o->silence_first)
            frame += s->plan.slot_samples + s->plan.tail_samples;
        double at = 1e-9 * (double)(o->start_ns - origin_ns) *
                    s->rig->survey.sample_rate_hz;
        if (o->start_ns && at > (double)frame)
            frame = (uint64_t)llrint(at);
    }
    if (!s->plan.placed)
        slot_plan_place(&s->plan, frame);
}

static unsigned char *first_of(const snd_pcm_channel_area_t *area, size_t frame)
{
    return (unsigned char *)area->addr + (area->first + area->step * frame) / 8;
}

/* Emission k of a round, which is in the slot of this piece. */
static void write_emission(const struct alsa_shot *s, const struct alsa_stream *stream,
                           const snd_pcm_channel_area_t *areas, size_t offset, size_t k,
                           const struct slot_piece *p)
{
    uint32_t speaker = s->under_way.speakers[k];
    const float *x = s->emissions[survey_is_down(&s->rig->survey, k)];
    const snd_pcm_channel_area_t *area = &areas[s->rig->outputs[speaker]];
    sample_format_write(stream->format, x + p->offset, p->n, s->rig->output_gain[speaker],
                        first_of(area, offset + p->at), area->step / 8);
}

/* Silence, and what is emitted of the shot, into n frames of playback from number `frame`
 * on. */
static void alsa_shot_fill(const struct alsa_shot *s, const struct alsa_stream *stream,
                           const snd_pcm_channel_area_t *areas, size_t offset,
                           uint64_t frame, size_t n)
{
    const struct survey *v = &s->rig->survey;
    size_t slot, end, n_emissions = s->under_way.n_speakers;
    snd_pcm_areas_silence(areas, offset, (unsigned)stream->n_channels, n,
                          alsa_format(stream->format));
    slot_plan_sounding(&s->plan, frame, n, s->n_emission, &slot, &end);
    for (; slot < end; slot++) {
        struct slot_piece p = slot_plan_emission(&s->plan, slot, frame, n, s->n_emission);
        size_t in_round = slot % survey_slots(v, n_emissions);
        for (size_t k = 0; k < n_emissions; k++)
            if (survey_slot_of(v, k) == in_round)
                write_emission(s, stream, areas, offset, k, &p);
    }
}

/* How much of n frames from `at` on has room: not where nobody has read what is there. */
static size_t room_for(const struct alsa_shot *s, size_t at, size_t n)
{
    size_t slot = of_number(atomic_load(&s->released), s->under_way.number);
    size_t end = slot_plan_offset(&s->plan, slot) + s->n_frames;
    return at >= end ? 0 : n < end - at ? n : end - at;
}

static void alsa_shot_take(struct alsa_shot *s, const struct alsa_stream *stream,
                           const snd_pcm_channel_area_t *areas, size_t offset,
                           uint64_t frame, size_t n)
{
    struct slot_piece p = slot_plan_recording(&s->plan, frame, n);
    size_t room = room_for(s, p.offset, p.n);
    slot_plan_lose(&s->plan, p.offset + room, p.n - room);
    for (size_t done = 0; done < room;) {
        size_t at = (p.offset + done) % s->n_frames;
        size_t part = room - done < s->n_frames - at ? room - done : s->n_frames - at;
        for (size_t m = 0; m < s->rig->survey.n_microphones; m++) {
            const snd_pcm_channel_area_t *area = &areas[s->rig->inputs[m]];
            sample_format_read(stream->format, first_of(area, offset + p.at + done),
                               area->step / 8, part, s->recording + m * s->n_frames + at);
        }
        done += part;
    }
}

static int64_t slot_ns(const struct alsa_shot *s, size_t k, int64_t origin_ns)
{
    double frames = (double)slot_plan_start(&s->plan, k);
    return origin_ns + (int64_t)(frames / s->rig->survey.sample_rate_hz * 1e9);
}

/* Publishes what the plan has settled since `before`. */
static bool publish(struct alsa_shot *s, size_t before, int64_t origin_ns)
{
    const struct slot_plan *p = &s->plan;
    for (size_t k = before; k < p->n_settled; k++) {
        size_t i = k % p->max_slots;
        atomic_store(&s->t0_ns[i], p->valid[i] ? slot_ns(s, k, origin_ns) : VOID_SLOT);
    }
    /* One that waits to be placed has nothing settled yet. */
    if (p->n_settled > before)
        atomic_store(&s->settled, with_number(s->under_way.number, p->n_settled));
    return p->n_settled > before;
}

/* All before `frame` is recorded; frame 0 was at origin_ns.  true: a slot settled;
 * *n_void: so many that nobody had made room for. */
static bool alsa_shot_heard(struct alsa_shot *s, uint64_t frame, int64_t origin_ns,
                            size_t *n_void)
{
    size_t before = s->plan.n_settled;
    *n_void = slot_plan_heard(&s->plan, frame);
    return publish(s, before, origin_ns);
}

/* The stream broke: nothing from `frame` on counts.  Returns the slots that makes void.
 */
static size_t alsa_shot_break(struct alsa_shot *s, uint64_t frame, int64_t origin_ns)
{
    size_t before = s->plan.n_settled, n_void = slot_plan_break(&s->plan, frame);
    publish(s, before, origin_ns);
    return n_void;
}

enum { MAX_FDS = 16, STALL_MS = 1000, STALL_PERIODS = 4 };

static void alsa_duplex_close(struct alsa_duplex *d)
{
    if (d->linked)
        snd_pcm_unlink(d->capture.pcm);
    alsa_stream_close(&d->playback);
    alsa_stream_close(&d->capture);
    *d = (struct alsa_duplex){.linked = false};
}

/* Errors are those of alsa_stream_open. */
static int alsa_duplex_open(struct alsa_duplex *out, const char *device,
                            const struct rig *rig, struct error *why)
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

/* Fills the playback buffer and starts, both counts from 0; also after a break.  0 or a
 * negative errno. */
static int alsa_duplex_start(struct alsa_duplex *d, const struct alsa_duplex_ends *ends)
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

/* Waits until a period is heard or stop_fd is readable, moves what there is, and fills up
 * the playback.  0, -ECANCELED (stop_fd), -ETIMEDOUT (no sound for much longer than a
 * period), -EPIPE, -ESTRPIPE, -ENODEV, other negative errno: what was heard since the
 * call before may be broken then. */
static int alsa_duplex_cycle(struct alsa_duplex *d, const struct alsa_duplex_ends *ends,
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

/* After -EPIPE: which side was it?  Both may be. */
static void alsa_duplex_broken(const struct alsa_duplex *d, bool *overrun, bool *underrun)
{
    *overrun = ran_out(&d->capture);
    *underrun = ran_out(&d->playback);
    if (!*overrun && !*underrun) /* drivers round it to their periods */
        *overrun = true;
}

enum {
    PATIENCE_MS = 200,  /* with a card that is away */
    FIRST_TRY_MS = 500, /* doubled after each try, */
    LAST_TRY_MS = 8000, /* up to this */
    MAX_BRIEF = 3,      /* runs shorter than a buffer, in a row */
    DRIFT_SHARE = 1000, /* of an estimate's error that each period corrects */
};

#define NS_PER_S 1e9

struct alsa_engine {
    char *device;
    const struct rig *rig;
    const struct clock_source *clock;
    struct alsa_duplex duplex;
    bool is_open; /* the duplex */
    bool running; /* shots may be placed */
    struct alsa_shot shot;
    struct alsa_report report;
    int64_t origin_ns; /* of frame 0 of this start */
    unsigned n_brief;
    int stop_fd, news_fd; /* eventfd */
    bool has_thread;
    pthread_t thread;
};

static void tell(struct alsa_engine *e)
{
    uint64_t one = 1;
    if (write(e->news_fd, &one, sizeof one) < 0)
        return; /* full: the reader has news enough */
}

static void fill(void *ctx, const struct alsa_stream *s,
                 const snd_pcm_channel_area_t *areas, size_t offset, uint64_t frame,
                 size_t n)
{
    struct alsa_engine *e = ctx;
    if (e->running)
        alsa_shot_place(&e->shot, frame, e->origin_ns);
    alsa_shot_fill(&e->shot, s, areas, offset, frame, n);
}

static void take(void *ctx, const struct alsa_stream *s,
                 const snd_pcm_channel_area_t *areas, size_t offset, uint64_t frame,
                 size_t n)
{
    alsa_shot_take(&((struct alsa_engine *)ctx)->shot, s, areas, offset, frame, n);
}

/* A thread reads frames late, never early: the earliest origin is the best one, but for a
 * slow drift between the card's clock and ours. */
static void observe_time(struct alsa_engine *e)
{
    double heard_s = (double)e->duplex.heard / e->rig->survey.sample_rate_hz;
    int64_t origin_ns = clock_now_ns(e->clock) - (int64_t)(heard_s * NS_PER_S);
    if (origin_ns < e->origin_ns)
        e->origin_ns = origin_ns;
    else
        e->origin_ns += (origin_ns - e->origin_ns) / DRIFT_SHARE;
}

/* Until something is wrong; *heard: the frames that are good. */
static int run_stream(struct alsa_engine *e, uint64_t *heard)
{
    const struct alsa_duplex_ends ends = {.fill = fill, .take = take, .ctx = e};
    size_t n_void;
    *heard = 0;
    e->running = false;
    int err = alsa_duplex_start(&e->duplex, &ends);
    e->origin_ns = clock_now_ns(e->clock);
    e->running = true;
    while (!err) {
        err = alsa_duplex_cycle(&e->duplex, &ends, e->stop_fd);
        if (err)
            break;
        *heard = e->duplex.heard;
        observe_time(e);
        if (alsa_shot_heard(&e->shot, *heard, e->origin_ns, &n_void))
            tell(e);
        alsa_report_count(&e->report, ALSA_SLOTS_INVALID, n_void);
    }
    return err;
}

static void count_break(struct alsa_engine *e, int err)
{
    bool overrun = false, underrun = false;
    if (err == -EPIPE)
        alsa_duplex_broken(&e->duplex, &overrun, &underrun);
    alsa_report_count(&e->report, ALSA_OVERRUNS, overrun);
    alsa_report_count(&e->report, ALSA_UNDERRUNS, underrun);
    alsa_report_count(&e->report, ALSA_STALLS, err == -ETIMEDOUT);
}

static const char *what_broke(int err)
{
    return err == -EPIPE      ? "frames were lost"
           : err == -ESTRPIPE ? "it was suspended"
                              : "it stood still";
}

/* true: another start of the same device may do. */
static bool settle_break(struct alsa_engine *e, int err, uint64_t heard)
{
    /* What was not played cannot have been heard. */
    uint64_t good = heard < e->duplex.played ? heard : e->duplex.played;
    size_t n_void = alsa_shot_break(&e->shot, good, e->origin_ns);
    bool passing = err == -EPIPE || err == -ESTRPIPE || err == -ETIMEDOUT;
    count_break(e, err);
    alsa_report_count(&e->report, ALSA_SLOTS_INVALID, n_void);
    e->n_brief = heard < e->duplex.playback.buffer ? e->n_brief + 1 : 0;
    if (!passing || e->n_brief >= MAX_BRIEF)
        return false;
    uint64_t restarts = alsa_report_count(&e->report, ALSA_RESTARTS, 1);
    if (!(restarts & (restarts - 1))) /* the 1st, 2nd, 4th: few lines for many */
        alsa_report_notice(&e->report, "%s: %s; started anew, %llu times so far",
                           e->device, what_broke(err), (unsigned long long)restarts);
    tell(e);
    return true;
}

/* true: stop.  Tells that the card is away, and waits before the next try. */
static bool wait_for_card(struct alsa_engine *e, int err, const char *text, int ms)
{
    struct pollfd stop = {.fd = e->stop_fd, .events = POLLIN};
    alsa_report_set(&e->report, err, "%s; tries again in %g s", text, 1e-3 * ms);
    tell(e);
    return poll(&stop, 1, ms) > 0;
}

/* Tries until the card is there again.  true: stop. */
static bool reopen(struct alsa_engine *e, int err)
{
    struct error gone, why;
    alsa_duplex_close(&e->duplex);
    e->is_open = false;
    error_say(&gone, err, "%s: %s", e->device,
              err == -ENODEV ? "it is gone" : snd_strerror(err));
    alsa_report_notice(&e->report, "%s", gone.text);
    for (int ms = FIRST_TRY_MS; !e->is_open; ms = ms < LAST_TRY_MS ? 2 * ms : ms) {
        if (wait_for_card(e, err, gone.text, ms))
            return true;
        err = alsa_duplex_open(&e->duplex, e->device, e->rig, &why);
        e->is_open = !err;
        if (err && err != -ENOENT) /* there, but not as it was */
            gone = why;
    }
    alsa_report_count(&e->report, ALSA_REOPENED, 1);
    alsa_report_set(&e->report, 0, "%s", "");
    alsa_report_notice(&e->report, "%s: it is there again", e->device);
    tell(e);
    return false;
}

static void *run(void *arg)
{
    struct alsa_engine *e = arg;
    uint64_t heard;
    for (;;) {
        int err = run_stream(e, &heard);
        if (err == -ECANCELED)
            return NULL;
        if (settle_break(e, err, heard))
            continue;
        if (reopen(e, err))
            return NULL;
    }
}

static void warn(struct alsa_engine *e)
{
    double rate_hz = e->rig->survey.sample_rate_hz;
    if (!e->duplex.one_clock)
        alsa_report_notice(
            &e->report,
            "%s: playback and capture cannot be linked, or are of two cards: they are "
            "started one after the other, and each start needs its own calibration of "
            "time zero",
            e->device);
    if (2 * e->duplex.playback.buffer < e->rig->buffer_frames)
        alsa_report_notice(&e->report,
                           "%s: its buffer holds %.0f ms, not the %.0f ms of the rig",
                           e->device, 1e3 * (double)e->duplex.playback.buffer / rate_hz,
                           1e3 * (double)e->rig->buffer_frames / rate_hz);
}

static int open_parts(struct alsa_engine *e, const char *device,
                      const struct firing_slots *slots, struct error *why)
{
    e->device = strdup(device);
    e->stop_fd = eventfd(0, EFD_CLOEXEC);
    e->news_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (!e->device || e->stop_fd < 0 || e->news_fd < 0 ||
        alsa_shot_create(&e->shot, e->rig, slots))
        return error_say(why, -ENOMEM, "out of memory");
    int err = alsa_duplex_open(&e->duplex, device, e->rig, why);
    e->is_open = !err;
    return err;
}

static int start_thread(struct alsa_engine *e, struct error *why)
{
    struct error missing = {.text = ""};
    /* What nothing paces must not outrun the rest. */
    int err = realtime_start(&e->thread, run, e, e->duplex.on_cards, &missing);
    if (err)
        return error_say(why, err, "%s: no thread: %s", e->device, strerror(-err));
    e->has_thread = true;
    if (missing.text[0])
        alsa_report_notice(&e->report, "%s", missing.text);
    return 0;
}

int alsa_engine_create(struct alsa_engine **out, const char *device,
                       const struct rig *rig, const struct firing_slots *slots,
                       const struct clock_source *clock, struct error *why)
{
    struct alsa_engine *e = calloc(1, sizeof *e);
    if (!e || alsa_report_create(&e->report)) {
        free(e);
        return error_say(why, -ENOMEM, "out of memory");
    }
    e->rig = rig;
    e->clock = clock;
    int err = open_parts(e, device, slots, why);
    if (!err) {
        warn(e);
        err = start_thread(e, why);
    }
    if (err)
        alsa_engine_destroy(e);
    else
        *out = e;
    return err;
}

struct alsa_shot *alsa_engine_shot(struct alsa_engine *e)
{
    return &e->shot;
}

struct alsa_report *alsa_engine_report(struct alsa_engine *e)
{
    return &e->report;
}

int alsa_engine_wait(struct alsa_engine *e, size_t k, struct error *why)
{
    struct pollfd news = {.fd = e->news_fd, .events = POLLIN};
    uint64_t n;
    while (alsa_shot_settled(&e->shot) <= k) {
        int ready = poll(&news, 1, PATIENCE_MS);
        if (ready < 0)
            return -errno;
        if (ready && read(e->news_fd, &n, sizeof n) == sizeof n)
            continue;
        if (alsa_report_condition(&e->report, why))
            return -EAGAIN;
    }
    return 0;
}

void alsa_engine_destroy(struct alsa_engine *e)
{
    uint64_t one = 1;
    if (e->has_thread && write(e->stop_fd, &one, sizeof one) == sizeof one)
        pthread_join(e->thread, NULL);
    if (e->is_open)
        alsa_duplex_close(&e->duplex);
    alsa_shot_clear(&e->shot);
    alsa_report_destroy(&e->report);
    close(e->stop_fd);
    close(e->news_fd);
    free(e->device);
    free(e);
}
