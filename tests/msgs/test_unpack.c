/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "msgs/survey.pb-c.h"
#include "msgs/unpack.h"
#include "msgs/volume.pb-c.h"
#include "tests/msgs/memory_limit.h"

#define MB ((size_t)1 << 20)

/* size bytes of one field again and again. */
static uint8_t *repeat(const char *field, size_t field_size, size_t size)
{
    uint8_t *out = malloc(size);

    assert_non_null(out);
    for (size_t at = 0; at < size; at += field_size)
        memcpy(out + at, field, at + field_size > size ? size - at : field_size);
    return out;
}

static void assert_refused(const ProtobufCMessageDescriptor *schema, const char *field,
                           size_t field_size, size_t size)
{
    uint8_t *bytes = repeat(field, field_size, size);

    assert_null(message_unpack(schema, size, bytes));
    free(bytes);
}

/* With so little memory that the attempt would fail otherwise, and the test with it. */
static void what_would_fill_the_memory_is_refused(void **state)
{
    (void)state;
    /* Field 100, which nobody knows, with a byte of content. */
    assert_refused(&anlos__volume__descriptor, "\xa0\x06\0", 3, 48 * MB);
    /* A number that is there once is sent millions of times. */
    assert_refused(&anlos__volume__descriptor, "\x08\x01", 2, 48 * MB);
    /* Empty submessages in a list: 12 is speakers_m. */
    assert_refused(&anlos__survey__descriptor, "\x62\0", 2, 15 * MB);
}

static void a_large_message_of_few_fields_is_unpacked(void **state)
{
    (void)state;
    const size_t n = 48 * MB;
    float *voxels = calloc(n / 4, 4);
    Anlos__Tensor tensor = ANLOS__TENSOR__INIT;
    Anlos__Volume volume = ANLOS__VOLUME__INIT;

    tensor.data.data = (uint8_t *)voxels;
    tensor.data.len = n;
    volume.intensity = &tensor;
    size_t size = anlos__volume__get_packed_size(&volume);
    uint8_t *bytes = malloc(size);
    anlos__volume__pack(&volume, bytes);
    free(voxels);
    Anlos__Volume *out =
        (Anlos__Volume *)message_unpack(&anlos__volume__descriptor, size, bytes);
    assert_non_null(out);
    assert_int_equal(out->intensity->data.len, n);
    anlos__volume__free_unpacked(out, NULL);
    free(bytes);
}

/* As many as a survey may have, all at the origin: each is 2 bytes then. */
static void a_list_as_long_as_surveys_have_is_unpacked(void **state)
{
    (void)state;
    uint8_t *bytes = repeat("\x62\0", 2, 2 * 4096);
    Anlos__Survey *out =
        (Anlos__Survey *)message_unpack(&anlos__survey__descriptor, 2 * 4096, bytes);

    assert_non_null(out);
    assert_int_equal(out->n_speakers_m, 4096);
    anlos__survey__free_unpacked(out, NULL);
    free(bytes);
}

static void what_is_not_of_the_format_is_refused(void **state)
{
    static const struct {
        const char *bytes;
        size_t size;
    } wrong[] = {
        {"\x01\0\0\0\0\0\0\0\0", 9},                              /* field 0 */
        {"\x0b", 1},                                              /* a group */
        {"\x08", 1},                                              /* no number */
        {"\x08\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01", 12}, /* one without an end */
        {"\x22\xff\xff\xff\xff\xff\xff\xff\xff\x7f", 10},         /* a length of 2^63 */
        {"\x22\x05\x08\x01", 4},                                  /* cut */
        {"\x22\x02\x08\x80", 4},                                  /* cut inside */
    };

    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        assert_null(message_unpack(&anlos__volume__descriptor, wrong[i].size,
                                   (const uint8_t *)wrong[i].bytes));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_would_fill_the_memory_is_refused),
        cmocka_unit_test(a_large_message_of_few_fields_is_unpacked),
        cmocka_unit_test(a_list_as_long_as_surveys_have_is_unpacked),
        cmocka_unit_test(what_is_not_of_the_format_is_refused),
    };
    if (memory_limit(512 * MB))
        return 1;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
