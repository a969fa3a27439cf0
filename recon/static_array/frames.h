/* SPDX-License-Identifier: MIT */
/* recon/static_array/frames.h -- images of a fixed array from its newest pings, a new one
 * for every ping if need be: the newest replaces the oldest (a sliding aperture).
 * Back-projection as in recon/coherent/backprojection.c; each ping keeps its part of the
 * image, so that a new image costs one ping and a sum, as long as nothing moves.
 *
 * An array that moves is imaged from where each element stood when it spoke or heard:
 * between pings, and while the sound was under way.  Motion shifts what a compressed
 * chirp shows: its delays are as of the instant that recon/static_array/range_doppler.h
 * tells, its phases as of the middle of the chirp, to first order in speed over sound
 * speed.  (From the phase 2 pi f tau(u) of what leaves at u = (f - f1) T / (f2 - f1), and
 * its derivative in f.) What is left blurs depth over the band: the delay at its two ends
 * differs by 2 T v / c, v being the speed towards the thing imaged. */
#ifndef ANLOS_RECON_STATIC_ARRAY_FRAMES_H
#define ANLOS_RECON_STATIC_ARRAY_FRAMES_H

#include <complex.h>
#include <stdbool.h>
#include <stdint.h>

#include "dsp/chirp.h"
#include "dsp/pulse_compress.h"
#include "recon/geometry.h"
#include "recon/grid.h"
#include "recon/mount.h"

#define FRAMES_MAX_PINGS 256

enum frames_sum {
    FRAMES_COHERENT, /* phases add up over the pings: what stands, or moves as known */
    FRAMES_POWER,    /* over a ping's microphones alone; pings add by power */
};

struct pool;

struct frames_config {
    const struct geometry *geometry; /* of one position */
    struct trace_format format;
    double band_hz[2];
    double gate_m[2]; /* ranges (half paths) below the first are muted */
    struct grid grid;
    struct pool *pool;  /* used while imaging; not owned */
    struct chirp chirp; /* of a ping that is not `down`; duration 0: no chirp */
    double latency_s;   /* from a ping's stamp to the start of its chirp */
    size_t n_pings;     /* 1..FRAMES_MAX_PINGS, the newest, which make an image */
    int64_t max_age_ns; /* of a ping in an image, before its newest one */
    enum frames_sum sum;
};

struct frames;

/* Allocates all; used from one thread at a time.  0, -EINVAL, -ENOTSUP (pings with places
 * of their own, or a stage), -ENOMEM. */
int frames_create(struct frames **out, const struct frames_config *cfg);

struct frames_ping {
    int64_t stamp_ns; /* of sample 0 of its recording */
    size_t speaker;
    bool down;                   /* its chirp ran from stop to start */
    const float complex *traces; /* [n_microphones][format.n_samples] */
    const bool *masked;          /* [n_microphones]; NULL: none */
};

/* Takes the place of the oldest ping; one that is older than the newest makes all others
 * be forgotten, and returns false.  A trace that recon/imaging/trace_check finds unfit
 * counts as masked. */
bool frames_add(struct frames *f, const struct frames_ping *ping);

/* The newest ping is in no image any more. */
void frames_spoil(struct frames *f);

struct frames_motion {
    const struct ego_path *path; /* of the vehicle; NULL: it stands */
    struct mount mount;
    double velocity_m_s[3]; /* over ground, of what is to be sharp, in the array frame */
};

struct frames_made { /* what an image was made of */
    int64_t
        stamp_ns; /* of the newest ping: the array stands in the image as it did then */
    size_t pings;
    double age_s;              /* of these in the mean, before the newest */
    size_t microphones_masked; /* in any of them */
    size_t unknown;            /* pings taken as if the vehicle stood: the path ends */
    size_t kept;               /* pings whose part of the last image still served */
};

/* intensity [nz][ny][nx]: range^2 |mean over the midpoints|^2, each midpoint counting
 * once however many live pairs share it: a point's level does not depend on how many
 * pings there are.  By power, the mean of that over the pings.  Range makes up for
 * spreading, once.  Midpoints are those of the array in its own frame.  motion may be
 * NULL: everything stands. Nothing is allocated.  Parts are made anew when an element has
 * moved by more than FRAMES_STILL_M since, or shares its midpoint with more or fewer
 * others; they are added up anew for each image, so that no rounding builds up. */
#define FRAMES_STILL_M 1e-4
void frames_image(struct frames *f, const struct frames_motion *motion, float *intensity,
                  struct frames_made *made);

/* Of the newest ping alone, after frames_image: its image's mean over blocks of about
 * FRAMES_BLOCK_M, [nz][ny][nx] of *blocks, in the same unit; 0 where less than half of a
 * block was imaged.  What stands out in ping after ping is told from it before it does in
 * their sum (recon/detection/occupancy.h).  NULL: it is in no image, or phases add up.
 * Until the next frames_image. */
#define FRAMES_BLOCK_M 0.08
const float *frames_newest(const struct frames *f, struct grid *blocks);

/* -- the pings of the newest image, by power, one by one: after frames_image, until the
 * next frames_add.  All in the array's frame as of the newest ping. */

struct frames_look {
    double age_s;           /* before the newest ping */
    double middle_m[3];     /* between its speaker and the microphones */
    double velocity_m_s[3]; /* of these over ground */
    double sweep_s_hz;      /* its chirp took so long for each hertz, < 0: downward; 0: it
                               is none that is known */
};

/* Only those that are so old at most are looked at; else all. */
void frames_look_back(struct frames *f, double age_s);

/* looks[n_pings of the configuration]; how many there are. */
size_t frames_looks(const struct frames *f, struct frames_look *looks);

/* The image of one of them alone, in the unit of frames_image's. */
void frames_alone(struct frames *f, size_t look, float *intensity);

enum frames_thing {
    FRAMES_SCATTERER, /* sends what comes to it everywhere */
    FRAMES_PLANE,     /* mirrors the speaker; square to the way from the array */
};

/* A thing's echo in each of these pings, if it is at each of n places: the mean over the
 * midpoints, with its phase, over the number of pings; echoes[looks][re, im][n].  What is
 * there, and at rest, is in phase in all: the square of the sum, times range^2, is as
 * bright then as the image by power. */
void frames_echoes(struct frames *f, enum frames_thing thing, const double (*at_m)[3],
                   size_t n, float *echoes);

/* The instant after a ping's stamp that its delays are those of; what moves is shown
 * where it was then (plus half its echo's delay). */
double frames_delay_instant_s(const struct frames_config *cfg, bool down);

void frames_reset(struct frames *f);
void frames_destroy(struct frames *f);

#endif
