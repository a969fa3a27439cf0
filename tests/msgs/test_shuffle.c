/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/array.pb-c.h"
#include "msgs/shuffle.h"
#include "msgs/tensor.h"
#include "msgs/unpack.h"

#define N 4096

/* A tensor that owns its data. */
static Anlos__Tensor own(const void *x, size_t size, Anlos__Tensor__Type type)
{
    Anlos__Tensor t = ANLOS__TENSOR__INIT;

    t.type = type;
    t.data.len = size;
    t.data.data = malloc(size ? size : 1);
    assert_non_null(t.data.data);
    if (size)
        memcpy(t.data.data, x, size);
    return t;
}

static void assert_shuffled(const float *x, size_t n, Anlos__Tensor__Type type,
                            const uint8_t *expected)
{
    Anlos__Tensor t = own(x, n * sizeof *x, ANLOS__TENSOR__TYPE__FLOAT32);

    assert_int_equal(tensor_shuffle(&t), 0);
    assert_int_equal(t.type, type);
    assert_int_equal(t.data.len, n * sizeof *x);
    if (expected)
        assert_memory_equal(t.data.data, expected, n * sizeof *x);
    assert_int_equal(tensor_unshuffle(&t), 0);
    assert_int_equal(t.type, ANLOS__TENSOR__TYPE__FLOAT32);
    assert_memory_equal(t.data.data, x, n * sizeof *x);
    free(t.data.data);
}

/* 1 is 32768 steps of 2^-15, zigzag 0x00010000; -2 is -65536, zigzag 0x0001ffff. */
static void whole_steps_have_the_bytes_on_paper(void **state)
{
    static const float x[] = {1.0f, -2.0f};
    static const uint8_t bytes[] = {0x00, 0xff, 0x00, 0xff, 0x01, 0x01, 0x00, 0x00};

    (void)state;
    assert_shuffled(x, 2, ANLOS__TENSOR__TYPE__SHUFFLED_Q15, bytes);
}

/* 0.1 / 2^20 is 0x33cccccd, a third of 2^-20 0x34aaaaab; to the left by one, the sign
 * last. */
static void other_floats_have_the_bytes_on_paper(void **state)
{
    static const float x[] = {0.1f * 0x1p-20f, -0.1f * 0x1p-20f, 1.0f / 3.0f * 0x1p-20f};
    static const uint8_t bytes[] = {0x9a, 0x9b, 0x56, 0x99, 0x99, 0x55,
                                    0x99, 0x99, 0x55, 0x67, 0x67, 0x69};

    (void)state;
    assert_shuffled(x, 3, ANLOS__TENSOR__TYPE__SHUFFLED_FLOAT32, bytes);
}

static uint32_t draw(uint32_t *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return *seed ^ *seed >> 15;
}

/* What a converter of 16, 24 or 32 bits gives (of 32, what a float holds of it). */
static void the_step_of_a_converter_is_found(void **state)
{
    static const struct {
        int bits;
        Anlos__Tensor__Type type;
    } cases[] = {{16, ANLOS__TENSOR__TYPE__SHUFFLED_Q15},
                 {24, ANLOS__TENSOR__TYPE__SHUFFLED_Q23},
                 {32, ANLOS__TENSOR__TYPE__SHUFFLED_Q31}};
    uint32_t seed = 1;
    float x[N];

    (void)state;
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        int bits = cases[k].bits;
        for (size_t i = 0; i < N; i++)
            x[i] = (float)((int32_t)draw(&seed) >> (32 - bits)) *
                   (float)ldexp(1, 1 - bits);
        x[N - 1] = (float)ldexp(1, 1 - bits); /* one step */
        x[N - 2] = -1.0f;
        assert_shuffled(x, N, cases[k].type, NULL);
    }
}

/* Any pattern: NaN with what is in it, infinite, denormal, -0. */
static void every_float_comes_back_bit_for_bit(void **state)
{
    static const uint32_t some[] = {0x7fc00001, 0xffc12345, 0x7f800000, 0xff800000,
                                    0x80000000, 0x00000001, 0x807fffff, 0x7f7fffff};
    uint32_t bits[N], seed = 7;
    float x[N];

    (void)state;
    for (size_t i = 0; i < N; i++)
        bits[i] = i < 8 ? some[i] : draw(&seed);
    memcpy(x, bits, sizeof x);
    assert_shuffled(x, N, ANLOS__TENSOR__TYPE__SHUFFLED_FLOAT32, NULL);
    for (size_t i = 0; i < 8; i++) { /* one among silence is enough */
        memset(x, 0, sizeof x);
        memcpy(&x[N / 2], &some[i], sizeof x[0]);
        assert_shuffled(x, N, ANLOS__TENSOR__TYPE__SHUFFLED_FLOAT32, NULL);
    }
}

/* A step of 2^-15 has room up to 65536, one of 2^-31 up to 1: what is larger has none. */
static void what_is_too_large_for_its_step_is_no_whole_number(void **state)
{
    static const struct {
        float x[2];
        Anlos__Tensor__Type type;
    } cases[] = {
        {{65535.0f, 0x1p-15f}, ANLOS__TENSOR__TYPE__SHUFFLED_Q15},
        {{-65536.0f, 0x1p-15f}, ANLOS__TENSOR__TYPE__SHUFFLED_Q15},
        {{65536.0f, 0x1p-15f}, ANLOS__TENSOR__TYPE__SHUFFLED_FLOAT32},
        {{-1.0f, 0x1p-31f}, ANLOS__TENSOR__TYPE__SHUFFLED_Q31},
        {{1.0f, 0x1p-31f}, ANLOS__TENSOR__TYPE__SHUFFLED_FLOAT32},
        {{0x1p-32f, 0.0f}, ANLOS__TENSOR__TYPE__SHUFFLED_FLOAT32},
    };

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        assert_shuffled(cases[i].x, 2, cases[i].type, NULL);
}

static void what_is_not_float32_is_left_alone(void **state)
{
    static const uint8_t some[8] = {1, 2, 3, 4, 5, 6, 7, 8};
    static const struct {
        Anlos__Tensor__Type type;
        size_t size;
    } cases[] = {{ANLOS__TENSOR__TYPE__COMPLEX64, 8},
                 {ANLOS__TENSOR__TYPE__NONE, 8},
                 {ANLOS__TENSOR__TYPE__FLOAT32, 0},
                 {ANLOS__TENSOR__TYPE__FLOAT32, 7},
                 {ANLOS__TENSOR__TYPE__SHUFFLED_Q23, 7},
                 {ANLOS__TENSOR__TYPE__SHUFFLED_Q23, 0},
                 {(Anlos__Tensor__Type)99, 8}};

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        Anlos__Tensor t = own(some, cases[i].size, cases[i].type);
        assert_int_equal(tensor_shuffle(&t), 0);
        assert_int_equal(tensor_unshuffle(&t), 0);
        assert_int_equal(t.type, cases[i].type);
        assert_int_equal(t.data.len, cases[i].size);
        assert_memory_equal(t.data.data, some, cases[i].size);
        free(t.data.data);
    }
}

static struct bytes_buffer ping_of(const float *x, size_t n)
{
    Anlos__Ping p = ANLOS__PING__INIT;
    struct tensor_view view;
    struct bytes_buffer out = {0};

    p.scan = 3;
    p.temperature_c = 21.5;
    p.samples = tensor_borrow_f32(&view, x, 2, (size_t)1, n);
    assert_int_equal(bytes_reserve(&out, anlos__ping__get_packed_size(&p)), 0);
    out.size = anlos__ping__pack(&p, out.data);
    return out;
}

static void a_message_is_float32_again_when_it_is_unpacked(void **state)
{
    struct bytes_buffer plain, shuffled = {0}, back = {0};
    const ProtobufCMessageDescriptor *schema = &anlos__ping__descriptor;
    size_t extents[2];
    float x[N];

    (void)state;
    for (size_t i = 0; i < N; i++)
        x[i] = sinf(0.1f * (float)i);
    plain = ping_of(x, N);
    assert_int_equal(payload_shuffle(&shuffled, schema, bytes_in(&plain), true), 0);
    assert_int_equal(shuffled.size, plain.size);
    assert_memory_not_equal(shuffled.data, plain.data, plain.size);

    /* A reader of before finds a type that it does not know, and no samples. */
    Anlos__Ping *p = anlos__ping__unpack(NULL, shuffled.size, shuffled.data);
    assert_null(tensor_f32(p->samples, 2, extents));
    anlos__ping__free_unpacked(p, NULL);

    p = (Anlos__Ping *)message_unpack(schema, shuffled.size, shuffled.data);
    assert_non_null(p);
    const float *samples = tensor_f32(p->samples, 2, extents);
    assert_non_null(samples);
    assert_memory_equal(samples, x, sizeof x);
    assert_int_equal(p->scan, 3);
    anlos__ping__free_unpacked(p, NULL);

    assert_int_equal(payload_shuffle(&back, schema, bytes_in(&shuffled), false), 0);
    assert_int_equal(back.size, plain.size);
    assert_memory_equal(back.data, plain.data, plain.size);
    assert_int_equal(payload_shuffle(&back, schema, bytes_in(&shuffled), true), 0);
    assert_memory_equal(back.data, shuffled.data, shuffled.size);
    assert_int_equal(payload_shuffle(&back, schema, (struct bytes){plain.data, 5}, true),
                     -EINVAL);
    bytes_free(&plain);
    bytes_free(&shuffled);
    bytes_free(&back);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(whole_steps_have_the_bytes_on_paper),
        cmocka_unit_test(other_floats_have_the_bytes_on_paper),
        cmocka_unit_test(the_step_of_a_converter_is_found),
        cmocka_unit_test(every_float_comes_back_bit_for_bit),
        cmocka_unit_test(what_is_too_large_for_its_step_is_no_whole_number),
        cmocka_unit_test(what_is_not_float32_is_left_alone),
        cmocka_unit_test(a_message_is_float32_again_when_it_is_unpacked),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
