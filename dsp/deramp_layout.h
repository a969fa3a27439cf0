/* dsp/deramp_layout.h -- what of a ping is deramped, in which steps of time, beat and
 * delay, and how an echo is weighted on its way. */
#ifndef ANLOS_DSP_DERAMP_LAYOUT_H
#define ANLOS_DSP_DERAMP_LAYOUT_H

#include "dsp/band_transform.h"
#include "dsp/deramp.h"

struct deramp_layout {
    struct trace_format format;
    size_t first, n_used;  /* samples of a ping */
    double begin_s, end_s; /* of them, after the emission */
    size_t n_mixed;        /* samples of the band that the mixer turns */
    double mixed_step_s;
    size_t n_beat;     /* of the transform to beats */
    size_t first_beat; /* bin of n_beat; they run on from its end to its beginning */
    size_t n_beats;
    double first_beat_s, beat_s; /* delay of the first beat, from one to the next */
    size_t n_aligned;            /* of the transform of the beats back to time */
    double step_s;               /* of aligned time */
    size_t n_band;               /* steps that the band covers */
    size_t n_range;              /* of the transform of the band to delays */
    size_t first_bin;            /* of it, the one of a trace's sample 0 */
};

/* And makes the transform that takes the band of a ping.  0, or as deramp_create; then
 * there may be a transform all the same. */
int deramp_layout_choose(struct deramp_layout *l, struct band_transform **transform,
                         const struct deramp_config *c);

double deramp_slope_hz_s(const struct deramp_config *c);

/* Weight of what a ping holds at that time, 0..1: 1 while echoes of the gate last. */
double deramp_fade(const struct deramp_layout *l, const struct deramp_config *c,
                   double t_s);

/* The window's, at a step of aligned time. */
double deramp_band_weight(const struct deramp_layout *l, const struct deramp_config *c,
                          size_t n);

/* What a unit echo of that delay adds up to. */
double deramp_echo_sum(const struct deramp_layout *l, const struct deramp_config *c,
                       double delay_s);

#endif
