/* SPDX-License-Identifier: MIT */
#include "hal/yaml_file.h"

#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <yaml.h>

#include "dsp/error.h"

/* How deep a YAML text goes, before anything is made of it: libyaml's time rises with
 * the square of the depth (32 kB of "[" take it seconds). */

#define YAML_MAX_DEPTH 64

static int step(yaml_event_type_t type)
{
    switch (type) {
    case YAML_SEQUENCE_START_EVENT:
    case YAML_MAPPING_START_EVENT:
        return 1;
    case YAML_SEQUENCE_END_EVENT:
    case YAML_MAPPING_END_EVENT:
        return -1;
    default:
        return 0;
    }
}

/* 0, -EINVAL (deeper; the error has the line), -ENOMEM.  Of text that is not YAML it
 * says nothing: 0. */
static int yaml_check_depth(const unsigned char *text, size_t size, const char *path,
                            struct error *why)
{
    yaml_parser_t parser;
    yaml_event_t event;
    int depth = 0;
    bool more = true;

    if (!yaml_parser_initialize(&parser))
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    yaml_parser_set_input_string(&parser, text, size);
    while (more && depth <= YAML_MAX_DEPTH && yaml_parser_parse(&parser, &event)) {
        depth += step(event.type);
        more = event.type != YAML_STREAM_END_EVENT;
        yaml_event_delete(&event);
    }
    size_t line = parser.mark.line + 1;
    bool starved = parser.error == YAML_MEMORY_ERROR;
    yaml_parser_delete(&parser);
    if (starved)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    return depth <= YAML_MAX_DEPTH
               ? 0
               : error_say(why, -EINVAL, "%s:%zu: more than %d levels deep", path, line,
                           YAML_MAX_DEPTH);
}

/* Compares a parsed YAML document with a libcyaml schema before libcyaml loads it.
 * libcyaml alone gives the line of the key before, takes "1.5x" for a number, and cuts
 * 2.5 to 2 where a whole number is meant. */

enum { MAX_DEPTH = 16, KEY_SIZE = 256 };

struct checker {
    yaml_document_t *document;
    const char *path;
    struct error *why;
    unsigned depth;
    char key[KEY_SIZE]; /* of the node being looked at; "" at the root */
};

static int check_node(struct checker *c, const struct cyaml_schema_value *schema,
                      yaml_node_t *node);

__attribute__((format(printf, 3, 4))) static int
refuse(struct checker *c, const yaml_node_t *node, const char *format, ...)
{
    char text[512];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return error_say(c->why, -EINVAL, "%s:%zu: %s%s%s", c->path,
                     node->start_mark.line + 1, c->key, c->key[0] ? ": " : "", text);
}

static const char *scalar_text(const yaml_node_t *node)
{
    return node->type == YAML_SCALAR_NODE ? (const char *)node->data.scalar.value : NULL;
}

/* What stands there, for "expected ..., found ...". */
static const char *found(const yaml_node_t *node, char buffer[64])
{
    if (node->type == YAML_MAPPING_NODE)
        return "keys and values";
    if (node->type == YAML_SEQUENCE_NODE)
        return "a list";
    if (!node->data.scalar.length)
        return "nothing";
    snprintf(buffer, 64, "\"%.48s\"", (const char *)node->data.scalar.value);
    return buffer;
}

static size_t key_push(struct checker *c, const char *format, const char *name, size_t i)
{
    size_t old = strlen(c->key);
    if (name)
        snprintf(c->key + old, KEY_SIZE - old, format, old ? "." : "", name);
    else
        snprintf(c->key + old, KEY_SIZE - old, "[%zu]", i);
    return old;
}

static size_t push_name(struct checker *c, const char *name)
{
    return key_push(c, "%s%s", name, 0);
}

static int check_float(struct checker *c, const yaml_node_t *node)
{
    const char *text = scalar_text(node);
    char buffer[64], *end = NULL;
    double value = text ? strtod(text, &end) : 0;
    if (!text || end == text || *end)
        return refuse(c, node, "expected a number, found %s", found(node, buffer));
    if (!isfinite(value))
        return refuse(c, node, "expected a finite number, found %s", found(node, buffer));
    return 0;
}

static int check_integer(struct checker *c, const struct cyaml_schema_value *schema,
                         const yaml_node_t *node)
{
    const char *text = scalar_text(node);
    char buffer[64], *end = NULL;
    unsigned bits = schema->data_size * CHAR_BIT;
    bool is_signed = schema->type == CYAML_INT;
    int64_t max = INT64_MAX >> (64 - bits);
    int64_t min = is_signed ? -max - 1 : 0;
    if (!is_signed && bits < 64)
        max = (INT64_C(1) << bits) - 1;
    errno = 0;
    int64_t value = text ? strtoll(text, &end, 0) : 0;
    if (!text || end == text || *end)
        return refuse(c, node, "expected a whole number, found %s", found(node, buffer));
    if (!is_signed && value < 0)
        return refuse(c, node, "expected 0 or more, not %s", text);
    if (errno == ERANGE || value < min || value > max)
        return refuse(c, node, "%s is outside %" PRId64 "..%" PRId64, text, min, max);
    return 0;
}

static int check_enum(struct checker *c, const struct cyaml_schema_value *schema,
                      const yaml_node_t *node)
{
    const char *text = scalar_text(node);
    char list[256] = "", buffer[64];
    for (uint32_t i = 0; i < schema->enumeration.count; i++) {
        const char *name = schema->enumeration.strings[i].str;
        if (text && !strcmp(text, name))
            return 0;
        text_add(list, sizeof list, ", ", "%s", name);
    }
    return refuse(c, node, "expected one of %s, found %s", list, found(node, buffer));
}

static int check_string(struct checker *c, const struct cyaml_schema_value *schema,
                        const yaml_node_t *node)
{
    char buffer[64];
    if (node->type != YAML_SCALAR_NODE)
        return refuse(c, node, "expected a text, found %s", found(node, buffer));
    size_t n = node->data.scalar.length;
    if (strlen(scalar_text(node)) != n)
        return refuse(c, node, "expected a text without zero bytes");
    if (n < schema->string.min)
        return refuse(c, node, "expected a text of at least %" PRIu32 " characters",
                      schema->string.min);
    if (n > schema->string.max)
        return refuse(c, node, "\"%.48s\" is longer than %" PRIu32 " characters",
                      scalar_text(node), schema->string.max);
    return 0;
}

static int check_bool(struct checker *c, const yaml_node_t *node)
{
    static const char *const words[] = {"true", "false", "yes", "no", "on", "off"};
    const char *text = scalar_text(node);
    char buffer[64];
    for (size_t i = 0; text && i < sizeof words / sizeof *words; i++)
        if (!strcmp(text, words[i]))
            return 0;
    return refuse(c, node, "expected true or false, found %s", found(node, buffer));
}

static int check_sequence(struct checker *c, const struct cyaml_schema_value *schema,
                          yaml_node_t *node)
{
    char buffer[64];
    if (node->type != YAML_SEQUENCE_NODE)
        return refuse(c, node, "expected a list, found %s", found(node, buffer));
    const yaml_node_item_t *item = node->data.sequence.items.start;
    size_t n = (size_t)(node->data.sequence.items.top - item);
    uint32_t min = schema->sequence.min, max = schema->sequence.max;
    if (min == max && n != min)
        return refuse(c, node, "expected %" PRIu32 " entries, found %zu", min, n);
    if (n < min)
        return refuse(c, node, "expected at least %" PRIu32 " entries, found %zu", min,
                      n);
    if (n > max)
        return refuse(c, node, "expected at most %" PRIu32 " entries, found %zu", max, n);
    for (size_t i = 0; i < n; i++) {
        size_t old = key_push(c, NULL, NULL, i);
        int err = check_node(c, schema->sequence.entry,
                             yaml_document_get_node(c->document, item[i]));
        if (err)
            return err;
        c->key[old] = 0;
    }
    return 0;
}

static int refuse_unknown(struct checker *c, const struct cyaml_schema_field *fields,
                          const yaml_node_t *key)
{
    char list[400] = "";
    for (; fields->key; fields++)
        text_add(list, sizeof list, ", ", "%s", fields->key);
    push_name(c, scalar_text(key) ? scalar_text(key) : "?");
    return refuse(c, key, "no such key; expected one of %s", list);
}

static yaml_node_t *find_key(struct checker *c, const yaml_node_t *mapping,
                             const char *name, unsigned occurrence, yaml_node_t **value)
{
    const yaml_node_pair_t *p = mapping->data.mapping.pairs.start;
    for (; p < mapping->data.mapping.pairs.top; p++) {
        yaml_node_t *key = yaml_document_get_node(c->document, p->key);
        if (!scalar_text(key) || strcmp(scalar_text(key), name) || occurrence--)
            continue;
        *value = yaml_document_get_node(c->document, p->value);
        return key;
    }
    return NULL;
}

static int check_field(struct checker *c, const struct cyaml_schema_field *field,
                       yaml_node_t *mapping)
{
    yaml_node_t *value, *again;
    const yaml_node_t *key = find_key(c, mapping, field->key, 0, &value);
    if (!key) {
        if (field->value.flags & CYAML_FLAG_OPTIONAL)
            return 0;
        return refuse(c, mapping, "the key \"%s\" is missing", field->key);
    }
    const yaml_node_t *second = find_key(c, mapping, field->key, 1, &again);
    size_t old = push_name(c, field->key);
    if (second)
        return refuse(c, second, "stands here a second time");
    int err = check_node(c, &field->value, value);
    if (!err)
        c->key[old] = 0;
    return err;
}

static int check_mapping(struct checker *c, const struct cyaml_schema_value *schema,
                         yaml_node_t *node)
{
    char buffer[64];
    const struct cyaml_schema_field *fields = schema->mapping.fields, *f;
    if (node->type != YAML_MAPPING_NODE)
        return refuse(c, node, "expected keys and values, found %s", found(node, buffer));
    const yaml_node_pair_t *p = node->data.mapping.pairs.start;
    for (; p < node->data.mapping.pairs.top; p++) {
        const yaml_node_t *key = yaml_document_get_node(c->document, p->key);
        for (f = fields; f->key; f++)
            if (scalar_text(key) && !strcmp(scalar_text(key), f->key))
                break;
        if (!f->key)
            return refuse_unknown(c, fields, key);
    }
    for (f = fields; f->key; f++) {
        int err = check_field(c, f, node);
        if (err)
            return err;
    }
    return 0;
}

/* flags and bitfields are left to libcyaml. */
static int check_value(struct checker *c, const struct cyaml_schema_value *schema,
                       yaml_node_t *node)
{
    switch (schema->type) {
    case CYAML_INT:
    case CYAML_UINT:
        return check_integer(c, schema, node);
    case CYAML_BOOL:
        return check_bool(c, node);
    case CYAML_ENUM:
        return check_enum(c, schema, node);
    case CYAML_FLOAT:
        return check_float(c, node);
    case CYAML_STRING:
        return check_string(c, schema, node);
    case CYAML_MAPPING:
        return check_mapping(c, schema, node);
    case CYAML_SEQUENCE:
    case CYAML_SEQUENCE_FIXED:
        return check_sequence(c, schema, node);
    default:
        return 0;
    }
}

static int check_node(struct checker *c, const struct cyaml_schema_value *schema,
                      yaml_node_t *node)
{
    /* An alias can make a document that contains itself. */
    if (c->depth >= MAX_DEPTH)
        return refuse(c, node, "more than %d levels deep", MAX_DEPTH);
    c->depth++;
    int err = check_value(c, schema, node);
    c->depth--;
    return err;
}

/* 0 or -EINVAL; path is named in the error. */
static int yaml_check(yaml_document_t *document, const struct cyaml_schema_value *schema,
                      const char *path, struct error *why)
{
    struct checker c = {.document = document, .path = path, .why = why};
    yaml_node_t *root = yaml_document_get_root_node(document);
    if (!root)
        return error_say(why, -EINVAL, "%s:1: the file is empty", path);
    return check_node(&c, schema, root);
}

struct bytes {
    unsigned char *data;
    size_t size;
};

static int read_whole(int fd, struct bytes *out)
{
    struct stat st;
    if (fstat(fd, &st) < 0)
        return -errno;
    if (S_ISDIR(st.st_mode))
        return -EISDIR;
    if (!S_ISREG(st.st_mode))
        return -EINVAL;
    if (st.st_size > (off_t)YAML_FILE_MAX_SIZE)
        return -EFBIG;
    size_t room = (size_t)st.st_size;
    out->data = malloc(room + 1);
    if (!out->data)
        return -ENOMEM;
    while (out->size < room) {
        ssize_t n = read(fd, out->data + out->size, room - out->size);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            return -errno;
        if (!n)
            break;
        out->size += (size_t)n;
    }
    return 0;
}

static int read_file(const char *path, struct bytes *out, struct error *why)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0) {
        int err = -errno;
        return error_say(why, err, "%s: %s", path, strerror(-err));
    }
    int err = read_whole(fd, out);
    close(fd);
    if (err == -EINVAL)
        return error_say(why, err, "%s: not a regular file", path);
    if (err == -EFBIG)
        return error_say(why, -EINVAL, "%s: larger than %u MiB; expected a YAML file",
                         path, YAML_FILE_MAX_SIZE >> 20);
    if (err)
        return error_say(why, err, "%s: %s", path, strerror(-err));
    return 0;
}

/* Why a parser could not go on; what fails without an error had no memory. */
static int refuse_text(const yaml_parser_t *parser, const char *path, struct error *why)
{
    size_t line = parser->problem_mark.line ? parser->problem_mark.line
                                            : parser->context_mark.line;

    if (parser->error == YAML_MEMORY_ERROR || parser->error == YAML_NO_ERROR)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    return error_say(why, -EINVAL, "%s:%zu: not YAML: %s", path, line + 1,
                     parser->problem ? parser->problem : "cannot be read");
}

static int check(const unsigned char *text, size_t size,
                 const struct cyaml_schema_value *schema, const char *path,
                 struct error *why)
{
    yaml_parser_t parser;
    yaml_document_t document, more;
    int err = yaml_check_depth(text, size, path, why);
    if (err)
        return err;
    if (!yaml_parser_initialize(&parser))
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    yaml_parser_set_input_string(&parser, text, size);
    if (!yaml_parser_load(&parser, &document)) {
        err = refuse_text(&parser, path, why);
        goto parser;
    }
    err = yaml_check(&document, schema, path, why);
    yaml_document_delete(&document);
    if (err)
        goto parser;
    if (!yaml_parser_load(&parser, &more)) {
        err = refuse_text(&parser, path, why);
        goto parser;
    }
    const yaml_node_t *root = yaml_document_get_root_node(&more);
    if (root)
        err = error_say(why, -EINVAL,
                        "%s:%zu: expected one document, here begins another", path,
                        root->start_mark.line + 1);
    yaml_document_delete(&more);
parser:
    yaml_parser_delete(&parser);
    return err;
}

/* The first error that libcyaml logs says what, the first place of its backtrace says
 * where; the rest repeats. */
struct cyaml_notes {
    char what[256];
    size_t line;
};

static void take_note(cyaml_log_t level, void *ctx, const char *format, va_list args)
{
    struct cyaml_notes *notes = ctx;
    char text[256];
    if (level < CYAML_LOG_ERROR)
        return;
    vsnprintf(text, sizeof text, format, args);
    text[strcspn(text, "\n")] = 0;
    const char *line = strstr(text, "(line: ");
    if (line && !notes->line)
        notes->line = strtoul(line + strlen("(line: "), NULL, 10);
    else if (!line && !notes->what[0] && !strstr(text, "Backtrace"))
        snprintf(notes->what, sizeof notes->what, "%s", text);
}

static cyaml_config_t config_of(struct cyaml_notes *notes)
{
    return (cyaml_config_t){.log_fn = notes ? take_note : NULL,
                            .log_ctx = notes,
                            .mem_fn = cyaml_mem,
                            .log_level = CYAML_LOG_ERROR,
                            .flags = CYAML_CFG_NO_ALIAS};
}

static int load(const unsigned char *text, size_t size,
                const struct cyaml_schema_value *schema, const char *path, void **out,
                struct error *why)
{
    struct cyaml_notes notes = {.line = 0};
    cyaml_config_t config = config_of(&notes);
    cyaml_err_t e = cyaml_load_data(text, size, &config, schema, out, NULL);
    /* The text was read before: of libyaml nothing is left but that it has no memory. */
    if (e == CYAML_ERR_OOM || e == CYAML_ERR_LIBYAML_PARSER ||
        e == CYAML_ERR_LIBYAML_PARSER_INIT)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    if (e != CYAML_OK)
        return error_say(why, -EINVAL, "%s:%zu: %s", path, notes.line ? notes.line : 1,
                         notes.what[0] ? notes.what : cyaml_strerror(e));
    if (!*out) /* all keys are optional, and none is there */
        *out = cyaml_mem(NULL, NULL, schema->data_size);
    else
        return 0;
    if (!*out)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    memset(*out, 0, schema->data_size);
    return 0;
}

int yaml_parse(const char *path, const void *data, size_t size,
               const struct cyaml_schema_value *schema, void **out, struct error *why)
{
    *out = NULL;
    if (size > YAML_FILE_MAX_SIZE)
        return error_say(why, -EINVAL, "%s: larger than %u MiB; expected a YAML file",
                         path, YAML_FILE_MAX_SIZE >> 20);
    int err = check(data, size, schema, path, why);
    return err ? err : load(data, size, schema, path, out, why);
}

int yaml_load(const char *path, const struct cyaml_schema_value *schema, void **out,
              struct error *why)
{
    struct bytes text = {.data = NULL};
    *out = NULL;
    int err = read_file(path, &text, why);
    if (!err)
        err = yaml_parse(path, text.data, text.size, schema, out, why);
    free(text.data);
    return err;
}

void yaml_unload(const struct cyaml_schema_value *schema, void *data)
{
    cyaml_config_t config = config_of(NULL);
    if (data)
        cyaml_free(&config, schema, data, 0);
}

char *yaml_sibling(const char *path, const char *name)
{
    const char *slash = name[0] == '/' ? NULL : strrchr(path, '/');
    char *out;

    return asprintf(&out, "%.*s%s", slash ? (int)(slash - path) + 1 : 0, path, name) < 0
               ? NULL
               : out;
}

/* -- where in a file a key stands ------------------------------------------------------
 */

/* What a step of a path ("name" or "[3]") leads to, and the line where it stands. */
static yaml_node_t *step_into(yaml_document_t *d, yaml_node_t *node, const char *name,
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
        node = step_into(d, node, key, n, &line);
        key += n;
        key += key[0] == '.';
    }
    *whole = node != NULL;
    return line;
}

static int open_document(const char *path, yaml_document_t *out)
{
    struct bytes text = {.size = 0};
    yaml_parser_t parser;
    int ok = !read_file(path, &text, NULL) && yaml_parser_initialize(&parser);

    if (ok) {
        yaml_parser_set_input_string(&parser, text.data, text.size);
        ok = yaml_parser_load(&parser, out);
        yaml_parser_delete(&parser);
    }
    free(text.data);
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
