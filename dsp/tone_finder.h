/* SPDX-License-Identifier: MIT */
/* dsp/tone_finder.h -- does a steady tone sound, or a comb of them: a motor's inverter, a
 * switching supply, the mains?  Such sound is a line in the spectrum of each ping, while
 * a chirp and all its echoes are smooth.  Lines nearer to each other than a ping resolves
 * show in its autocorrelation, at one over how far they are apart.
 *
 * Powers of the spectra of TONE_FINDER_BLOCK pings, each over its sum, are averaged,
 * channel by channel (Welch 1967), of the pings and of their differences to the one
 * before by the same speaker: direct sound, walls and clutter are in both and drop out,
 * as does a tone whose phase is the same again after a round.  A line is
 * TONE_FINDER_RATIO over the median around it in either, in half of the channels.  There
 * is a comb where of all that is left without a few lines TONE_FINDER_COMB or more comes
 * again after one time, and not after most others, in the
 * differences.  It is there after TONE_FINDER_SOME such blocks in a row at nearly the
 * same frequency, and gone after TONE_FINDER_FEW without.
 *
 * Up to TONE_FINDER_CHANNELS channels are heard, evenly chosen.  A ping costs a transform
 * of one and a half times its length for two of them. */
#ifndef ANLOS_DSP_TONE_FINDER_H
#define ANLOS_DSP_TONE_FINDER_H

#include <stdbool.h>
#include <stddef.h>

#define TONE_FINDER_BLOCK    16 /* pings */
#define TONE_FINDER_SOME     2  /* blocks */
#define TONE_FINDER_FEW      3
#define TONE_FINDER_CHANNELS 16
#define TONE_FINDER_RATIO    10.0 /* 10 dB */
#define TONE_FINDER_LINES    8    /* more are a comb */
#define TONE_FINDER_COMB     0.3
#define TONE_FINDER_LEAST_HZ 48.0 /* apart: lines of a comb */
#define TONE_FINDER_MOST_HZ  400.0

struct tone_finder_config {
    size_t n_speakers, n_channels, n_samples; /* of a ping: 21 ms and more show a comb */
    double rate_hz;
    double band_hz[2]; /* that counts */
};

enum tone_kind { TONE_NONE, TONE_LINES, TONE_COMB };

struct tone_found {
    enum tone_kind kind;
    double frequency_hz; /* of the loudest line; of a comb, how far its lines are apart */
    double rms;          /* in the median channel, of that line, or of the comb */
    size_t n_lines;      /* TONE_LINES: 1.. */
};

struct tone_finder;

/* 0, -EINVAL, -ENOMEM. */
int tone_finder_create(struct tone_finder **out, const struct tone_finder_config *cfg);

/* samples: [n_channels][stride >= n_samples].  A channel of zeros does not count. */
void tone_finder_ping(struct tone_finder *f, size_t speaker, const float *samples,
                      size_t stride);

/* "a steady tone of 5013 Hz", "3 steady tones, the loudest 5013 Hz", "a comb of tones
 * 50.0 Hz apart"; "" where there is none. */
void tone_found_text(const struct tone_found *t, char *text, size_t size);

/* What is there now. */
const struct tone_found *tone_finder_found(const struct tone_finder *f);
void tone_finder_destroy(struct tone_finder *f);

#endif
