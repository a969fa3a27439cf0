/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/topic/message_json.h"

#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
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

static json_t *string_json(const char *s)
{
    json_t *j = json_string(s ? s : "");
    return j ? j : json_null(); /* not UTF-8 */
}

static json_t *wide_json(int64_t v)
{
    return json_sprintf("%" PRId64, v);
}

/* One value of a field's type at an address. */
static json_t *value_json(const ProtobufCFieldDescriptor *f, const void *at, bool full)
{
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
        return wide_json(*(const int64_t *)at);
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
        return string_json(*(char *const *)at);
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

size_t message_value_size(ProtobufCType type)
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
        json_array_append_new(
            array, value_json(f, values + i * message_value_size(f->type), full));
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

/* Null: not UTF-8. */
static json_t *text_json(const char *text, size_t n)
{
    json_t *j = json_stringn(n ? text : "", n);

    return j ? j : json_null();
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
