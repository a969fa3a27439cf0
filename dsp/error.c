/* SPDX-License-Identifier: MIT */
#include "dsp/error.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

int error_say(struct error *e, int err, const char *format, ...)
{
    if (e) {
        va_list args;
        va_start(args, format);
        vsnprintf(e->text, sizeof e->text, format, args);
        va_end(args);
    }
    return err;
}

void text_add(char *text, size_t size, const char *separator, const char *format, ...)
{
    size_t used = strlen(text);
    va_list args;

    used += (size_t)snprintf(text + used, size - used, "%s", used ? separator : "");
    va_start(args, format);
    if (used < size)
        vsnprintf(text + used, size - used, format, args);
    va_end(args);
}

#define LONGEST_WORD 32
#define HINT_CHANGES 2

/* Insertions, deletions and changes that make b out of a (Levenshtein). */
static size_t edit_distance(const char *a, size_t n, const char *b)
{
    size_t row[LONGEST_WORD + 1], m = strlen(b);
    if (n > LONGEST_WORD || m > LONGEST_WORD)
        return LONGEST_WORD;
    for (size_t j = 0; j <= m; j++)
        row[j] = j;
    for (size_t i = 1; i <= n; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= m; j++) {
            size_t change = diagonal + (a[i - 1] != b[j - 1]);
            size_t shift = 1 + (row[j] < row[j - 1] ? row[j] : row[j - 1]);
            diagonal = row[j];
            row[j] = change < shift ? change : shift;
        }
    }
    return row[m];
}

struct nearest nearest_begin(const char *word, size_t n, size_t changes)
{
    return (struct nearest){.word = word, .n = n, .least = changes + 1};
}

void nearest_try(struct nearest *s, const char *name)
{
    size_t d = edit_distance(s->word, s->n, name);
    if (d < s->least && d < s->n && 2 * d <= s->n + 1) {
        s->least = d;
        s->best = name;
    }
}

const char *nearest_hint(char out[NEAREST_HINT_SIZE], const char *word, const char *list)
{
    struct nearest s = nearest_begin(word, strlen(word), HINT_CHANGES);

    for (; *list; list += strlen(list) + 1)
        nearest_try(&s, list);
    out[0] = '\0';
    if (s.best)
        snprintf(out, NEAREST_HINT_SIZE, "; did you mean %s?", s.best);
    return out;
}
