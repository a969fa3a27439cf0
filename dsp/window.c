#include "dsp/window.h"

#include <math.h>

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
