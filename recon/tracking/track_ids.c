/* SPDX-License-Identifier: MIT */
#include "recon/tracking/track_ids.h"

#define SECOND_NS 1000000000u

void track_ids_begin(struct track_ids *ids, int64_t now_ns)
{
    ids->last = (unsigned)((uint64_t)now_ns / SECOND_NS % TRACK_ID_MAX);
}

unsigned track_ids_take(struct track_ids *ids, int64_t now_ns)
{
    for (unsigned tried = 0; tried < TRACK_ID_MAX; tried++) {
        ids->last = ids->last % TRACK_ID_MAX + 1;
        int64_t until_ns = ids->rest_until_ns[ids->last];
        if (ids->taken[ids->last] || (until_ns && now_ns < until_ns))
            continue;
        ids->taken[ids->last] = true;
        return ids->last;
    }
    return 0;
}

void track_ids_give_back(struct track_ids *ids, unsigned id, int64_t now_ns,
                         double rest_s)
{
    ids->taken[id] = false;
    ids->rest_until_ns[id] = now_ns + (int64_t)(1e9 * rest_s);
}

void track_ids_rest(struct track_ids *ids, int64_t now_ns, double rest_s)
{
    for (unsigned id = 1; id <= TRACK_ID_MAX; id++)
        if (ids->taken[id] || ids->rest_until_ns[id])
            track_ids_give_back(ids, id, now_ns, rest_s);
}
