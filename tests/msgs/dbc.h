/* SPDX-License-Identifier: MIT */
/* The DBC's lines, for tests that hold our frames against them. */
#ifndef ANLOS_TESTS_MSGS_DBC_H
#define ANLOS_TESTS_MSGS_DBC_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "msgs/can/layout.h"

#define DBC_FILE SOURCE_DIR "/msgs/can/anlos.dbc"

struct dbc_signal {
    char name[64], unit[16], receiver[64];
    unsigned start, length;
    char sign;
    bool is_float;
    double factor, offset, min, max;
};

/* The first line, after the n-th with skip, that begins with a text. */
static inline bool dbc_line(const char *begin, size_t skip, char line[static 4000])
{
    FILE *dbc = fopen(DBC_FILE, "r");
    bool found = false;

    if (!dbc)
        return false;
    while (!found && fgets(line, 4000, dbc))
        found = !strncmp(line, begin, strlen(begin)) && !skip--;
    fclose(dbc);
    return found;
}

/* The n-th signal of a message, or with a name the one of that name. */
static inline bool dbc_signal(const char *message, const char *name, size_t n,
                              struct dbc_signal *s)
{
    char line[4000], current[64] = "", begin[128];
    unsigned order = 0, id = 0;
    bool found = false;
    FILE *dbc = fopen(DBC_FILE, "r");

    if (!dbc)
        return false;
    while (!found && fgets(line, sizeof line, dbc)) {
        sscanf(line, "BO_ %u %63[^:]", &id, current);
        *s = (struct dbc_signal){.name = ""};
        found = strcmp(current, message) == 0 &&
                sscanf(line,
                       " SG_ %63s : %u|%u@%u%c (%lf,%lf) [%lf|%lf] \"%15[^\"]\" %63s",
                       s->name, &s->start, &s->length, &order, &s->sign, &s->factor,
                       &s->offset, &s->min, &s->max, s->unit, s->receiver) >= 9 &&
                order == 1 && (name ? !strcmp(s->name, name) : !n--);
    }
    fclose(dbc);
    if (found && !*s->unit) /* "" is no unit: nothing to convert */
        sscanf(strrchr(strtok(line, "\n"), '"') + 1, " %63s", s->receiver);
    snprintf(begin, sizeof begin, "SIG_VALTYPE_ %u %s : 1;", id, s->name);
    s->is_float = found && dbc_line(begin, 0, line);
    return found;
}

/* The bits as the DBC places them, by way of a window of 64: not how the code under test
 * does it. */
static inline int64_t dbc_raw(const struct dbc_signal *s, const struct can_frame_data *f)
{
    unsigned first = s->start / 8, shift = s->start % 8;
    unsigned __int128 window = 0;

    for (unsigned i = 0; i < 9 && first + i < f->size; i++)
        window |= (unsigned __int128)f->data[first + i] << 8 * i;
    uint64_t word = (uint64_t)(window >> shift) << (64 - s->length) >> (64 - s->length);
    if (!s->is_float && s->sign == '-' && word >> (s->length - 1))
        return (int64_t)word - (INT64_C(1) << s->length);
    return (int64_t)word;
}

static inline double dbc_physical(const struct dbc_signal *s,
                                  const struct can_frame_data *f)
{
    int64_t raw = dbc_raw(s, f);
    uint32_t pattern = (uint32_t)raw;
    float value;

    if (!s->is_float)
        return (double)raw * s->factor + s->offset;
    memcpy(&value, &pattern, sizeof value);
    return (double)value;
}

#endif
