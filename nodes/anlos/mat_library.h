/* nodes/anlos/mat_library.h -- variables of a MATLAB file by libmatio.  A damaged file
 * can make libmatio and HDF5 crash, loop and take all memory: only for a process of its
 * own (nodes/anlos/mat_file.h). */
#ifndef ANLOS_NODES_ANLOS_MAT_LIBRARY_H
#define ANLOS_NODES_ANLOS_MAT_LIBRARY_H

#include <complex.h>
#include <matio.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/complaint.h"

struct mat_library;

struct mat_variable { /* with its data */
    matvar_t *variable;
    size_t n, element_size;
    const char *re, *im; /* [n] elements of the variable's class; im NULL: real */
};

/* As nodes/anlos/mat_file.h has them. */
int mat_library_open(struct mat_library **out, const char *path, struct complaint *why);
bool mat_library_has(struct mat_library *f, const char *name);
int mat_library_extents(struct mat_library *f, const char *name, size_t rank,
                        size_t extents[], struct complaint *why);
void mat_library_close(struct mat_library *f);

/* Reads all of a variable, which stays as long as its process.  0, as
 * mat_file_read_float. */
int mat_library_load(struct mat_library *f, const char *name, size_t rank,
                     size_t extents[], bool may_be_complex, struct mat_variable *out,
                     struct complaint *why);

/* Its elements from `first` on, converted: out[n]. */
void mat_library_floats(const struct mat_variable *v, size_t first, size_t n, float *out);
void mat_library_doubles(const struct mat_variable *v, size_t first, size_t n,
                         double *out);
void mat_library_complex(const struct mat_variable *v, size_t first, size_t n,
                         float complex *out);

#endif
