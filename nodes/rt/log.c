/* SPDX-License-Identifier: MIT */
#include "nodes/rt/log.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "nodes/rt/log_repeats.h"

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
