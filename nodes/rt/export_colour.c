/* SPDX-License-Identifier: MIT */
#include "nodes/rt/export_colour.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/rank.h"

#define STANDS_OUT_DB 30.0
#define MOST_SAMPLES  65536 /* that a median is of */

static const double inferno[7][3] = {
    {0.0002189403691192265, 0.001651004631001012, -0.01948089843709184},
    {0.1065134194856116, 0.5639564367884091, 3.932712388889277},
    {11.60249308247187, -3.972853965665698, -15.9423941062914},
    {-41.70399613139459, 17.43639888205313, 44.35414519872813},
    {77.162935699427, -33.40235894210092, -81.80730925738993},
    {-71.31942824499214, 32.62606426397723, 73.20951985803202},
    {25.13112622477341, -12.24266895238567, -23.07032500287172},
};

void colour_at(double t, double rgb[3])
{
    t = fmin(fmax(t, 0.0), 1.0);
    for (int c = 0; c < 3; c++) {
        double v = 0.0;
        for (int k = 6; k >= 0; k--)
            v = v * t + inferno[k][c];
        rgb[c] = fmin(fmax(v, 0.0), 1.0);
    }
}

int colour_full_scale(double *out, double *noise, const float *intensity, size_t n,
                      double brightest)
{
    size_t step = n / MOST_SAMPLES + 1, taken = 0, kept = 0;
    float *list = malloc((n / step + 1) * sizeof *list);

    if (!list)
        return -ENOMEM;
    for (size_t i = 0; i < n; i += step, taken++)
        if (intensity[i] > 0.0f && isfinite(intensity[i]))
            list[kept++] = intensity[i];
    double median = 2 * kept > taken ? (double)rank_smallest(list, kept, kept / 2 + 1)
                                     : 0.0;
    free(list);
    if (noise)
        *noise = median;
    *out = fmax(brightest, median * pow(10.0, 0.1 * STANDS_OUT_DB));
    return 0;
}
