#include "hal/yaml/check.h"

#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_DEPTH = 16, KEY_SIZE = 256 };

struct checker {
    yaml_document_t *document;
    const char *path;
    struct complaint *why;
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
    return complain(c->why, -EINVAL, "%s:%zu: %s%s%s", c->path, node->start_mark.line + 1,
                    c->key, c->key[0] ? ": " : "", text);
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
        size_t n = strlen(list);
        snprintf(list + n, sizeof list - n, "%s%s", n ? ", " : "", name);
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
    for (; fields->key; fields++) {
        size_t n = strlen(list);
        snprintf(list + n, sizeof list - n, "%s%s", n ? ", " : "", fields->key);
    }
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

int yaml_check(yaml_document_t *document, const struct cyaml_schema_value *schema,
               const char *path, struct complaint *why)
{
    struct checker c = {.document = document, .path = path, .why = why};
    yaml_node_t *root = yaml_document_get_root_node(document);
    if (!root)
        return complain(why, -EINVAL, "%s:1: the file is empty", path);
    return check_node(&c, schema, root);
}
