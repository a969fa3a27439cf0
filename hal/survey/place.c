/* SPDX-License-Identifier: MIT */
#include "hal/survey/place.h"

#include <ctype.h>
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <yaml.h>

/* What a step of a path ("name" or "[3]") leads to, and the line where it stands. */
static yaml_node_t *step(yaml_document_t *d, yaml_node_t *node, const char *name,
                         size_t length, size_t *line)
{
    if (name[0] == '[' && node->type == YAML_SEQUENCE_NODE) {
        size_t i = strtoul(name + 1, NULL, 10);
        const yaml_node_item_t *start = node->data.sequence.items.start;
        if (i >= (size_t)(node->data.sequence.items.top - start))
            return NULL;
        yaml_node_t *item = yaml_document_get_node(d, start[i]);
        *line = item->start_mark.line + 1;
        return item;
    }
    if (node->type != YAML_MAPPING_NODE)
        return NULL;
    const yaml_node_pair_t *p = node->data.mapping.pairs.start;
    for (; p < node->data.mapping.pairs.top; p++) {
        const yaml_node_t *key = yaml_document_get_node(d, p->key);
        if (key->type != YAML_SCALAR_NODE || key->data.scalar.length != length ||
            memcmp(key->data.scalar.value, name, length))
            continue;
        *line = key->start_mark.line + 1;
        return yaml_document_get_node(d, p->value);
    }
    return NULL;
}

/* Follows a path; *whole tells whether all of it was there. */
static size_t find_line(yaml_document_t *d, const char *key, int *whole)
{
    yaml_node_t *node = yaml_document_get_root_node(d);
    size_t line = 0;
    *whole = 0;
    while (node && *key) {
        size_t n = key[0] == '[' ? strcspn(key, "]") + 1 : strcspn(key, ".[");
        if (key[0] == '[' && n > strlen(key))
            return line;
        node = step(d, node, key, n, &line);
        key += n;
        key += key[0] == '.';
    }
    *whole = node != NULL;
    return line;
}

static int open_document(const char *path, yaml_document_t *out)
{
    yaml_parser_t parser;
    FILE *f = fopen(path, "re");
    if (!f)
        return 0;
    int ok = yaml_parser_initialize(&parser);
    if (ok) {
        yaml_parser_set_input_file(&parser, f);
        ok = yaml_parser_load(&parser, out);
        yaml_parser_delete(&parser);
    }
    fclose(f);
    return ok;
}

size_t yaml_line(const char *path, const char *key)
{
    yaml_document_t d;
    int whole;
    if (!open_document(path, &d))
        return 0;
    size_t line = find_line(&d, key, &whole);
    yaml_document_delete(&d);
    return line;
}

static int error_say_at(struct error *why, int err, const char *path, size_t line,
                        const char *text)
{
    if (line)
        return error_say(why, err, "%s:%zu: %s", path, line, text);
    return error_say(why, err, "%s: %s", path, text);
}

int yaml_error_say(struct error *why, int err, const char *path, const char *key,
                   const char *format, ...)
{
    char text[800];
    int n = snprintf(text, sizeof text, "%.200s: ", key);
    va_list args;
    va_start(args, format);
    vsnprintf(text + n, sizeof text - (size_t)n, format, args);
    va_end(args);
    return error_say_at(why, err, path, yaml_line(path, key), text);
}

int yaml_check_range(const char *path, const char *key, double value, double min,
                     double max, struct error *why)
{
    return value >= min && value <= max
               ? 0
               : yaml_error_say(why, -EINVAL, path, key, "expected %g to %g, not %g", min,
                                max, value);
}

/* "chirp_start_hz": as it stands, then chirp.start_hz, chirp_start.hz, and the same with
 * the unit lists say (stage_positions_m is stage.positions_m). */
static size_t line_of_word(yaml_document_t *d, const char *word)
{
    char key[64];
    int whole;
    snprintf(key, sizeof key, "%s", word);
    size_t line = find_line(d, key, &whole);
    if (line)
        return line;
    for (char *u = strchr(key, '_'); u; u = strchr(u + 1, '_')) {
        *u = '.';
        line = find_line(d, key, &whole);
        if (whole)
            return line;
        *u = '_';
    }
    return 0;
}

/* Copies the word that text begins with; returns its length there. */
static size_t take_word(const char *text, char word[64])
{
    size_t n = 0;
    while (isalnum((unsigned char)text[n]) || (text[n] && strchr("_.[]", text[n])))
        n++;
    word[0] = 0;
    if (n && n < 64) {
        memcpy(word, text, n);
        word[n] = 0;
        if (word[n - 1] == '.')
            word[n - 1] = 0;
    }
    return n;
}

/* "chirp stop_hz is ..." is chirp.stop_hz, when that is there. */
static size_t line_of_words(yaml_document_t *d, const char *first, const char *second)
{
    char key[130];
    int whole;
    snprintf(key, sizeof key, "%s.%s", first, second);
    size_t line = second[0] ? find_line(d, key, &whole) : 0;
    return line ? line : line_of_word(d, first);
}

static size_t line_of_text(yaml_document_t *d, const char *text)
{
    char first[64], second[64] = "";
    while (*text) {
        size_t n = take_word(text, first);
        if (text[n] == ' ')
            take_word(text + n + 1, second);
        size_t line = first[0] ? line_of_words(d, first, second) : 0;
        if (line)
            return line;
        text += n ? n : 1;
    }
    return 0;
}

void yaml_place_error(struct error *why, const char *path)
{
    yaml_document_t d;
    size_t line = 0;
    if (!why)
        return;
    struct error before = *why;
    if (open_document(path, &d)) {
        line = line_of_text(&d, before.text);
        yaml_document_delete(&d);
    }
    error_say_at(why, 0, path, line, before.text);
}
