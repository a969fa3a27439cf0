#include "hal/alsa/slot_plan.h"

#include <errno.h>
#include <stdlib.h>

int slot_plan_create(struct slot_plan *out, size_t slot_samples, size_t tail_samples,
                     size_t max_slots)
{
    *out = (struct slot_plan){.slot_samples = slot_samples, .tail_samples = tail_samples};
    out->valid = calloc(max_slots, sizeof *out->valid);
    return out->valid ? 0 : -ENOMEM;
}

void slot_plan_load(struct slot_plan *p, size_t n_slots)
{
    p->n_slots = n_slots;
    p->first = p->n_settled = 0;
    p->placed = false;
}

void slot_plan_place(struct slot_plan *p, uint64_t frame)
{
    p->first = p->n_settled;
    p->origin = frame;
    p->placed = p->n_settled < p->n_slots;
}

static uint64_t slot_start(const struct slot_plan *p, size_t slot)
{
    return p->origin + (slot - p->first) * p->slot_samples;
}

struct slot_piece slot_plan_emission(const struct slot_plan *p, uint64_t frame, size_t n,
                                     size_t n_emission)
{
    struct slot_piece piece = {.slot = p->first};
    if (!p->placed || !n_emission)
        return piece;
    uint64_t end = frame + n;
    if (frame > p->origin)
        piece.slot += (frame - p->origin) / p->slot_samples;
    if (frame >= slot_start(p, piece.slot) + n_emission)
        piece.slot++;
    uint64_t start = slot_start(p, piece.slot);
    if (piece.slot >= p->n_slots || start >= end)
        return piece;
    uint64_t from = start > frame ? start : frame;
    uint64_t to = start + n_emission < end ? start + n_emission : end;
    piece.at = from - frame;
    piece.offset = from - start;
    piece.n = to - from;
    return piece;
}

struct slot_piece slot_plan_recording(const struct slot_plan *p, uint64_t frame, size_t n)
{
    struct slot_piece piece = {.slot = p->first};
    uint64_t end = frame + n;
    uint64_t over = slot_start(p, p->n_slots) + p->tail_samples;
    if (!p->placed || end <= p->origin || frame >= over)
        return piece;
    uint64_t from = p->origin > frame ? p->origin : frame;
    piece.slot += (from - p->origin) / p->slot_samples;
    piece.at = from - frame;
    piece.offset = p->first * p->slot_samples + (from - p->origin);
    piece.n = (over < end ? over : end) - from;
    return piece;
}

bool slot_plan_heard(struct slot_plan *p, uint64_t frame)
{
    size_t before = p->n_settled;
    while (p->placed && p->n_settled < p->n_slots &&
           slot_start(p, p->n_settled + 1) + p->tail_samples <= frame)
        p->valid[p->n_settled++] = true;
    if (p->n_settled == p->n_slots)
        p->placed = false;
    return p->n_settled > before;
}

size_t slot_plan_break(struct slot_plan *p, uint64_t frame)
{
    size_t n_void = 0;
    slot_plan_heard(p, frame);
    while (p->placed && p->n_settled < p->n_slots &&
           slot_start(p, p->n_settled) < frame) {
        p->valid[p->n_settled++] = false;
        n_void++;
    }
    p->placed = false;
    return n_void;
}

void slot_plan_clear(struct slot_plan *p)
{
    free(p->valid);
    *p = (struct slot_plan){.valid = NULL};
}
