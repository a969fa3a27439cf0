/* SPDX-License-Identifier: MIT */
#include "nodes/scan/pending_fire.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define RESEND_NS 500000000LL /* without an answer */

int pending_fire_reset(struct pending_fire *v, size_t n_speakers)
{
    uint32_t *speakers = calloc(n_speakers, sizeof *speakers);

    if (!speakers)
        return -ENOMEM;
    free(v->speakers);
    v->speakers = speakers;
    v->answered = true;
    return 0;
}

void pending_fire_load(struct pending_fire *v, uint32_t scan, const uint32_t *speakers,
                       size_t n)
{
    uint32_t id = v->command.id + 1;

    memcpy(v->speakers, speakers, n * sizeof *speakers);
    anlos__fire_command__init(&v->command);
    v->command.id = id;
    v->command.scan = scan;
    v->command.n_speakers = n;
    v->command.speakers = v->speakers;
    v->answered = false;
}

Anlos__FireCommand pending_fire_send(struct pending_fire *v, int64_t now_ns)
{
    v->sent_ns = now_ns;
    return v->command;
}

void pending_fire_answer(struct pending_fire *v)
{
    v->answered = true;
}

bool pending_fire_is_due(const struct pending_fire *v, int64_t now_ns)
{
    return !v->answered && now_ns - v->sent_ns >= RESEND_NS;
}

void pending_fire_clear(struct pending_fire *v)
{
    free(v->speakers);
    *v = (struct pending_fire){.answered = true};
}
