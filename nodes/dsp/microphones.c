#include "nodes/dsp/microphones.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/rt/channel_check.h"

struct microphones {
    size_t n;
    struct channel_check *check; /* of one ping at a time */
    bool *unfit;                 /* [n], of the newest ping */
    unsigned *noticed;           /* [n], faults said already */
};

int microphones_create(struct microphones **out, size_t n)
{
    struct microphones *m = calloc(1, sizeof *m);

    if (!m)
        return -ENOMEM;
    m->n = n;
    m->unfit = calloc(n, sizeof *m->unfit);
    m->noticed = calloc(n, sizeof *m->noticed);
    int err = m->unfit && m->noticed ? channel_check_create(&m->check, n, 1) : -ENOMEM;
    if (err)
        microphones_destroy(m);
    else
        *out = m;
    return err;
}

/* For people they count from 1. */
static void notice(struct microphones *m, size_t mic,
                   const struct channel_summary *summary, char *note, size_t size)
{
    const struct {
        bool is;
        const char *text;
    } faults[] = {{summary->silent, "is silent"},
                  {summary->damaged, "has samples that are not finite"},
                  {summary->clipped, "is clipped"}};

    for (unsigned i = 0; i < sizeof faults / sizeof *faults; i++) {
        size_t used = strlen(note);
        if (!faults[i].is || m->noticed[mic] & 1u << i)
            continue;
        m->noticed[mic] |= 1u << i;
        snprintf(note + used, size - used, "%smicrophone %zu %s", used ? "; " : "",
                 mic + 1, faults[i].text);
    }
}

uint64_t microphones_judge(struct microphones *m, const Anlos__Ping *ping,
                           const float *samples, size_t n_samples,
                           protobuf_c_boolean *masked, struct microphones_faults *faults,
                           char *note, size_t note_size)
{
    struct channel_summary summary;
    uint64_t clipped = 0;

    *faults = (struct microphones_faults){.n = m->n};
    memset(m->unfit, 0, m->n * sizeof *m->unfit);
    channel_check_position(m->check, 0, n_samples, samples, ping->clipped,
                           ping->not_finite, m->unfit);
    for (size_t i = 0; i < m->n; i++) {
        channel_check_summary(m->check, i, &summary);
        notice(m, i, &summary, note, note_size);
        faults->silent += summary.silent;
        faults->damaged += summary.damaged;
        faults->clipped += summary.clipped;
        clipped += ping->clipped[i];
        masked[i] = m->unfit[i];
    }
    return clipped;
}

void microphones_destroy(struct microphones *m)
{
    if (!m)
        return;
    channel_check_destroy(m->check);
    free(m->unfit);
    free(m->noticed);
    free(m);
}
