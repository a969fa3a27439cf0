/* nodes/anlos/mat_process.h -- MATLAB files are read in a child process with bounded time
 * and memory, one for each question: libmatio and HDF5 do not withstand damaged files,
 * and what becomes of them there is an error here. */
#ifndef ANLOS_NODES_ANLOS_MAT_PROCESS_H
#define ANLOS_NODES_ANLOS_MAT_PROCESS_H

#include <stddef.h>

#include "dsp/complaint.h"

enum mat_what { MAT_OPEN, MAT_HAS, MAT_EXTENTS, MAT_FLOATS, MAT_DOUBLES, MAT_COMPLEX };

struct mat_question {
    const char *path;
    enum mat_what what;
    const char *name; /* of a variable; not with MAT_OPEN */
    size_t rank;      /* of its extents */
};

/* extents[rank] are written from MAT_EXTENTS on, *data from MAT_FLOATS on: free() it.
 * 0, -ENOENT (no such variable) and other errno of reading, -EINVAL (what is in the file
 * does not suit), -EFBIG, -EIO (truncated, or damaged so that it cannot be read),
 * -ENOMEM, and errors of fork(2) and pipe(2). */
int mat_process_ask(const struct mat_question *q, size_t extents[], void **data,
                    struct complaint *why);

#endif
