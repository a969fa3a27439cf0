#include "recon/inverse/iterative.h"

#include "dsp/vector.h"

VECTOR_CLONES
static void smear_rows(size_t n, const float *restrict before, const float *restrict at,
                       const float *restrict after, float *restrict out)
{
    for (size_t i = 0; i < n; i++)
        out[i] = 0.75f * at[i] + 0.125f * (before[i] + after[i]);
}

/* Along an axis of n voxels that lie `stride` apart; periodic, as the blur is. */
static void smear(size_t size, size_t n, size_t stride, const float *in, float *out)
{
    for (size_t block = 0; block < size; block += n * stride)
        for (size_t k = 0; k < n; k++)
            smear_rows(stride, in + block + (k + n - 1) % n * stride,
                       in + block + k * stride, in + block + (k + 1) % n * stride,
                       out + block + k * stride);
}

void iterative_beam(const size_t n[3], float *restrict x, float *restrict spare)
{
    size_t plane = n[0] * n[1], size = plane * n[2];
    smear(size, n[0], 1, x, spare);
    smear(size, n[1], n[0], spare, x);
    smear(size, n[2], plane, x, spare);
    for (size_t i = 0; i < size; i++)
        x[i] = spare[i];
}
