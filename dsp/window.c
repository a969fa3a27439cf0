/* SPDX-License-Identifier: MIT */
#include "dsp/window.h"

#include <math.h>
#include <string.h>

double window_weight(enum window w, double x)
{
    if (!(x >= 0.0 && x <= 1.0))
        return 0.0;
    switch (w) {
    case WINDOW_HANN:
        return 0.5 - 0.5 * cos(2.0 * M_PI * x);
    case WINDOW_HAMMING:
        return 0.54 - 0.46 * cos(2.0 * M_PI * x);
    case WINDOW_RECTANGULAR:
        break;
    }
    return 1.0;
}

static float rise(size_t i, size_t n)
{
    return (float)(0.5 - 0.5 * cos(M_PI * ((double)i + 0.5) / (double)n));
}

void taper_ends(const float *x, size_t n, size_t head, size_t tail, float *out)
{
    head = head < n ? head : n;
    tail = tail < n ? tail : n;
    memmove(out, x, n * sizeof *out);
    for (size_t i = 0; i < head; i++)
        out[i] *= rise(i, head);
    for (size_t i = 0; i < tail; i++)
        out[n - 1 - i] *= rise(i, tail);
}
