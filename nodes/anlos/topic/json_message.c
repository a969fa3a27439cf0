/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/topic/json_message.h"

#include <errno.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/nearest.h"
#include "msgs/tensor.pb-c.h"
#include "nodes/anlos/topic/message_json.h"

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
        snprintf(all + strlen(all), sizeof all - strlen(all), "%s%s", i ? ", " : "",
                 d->values[i].name);
    return error_say(p->why, -EINVAL, "%s: expected one of %s", p->path, all);
}

/* -- tensors ----------------------------------------------------------------------------
 */

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

/* -- fields -----------------------------------------------------------------------------
 */

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
    size_t n = json_array_size(j), width = message_value_size(f->type);
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

static int no_field(const struct place *p, const char *name,
                    const ProtobufCMessageDescriptor *d)
{
    struct nearest s = nearest_begin(name, strlen(name), 3);

    for (unsigned i = 0; i < d->n_fields; i++)
        nearest_try(&s, d->fields[i].name);
    if (s.best)
        return error_say(p->why, -EINVAL, "%s: %s has no such field; did you mean %s?",
                         p->path, d->name, s.best);
    char all[256] = "";
    for (unsigned i = 0; i < d->n_fields; i++)
        snprintf(all + strlen(all), sizeof all - strlen(all), "%s%s", i ? ", " : "",
                 d->fields[i].name);
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
