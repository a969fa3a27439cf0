/* nodes/dsp/microphones.h -- which microphones of a ping are fit to be used, and what is
 * wrong with the others: counted for each ping, said once for each microphone. */
#ifndef ANLOS_NODES_DSP_MICROPHONES_H
#define ANLOS_NODES_DSP_MICROPHONES_H

#include <stddef.h>
#include <stdint.h>

#include "msgs/array.pb-c.h"

struct microphones_faults { /* of how many, so many are: */
    size_t n, silent, damaged, clipped;
};

struct microphones;

/* 0, -ENOMEM. */
int microphones_create(struct microphones **out, size_t n);

/* samples [n][n_samples] of a ping; masked[n] becomes true where one is of no use, else
 * false.  note: gets what was not said before, or stays as it is.  The clipped samples of
 * all. */
uint64_t microphones_judge(struct microphones *m, const Anlos__Ping *ping,
                           const float *samples, size_t n_samples,
                           protobuf_c_boolean *masked, struct microphones_faults *faults,
                           char *note, size_t note_size);
void microphones_destroy(struct microphones *m);

#endif
