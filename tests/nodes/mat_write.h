/* SPDX-License-Identifier: MIT */
/* tests/nodes/mat_write.h -- writes MATLAB files for tests, with libmatio itself. */
#ifndef ANLOS_TESTS_NODES_MAT_WRITE_H
#define ANLOS_TESTS_NODES_MAT_WRITE_H

#include <matio.h>
#include <stddef.h>

/* Real data [rows][columns] in MATLAB's order; or, with im, complex. */
static inline void mat_put(mat_t *mat, const char *name, enum matio_classes class,
                           size_t rows, size_t columns, void *re, void *im)
{
    static const enum matio_types types[] = {
        [MAT_C_DOUBLE] = MAT_T_DOUBLE, [MAT_C_SINGLE] = MAT_T_SINGLE,
        [MAT_C_INT8] = MAT_T_INT8,     [MAT_C_UINT8] = MAT_T_UINT8,
        [MAT_C_INT16] = MAT_T_INT16,   [MAT_C_UINT16] = MAT_T_UINT16,
        [MAT_C_INT32] = MAT_T_INT32,   [MAT_C_UINT32] = MAT_T_UINT32,
        [MAT_C_INT64] = MAT_T_INT64,   [MAT_C_UINT64] = MAT_T_UINT64};
    size_t dims[2] = {rows, columns};
    mat_complex_split_t split = {re, im};
    matvar_t *v = Mat_VarCreate(name, class, types[class], 2, dims, im ? &split : re,
                                im ? MAT_F_COMPLEX : 0);
    assert_non_null(v);
    assert_int_equal(Mat_VarWrite(mat, v, MAT_COMPRESSION_ZLIB), 0);
    Mat_VarFree(v);
}

static inline void mat_put_number(mat_t *mat, const char *name, double value)
{
    mat_put(mat, name, MAT_C_DOUBLE, 1, 1, &value, NULL);
}

#endif
