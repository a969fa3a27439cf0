/* SPDX-License-Identifier: MIT */
#include "msgs/unpack.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>

#include "msgs/bag/bytes.h"
#include "msgs/shuffle.h"

#define FIELD_BYTES   40 /* of protobuf-c's list of what it found */
#define UNKNOWN_BYTES 32 /* of a field that the schema does not know */
#define HEAP_BYTES    16 /* of an allocation, beside its content */
#define MAX_VARINT    10

struct budget {
    size_t left;
};

static bool spend(struct budget *b, size_t bytes)
{
    bool enough = bytes <= b->left;

    b->left = enough ? b->left - bytes : 0;
    return enough;
}

static uint64_t take_varint(struct bytes_cursor *c)
{
    uint64_t value = 0, byte = 0x80;

    for (unsigned i = 0; i < MAX_VARINT && byte & 0x80; i++) {
        byte = bytes_number(c, 1);
        value |= (byte & 0x7f) << 7 * i;
    }
    c->failed = c->failed || byte & 0x80;
    return value;
}

/* What follows a tag; of numbers it is empty. */
static struct bytes take_content(struct bytes_cursor *c, unsigned wire_type)
{
    struct bytes content = {NULL, 0};

    switch (wire_type) {
    case PROTOBUF_C_WIRE_TYPE_VARINT:
        take_varint(c);
        break;
    case PROTOBUF_C_WIRE_TYPE_64BIT:
        bytes_take(c, 8);
        break;
    case PROTOBUF_C_WIRE_TYPE_LENGTH_PREFIXED:
        content = bytes_take(c, take_varint(c));
        break;
    case PROTOBUF_C_WIRE_TYPE_32BIT:
        bytes_take(c, 4);
        break;
    default: /* groups, which proto3 does not have */
        c->failed = true;
    }
    return content;
}

static bool spend_message(struct budget *b, const ProtobufCMessageDescriptor *d,
                          struct bytes message);

/* Of packed numbers in memory, for each byte on the way: a number without a fixed size
 * has one at least. */
static size_t growth(ProtobufCType type)
{
    switch (type) {
    case PROTOBUF_C_TYPE_FIXED32:
    case PROTOBUF_C_TYPE_SFIXED32:
    case PROTOBUF_C_TYPE_FLOAT:
    case PROTOBUF_C_TYPE_FIXED64:
    case PROTOBUF_C_TYPE_SFIXED64:
    case PROTOBUF_C_TYPE_DOUBLE:
        return 1;
    case PROTOBUF_C_TYPE_INT64:
    case PROTOBUF_C_TYPE_UINT64:
    case PROTOBUF_C_TYPE_SINT64:
        return 8;
    default:
        return 4;
    }
}

static bool spend_field(struct budget *b, const ProtobufCFieldDescriptor *f,
                        struct bytes content)
{
    bool repeated = f->label == PROTOBUF_C_LABEL_REPEATED;

    if (f->type == PROTOBUF_C_TYPE_MESSAGE)
        return spend(b, sizeof(void *)) && spend_message(b, f->descriptor, content);
    if (f->type == PROTOBUF_C_TYPE_STRING || f->type == PROTOBUF_C_TYPE_BYTES)
        return spend(b, content.size + HEAP_BYTES +
                            (repeated ? sizeof(ProtobufCBinaryData) : 0));
    return !repeated || spend(b, sizeof(double) + growth(f->type) * content.size);
}

static bool spend_message(struct budget *b, const ProtobufCMessageDescriptor *d,
                          struct bytes message)
{
    struct bytes_cursor c = {.left = message};

    if (!spend(b, d->sizeof_message + HEAP_BYTES))
        return false;
    while (c.left.size) {
        uint64_t tag = take_varint(&c);
        struct bytes content = take_content(&c, tag & 7);
        if (c.failed || !(tag >> 3) || tag > UINT32_MAX || !spend(b, FIELD_BYTES))
            return false;
        const ProtobufCFieldDescriptor *f =
            protobuf_c_message_descriptor_get_field(d, (unsigned)(tag >> 3));
        if (f ? !spend_field(b, f, content)
              : !spend(b, UNKNOWN_BYTES + HEAP_BYTES + content.size))
            return false;
    }
    return true;
}

/* What protobuf-c does by itself, but that it is told when there is none. */
static void *take(void *failed, size_t size)
{
    void *p = malloc(size);

    if (!p)
        *(bool *)failed = true;
    return p;
}

static void give_back(void *failed, void *p)
{
    (void)failed;
    free(p);
}

ProtobufCMessage *message_unpack_as_it_is(const ProtobufCMessageDescriptor *schema,
                                          size_t size, const uint8_t *data)
{
    struct budget b = {.left = UNPACK_SPARE_BYTES};
    bool failed = false;
    ProtobufCAllocator heap = {
        .alloc = take, .free = give_back, .allocator_data = &failed};

    errno = EBADMSG;
    if (size > (SIZE_MAX - b.left) / 4)
        return NULL;
    b.left += 4 * size;
    if (!spend_message(&b, schema, (struct bytes){data, size}))
        return NULL;
    ProtobufCMessage *m = protobuf_c_message_unpack(schema, &heap, size, data);
    if (!m)
        errno = failed ? ENOMEM : EBADMSG;
    return m;
}

ProtobufCMessage *message_unpack(const ProtobufCMessageDescriptor *schema, size_t size,
                                 const uint8_t *data)
{
    ProtobufCMessage *m = message_unpack_as_it_is(schema, size, data);

    if (!m || !message_unshuffle(m))
        return m;
    protobuf_c_message_free_unpacked(m, NULL);
    errno = ENOMEM;
    return NULL;
}

ProtobufCMessage *message_copy(const ProtobufCMessage *m)
{
    size_t size = protobuf_c_message_get_packed_size(m);
    uint8_t *bytes = malloc(size ? size : 1);

    if (!bytes)
        return NULL;
    protobuf_c_message_pack(m, bytes);
    ProtobufCMessage *out = protobuf_c_message_unpack(m->descriptor, NULL, size, bytes);
    free(bytes);
    return out;
}
