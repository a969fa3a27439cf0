/* dsp/window.h -- weights over a band or a slot. */
#ifndef ANLOS_DSP_WINDOW_H
#define ANLOS_DSP_WINDOW_H

enum window { WINDOW_RECTANGULAR, WINDOW_HANN, WINDOW_HAMMING };

/* Weight at x in 0..1 across the extent, 1 at most; 0 outside of it. */
double window_weight(enum window w, double x);

#endif
