/* nodes/anlos/bench/trials.h -- images of one point in much noise, again and again: the
 * point's echoes are compressed once, white noise is made at the rate of the recording
 * and compressed for each seed, and as compression is linear, any mixture of the two
 * images without a new recording. */
#ifndef ANLOS_NODES_ANLOS_BENCH_TRIALS_H
#define ANLOS_NODES_ANLOS_BENCH_TRIALS_H

#include "nodes/anlos/bench/bound.h"
#include "nodes/anlos/bench/scene.h"
#include "recon/processing.h"

#define BENCH_TRIAL_METHODS 16

struct bench_trials;

/* scene: noiseless, without background, of one point; must outlive the trials.  limits:
 * minimum, maximum and step of x, y, z.  methods as imager_methods().  0, -ENOMEM,
 * -ENOTSUP (a method cannot), other negative errno. */
int bench_trials_create(struct bench_trials **out, const struct bench_scene *scene,
                        const double limits[3][3], const char *methods,
                        enum window window, size_t threads, struct complaint *why);

/* Noise of a seed, of rms 1 a sample in the recording less its background. */
void bench_trials_noise(struct bench_trials *t, uint64_t seed);

/* Of method number m: the echoes times `signal` plus the noise times `noise`; [grid].
 * Valid until the next. */
const float *bench_trials_image(struct bench_trials *t, size_t m, double signal,
                                double noise);

const struct processing *bench_trials_processing(const struct bench_trials *t);

/* Mean square of the echoes over the slots of the recording: what raw signal to noise is
 * about. */
double bench_trials_power(const struct bench_trials *t);

/* The bound of the point's place, at a raw signal to noise of 0 dB: it falls with the
 * root of the signal to noise.  A background with as much noise is taken away.  0, -EDOM.
 */
int bench_trials_bound(const struct bench_trials *t, bool phase_known,
                       struct bench_bound *out);
void bench_trials_destroy(struct bench_trials *t);

#endif
