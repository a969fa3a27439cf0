#include "hal/alsa/shot.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "hal/alsa/capability.h"
#include "hal/alsa/emission.h"
#include "recon/tail.h"

enum { RING_S = 1, NUMBER_BITS = 16 };
#define VOID_SLOT INT64_MIN

static int allocate(struct alsa_shot *s)
{
    const struct survey *v = &s->rig->survey;
    size_t n = s->plan.max_slots;
    for (int down = 0; down < 2; down++)
        s->emissions[down] = emission_create(v, down, &s->n_emission);
    s->ordered.speakers = calloc(v->n_speakers, sizeof *s->ordered.speakers);
    s->under_way.speakers = calloc(v->n_speakers, sizeof *s->under_way.speakers);
    s->recording = calloc(v->n_microphones * s->n_frames, sizeof *s->recording);
    s->t0_ns = calloc(n, sizeof *s->t0_ns);
    return s->emissions[0] && s->emissions[1] && s->ordered.speakers &&
                   s->under_way.speakers && s->recording && s->t0_ns
               ? 0
               : -ENOMEM;
}

int alsa_shot_create(struct alsa_shot *out, const struct rig *rig)
{
    const struct survey *s = &rig->survey;
    size_t tail = tail_samples(s), whole = s->n_speakers * s->slot_samples + tail;
    size_t endless = RING_S * (size_t)s->sample_rate_hz + 2 * rig->buffer_frames +
                     s->slot_samples + tail;
    *out = (struct alsa_shot){.rig = rig};
    if (pthread_mutex_init(&out->mutex, NULL))
        return -ENOMEM;
    out->n_frames = whole > endless ? whole : endless;
    int err = slot_plan_create(&out->plan, s->slot_samples, tail,
                               out->n_frames / s->slot_samples + 1);
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

void alsa_shot_fire(struct alsa_shot *s, const uint32_t *speakers, size_t n_speakers,
                    bool endless)
{
    pthread_mutex_lock(&s->mutex);
    struct alsa_order *o = &s->ordered;
    memcpy(o->speakers, speakers, n_speakers * sizeof *o->speakers);
    o->number++;
    o->n_speakers = n_speakers;
    o->endless = endless;
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

size_t alsa_shot_settled(const struct alsa_shot *s)
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
    size_t at = k * s->plan.slot_samples % s->n_frames;
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
                                   .silence_first = o->silence_first};
        o->silence_first = o->silence_first && !o->n_speakers;
        s->ordered_anew = false;
    }
    pthread_mutex_unlock(&s->mutex);
    return anew;
}

void alsa_shot_place(struct alsa_shot *s, uint64_t frame)
{
    const struct alsa_order *o = &s->under_way;
    if (take_order(s)) {
        size_t slots = survey_slots(&s->rig->survey, o->n_speakers);
        slot_plan_load(&s->plan, o->endless && slots ? SLOT_PLAN_ENDLESS : slots);
        if (o->silence_first)
            frame += s->plan.slot_samples + s->plan.tail_samples;
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

void alsa_shot_fill(const struct alsa_shot *s, const struct alsa_stream *stream,
                    const snd_pcm_channel_area_t *areas, size_t offset, uint64_t frame,
                    size_t n)
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
    size_t end = slot * s->plan.slot_samples + s->n_frames;
    return at >= end ? 0 : n < end - at ? n : end - at;
}

void alsa_shot_take(struct alsa_shot *s, const struct alsa_stream *stream,
                    const snd_pcm_channel_area_t *areas, size_t offset, uint64_t frame,
                    size_t n)
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
    double frames = (double)(s->plan.origin + (k - s->plan.first) * s->plan.slot_samples);
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

bool alsa_shot_heard(struct alsa_shot *s, uint64_t frame, int64_t origin_ns,
                     size_t *n_void)
{
    size_t before = s->plan.n_settled;
    *n_void = slot_plan_heard(&s->plan, frame);
    return publish(s, before, origin_ns);
}

size_t alsa_shot_break(struct alsa_shot *s, uint64_t frame, int64_t origin_ns)
{
    size_t before = s->plan.n_settled, n_void = slot_plan_break(&s->plan, frame);
    publish(s, before, origin_ns);
    return n_void;
}

void alsa_shot_clear(struct alsa_shot *s)
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
