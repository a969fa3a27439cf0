#include "nodes/scan/volley.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define RESEND_NS 500000000LL /* without an answer */

int volley_reset(struct volley *v, size_t n_speakers)
{
    uint32_t *speakers = calloc(n_speakers, sizeof *speakers);

    if (!speakers)
        return -ENOMEM;
    free(v->speakers);
    v->speakers = speakers;
    v->answered = true;
    return 0;
}

void volley_load(struct volley *v, uint32_t scan, const uint32_t *speakers, size_t n)
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

Anlos__FireCommand volley_send(struct volley *v, int64_t now_ns)
{
    v->sent_ns = now_ns;
    return v->command;
}

void volley_answer(struct volley *v)
{
    v->answered = true;
}

bool volley_is_due(const struct volley *v, int64_t now_ns)
{
    return !v->answered && now_ns - v->sent_ns >= RESEND_NS;
}

void volley_clear(struct volley *v)
{
    free(v->speakers);
    *v = (struct volley){.answered = true};
}
