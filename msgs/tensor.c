/* SPDX-License-Identifier: MIT */
#include "msgs/tensor.h"

#include <stdarg.h>
#include <stdbool.h>

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "a Tensor is little endian and borrowed as it is: this machine would have to swap"
#endif

_Static_assert(sizeof(float) == 4 && sizeof(float complex) == 8, "Tensor element sizes");

static Anlos__Tensor *borrow(struct tensor_view *v, Anlos__Tensor__Type type,
                             size_t element_size, const void *x, int n_dims, va_list dims)
{
    anlos__tensor__init(&v->message);
    bool fits = n_dims >= 1 && n_dims <= TENSOR_MAX_DIMS;
    size_t size = element_size;
    for (int i = 0; fits && i < n_dims; i++) {
        size_t extent = va_arg(dims, size_t);
        v->shape[i] = (uint32_t)extent;
        fits = extent <= UINT32_MAX && !__builtin_mul_overflow(size, extent, &size);
    }
    if (!fits) /* type NONE: whoever receives it refuses it */
        return &v->message;
    v->message.type = type;
    v->message.n_shape = (size_t)n_dims;
    v->message.shape = v->shape;
    v->message.data.len = size;
    v->message.data.data = (uint8_t *)(uintptr_t)x; /* packing only reads */
    return &v->message;
}

Anlos__Tensor *tensor_borrow_f32(struct tensor_view *v, const float *x, int n_dims, ...)
{
    va_list dims;
    va_start(dims, n_dims);
    Anlos__Tensor *t = borrow(v, ANLOS__TENSOR__TYPE__FLOAT32, 4, x, n_dims, dims);
    va_end(dims);
    return t;
}

Anlos__Tensor *tensor_borrow_c64(struct tensor_view *v, const float complex *x,
                                 int n_dims, ...)
{
    va_list dims;
    va_start(dims, n_dims);
    Anlos__Tensor *t = borrow(v, ANLOS__TENSOR__TYPE__COMPLEX64, 8, x, n_dims, dims);
    va_end(dims);
    return t;
}

static bool holds(const Anlos__Tensor *t, Anlos__Tensor__Type type, size_t element_size,
                  int n_dims, size_t *extents)
{
    if (!t || t->type != type || n_dims < 1 || t->n_shape != (size_t)n_dims)
        return false;
    size_t size = element_size;
    for (int i = 0; i < n_dims; i++) {
        extents[i] = t->shape[i];
        if (!extents[i] || __builtin_mul_overflow(size, extents[i], &size))
            return false;
    }
    return t->data.data && t->data.len == size &&
           (uintptr_t)t->data.data % _Alignof(float) == 0;
}

const float *tensor_f32(const Anlos__Tensor *t, int n_dims, size_t *extents)
{
    if (!holds(t, ANLOS__TENSOR__TYPE__FLOAT32, sizeof(float), n_dims, extents))
        return NULL;
    return (const float *)(const void *)t->data.data;
}

const float complex *tensor_c64(const Anlos__Tensor *t, int n_dims, size_t *extents)
{
    if (!holds(t, ANLOS__TENSOR__TYPE__COMPLEX64, sizeof(float complex), n_dims, extents))
        return NULL;
    return (const float complex *)(const void *)t->data.data;
}
