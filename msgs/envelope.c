/* SPDX-License-Identifier: MIT */
#include "msgs/envelope.h"

#include <errno.h>
#include <string.h>

enum {
    AT_TOPIC = 0,
    AT_MAGIC = 24,
    AT_VERSION = 28,
    AT_NODE = 32,
    AT_EPOCH = 48,
    AT_SEQUENCE = 56,
    AT_CAPTURE = 64,
    AT_PUBLISH = 72,
    AT_PAYLOAD_SIZE = 80,
    AT_REPLAYED = 84,
    AT_PADDING = 85,
};

static void put(uint8_t *out, uint64_t value, unsigned n_bytes)
{
    for (unsigned i = 0; i < n_bytes; i++)
        out[i] = (uint8_t)(value >> (8 * i));
}

static uint64_t get(const uint8_t *data, unsigned n_bytes)
{
    uint64_t value = 0;
    for (unsigned i = 0; i < n_bytes; i++)
        value |= (uint64_t)data[i] << (8 * i);
    return value;
}

static bool zeros(const uint8_t *data, size_t size)
{
    for (size_t i = 0; i < size; i++)
        if (data[i])
            return false;
    return true;
}

/* Not empty, ended within its field, and nothing behind the end. */
static bool name_holds(const uint8_t *field, size_t size)
{
    size_t length = strnlen((const char *)field, size);
    return length > 0 && length < size && zeros(field + length, size - length);
}

void envelope_pack(const struct envelope *e, uint8_t *out)
{
    memset(out, 0, ENVELOPE_SIZE);
    memcpy(out + AT_TOPIC, e->topic, strnlen(e->topic, sizeof e->topic - 1));
    put(out + AT_MAGIC, ENVELOPE_MAGIC, 4);
    put(out + AT_VERSION, ENVELOPE_VERSION, 4);
    memcpy(out + AT_NODE, e->node, strnlen(e->node, sizeof e->node - 1));
    put(out + AT_EPOCH, (uint64_t)e->epoch_ns, 8);
    put(out + AT_SEQUENCE, e->sequence, 8);
    put(out + AT_CAPTURE, (uint64_t)e->capture_ns, 8);
    put(out + AT_PUBLISH, (uint64_t)e->publish_ns, 8);
    put(out + AT_PAYLOAD_SIZE, e->payload_size, 4);
    out[AT_REPLAYED] = e->replayed;
}

static bool stamp_holds(const uint8_t *data)
{
    return get(data, 8) <= (uint64_t)ENVELOPE_MAX_STAMP;
}

enum envelope_fault envelope_inspect(const uint8_t *data, size_t size, size_t max_payload)
{
    if (size < ENVELOPE_SIZE)
        return ENVELOPE_SHORT;
    if (get(data + AT_MAGIC, 4) != ENVELOPE_MAGIC)
        return ENVELOPE_FOREIGN;
    if (get(data + AT_VERSION, 4) != ENVELOPE_VERSION)
        return ENVELOPE_OTHER_VERSION;
    if (!name_holds(data + AT_TOPIC, ENVELOPE_TOPIC_SIZE) ||
        !name_holds(data + AT_NODE, ENVELOPE_NODE_SIZE) ||
        !stamp_holds(data + AT_CAPTURE) || !stamp_holds(data + AT_PUBLISH) ||
        data[AT_REPLAYED] > 1 || !zeros(data + AT_PADDING, ENVELOPE_SIZE - AT_PADDING))
        return ENVELOPE_GARBLED;
    if (get(data + AT_PAYLOAD_SIZE, 4) != size - ENVELOPE_SIZE)
        return ENVELOPE_LENGTH;
    return size - ENVELOPE_SIZE > max_payload ? ENVELOPE_TOO_LARGE : ENVELOPE_SOUND;
}

int envelope_unpack(struct envelope *e, const uint8_t *data, size_t size,
                    size_t max_payload)
{
    switch (envelope_inspect(data, size, max_payload)) {
    case ENVELOPE_SOUND:
        break;
    case ENVELOPE_FOREIGN:
    case ENVELOPE_OTHER_VERSION:
    case ENVELOPE_GARBLED:
        return -EPROTO;
    case ENVELOPE_SHORT:
    case ENVELOPE_LENGTH:
    case ENVELOPE_TOO_LARGE:
        return -EMSGSIZE;
    }
    memcpy(e->topic, data + AT_TOPIC, sizeof e->topic);
    memcpy(e->node, data + AT_NODE, sizeof e->node);
    e->epoch_ns = (int64_t)get(data + AT_EPOCH, 8);
    e->sequence = get(data + AT_SEQUENCE, 8);
    e->capture_ns = (int64_t)get(data + AT_CAPTURE, 8);
    e->publish_ns = (int64_t)get(data + AT_PUBLISH, 8);
    e->payload_size = (uint32_t)get(data + AT_PAYLOAD_SIZE, 4);
    e->replayed = data[AT_REPLAYED];
    return 0;
}
