/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "msgs/tensor.h"

/* Over the wire: what arrives lives in memory of its own. */
static Anlos__Tensor *send(const Anlos__Tensor *t)
{
    size_t size = anlos__tensor__get_packed_size(t);
    uint8_t *bytes = malloc(size);
    assert_non_null(bytes);
    assert_int_equal(anlos__tensor__pack(t, bytes), size);
    Anlos__Tensor *back = anlos__tensor__unpack(NULL, size, bytes);
    free(bytes);
    assert_non_null(back);
    return back;
}

static void floats_arrive_as_they_were(void **state)
{
    (void)state;
    const float x[2][3] = {{1, -2.5f, 1e-30f}, {0, -0.0f, 3e38f}};
    struct tensor_view view;
    size_t extents[2];
    Anlos__Tensor *t = send(tensor_borrow_f32(&view, &x[0][0], 2, (size_t)2, (size_t)3));
    const float *y = tensor_f32(t, 2, extents);
    assert_non_null(y);
    assert_int_equal(extents[0], 2);
    assert_int_equal(extents[1], 3);
    assert_memory_equal(x, y, sizeof x);
    anlos__tensor__free_unpacked(t, NULL);
}

static void complex_numbers_arrive_as_they_were(void **state)
{
    (void)state;
    const float complex x[4] = {1 + 2 * I, -3 * I, 4, -5 + 6 * I};
    struct tensor_view view;
    size_t extents[3];
    Anlos__Tensor *t =
        send(tensor_borrow_c64(&view, x, 3, (size_t)1, (size_t)4, (size_t)1));
    const float complex *y = tensor_c64(t, 3, extents);
    assert_non_null(y);
    assert_int_equal(extents[0], 1);
    assert_int_equal(extents[1], 4);
    assert_int_equal(extents[2], 1);
    assert_memory_equal(x, y, sizeof x);
    anlos__tensor__free_unpacked(t, NULL);
}

/* Little endian float32, as IEEE 754 writes 1.0 and -2.0. */
static void the_bytes_are_little_endian(void **state)
{
    (void)state;
    const uint8_t expected[] = {0, 0, 0x80, 0x3f, 0, 0, 0, 0xc0};
    const float x[2] = {1, -2};
    struct tensor_view view;
    const Anlos__Tensor *t = tensor_borrow_f32(&view, x, 1, (size_t)2);
    assert_int_equal(t->data.len, sizeof expected);
    assert_memory_equal(t->data.data, expected, sizeof expected);
}

static void borrowing_copies_nothing(void **state)
{
    (void)state;
    const float x[1] = {1};
    struct tensor_view view;
    assert_ptr_equal(tensor_borrow_f32(&view, x, 1, (size_t)1)->data.data, x);
}

static void a_tensor_of_another_kind_is_not_read(void **state)
{
    (void)state;
    const float x[6] = {0};
    struct tensor_view view;
    size_t extents[3];
    Anlos__Tensor *t = tensor_borrow_f32(&view, x, 2, (size_t)2, (size_t)3);
    assert_non_null(tensor_f32(t, 2, extents));
    assert_null(tensor_f32(NULL, 2, extents));
    assert_null(tensor_c64(t, 2, extents));
    assert_null(tensor_f32(t, 1, extents));
    assert_null(tensor_f32(t, 3, extents));
    assert_null(tensor_f32(t, 0, extents));
    t->type = ANLOS__TENSOR__TYPE__NONE;
    assert_null(tensor_f32(t, 2, extents));
    t->type = (Anlos__Tensor__Type)99;
    assert_null(tensor_f32(t, 2, extents));
}

static void data_that_is_not_of_the_shape_is_not_read(void **state)
{
    (void)state;
    const float x[7] = {0};
    struct tensor_view view;
    size_t extents[3];
    Anlos__Tensor *t = tensor_borrow_f32(&view, x, 2, (size_t)2, (size_t)3);
    for (size_t size = 0; size <= sizeof x; size++) {
        t->data.len = size;
        assert_true((tensor_f32(t, 2, extents) != NULL) == (size == 6 * sizeof *x));
    }
    t->data.len = 0;
    t->shape[1] = 0;
    assert_null(tensor_f32(t, 2, extents));
}

/* 2^31 * 2^31 * 4 elements of 4 bytes are 2^66 bytes: 0 when the product wraps. */
static void a_shape_whose_size_wraps_around_is_not_read(void **state)
{
    (void)state;
    const float x[1] = {0};
    struct tensor_view view;
    size_t extents[3];
    Anlos__Tensor *t = tensor_borrow_f32(&view, x, 3, (size_t)1, (size_t)1, (size_t)1);
    t->shape[0] = t->shape[1] = UINT32_C(1) << 31;
    t->shape[2] = 4;
    t->data.len = 0;
    assert_null(tensor_f32(t, 3, extents));
}

static void what_does_not_fit_a_tensor_is_empty(void **state)
{
    (void)state;
    const float x[1] = {0};
    struct tensor_view view;
    const Anlos__Tensor *t =
        tensor_borrow_f32(&view, x, 4, (size_t)1, (size_t)1, (size_t)1, (size_t)1);
    assert_int_equal(t->type, ANLOS__TENSOR__TYPE__NONE);
    assert_int_equal(t->n_shape, 0);
    t = tensor_borrow_f32(&view, x, 1, (size_t)UINT32_MAX + 1);
    assert_int_equal(t->type, ANLOS__TENSOR__TYPE__NONE);
    assert_int_equal(t->data.len, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(floats_arrive_as_they_were),
        cmocka_unit_test(complex_numbers_arrive_as_they_were),
        cmocka_unit_test(the_bytes_are_little_endian),
        cmocka_unit_test(borrowing_copies_nothing),
        cmocka_unit_test(a_tensor_of_another_kind_is_not_read),
        cmocka_unit_test(data_that_is_not_of_the_shape_is_not_read),
        cmocka_unit_test(a_shape_whose_size_wraps_around_is_not_read),
        cmocka_unit_test(what_does_not_fit_a_tensor_is_empty),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
