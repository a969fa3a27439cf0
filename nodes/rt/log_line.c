/* SPDX-License-Identifier: MIT */
#include "nodes/rt/log_line.h"

#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "nodes/rt/json_whole.h"

#define NS_PER_S 1000000000LL

static const char *const level_names[] = {"debug", "info", "warning", "error"};

const char *log_level_name(enum log_level level)
{
    return level_names[level];
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

int log_format_parse(enum log_format *out, const char *name)
{
    bool json = !strcmp(name, "json");

    if (!json && strcmp(name, "text"))
        return -EINVAL;
    *out = json ? LOG_FORMAT_JSON : LOG_FORMAT_TEXT;
    return 0;
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
