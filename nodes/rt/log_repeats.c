/* SPDX-License-Identifier: MIT */
#include "nodes/rt/log_repeats.h"

#include <stdio.h>
#include <string.h>

/* A clock that was set back ends the wait too. */
static bool is_over(int64_t told_ns, int64_t now_ns)
{
    return now_ns < told_ns || now_ns - told_ns >= LOG_REPEATS_NS;
}

/* Says what was counted of text i, and counts anew. */
static void tell(struct log_repeats *r, size_t i, int64_t now_ns, struct log_line *out)
{
    out->stamp_ns = now_ns;
    out->level = r->recent[i].level;
    memcpy(out->text, r->recent[i].text, sizeof out->text);
    out->repeats = r->recent[i].count;
    out->repeats_s = now_ns > r->recent[i].told_ns
                         ? 1e-9 * (double)(now_ns - r->recent[i].told_ns)
                         : 0;
    out->repeats_ago_s = now_ns > r->recent[i].came_ns
                             ? 1e-9 * (double)(now_ns - r->recent[i].came_ns)
                             : 0;
    r->recent[i].told_ns = now_ns;
    r->recent[i].count = 0;
}

/* A free place, or that of the text told longest ago. */
static size_t find_place(const struct log_repeats *r)
{
    size_t oldest = 0;

    for (size_t i = 0; i < LOG_REPEATS_MAX; i++) {
        if (!r->recent[i].used)
            return i;
        if (r->recent[i].told_ns < r->recent[oldest].told_ns)
            oldest = i;
    }
    return oldest;
}

bool log_repeats_take(struct log_repeats *r, const struct log_line *l,
                      struct log_line *out)
{
    size_t i = 0;

    out->repeats = 0;
    while (i < LOG_REPEATS_MAX && (!r->recent[i].used || r->recent[i].level != l->level ||
                                   strcmp(r->recent[i].text, l->text)))
        i++;
    bool over = i < LOG_REPEATS_MAX && is_over(r->recent[i].told_ns, l->stamp_ns);
    if (i < LOG_REPEATS_MAX && (!over || r->recent[i].count)) {
        r->recent[i].count++;
        r->recent[i].came_ns = l->stamp_ns;
        if (over)
            tell(r, i, l->stamp_ns, out);
        return false;
    }
    if (i == LOG_REPEATS_MAX)
        i = find_place(r);
    if (r->recent[i].used && r->recent[i].count)
        tell(r, i, l->stamp_ns, out);
    r->recent[i].used = true;
    r->recent[i].level = l->level;
    snprintf(r->recent[i].text, sizeof r->recent[i].text, "%s", l->text);
    r->recent[i].told_ns = l->stamp_ns;
    r->recent[i].count = 0;
    return true;
}

bool log_repeats_due(struct log_repeats *r, int64_t now_ns, bool all,
                     struct log_line *out)
{
    size_t first = LOG_REPEATS_MAX;

    for (size_t i = 0; i < LOG_REPEATS_MAX; i++) {
        if (!r->recent[i].used || (!all && !is_over(r->recent[i].told_ns, now_ns)))
            continue;
        if (!r->recent[i].count)
            r->recent[i].used = false;
        else if (first == LOG_REPEATS_MAX ||
                 r->recent[i].came_ns < r->recent[first].came_ns)
            first = i;
    }
    if (first < LOG_REPEATS_MAX)
        tell(r, first, now_ns, out);
    return first < LOG_REPEATS_MAX;
}
