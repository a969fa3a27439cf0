/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/text.h"

#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

static bool continues(char byte)
{
    return ((unsigned char)byte & 0xc0) == 0x80;
}

size_t text_columns(const char *s)
{
    size_t n = 0;

    for (; *s; s++)
        n += !continues(*s);
    return n;
}

void text_cut(char *s, size_t columns)
{
    for (; *s; s++)
        if (!continues(*s) && !columns--)
            *s-- = '\0';
}

size_t text_line(const char *s, size_t columns)
{
    size_t n = 0, blank = 0;

    for (; s[n]; n++) {
        if (!continues(s[n]) && !columns--)
            return s[n] == ' ' ? n + 1 : blank ? blank : n;
        if (s[n] == ' ')
            blank = n + 1;
    }
    return n;
}

/* Bytes of the UTF-8 character at s; 0: it is none, or one that steers a terminal. */
static size_t character(const char *s)
{
    const unsigned char *u = (const unsigned char *)s;
    size_t n = u[0] < 0x80 ? 1 : u[0] < 0xc2 ? 0 : u[0] < 0xe0 ? 2 : u[0] < 0xf0 ? 3 : 4;

    if (u[0] > 0xf4 || u[0] == 0x7f || (u[0] == 0xc2 && u[1] < 0xa0))
        return 0;
    if ((u[0] == 0xe0 && u[1] < 0xa0) || (u[0] == 0xed && u[1] > 0x9f) ||
        (u[0] == 0xf0 && u[1] < 0x90) || (u[0] == 0xf4 && u[1] > 0x8f))
        return 0;
    for (size_t i = 1; i < n; i++)
        if (!continues(s[i]))
            return 0;
    return n;
}

void text_clean(char *out, size_t size, const char *in)
{
    size_t used = 0;

    while (*in) {
        size_t n = character(in);
        if (used + (n ? n : 1) >= size)
            break;
        if (n && (unsigned char)*in >= ' ')
            memcpy(out + used, in, n);
        else
            out[used] = n ? ' ' : '?';
        used += n ? n : 1;
        in += n ? n : 1;
    }
    out[used] = '\0';
}

/* Three digits that count, and a letter. */
static void scaled(char *out, size_t size, double v, double kilo)
{
    static const char letters[] = " kMGTPE";
    size_t i = 0;

    while (v >= 999.5 && letters[i + 1]) {
        v /= kilo;
        i++;
    }
    if (i)
        snprintf(out, size, "%.*f%c", v < 9.95, v, letters[i]);
    else
        snprintf(out, size, "%.0f", v);
}

void text_count(char *out, size_t size, uint64_t n)
{
    if (n < 100000)
        snprintf(out, size, "%" PRIu64, n);
    else
        scaled(out, size, (double)n, 1e3);
}

void text_bytes(char *out, size_t size, double bytes)
{
    if (isnan(bytes))
        snprintf(out, size, "-");
    else
        scaled(out, size, bytes, 1e3);
}

void text_percent(char *out, size_t size, double share)
{
    if (isnan(share))
        snprintf(out, size, "-");
    else
        snprintf(out, size, "%.1f", 100.0 * share);
}

void text_rate(char *out, size_t size, double hz, double expected_hz)
{
    char is[16] = "-", wanted[16] = "-";

    if (hz >= 99999.5)
        scaled(is, sizeof is, hz, 1e3);
    else if (!isnan(hz))
        snprintf(is, sizeof is, "%.*f", hz < 99.95, hz);
    if (expected_hz > 0)
        snprintf(wanted, sizeof wanted, "%g", expected_hz);
    snprintf(out, size, "%s/%s", is, wanted);
}

static void milliseconds(char *out, size_t size, double s)
{
    if (fabs(s) < 0.00995)
        snprintf(out, size, "%.1f", 1e3 * s);
    else if (fabs(s) < 99.9995)
        snprintf(out, size, "%.0f", 1e3 * s);
    else
        snprintf(out, size, "%.0fs", s);
}

void text_latency(char *out, size_t size, const struct table_latency *l)
{
    char median[16], p99[16];

    milliseconds(median, sizeof median, l->median_s);
    milliseconds(p99, sizeof p99, l->p99_s);
    if (l->n)
        snprintf(out, size, "%s/%s", median, p99);
    else
        snprintf(out, size, "-");
}

void text_duration(char *out, size_t size, double s)
{
    double whole = floor(s);

    if (isnan(s))
        snprintf(out, size, "-");
    else if (whole < 60)
        snprintf(out, size, "%.0fs", whole);
    else if (whole < 3600)
        snprintf(out, size, "%.0fm%02.0fs", floor(whole / 60), fmod(whole, 60));
    else
        snprintf(out, size, "%.0fh%02.0fm", floor(whole / 3600),
                 floor(fmod(whole, 3600) / 60));
}
