/* SPDX-License-Identifier: MIT */
/* Bytes as a whole message of the bus, and as the content of one of each topic: unpacked,
 * printed, packed again, shuffled and back. */
#include <stdlib.h>
#include <string.h>

#include "msgs/bus.h"
#include "msgs/convert.h"
#include "msgs/shuffle.h"
#include "nodes/anlos/topic/message_json.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/messages.h"

static void try_envelope(const uint8_t *data, size_t size)
{
    uint8_t again[ENVELOPE_SIZE];
    struct envelope e;

    if (envelope_unpack(&e, data, size, 1 << 20))
        return;
    envelope_pack(&e, again);
    FUZZ_REQUIRE(!memcmp(again, data, ENVELOPE_SIZE));
}

static void try_survey(Anlos__Survey *m)
{
    struct survey s;

    if (!messages_survey(&s, m))
        survey_clear(&s);
}

static void print(const ProtobufCMessage *m, bool full)
{
    json_t *json = message_json(m, full);
    char *text = json ? json_dumps(json, 0) : NULL;

    FUZZ_REQUIRE(text);
    free(text);
    json_decref(json);
}

/* The second time it is the same: what is packed is unpacked to itself. */
static void pack_again(const ProtobufCMessage *m)
{
    size_t size = protobuf_c_message_get_packed_size(m);
    uint8_t *bytes = malloc(2 * size + 1);

    FUZZ_REQUIRE(bytes && protobuf_c_message_pack(m, bytes) == size);
    ProtobufCMessage *again = protobuf_c_message_unpack(m->descriptor, NULL, size, bytes);
    FUZZ_REQUIRE(again && protobuf_c_message_get_packed_size(again) == size);
    protobuf_c_message_pack(again, bytes + size);
    FUZZ_REQUIRE(!memcmp(bytes, bytes + size, size));
    protobuf_c_message_free_unpacked(again, NULL);
    free(bytes);
}

/* Of what is packed as we do it nothing is lost, whatever its tensors are. */
static void shuffle_and_back(const ProtobufCMessage *m)
{
    size_t size = protobuf_c_message_get_packed_size(m);
    struct bytes_buffer plain = {0}, shuffled = {0}, back = {0};

    FUZZ_REQUIRE(!bytes_reserve(&plain, size + 1));
    plain.size = protobuf_c_message_pack(m, plain.data);
    FUZZ_REQUIRE(!payload_shuffle(&shuffled, m->descriptor, bytes_in(&plain), true));
    FUZZ_REQUIRE(!payload_shuffle(&back, m->descriptor, bytes_in(&shuffled), false));
    FUZZ_REQUIRE(shuffled.size == plain.size &&
                 bytes_equal(bytes_in(&back), bytes_in(&plain)));
    bytes_free(&plain);
    bytes_free(&shuffled);
    bytes_free(&back);
}

static void try_payload(const struct topic *t, struct bytes payload)
{
    const struct bus_message message = {.topic = t,
                                        .envelope.payload_size = (uint32_t)payload.size,
                                        .payload = payload.data};
    ProtobufCMessage *m = bus_message_unpack(&message);
    struct grid grid;

    if (!m)
        return;
    print(m, false);
    print(m, true);
    pack_again(m);
    shuffle_and_back(m);
    if (t == topic_survey())
        try_survey((Anlos__Survey *)m);
    if (t == topic_volume())
        volume_grid((Anlos__Volume *)m, &grid);
    protobuf_c_message_free_unpacked(m, NULL);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct bytes input = {data, size}, payload;
    const struct topic *topic;

    try_envelope(data, size);
    while (messages_next(&input, &topic, &payload))
        try_payload(topic, payload);
    return 0;
}
