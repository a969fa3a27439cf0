#include "hal/alsa/shot.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "hal/alsa/capability.h"
#include "hal/alsa/emission.h"
#include "hal/tail.h"

int alsa_shot_create(struct alsa_shot *out, const struct rig *rig)
{
    const struct survey *s = &rig->survey;
    size_t tail = tail_samples(s);
    *out = (struct alsa_shot){.rig = rig};
    int err = slot_plan_create(&out->plan, s->slot_samples, tail, s->n_speakers);
    out->n_frames = s->n_speakers * s->slot_samples + tail;
    out->emission = emission_create(s, &out->n_emission);
    out->speakers = calloc(s->n_speakers, sizeof *out->speakers);
    out->recording = calloc(s->n_microphones * out->n_frames, sizeof *out->recording);
    out->t0_ns = calloc(s->n_speakers, sizeof *out->t0_ns);
    if (!err && out->emission && out->speakers && out->recording && out->t0_ns)
        return 0;
    alsa_shot_clear(out);
    return -ENOMEM;
}

void alsa_shot_fire(struct alsa_shot *s, const uint32_t *speakers, size_t n_speakers)
{
    memcpy(s->speakers, speakers, n_speakers * sizeof *s->speakers);
    atomic_store(&s->n_settled, 0);
    atomic_store(&s->n_fired, n_speakers);
    atomic_store(&s->fired, true);
}

bool alsa_shot_read(const struct alsa_shot *s, size_t k, bool *valid, int64_t *t0_ns)
{
    if (k >= atomic_load(&s->n_settled))
        return false;
    *valid = s->plan.valid[k];
    *t0_ns = s->t0_ns[k];
    return true;
}

void alsa_shot_place(struct alsa_shot *s, uint64_t frame)
{
    if (atomic_exchange(&s->fired, false))
        slot_plan_load(&s->plan, atomic_load(&s->n_fired));
    if (!s->plan.placed)
        slot_plan_place(&s->plan, frame);
}

static unsigned char *first_of(const snd_pcm_channel_area_t *area, size_t frame)
{
    return (unsigned char *)area->addr + (area->first + area->step * frame) / 8;
}

void alsa_shot_fill(const struct alsa_shot *s, const struct alsa_stream *stream,
                    const snd_pcm_channel_area_t *areas, size_t offset, uint64_t frame,
                    size_t n)
{
    snd_pcm_areas_silence(areas, offset, (unsigned)stream->n_channels, n,
                          alsa_format(stream->format));
    for (size_t done = 0; done < n;) {
        struct slot_piece p =
            slot_plan_emission(&s->plan, frame + done, n - done, s->n_emission);
        if (!p.n)
            return;
        uint32_t speaker = s->speakers[p.slot];
        const snd_pcm_channel_area_t *area = &areas[s->rig->outputs[speaker]];
        sample_format_write(stream->format, s->emission + p.offset, p.n,
                            s->rig->output_gain[speaker],
                            first_of(area, offset + done + p.at), area->step / 8);
        done += p.at + p.n;
    }
}

void alsa_shot_take(struct alsa_shot *s, const struct alsa_stream *stream,
                    const snd_pcm_channel_area_t *areas, size_t offset, uint64_t frame,
                    size_t n)
{
    struct slot_piece p = slot_plan_recording(&s->plan, frame, n);
    for (size_t m = 0; p.n && m < s->rig->survey.n_microphones; m++) {
        const snd_pcm_channel_area_t *area = &areas[s->rig->inputs[m]];
        sample_format_read(stream->format, first_of(area, offset + p.at), area->step / 8,
                           p.n, s->recording + m * s->n_frames + p.offset);
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
    for (size_t k = before; k < s->plan.n_settled; k++)
        s->t0_ns[k] = slot_ns(s, k, origin_ns);
    /* One that waits to be placed has nothing settled yet. */
    if (s->plan.n_settled > before)
        atomic_store(&s->n_settled, s->plan.n_settled);
    return s->plan.n_settled > before;
}

bool alsa_shot_heard(struct alsa_shot *s, uint64_t frame, int64_t origin_ns)
{
    size_t before = s->plan.n_settled;
    slot_plan_heard(&s->plan, frame);
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
    free(s->emission);
    free(s->speakers);
    free(s->recording);
    free(s->t0_ns);
    memset(s, 0, sizeof *s);
}
