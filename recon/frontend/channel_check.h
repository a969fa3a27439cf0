/* SPDX-License-Identifier: MIT */
/* recon/frontend/channel_check.h -- which microphones of a recording can be used,
 * position by position, and what was wrong with the others. */
#ifndef ANLOS_RECON_FRONTEND_CHANNEL_CHECK_H
#define ANLOS_RECON_FRONTEND_CHANNEL_CHECK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A channel is left out of a position where it is silent (all equal, or over 60 dB below
 * the median channel), where a sample is not finite (one lost sample of the direct path
 * outshines every echo once the background is subtracted), or where over 1 % of it clips.
 */
struct channel_check;

/* 0, -ENOMEM. */
int channel_check_create(struct channel_check **out, size_t n_microphones,
                         size_t n_positions);

/* samples [n_microphones][n_frames]; clipped and not_finite [n_microphones] as
 * recording_read counts them.  masked[n_microphones] becomes true where the channel is of
 * no use and is left alone elsewhere.  Different positions from different threads. */
void channel_check_position(struct channel_check *c, size_t position, size_t n_frames,
                            const float *samples, const uint32_t *clipped,
                            const uint32_t *not_finite, bool *masked);

/* Over all positions. */
struct channel_summary {
    size_t silent, damaged, clipped; /* positions left out for that reason */
    uint64_t clipped_samples, not_finite_samples;
};
void channel_check_summary(const struct channel_check *c, size_t microphone,
                           struct channel_summary *out);
void channel_check_destroy(struct channel_check *c);

#endif
