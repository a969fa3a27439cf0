/* SPDX-License-Identifier: MIT */
/* msgs/envelope.h -- the fixed header in front of every message on the bus.  It says who
 * sent it, which one of the sender's it is, and when the sound in it was taken; loss is
 * counted from it.  Little endian, 96 bytes; the topic comes first because nanomsg
 * filters on a message's first bytes.
 *
 *   0 topic[24]   24 magic u32   28 version u32   32 node[16]   48 epoch_ns i64
 *  56 sequence u64   64 capture_ns i64   72 publish_ns i64   80 payload_size u32
 *  84 replayed u8, 0 or 1   85 eleven zeros   96 payload */
#ifndef ANLOS_MSGS_ENVELOPE_H
#define ANLOS_MSGS_ENVELOPE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define ENVELOPE_SIZE       96
#define ENVELOPE_TOPIC_SIZE 24 /* name, zero padded, at least one zero */
#define ENVELOPE_NODE_SIZE  16
#define ENVELOPE_MAGIC      0x534f4c4eu /* "NLOS" */
#define ENVELOPE_VERSION    1
#define ENVELOPE_MAX_STAMP                                                               \
    (INT64_C(1) << 62) /* ns: year 2116; from 0: differences hold */

struct envelope {
    char topic[ENVELOPE_TOPIC_SIZE];
    char node[ENVELOPE_NODE_SIZE]; /* who published */
    int64_t epoch_ns;              /* when that process started: a restart is not a gap */
    uint64_t sequence;             /* of this topic from this process, from 0 */
    int64_t capture_ns;            /* when the sound was taken; 0: not of any sound */
    int64_t publish_ns;
    uint32_t payload_size;
    bool replayed; /* of a recording, or made from it: its times are not those of now */
};

/* What can be wrong with a message, in the order in which it is looked for. */
enum envelope_fault {
    ENVELOPE_SOUND,
    ENVELOPE_SHORT,   /* ends within the header */
    ENVELOPE_FOREIGN, /* magic */
    ENVELOPE_OTHER_VERSION,
    ENVELOPE_GARBLED, /* a name without an end or empty, a stamp that is none, or what has
                       * to be zero is not */
    ENVELOPE_LENGTH,  /* payload_size is not what follows */
    ENVELOPE_TOO_LARGE,
};

/* out[ENVELOPE_SIZE].  Names that are too long are cut. */
void envelope_pack(const struct envelope *e, uint8_t *out);

/* data[size] is a whole message. */
enum envelope_fault envelope_inspect(const uint8_t *data, size_t size,
                                     size_t max_payload);

/* 0, -EPROTO (magic, version, garbled) or -EMSGSIZE (short, length, too large); *e is
 * written only with 0. */
int envelope_unpack(struct envelope *e, const uint8_t *data, size_t size,
                    size_t max_payload);

#endif
