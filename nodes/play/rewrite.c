/* SPDX-License-Identifier: MIT */
#include "nodes/play/rewrite.h"

#include <errno.h>
#include <string.h>

#include "msgs/bag/topic_message.h"
#include "msgs/convert.h"
#include "msgs/shuffle.h"
#include "msgs/tensor.pb-c.h"
#include "msgs/unpack.h"
#include "recon/survey.h"

static const ProtobufCFieldDescriptor *find(const ProtobufCMessageDescriptor *d,
                                            const char *name)
{
    const ProtobufCFieldDescriptor *f =
        protobuf_c_message_descriptor_get_field_by_name(d, name);

    return f && f->label != PROTOBUF_C_LABEL_REPEATED &&
                   (f->type == PROTOBUF_C_TYPE_UINT32 || f->type == PROTOBUF_C_TYPE_ENUM)
               ? f
               : NULL;
}

static uint32_t *at(const ProtobufCMessage *m, const ProtobufCFieldDescriptor *f)
{
    return (uint32_t *)(void *)((char *)m + f->offset);
}

int64_t rewrite_peek(const ProtobufCMessage *m, const char *field)
{
    const ProtobufCFieldDescriptor *f = find(m->descriptor, field);

    return f ? (int64_t)*at(m, f) : -1;
}

static int pack(const ProtobufCMessage *m, struct bytes *payload,
                struct bytes_buffer *into)
{
    size_t size = protobuf_c_message_get_packed_size(m);

    if (bytes_reserve(into, size ? size : 1))
        return -ENOMEM;
    into->size = protobuf_c_message_pack(m, into->data);
    *payload = bytes_in(into);
    return 0;
}

enum { FIRST_FIELD = 0x08 }; /* as a number: the id, in all that name a survey */

/* Where the survey's id is missing; NULL: it is there, or the topic has none. */
static const ProtobufCFieldDescriptor *find_missing(const struct topic *t,
                                                    const struct bytes *payload)
{
    const ProtobufCFieldDescriptor *f =
        protobuf_c_message_descriptor_get_field_by_name(t->schema, "survey_id");

    return f && f->id == 1 && f->type == PROTOBUF_C_TYPE_UINT64 &&
                   !(payload->size && payload->data[0] == FIRST_FIELD)
               ? f
               : NULL;
}

int rewrite(const struct topic *t, uint32_t scan_base, uint64_t survey_id,
            struct bytes *payload, struct bytes_buffer *into)
{
    const ProtobufCFieldDescriptor *missing = survey_id ? find_missing(t, payload) : NULL;
    const ProtobufCFieldDescriptor *scan = scan_base ? find(t->schema, "scan") : NULL;
    const ProtobufCFieldDescriptor *source = find(t->schema, "source");

    if (source && source->descriptor != &anlos__source__descriptor)
        source = NULL;
    bool changes = scan || source || missing;
    if (!changes && !bag_topic_is_shuffled(t))
        return 0;
    ProtobufCMessage *m =
        message_unpack_as_it_is(t->schema, payload->size, payload->data);
    if (!m)
        return errno == ENOMEM ? -ENOMEM : changes ? -EPROTO : 0;
    int err = 0;
    if (!changes && !message_is_shuffled(m))
        goto message;
    err = message_unshuffle(m);
    if (err)
        goto message;
    if (scan)
        *at(m, scan) += scan_base;
    if (missing && !*(uint64_t *)(void *)((char *)m + missing->offset))
        *(uint64_t *)(void *)((char *)m + missing->offset) = survey_id;
    if (t->schema == &anlos__survey__descriptor)
        survey_complete_id((Anlos__Survey *)m);
    if (source)
        *at(m, source) = ANLOS__SOURCE__REPLAY;
    err = pack(m, payload, into);
message:
    protobuf_c_message_free_unpacked(m, NULL);
    return err;
}
