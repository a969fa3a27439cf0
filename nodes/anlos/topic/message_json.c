/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/topic/message_json.h"

#include <errno.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/tensor.pb-c.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"

static json_t *tensor_json(const Anlos__Tensor *t, bool full)
{
    static const char *const types[] = {"NONE", "FLOAT32", "COMPLEX64"};
    bool complex = t->type == ANLOS__TENSOR__TYPE__COMPLEX64;
    size_t width = complex ? 2 : 1, n = t->data.len / (width * sizeof(float));
    double min = INFINITY, max = -INFINITY;
    json_t *o = json_object(), *shape = json_array(), *data = full ? json_array() : NULL;

    for (size_t i = 0; i < n; i++) {
        float v[2] = {0.0f, 0.0f};
        memcpy(v, t->data.data + i * width * sizeof(float), width * sizeof(float));
        double value = complex ? hypot((double)v[0], (double)v[1]) : (double)v[0];
        min = fmin(min, value);
        max = fmax(max, value);
        if (full)
            json_array_append_new(data,
                                  complex ? json_pack("[o, o]", export_real((double)v[0]),
                                                      export_real((double)v[1]))
                                          : export_real((double)v[0]));
    }
    for (size_t i = 0; i < t->n_shape; i++)
        json_array_append_new(shape, json_integer(t->shape[i]));
    json_object_set_new(o, "type",
                        json_string((unsigned)t->type < 3 ? types[t->type] : "unknown"));
    json_object_set_new(o, "shape", shape);
    json_object_set_new(o, "min", export_real(min));
    json_object_set_new(o, "max", export_real(max));
    if (full)
        json_object_set_new(o, "data", data);
    return o;
}

static json_t *bytes_json(const ProtobufCBinaryData *b, bool full)
{
    if (!full)
        return json_pack("{sI}", "bytes", (json_int_t)b->len);
    char *hex = malloc(2 * b->len + 1);
    if (!hex)
        return NULL;
    for (size_t i = 0; i < b->len; i++)
        snprintf(hex + 2 * i, 3, "%02x", b->data[i]);
    hex[2 * b->len] = '\0';
    json_t *j = json_string(hex);
    free(hex);
    return j;
}

static json_t *enum_json(const ProtobufCFieldDescriptor *f, int value)
{
    const ProtobufCEnumValue *v =
        protobuf_c_enum_descriptor_get_value(f->descriptor, value);
    return v ? json_string(v->name) : json_integer(value);
}

/* Null: not UTF-8. */
static json_t *text_json(const char *text, size_t n)
{
    json_t *j = json_stringn(n ? text : "", n);

    return j ? j : json_null();
}

/* One value of a field's type at an address. */
static json_t *value_json(const ProtobufCFieldDescriptor *f, const void *at, bool full)
{
    const char *text;

    switch (f->type) {
    case PROTOBUF_C_TYPE_INT32:
    case PROTOBUF_C_TYPE_SINT32:
    case PROTOBUF_C_TYPE_SFIXED32:
        return json_integer(*(const int32_t *)at);
    case PROTOBUF_C_TYPE_UINT32:
    case PROTOBUF_C_TYPE_FIXED32:
        return json_integer(*(const uint32_t *)at);
    case PROTOBUF_C_TYPE_INT64:
    case PROTOBUF_C_TYPE_SINT64:
    case PROTOBUF_C_TYPE_SFIXED64:
        return json_sprintf("%" PRId64, *(const int64_t *)at);
    case PROTOBUF_C_TYPE_UINT64:
    case PROTOBUF_C_TYPE_FIXED64:
        return json_sprintf("%" PRIu64, *(const uint64_t *)at);
    case PROTOBUF_C_TYPE_FLOAT:
        return export_real((double)*(const float *)at);
    case PROTOBUF_C_TYPE_DOUBLE:
        return export_real(*(const double *)at);
    case PROTOBUF_C_TYPE_BOOL:
        return json_boolean(*(const protobuf_c_boolean *)at);
    case PROTOBUF_C_TYPE_ENUM:
        return enum_json(f, *(const int *)at);
    case PROTOBUF_C_TYPE_STRING:
        text = *(char *const *)at;
        return text_json(text, text ? strlen(text) : 0);
    case PROTOBUF_C_TYPE_BYTES:
        return bytes_json(at, full);
    case PROTOBUF_C_TYPE_MESSAGE:
        return *(ProtobufCMessage *const *)at
                   ? message_json(*(ProtobufCMessage *const *)at, full)
                   : json_null();
    default:
        return json_null();
    }
}

/* Bytes of one value of a field that repeats, in protobuf-c's array of them. */
static size_t value_size(ProtobufCType type)
{
    switch (type) {
    case PROTOBUF_C_TYPE_INT64:
    case PROTOBUF_C_TYPE_SINT64:
    case PROTOBUF_C_TYPE_SFIXED64:
    case PROTOBUF_C_TYPE_UINT64:
    case PROTOBUF_C_TYPE_FIXED64:
    case PROTOBUF_C_TYPE_DOUBLE:
        return 8;
    case PROTOBUF_C_TYPE_BOOL:
        return sizeof(protobuf_c_boolean);
    case PROTOBUF_C_TYPE_STRING:
    case PROTOBUF_C_TYPE_MESSAGE:
        return sizeof(void *);
    case PROTOBUF_C_TYPE_BYTES:
        return sizeof(ProtobufCBinaryData);
    default:
        return 4;
    }
}

static json_t *field_json(const ProtobufCFieldDescriptor *f, const uint8_t *message,
                          bool full)
{
    if (f->label != PROTOBUF_C_LABEL_REPEATED)
        return value_json(f, message + f->offset, full);
    size_t n = *(const size_t *)(const void *)(message + f->quantifier_offset);
    const uint8_t *values = *(uint8_t *const *)(const void *)(message + f->offset);
    json_t *array = json_array();
    for (size_t i = 0; i < n; i++)
        json_array_append_new(array,
                              value_json(f, values + i * value_size(f->type), full));
    return array;
}

json_t *message_json(const ProtobufCMessage *m, bool full)
{
    const ProtobufCMessageDescriptor *d = m->descriptor;
    if (d == &anlos__tensor__descriptor)
        return tensor_json((const Anlos__Tensor *)m, full);
    json_t *o = json_object();
    for (unsigned i = 0; o && i < d->n_fields; i++) {
        const ProtobufCFieldDescriptor *f = &d->fields[i];
        json_t *v = field_json(f, (const uint8_t *)m, full);
        if (json_object_set_new(o, f->name, v)) {
            json_decref(o);
            return NULL;
        }
    }
    return o;
}

int message_line_write(const struct message_line *l, bool full, FILE *f)
{
    const struct envelope *e = l->envelope;
    json_t *o = json_pack(
        "{so, so, sI, sI, sI, sI}", "topic", text_json(l->topic, l->n_topic), "from",
        text_json(e->node, strlen(e->node)), "sequence", (json_int_t)e->sequence,
        "capture_ns", (json_int_t)e->capture_ns, "publish_ns", (json_int_t)e->publish_ns,
        "bytes", (json_int_t)l->n_bytes);

    if (e->replayed)
        json_object_set_new(o, "replayed", json_true());
    json_object_set_new(o, "content",
                        l->content ? message_json(l->content, full)
                                   : json_string(l->why_not));
    return usage_json_line(o, f);
}

/* -- and back ------------------------------------------------------------------------
 */

enum { PATH_SIZE = 160 };

struct place { /* in the JSON, for errors */
    char path[PATH_SIZE];
    struct error *why;
};

static const char *kind(const json_t *j)
{
    static const char *const names[] = {
        [JSON_OBJECT] = "an object", [JSON_ARRAY] = "an array",
        [JSON_STRING] = "a text",    [JSON_INTEGER] = "a whole number",
        [JSON_REAL] = "a number",    [JSON_TRUE] = "true",
        [JSON_FALSE] = "false",      [JSON_NULL] = "null",
    };

    return names[json_typeof(j)];
}

static int expected(const struct place *p, const char *what, const json_t *j)
{
    return error_say(p->why, -EINVAL, "%s: expected %s, not %s", p->path, what, kind(j));
}

static int no_memory(const struct place *p)
{
    return error_say(p->why, -ENOMEM, "out of memory");
}

static struct place inside(const struct place *p, const char *field)
{
    struct place q = {.why = p->why};

    snprintf(q.path, sizeof q.path, "%.100s%s%.50s", p->path, p->path[0] ? "." : "",
             field);
    return q;
}

static struct place at_index(const struct place *p, size_t i)
{
    struct place q = {.why = p->why};

    snprintf(q.path, sizeof q.path, "%.130s[%zu]", p->path, i);
    return q;
}

/* A whole number, which may be a text where JSON's own are too short. */
static int take_signed(const struct place *p, const json_t *j, int64_t min, int64_t max,
                       int64_t *out)
{
    const char *text = json_string_value(j);
    char *end = NULL;

    errno = 0;
    if (json_is_integer(j))
        *out = json_integer_value(j);
    else if (text && *text)
        *out = strtoll(text, &end, 10);
    else
        return expected(p, "a whole number", j);
    if (end && *end)
        return error_say(p->why, -EINVAL, "%s: \"%.40s\" is no whole number", p->path,
                         text);
    return errno || *out < min || *out > max
               ? error_say(p->why, -EINVAL,
                           "%s: out of range: expected %" PRId64 " to %" PRId64, p->path,
                           min, max)
               : 0;
}

static int take_unsigned(const struct place *p, const json_t *j, uint64_t max,
                         uint64_t *out)
{
    const char *text = json_string_value(j);
    int64_t small;
    char *end;

    if (!text || *text == '-' || max <= INT64_MAX) {
        int err =
            take_signed(p, j, 0, max < INT64_MAX ? (int64_t)max : INT64_MAX, &small);
        *out = err ? 0 : (uint64_t)small;
        return err;
    }
    errno = 0;
    *out = strtoull(text, &end, 10);
    return errno || *end || !*text
               ? error_say(p->why, -EINVAL,
                           "%s: \"%.40s\" is no whole number from 0 to %" PRIu64, p->path,
                           text, max)
               : 0;
}

static int take_real(const struct place *p, const json_t *j, double largest, double *out)
{
    if (!json_is_number(j) && !json_is_null(j))
        return expected(p, "a number", j);
    *out = json_is_null(j) ? NAN : json_number_value(j);
    return fabs(*out) > largest
               ? error_say(p->why, -EINVAL, "%s: out of range: expected up to %g",
                           p->path, largest)
               : 0;
}

static int take_enum(const struct place *p, const json_t *j,
                     const ProtobufCEnumDescriptor *d, int *out)
{
    const char *name = json_string_value(j);
    const ProtobufCEnumValue *v = NULL;

    if (!name && !json_is_integer(j))
        return expected(p, "a name", j);
    json_int_t n = name ? 0 : json_integer_value(j);
    if (name)
        v = protobuf_c_enum_descriptor_get_value_by_name(d, name);
    else if (n >= INT32_MIN && n <= INT32_MAX)
        v = protobuf_c_enum_descriptor_get_value(d, (int)n);
    if (v) {
        *out = v->value;
        return 0;
    }
    char all[160] = "";
    for (unsigned i = 0; i < d->n_values; i++)
        text_add(all, sizeof all, ", ", "%s", d->values[i].name);
    return error_say(p->why, -EINVAL, "%s: expected one of %s", p->path, all);
}

static int put_numbers(const struct place *p, const json_t *data, size_t width,
                       float *out)
{
    for (size_t i = 0; i < json_array_size(data); i++) {
        const json_t *one = json_array_get(data, i);
        struct place q = at_index(p, i);
        if (width == 2 && json_array_size(one) != 2)
            return expected(&q, "[real, imaginary]", one);
        for (size_t k = 0; k < width; k++) {
            double v;
            int err =
                take_real(&q, width == 2 ? json_array_get(one, k) : one, FLT_MAX, &v);
            if (err)
                return err;
            out[i * width + k] = (float)v;
        }
    }
    return 0;
}

static int take_shape(const struct place *p, const json_t *j, Anlos__Tensor *t,
                      size_t *n_numbers)
{
    size_t n = json_array_size(j);
    struct place q = inside(p, "shape");

    if (!json_is_array(j))
        return error_say(p->why, -EINVAL, "%s: expected an array", q.path);
    t->shape = calloc(n ? n : 1, sizeof *t->shape);
    if (!t->shape)
        return no_memory(p);
    t->n_shape = n;
    *n_numbers = 1;
    for (size_t i = 0; i < n; i++) {
        uint64_t extent = 0;
        int err = take_unsigned(&q, json_array_get(j, i), UINT32_MAX, &extent);
        if (err)
            return err;
        t->shape[i] = (uint32_t)extent;
        if (__builtin_mul_overflow(*n_numbers, (size_t)extent, n_numbers))
            return error_say(p->why, -EINVAL, "%s: too large", q.path);
    }
    return 0;
}

static int take_tensor(const struct place *p, const json_t *j, Anlos__Tensor *t)
{
    const json_t *data = json_object_get(j, "data");
    const json_t *type = json_object_get(j, "type");
    struct place at_type = inside(p, "type"), at_data = inside(p, "data");
    int value = 0;
    size_t n = 0;

    if (!type)
        return error_say(p->why, -EINVAL, "%s: is missing", at_type.path);
    int err = take_enum(&at_type, type, &anlos__tensor__type__descriptor, &value);
    if (!err)
        err = take_shape(p, json_object_get(j, "shape"), t, &n);
    if (err)
        return err;
    t->type = (Anlos__Tensor__Type)value;
    if (!json_is_array(data))
        return error_say(p->why, -EINVAL,
                         "%s: expected the numbers, as 'anlos topic echo --full' prints "
                         "them",
                         at_data.path);
    if (json_array_size(data) != n)
        return error_say(p->why, -EINVAL, "%s: %zu numbers, but the shape has %zu",
                         at_data.path, json_array_size(data), n);
    size_t width = t->type == ANLOS__TENSOR__TYPE__COMPLEX64 ? 2 : 1;
    t->data.data = malloc(n ? n * width * sizeof(float) : 1);
    if (!t->data.data)
        return no_memory(p);
    t->data.len = n * width * sizeof(float);
    return put_numbers(&at_data, data, width, (float *)(void *)t->data.data);
}

static int take_message(const struct place *p, ProtobufCMessage **out, const json_t *j,
                        const ProtobufCMessageDescriptor *d);

static int take_text(const struct place *p, const json_t *j, char **at)
{
    if (!json_is_string(j))
        return expected(p, "a text", j);
    char *copy = strdup(json_string_value(j));
    if (!copy)
        return no_memory(p);
    *at = copy;
    return 0;
}

/* One value of a field's type to an address, which holds the default. */
static int take_value(const struct place *p, const ProtobufCFieldDescriptor *f,
                      const json_t *j, void *at)
{
    int64_t i = 0;
    uint64_t u = 0;
    double v = 0.0;
    int err;

    switch (f->type) {
    case PROTOBUF_C_TYPE_INT32:
    case PROTOBUF_C_TYPE_SINT32:
    case PROTOBUF_C_TYPE_SFIXED32:
        err = take_signed(p, j, INT32_MIN, INT32_MAX, &i);
        *(int32_t *)at = (int32_t)i;
        return err;
    case PROTOBUF_C_TYPE_UINT32:
    case PROTOBUF_C_TYPE_FIXED32:
        err = take_unsigned(p, j, UINT32_MAX, &u);
        *(uint32_t *)at = (uint32_t)u;
        return err;
    case PROTOBUF_C_TYPE_INT64:
    case PROTOBUF_C_TYPE_SINT64:
    case PROTOBUF_C_TYPE_SFIXED64:
        return take_signed(p, j, INT64_MIN, INT64_MAX, at);
    case PROTOBUF_C_TYPE_UINT64:
    case PROTOBUF_C_TYPE_FIXED64:
        return take_unsigned(p, j, UINT64_MAX, at);
    case PROTOBUF_C_TYPE_FLOAT:
        err = take_real(p, j, FLT_MAX, &v);
        *(float *)at = err ? 0.0f : (float)v;
        return err;
    case PROTOBUF_C_TYPE_DOUBLE:
        return take_real(p, j, DBL_MAX, at);
    case PROTOBUF_C_TYPE_BOOL:
        *(protobuf_c_boolean *)at = json_is_true(j);
        return json_is_boolean(j) ? 0 : expected(p, "true or false", j);
    case PROTOBUF_C_TYPE_ENUM:
        return take_enum(p, j, f->descriptor, at);
    case PROTOBUF_C_TYPE_STRING:
        return take_text(p, j, at);
    case PROTOBUF_C_TYPE_MESSAGE:
        return take_message(p, at, j, f->descriptor);
    default: /* bytes stand in tensors alone */
        return error_say(p->why, -EINVAL, "%s: cannot be given as JSON", p->path);
    }
}

/* A value that failed has allocated nothing, so what is counted is what there is. */
static int take_field(const struct place *p, const ProtobufCFieldDescriptor *f,
                      const json_t *j, uint8_t *message)
{
    if (f->label != PROTOBUF_C_LABEL_REPEATED) {
        bool absent = json_is_null(j) && f->type == PROTOBUF_C_TYPE_MESSAGE;
        return absent ? 0 : take_value(p, f, j, message + f->offset);
    }
    if (!json_is_array(j))
        return expected(p, "an array", j);
    size_t n = json_array_size(j), width = value_size(f->type);
    size_t *count = (size_t *)(void *)(message + f->quantifier_offset);
    uint8_t *values = n ? calloc(n, width) : NULL;
    if (n && !values)
        return no_memory(p);
    *(void **)(void *)(message + f->offset) = values;
    for (size_t i = 0; i < n; i++) {
        struct place q = at_index(p, i);
        int err = take_value(&q, f, json_array_get(j, i), values + i * width);
        if (err)
            return err;
        *count = i + 1;
    }
    if (!n)
        *count = 0;
    return 0;
}

/* The field that was probably meant; NULL: none is near. */
static const char *nearest_field(const char *name, const ProtobufCMessageDescriptor *d)
{
    struct nearest s = nearest_begin(name, strlen(name), 3);

    for (unsigned i = 0; i < d->n_fields; i++)
        nearest_try(&s, d->fields[i].name);
    return s.best;
}

static int no_field(const struct place *p, const char *name,
                    const ProtobufCMessageDescriptor *d)
{
    const char *near = nearest_field(name, d);

    if (near)
        return error_say(p->why, -EINVAL, "%s: %s has no such field; did you mean %s?",
                         p->path, d->name, near);
    char all[256] = "";
    for (unsigned i = 0; i < d->n_fields; i++)
        text_add(all, sizeof all, ", ", "%s", d->fields[i].name);
    return error_say(p->why, -EINVAL, "%s: %s has no such field; it has %s", p->path,
                     d->name, all);
}

static int take_fields(const struct place *p, ProtobufCMessage *m, const json_t *j)
{
    const ProtobufCMessageDescriptor *d = m->descriptor;
    const char *name;
    const json_t *value;

    if (d == &anlos__tensor__descriptor)
        return take_tensor(p, j, (Anlos__Tensor *)m);
    json_object_foreach((json_t *)j, name, value)
    {
        struct place q = inside(p, name);
        const ProtobufCFieldDescriptor *f =
            protobuf_c_message_descriptor_get_field_by_name(d, name);
        int err = f ? take_field(&q, f, value, (uint8_t *)m) : no_field(&q, name, d);
        if (err)
            return err;
    }
    return 0;
}

static int take_point(const struct place *p, const json_t *j, Anlos__Vec3 *v)
{
    double *const to[3] = {&v->x, &v->y, &v->z};
    int err = json_array_size(j) == 3 ? 0 : expected(p, "three numbers", j);

    for (size_t i = 0; !err && i < 3; i++) {
        struct place q = at_index(p, i);
        err = take_real(&q, json_array_get(j, i), DBL_MAX, to[i]);
    }
    return err;
}

static int take_message(const struct place *p, ProtobufCMessage **out, const json_t *j,
                        const ProtobufCMessageDescriptor *d)
{
    bool point = d == &anlos__vec3__descriptor && json_is_array(j);

    if (!json_is_object(j) && !point)
        return p->path[0] ? expected(p, "an object", j)
                          : error_say(p->why, -EINVAL,
                                      "expected an object, {...}, not %s", kind(j));
    ProtobufCMessage *m = malloc(d->sizeof_message);
    if (!m)
        return no_memory(p);
    protobuf_c_message_init(d, m);
    int err = point ? take_point(p, j, (Anlos__Vec3 *)m) : take_fields(p, m, j);
    if (err)
        protobuf_c_message_free_unpacked(m, NULL);
    else
        *out = m;
    return err;
}

int json_message(ProtobufCMessage **out, const json_t *j,
                 const ProtobufCMessageDescriptor *schema, struct error *why)
{
    const struct place top = {.why = why};

    return take_message(&top, out, j, schema);
}

/* -- one field -----------------------------------------------------------------------
 */

enum { NAME_SIZE = 64 };

/* The next name or index of the path; *path comes to stand behind its dot, or is NULL at
 * the end.  false: empty or too long. */
static bool next_part(const char **path, char out[NAME_SIZE])
{
    size_t n = strcspn(*path, ".");

    if (!n || n >= NAME_SIZE)
        return false;
    memcpy(out, *path, n);
    out[n] = '\0';
    *path = (*path)[n] ? *path + n + 1 : NULL;
    return true;
}

static bool is_index(const char *part)
{
    return part[strspn(part, "0123456789")] == '\0';
}

int field_path_check(const char *path, const ProtobufCMessageDescriptor *schema,
                     struct error *why)
{
    const ProtobufCMessageDescriptor *d = schema;
    bool list = false;
    char part[NAME_SIZE];

    while (path) {
        if (!next_part(&path, part))
            return error_say(why, -EINVAL, "expected names of fields with dots between");
        if (list && is_index(part)) {
            list = false;
            continue;
        }
        if (!d)
            return error_say(why, -EINVAL, "%s: there are no fields in what is before it",
                             part);
        const ProtobufCFieldDescriptor *f =
            protobuf_c_message_descriptor_get_field_by_name(d, part);
        if (!f && d == &anlos__tensor__descriptor && !path &&
            (!strcmp(part, "min") || !strcmp(part, "max"))) /* message_json's own */
            return 0;
        if (!f) {
            const char *near = nearest_field(part, d);
            return error_say(why, -EINVAL, "%s: %s has no such field%s%s%s", part,
                             d->name, near ? "; did you mean " : "", near ? near : "",
                             near ? "?" : "");
        }
        list = f->label == PROTOBUF_C_LABEL_REPEATED;
        d = f->type == PROTOBUF_C_TYPE_MESSAGE ? f->descriptor : NULL;
    }
    return 0;
}

json_t *field_path_pick(const char *path, json_t *content)
{
    const char *rest = path;
    char part[NAME_SIZE];

    if (!path)
        return json_incref(content);
    if (!json_is_array(content)) {
        json_t *v = next_part(&rest, part) ? json_object_get(content, part) : NULL;
        return v ? field_path_pick(rest, v) : json_null();
    }
    if (next_part(&rest, part) && is_index(part)) {
        json_t *v = json_array_get(content, strtoul(part, NULL, 10));
        return v ? field_path_pick(rest, v) : json_null();
    }
    json_t *each = json_array();
    for (size_t i = 0; each && i < json_array_size(content); i++)
        json_array_append_new(each, field_path_pick(path, json_array_get(content, i)));
    return each;
}
