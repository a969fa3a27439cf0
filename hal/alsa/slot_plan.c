/* SPDX-License-Identifier: MIT */
#include "hal/alsa/slot_plan.h"

#include <errno.h>
#include <stdlib.h>

int slot_plan_create(struct slot_plan *out, size_t slot_samples, size_t tail_samples,
                     size_t max_slots)
{
    *out = (struct slot_plan){.slot_samples = slot_samples,
                              .tail_samples = tail_samples,
                              .endless = {.slot_samples = slot_samples},
                              .max_slots = max_slots};
    out->valid = calloc(max_slots, sizeof *out->valid);
    return out->valid ? 0 : -ENOMEM;
}

void slot_plan_load(struct slot_plan *p, size_t n_slots)
{
    p->n_slots = n_slots;
    p->slots = n_slots == SLOT_PLAN_ENDLESS
                   ? p->endless
                   : (struct firing_slots){.slot_samples = p->slot_samples};
    p->first = p->n_settled = 0;
    p->gap[0] = p->gap[1] = 0;
    p->placed = false;
}

void slot_plan_place(struct slot_plan *p, uint64_t frame)
{
    p->first = p->n_settled;
    p->origin = frame;
    p->placed = p->n_settled < p->n_slots;
}

uint64_t slot_plan_offset(const struct slot_plan *p, size_t k)
{
    return firing_start(&p->slots, k);
}

uint64_t slot_plan_start(const struct slot_plan *p, size_t k)
{
    return p->origin + slot_plan_offset(p, k) - slot_plan_offset(p, p->first);
}

/* How many slots begin before a frame, counted from `first`. */
static size_t slots_before(const struct slot_plan *p, uint64_t frame)
{
    if (frame <= p->origin)
        return 0;
    uint64_t offset = frame - p->origin + slot_plan_offset(p, p->first);
    size_t k = firing_slot_before(&p->slots, (double)offset);
    k = k > p->first ? k : p->first;
    while (slot_plan_offset(p, k) < offset)
        k++;
    return k - p->first;
}

void slot_plan_sounding(const struct slot_plan *p, uint64_t frame, size_t n,
                        size_t n_emission, size_t *first, size_t *end)
{
    *first = *end = p->first;
    if (!p->placed || !n_emission)
        return;
    /* Over are those that began n_emission before the first frame, or earlier. */
    uint64_t over = frame >= n_emission ? frame - n_emission + 1 : 0;
    *first += slots_before(p, over);
    *end += slots_before(p, frame + n);
    if (*end > p->n_slots)
        *end = p->n_slots;
    if (*first > *end)
        *first = *end;
}

struct slot_piece slot_plan_emission(const struct slot_plan *p, size_t slot,
                                     uint64_t frame, size_t n, size_t n_emission)
{
    uint64_t start = slot_plan_start(p, slot), end = frame + n;
    uint64_t from = start > frame ? start : frame;
    uint64_t to = start + n_emission < end ? start + n_emission : end;
    return (struct slot_piece){.at = from - frame,
                               .n = to > from ? to - from : 0,
                               .slot = slot,
                               .offset = from - start};
}

struct slot_piece slot_plan_recording(const struct slot_plan *p, uint64_t frame, size_t n)
{
    struct slot_piece piece = {.slot = p->first};
    uint64_t end = frame + n;
    uint64_t over = slot_plan_start(p, p->n_slots) + p->tail_samples;
    if (!p->placed || end <= p->origin || frame >= over)
        return piece;
    uint64_t from = p->origin > frame ? p->origin : frame;
    piece.slot += slots_before(p, from + 1) - 1;
    piece.at = from - frame;
    piece.offset = slot_plan_offset(p, p->first) + (from - p->origin);
    piece.n = (over < end ? over : end) - from;
    return piece;
}

void slot_plan_lose(struct slot_plan *p, size_t offset, size_t n)
{
    if (!n)
        return;
    /* What settled slots lost is of no more interest. */
    if (p->gap[1] <= slot_plan_offset(p, p->n_settled))
        p->gap[0] = offset;
    p->gap[1] = offset + n;
}

static bool is_whole(const struct slot_plan *p, size_t slot)
{
    size_t start = slot_plan_offset(p, slot);
    return start >= p->gap[1] || start + p->slot_samples + p->tail_samples <= p->gap[0];
}

static void settle(struct slot_plan *p, bool valid, size_t *n_void)
{
    p->valid[p->n_settled++ % p->max_slots] = valid;
    *n_void += !valid;
}

size_t slot_plan_heard(struct slot_plan *p, uint64_t frame)
{
    size_t n_void = 0;
    while (p->placed && p->n_settled < p->n_slots &&
           slot_plan_start(p, p->n_settled) + p->slot_samples + p->tail_samples <= frame)
        settle(p, is_whole(p, p->n_settled), &n_void);
    if (p->n_settled == p->n_slots)
        p->placed = false;
    return n_void;
}

size_t slot_plan_break(struct slot_plan *p, uint64_t frame)
{
    size_t n_void = slot_plan_heard(p, frame);
    while (p->placed && p->n_settled < p->n_slots &&
           slot_plan_start(p, p->n_settled) < frame)
        settle(p, false, &n_void);
    p->placed = false;
    return n_void;
}

void slot_plan_clear(struct slot_plan *p)
{
    free(p->valid);
    *p = (struct slot_plan){.valid = NULL};
}
