#include "nodes/scan/rounds.h"

#include <stdio.h>

#define SILENT_NS 2000000000LL

void rounds_start(struct rounds *t, size_t n_speakers)
{
    t->n_speakers = n_speakers;
    t->next = 0;
    t->n = 0;
}

void rounds_add(struct rounds *t, uint32_t round, size_t index, bool valid,
                int64_t now_ns)
{
    uint64_t at = (uint64_t)(round - 1) * t->n_speakers + index;

    if (at < t->next)
        return;
    t->all_lost += at - t->next + !valid;
    t->all_void += !valid;
    t->all_done += valid;
    t->next = at + 1;
    t->newest_ns[t->n++ % ROUNDS_RING] = now_ns;
}

size_t rounds_frames(const struct rounds *t)
{
    return t->n_speakers ? (size_t)(t->next / t->n_speakers) : 0;
}

static double pings_per_s(const struct rounds *t, int64_t now_ns)
{
    size_t n = t->n < ROUNDS_RING ? t->n : ROUNDS_RING;

    if (n < 2)
        return 0.0;
    int64_t newest = t->newest_ns[(t->n - 1) % ROUNDS_RING];
    int64_t oldest = t->newest_ns[(t->n - n) % ROUNDS_RING];
    if (newest <= oldest || now_ns - newest > SILENT_NS)
        return 0.0;
    return 1e9 * (double)(n - 1) / (double)(newest - oldest);
}

void rounds_text(const struct rounds *t, int64_t now_ns, char *out, size_t size)
{
    double rate = pings_per_s(t, now_ns);

    if (!t->n) {
        snprintf(out, size, "waits for the first ping");
        return;
    }
    int n = snprintf(out, size, "%.1f frames/s, %.1f pings/s",
                     t->n_speakers ? rate / (double)t->n_speakers : 0.0, rate);

    if (t->all_void && n > 0 && (size_t)n < size)
        snprintf(out + n, size - (size_t)n, "; %llu void",
                 (unsigned long long)t->all_void);
}
