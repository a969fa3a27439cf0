/* dsp/chirp.h -- the linear FM replica (Lindell 2019, Eq. 5). */
#ifndef ANLOS_DSP_CHIRP_H
#define ANLOS_DSP_CHIRP_H

#include <stdbool.h>
#include <stddef.h>

struct chirp {
    double start_hz, stop_hz;
    double duration_s;
    bool sine; /* else it starts as a cosine */
};

/* Samples of one chirp at a rate, to the nearest. */
size_t chirp_length(const struct chirp *c, double sample_rate_hz);

/* Phase at a time after the start, in rad; a real chirp is the cosine of it. */
double chirp_phase_rad(const struct chirp *c, double t_s);

/* out[chirp_length]: amplitude 1; phase kept in double. */
void chirp_generate(const struct chirp *c, double sample_rate_hz, float *out);

#endif
