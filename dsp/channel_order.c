#include "dsp/channel_order.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/rank.h"

/* NaN: heard by fewer than half. */
static double misfit(const double *heard, const double *expected, size_t n,
                     double *scratch)
{
    size_t m = 0;
    for (size_t i = 0; i < n; i++)
        if (!isnan(heard[i]))
            scratch[m++] = fabs(heard[i] - expected[i]);
    if (2 * m < n || !m)
        return NAN;
    return rank_double(scratch, m, m / 2 + 1);
}

int channel_order_find(size_t n, size_t n_others, const double *heard,
                       const double *expected, double tolerance_s,
                       struct channel_place *out)
{
    double *scratch = malloc((n_others + 1) * sizeof *scratch);
    if (!scratch)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++) {
        const double *row = heard + i * n_others;
        double own = misfit(row, expected + i * n_others, n_others, scratch);
        struct channel_place best = {i, own, own};
        for (size_t k = 0; k < n; k++) {
            double other = misfit(row, expected + k * n_others, n_others, scratch);
            if (other < best.other_s) {
                best.answers_as = k;
                best.other_s = other;
            }
        }
        out[i] = best;
        if (!(own > tolerance_s && best.other_s < 0.5 * own))
            out[i] = (struct channel_place){i, own, own};
    }
    free(scratch);
    return 0;
}
