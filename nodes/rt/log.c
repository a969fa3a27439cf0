/* SPDX-License-Identifier: MIT */
#include "nodes/rt/log.h"

#include <errno.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <jansson.h>

#include "nodes/rt/json_whole.h"

/* -- a line -------------------------------------------------------------------------- */

#define NS_PER_S 1000000000LL

static const char *const level_names[] = {"debug", "info", "warning", "error"};

const char *log_level_name(enum log_level level)
{
    return level < sizeof level_names / sizeof *level_names ? level_names[level] : NULL;
}

int log_level_parse(enum log_level *out, const char *name)
{
    for (int i = LOG_LEVEL_DEBUG; i <= LOG_LEVEL_ERROR; i++) {
        if (!strcmp(name, level_names[i])) {
            *out = (enum log_level)i;
            return 0;
        }
    }
    return -EINVAL;
}

static const char *const format_names[] = {
    [LOG_FORMAT_TEXT] = "text", [LOG_FORMAT_JSON] = "json"};

const char *log_format_name(enum log_format format)
{
    return format < sizeof format_names / sizeof *format_names ? format_names[format]
                                                               : NULL;
}

int log_format_parse(enum log_format *out, const char *name)
{
    for (int i = LOG_FORMAT_TEXT; i <= LOG_FORMAT_JSON; i++) {
        if (!strcmp(name, format_names[i])) {
            *out = (enum log_format)i;
            return 0;
        }
    }
    return -EINVAL;
}

/* "2026-11-21T20:15:09.123Z" */
static void log_stamp_write(char out[LOG_STAMP_SIZE], int64_t stamp_ns)
{
    int64_t s = stamp_ns / NS_PER_S - (stamp_ns % NS_PER_S < 0);
    time_t seconds = (time_t)s;
    struct tm t;
    char day[32] = "";

    if (gmtime_r(&seconds, &t))
        strftime(day, sizeof day, "%Y-%m-%dT%H:%M:%S", &t);
    snprintf(out, LOG_STAMP_SIZE, "%.19s.%03uZ", day,
             (unsigned)((stamp_ns - s * NS_PER_S) / 1000000) % 1000u);
}

void log_line_text(const struct log_line *l, char *out, size_t size)
{
    char ago[40] = "";

    if (l->repeats_ago_s >= 1.0)
        snprintf(ago, sizeof ago, ", last %.0f s ago", l->repeats_ago_s);
    if (l->repeats)
        snprintf(out, size, "%s (%" PRIu64 " time%s more in %.0f s%s)", l->text,
                 l->repeats, l->repeats == 1 ? "" : "s", l->repeats_s, ago);
    else
        snprintf(out, size, "%s", l->text);
}

static size_t write_json(const struct log_line *l, char *out)
{
    char stamp[LOG_STAMP_SIZE];

    log_stamp_write(stamp, l->stamp_ns);
    json_t *o = json_pack("{ss, ss, ss, ss}", "stamp", stamp, "level",
                          log_level_name(l->level), "node", l->node, "text", l->text);
    if (o && l->repeats) {
        json_object_set_new(o, "repeats", json_integer((json_int_t)l->repeats));
        json_object_set_new(o, "repeats_s", json_real(l->repeats_s));
        json_object_set_new(o, "repeats_ago_s", json_real(l->repeats_ago_s));
    }
    size_t n = json_whole(o) ? json_dumpb(o, out, LOG_LINE_SIZE - 1,
                                          JSON_COMPACT | JSON_REAL_PRECISION(4))
                             : 0;
    json_decref(o);
    return n < LOG_LINE_SIZE ? n : 0;
}

size_t log_line_write(const struct log_line *l, enum log_format format,
                      char out[LOG_LINE_SIZE])
{
    char stamp[LOG_STAMP_SIZE], text[LOG_TEXT_SIZE + 96];
    size_t n = format == LOG_FORMAT_JSON ? write_json(l, out) : 0;

    if (!n) {
        log_stamp_write(stamp, l->stamp_ns);
        log_line_text(l, text, sizeof text);
        int length = snprintf(out, LOG_LINE_SIZE, "%s %-7s %-7s %s", stamp, l->node,
                              log_level_name(l->level), text);
        n = length > 0 ? (size_t)length : 0;
    }
    out[n] = '\n';
    return n + 1;
}

int log_line_read(struct log_line *out, const char *line)
{
    struct tm t = {0};
    char level[8], zone;
    unsigned ms;
    int end = 0;
    struct log_line l = {0};

    if (sscanf(line, "%4d-%2d-%2dT%2d:%2d:%2d.%3u%c %15s %7s%n", &t.tm_year, &t.tm_mon,
               &t.tm_mday, &t.tm_hour, &t.tm_min, &t.tm_sec, &ms, &zone, l.node, level,
               &end) != 10 ||
        zone != 'Z' || !end || line[end] != ' ' || log_level_parse(&l.level, level))
        return -EINVAL;
    /* The level's column is as wide as its longest name. */
    const char *text = line + end + 1 + (sizeof level - 1 - strlen(level));
    if (strlen(line) < (size_t)(text - line))
        text = line + strlen(line);
    t.tm_year -= 1900;
    t.tm_mon -= 1;
    l.stamp_ns = (int64_t)timegm(&t) * NS_PER_S + (int64_t)ms * 1000000;
    snprintf(l.text, sizeof l.text, "%s", text);
    *out = l;
    return 0;
}

/* Bytes of the UTF-8 character at p; 0: it is none (RFC 3629). */
static size_t utf8_length(const unsigned char *p)
{
    size_t n = p[0] < 0x80 ? 1 : p[0] < 0xc2 ? 0 : p[0] < 0xe0 ? 2 : p[0] < 0xf0 ? 3 : 4;

    if (p[0] > 0xf4)
        return 0;
    for (size_t i = 1; i < n; i++)
        if ((p[i] & 0xc0) != 0x80)
            return 0;
    if ((p[0] == 0xe0 && p[1] < 0xa0) || (p[0] == 0xed && p[1] > 0x9f) ||
        (p[0] == 0xf0 && p[1] < 0x90) || (p[0] == 0xf4 && p[1] > 0x8f))
        return 0;
    return n;
}

void log_text_clean(char *text)
{
    unsigned char *p = (unsigned char *)text;

    while (*p) {
        size_t n = utf8_length(p);
        if (!n)
            *p = '?';
        else if (n == 1 && (*p < 0x20 || *p == 0x7f))
            *p = ' ';
        p += n ? n : 1;
    }
}

/* -- the same again: counted, not written -------------------------------------------- */

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

/* -- the log ------------------------------------------------------------------------- */

struct log {
    struct log_config cfg;
    char node[ENVELOPE_NODE_SIZE];
    pthread_mutex_t lock; /* what follows, and the order of lines */
    void (*call)(void *ctx, const struct log_line *line);
    void *ctx;
    struct log_repeats repeats;
    uint64_t n_errors;
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
    l->n_errors += level == LOG_LEVEL_ERROR;
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

uint64_t log_errors(struct log *l)
{
    pthread_mutex_lock(&l->lock);
    uint64_t n = l->n_errors;
    pthread_mutex_unlock(&l->lock);
    return n;
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
