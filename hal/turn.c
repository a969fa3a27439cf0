/* SPDX-License-Identifier: MIT */
#include "hal/turn.h"

void turn_start(struct turn *t, const struct array_shot *shot, int64_t now_ns)
{
    *t = (struct turn){.n_speakers = shot->n_speakers,
                       .endless = shot->endless,
                       .continuous = shot->n_rounds > 0,
                       .paced = shot->endless || (shot->n_rounds && shot->start_ns),
                       .start_ns = now_ns};
    if (shot->n_rounds && shot->start_ns > now_ns)
        t->start_ns = shot->start_ns;
}

void turn_advance(struct turn *t)
{
    if (++t->next < t->n_speakers || !(t->endless || t->continuous))
        return;
    t->next = 0;
    t->round++;
}

size_t turn_slot(const struct turn *t, const struct survey *s)
{
    return t->round * survey_slots(s, t->n_speakers) + survey_slot_of(s, t->next);
}

void turn_go(struct turn *t, const struct survey *s, size_t slot)
{
    t->round = slot / survey_slots(s, t->n_speakers);
    for (t->next = 0; turn_slot(t, s) < slot;)
        t->next++;
}

uint32_t turn_frame(const struct turn *t)
{
    return t->endless || t->continuous ? (uint32_t)(t->round + 1) : 0;
}

int turn_wait(const struct turn *t, const struct survey *s, size_t n_ping,
              const struct clock_source *clock, int64_t *t0_ns, struct error *why)
{
    double start = (double)turn_slot(t, s) * (double)s->slot_samples;
    *t0_ns = clock_now_ns(clock);
    if (!t->paced)
        return 0;
    *t0_ns = t->start_ns + (int64_t)(1e9 * start / s->sample_rate_hz);
    int64_t end_ns = *t0_ns + (int64_t)(1e9 * (double)n_ping / s->sample_rate_hz);
    int err = clock->sleep_until_ns(clock->state, end_ns);
    return err ? error_say(why, err, "the wait for a ping was interrupted") : 0;
}
