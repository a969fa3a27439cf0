/* SPDX-License-Identifier: MIT */
#include "msgs/shuffle.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/unpack.h"

static const struct {
    Anlos__Tensor__Type type;
    float steps; /* in 1.0 */
} whole[] = {{ANLOS__TENSOR__TYPE__SHUFFLED_Q15, 0x1p15f},
             {ANLOS__TENSOR__TYPE__SHUFFLED_Q23, 0x1p23f},
             {ANLOS__TENSOR__TYPE__SHUFFLED_Q31, 0x1p31f}};
#define N_WHOLE (sizeof whole / sizeof *whole)

static uint32_t bits_of(float x)
{
    uint32_t bits;

    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static float float_of(uint32_t bits)
{
    float x;

    memcpy(&x, &bits, sizeof x);
    return x;
}

/* -0 is none of a converter, and NaN and what is too large are no integers. */
static bool is_whole(float x, float steps)
{
    float y = x * steps;

    return y >= -0x1p31f && y < 0x1p31f && (float)(int32_t)y == y &&
           bits_of(x) != UINT32_C(0x80000000);
}

static bool are_whole(const float *x, size_t n, float steps)
{
    bool are = true;

    for (size_t i = 0; i < n && are; i += 64) { /* at once, but not all for nothing */
        for (size_t k = i; k < i + 64 && k < n; k++)
            are &= is_whole(x[k], steps);
    }
    return are;
}

/* The coarsest step of which all are whole numbers; N_WHOLE: none. */
static size_t find_step(const float *x, size_t n)
{
    size_t k = 0;

    while (k < N_WHOLE && !are_whole(x, n, whole[k].steps))
        k++;
    return k;
}

static uint32_t zigzag(int32_t v)
{
    return (uint32_t)v << 1 ^ (v < 0 ? UINT32_MAX : 0);
}

static int32_t unzigzag(uint32_t u)
{
    return (int32_t)(u >> 1 ^ (u & 1 ? UINT32_MAX : 0));
}

static void put(uint8_t *out, size_t n, size_t i, uint32_t u)
{
    for (size_t byte = 0; byte < 4; byte++)
        out[byte * n + i] = (uint8_t)(u >> 8 * byte);
}

static uint32_t take(const uint8_t *in, size_t n, size_t i)
{
    uint32_t u = 0;

    for (size_t byte = 0; byte < 4; byte++)
        u |= (uint32_t)in[byte * n + i] << 8 * byte;
    return u;
}

static void replace(Anlos__Tensor *t, Anlos__Tensor__Type type, uint8_t *data)
{
    free(t->data.data);
    t->data.data = data;
    t->type = type;
}

int tensor_shuffle(Anlos__Tensor *t)
{
    size_t n = t->data.len / 4;

    if (t->type != ANLOS__TENSOR__TYPE__FLOAT32 || !n || t->data.len % 4)
        return 0;
    uint8_t *out = malloc(t->data.len);
    if (!out)
        return -ENOMEM;
    const float *x = (const float *)(const void *)t->data.data;
    size_t k = find_step(x, n);
    if (k < N_WHOLE) {
        for (size_t i = 0; i < n; i++)
            put(out, n, i, zigzag((int32_t)(x[i] * whole[k].steps)));
    } else {
        for (size_t i = 0; i < n; i++)
            put(out, n, i, bits_of(x[i]) << 1 | bits_of(x[i]) >> 31);
    }
    replace(t, k < N_WHOLE ? whole[k].type : ANLOS__TENSOR__TYPE__SHUFFLED_FLOAT32, out);
    return 0;
}

/* Of a tensor's type; N_WHOLE: it is of none. */
static size_t step_of(const Anlos__Tensor *t)
{
    size_t k = 0;

    while (k < N_WHOLE && t->type != whole[k].type)
        k++;
    return k;
}

static int is_shuffled(Anlos__Tensor *t)
{
    return step_of(t) < N_WHOLE || t->type == ANLOS__TENSOR__TYPE__SHUFFLED_FLOAT32;
}

int tensor_unshuffle(Anlos__Tensor *t)
{
    size_t n = t->data.len / 4, k = step_of(t);

    if (!is_shuffled(t) || !n || t->data.len % 4)
        return 0;
    uint8_t *out = malloc(t->data.len);
    if (!out)
        return -ENOMEM;
    float *x = (float *)(void *)out;
    const uint8_t *in = t->data.data;
    if (k < N_WHOLE) {
        for (size_t i = 0; i < n; i++)
            x[i] = (float)unzigzag(take(in, n, i)) * (1.0f / whole[k].steps);
    } else {
        for (size_t i = 0; i < n; i++)
            x[i] = float_of(take(in, n, i) >> 1 | take(in, n, i) << 31);
    }
    replace(t, ANLOS__TENSOR__TYPE__FLOAT32, out);
    return 0;
}

static int each_tensor(ProtobufCMessage *m, int (*change)(Anlos__Tensor *t))
{
    const ProtobufCMessageDescriptor *d = m->descriptor;
    int err = 0;

    for (unsigned i = 0; i < d->n_fields && !err; i++) {
        const ProtobufCFieldDescriptor *f = &d->fields[i];
        if (f->type != PROTOBUF_C_TYPE_MESSAGE || f->label == PROTOBUF_C_LABEL_REPEATED ||
            f->descriptor != &anlos__tensor__descriptor)
            continue;
        Anlos__Tensor *t;
        memcpy(&t, (const char *)m + f->offset, sizeof t);
        if (t)
            err = change(t);
    }
    return err;
}

static int message_shuffle(ProtobufCMessage *m)
{
    return each_tensor(m, tensor_shuffle);
}

int message_unshuffle(ProtobufCMessage *m)
{
    return each_tensor(m, tensor_unshuffle);
}

bool message_is_shuffled(ProtobufCMessage *m)
{
    return each_tensor(m, is_shuffled) != 0;
}

int payload_shuffle(struct bytes_buffer *out, const ProtobufCMessageDescriptor *schema,
                    struct bytes payload, bool shuffled)
{
    ProtobufCMessage *m = message_unpack(schema, payload.size, payload.data);
    int err = m ? 0 : errno == ENOMEM ? -ENOMEM : -EINVAL;

    if (m && shuffled)
        err = message_shuffle(m);
    if (!err)
        err = bytes_reserve(out, protobuf_c_message_get_packed_size(m));
    if (!err)
        out->size = protobuf_c_message_pack(m, out->data);
    if (m)
        protobuf_c_message_free_unpacked(m, NULL);
    return err;
}
