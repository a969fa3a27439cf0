/* SPDX-License-Identifier: MIT */
#include "nodes/rt/log.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* The texts that were written of late, so that one that comes again and again is counted
 * instead, and said once in a while. */

#define LOG_REPEATS_NS 10000000000LL /* a text is written at most once in this time */

enum { LOG_REPEATS_MAX = 16 };

struct log_repeats {
    struct {
        bool used;
        enum log_level level;
        char text[LOG_TEXT_SIZE];
        int64_t told_ns; /* when it was written last */
        int64_t came_ns; /* when it came last */
        uint64_t count;  /* how often it came since it was written */
    } recent[LOG_REPEATS_MAX];
};

/* A clock that was set back ends the wait too. */
static bool is_over(int64_t told_ns, int64_t now_ns)
{
    return now_ns < told_ns || now_ns - told_ns >= LOG_REPEATS_NS;
}

/* Says what was counted of text i, and counts anew. */
static void tell_count(struct log_repeats *r, size_t i, int64_t now_ns,
                       struct log_line *out)
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

/* A line with stamp, level and text is about to be written.  false: it is not, but
 * counted.  *out (if out->repeats > 0) is to be written, before it: the text itself, when
 * its count is due just now, or, when there is no place left to remember it in, the one
 * told longest ago, which is forgotten. */
static bool log_repeats_take(struct log_repeats *r, const struct log_line *l,
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
            tell_count(r, i, l->stamp_ns, out);
        return false;
    }
    if (i == LOG_REPEATS_MAX)
        i = find_place(r);
    if (r->recent[i].used && r->recent[i].count)
        tell_count(r, i, l->stamp_ns, out);
    r->recent[i].used = true;
    r->recent[i].level = l->level;
    snprintf(r->recent[i].text, sizeof r->recent[i].text, "%s", l->text);
    r->recent[i].told_ns = l->stamp_ns;
    r->recent[i].count = 0;
    return true;
}

/* The next text, in the order in which they came last, whose repeats are to be said now
 * (with all: however short ago it was said last); stamp, level, text and repeats of *out
 * are set.  false: there is none. */
static bool log_repeats_due(struct log_repeats *r, int64_t now_ns, bool all,
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
        tell_count(r, first, now_ns, out);
    return first < LOG_REPEATS_MAX;
}

struct log {
    struct log_config cfg;
    char node[ENVELOPE_NODE_SIZE];
    pthread_mutex_t lock; /* what follows, and the order of lines */
    void (*call)(void *ctx, const struct log_line *line);
    void *ctx;
    struct log_repeats repeats;
    char written[LOG_LINE_SIZE];
};

int log_create(struct log **out, const struct log_config *cfg)
{
    struct log *l = calloc(1, sizeof *l);
    int err = l ? -pthread_mutex_init(&l->lock, NULL) : -ENOMEM;

    if (err) {
        free(l);
        return err;
    }
    l->cfg = *cfg;
    snprintf(l->node, sizeof l->node, "%s", cfg->node);
    l->cfg.node = l->node;
    *out = l;
    return 0;
}

void log_on_line(struct log *l, void (*call)(void *ctx, const struct log_line *line),
                 void *ctx)
{
    pthread_mutex_lock(&l->lock);
    l->call = call;
    l->ctx = ctx;
    pthread_mutex_unlock(&l->lock);
}

static void put_line(struct log *l, struct log_line *line)
{
    memcpy(line->node, l->node, sizeof line->node);
    if (line->level >= l->cfg.least) {
        size_t n = log_line_write(line, l->cfg.format, l->written);
        /* Whoever reads the log may be gone; there is nobody left to tell. */
        ssize_t done = write(l->cfg.fd, l->written, n);
        (void)done;
    }
    if (l->call && line->level >= LOG_LEVEL_INFO)
        l->call(l->ctx, line);
}

static void write_text(struct log *l, enum log_level level, bool each, const char *format,
                       va_list args)
{
    struct log_line line = {.level = level}, before = {.repeats = 0};

    if (level < l->cfg.least && level < LOG_LEVEL_INFO)
        return;
    vsnprintf(line.text, sizeof line.text, format, args);
    log_text_clean(line.text);
    pthread_mutex_lock(&l->lock);
    line.stamp_ns = clock_now_ns(l->cfg.clock);
    bool fresh = each || log_repeats_take(&l->repeats, &line, &before);
    if (before.repeats)
        put_line(l, &before);
    if (fresh)
        put_line(l, &line);
    pthread_mutex_unlock(&l->lock);
}

void log_vwrite(struct log *l, enum log_level level, const char *format, va_list args)
{
    write_text(l, level, false, format, args);
}

void log_vwrite_each(struct log *l, enum log_level level, const char *format,
                     va_list args)
{
    write_text(l, level, true, format, args);
}

void log_write(struct log *l, enum log_level level, const char *format, ...)
{
    va_list args;

    va_start(args, format);
    log_vwrite(l, level, format, args);
    va_end(args);
}

static void tell_repeats(struct log *l, bool all)
{
    struct log_line line, tick = {.level = LOG_LEVEL_INFO};

    pthread_mutex_lock(&l->lock);
    int64_t now_ns = clock_now_ns(l->cfg.clock);
    while (log_repeats_due(&l->repeats, now_ns, all, &line))
        put_line(l, &line);
    tick.stamp_ns = now_ns;
    memcpy(tick.node, l->node, sizeof tick.node);
    if (l->call)
        l->call(l->ctx, &tick);
    pthread_mutex_unlock(&l->lock);
}

void log_tick(struct log *l)
{
    tell_repeats(l, false);
}

void log_tell_repeats(struct log *l)
{
    tell_repeats(l, true);
}

void log_destroy(struct log *l)
{
    if (!l)
        return;
    tell_repeats(l, true);
    pthread_mutex_destroy(&l->lock);
    free(l);
}
