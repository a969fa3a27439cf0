/* SPDX-License-Identifier: MIT */
/* tests/recon/library_rig.h -- what the tests of libanlos share: public headers alone,
 * and the echoes of a point in closed form. */
#ifndef ANLOS_TESTS_RECON_LIBRARY_RIG_H
#define ANLOS_TESTS_RECON_LIBRARY_RIG_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <anlos/anlos.h>

#define PI 3.14159265358979323846

/* A small array before a wall: points appear at z behind it and are really before it. */
enum {
    POSITIONS = 6,
    MOST_POSITIONS = 8,
    SPEAKERS = 4,
    MICS = 4,
    SLOT = 1500,
    PING = 2500
};
#define RATE_HZ  48000.0
#define SPEED    343.0
#define WALL_M   0.8
#define CHIRP_S  0.03125
#define START_HZ 2000.0
#define STOP_HZ  20000.0

static const double stage[MOST_POSITIONS] = {0, 0.04, 0.08, 0.12, 0.16, 0.2, 0.24, 0.28};
static const double point_m[3] = {0.12, 0.1, 1.2}; /* as imaged */
static const double x_axis[3] = {1, 0, 0}, z_axis[3] = {0, 0, 1};

#define SECOND INT64_C(1000000000)

static struct anlos_error why;

static inline void ok(int code)
{
    if (code < 0)
        fail_msg("%d: %s", code, why.text);
}

/* Refused with this code and a sentence that has the words. */
static inline void refused(int code, int expected, const char *words)
{
    if (code != expected || why.code != expected || !strstr(why.text, words))
        fail_msg("%d (expected %d): '%s' (expected '%s')", code, expected, why.text,
                 words);
    why = (struct anlos_error){0, ""};
}

static inline double element(size_t i)
{
    return 0.08 * (double)i;
}

static inline struct anlos_survey *make_survey_without_wall(size_t positions)
{
    static const double x[] = {0.02, 0.24, 0.02}, y[] = {0, 0.22, 0.02},
                        z[] = {0.9, 1.5, 0.01};
    struct anlos_survey *s;
    double speakers[SPEAKERS][3] = {{0}}, mics[MICS][3] = {{0}};

    for (size_t i = 0; i < SPEAKERS; i++) {
        speakers[i][1] = mics[i][1] = element(i);
        mics[i][0] = 0.04;
    }
    ok(anlos_survey_create(&s, &why));
    ok(anlos_survey_speakers(s, speakers[0], SPEAKERS, &why));
    ok(anlos_survey_microphones(s, mics[0], MICS, &why));
    ok(anlos_survey_stage(s, x_axis, stage, positions, &why));
    ok(anlos_survey_chirp(s, START_HZ, STOP_HZ, CHIRP_S, false, &why));
    ok(anlos_survey_sampling(s, RATE_HZ, SLOT, 0, &why));
    ok(anlos_survey_sound_speed(s, SPEED, &why));
    ok(anlos_survey_volume(s, x, y, z, &why));
    return s;
}

static inline struct anlos_survey *make_survey(size_t positions)
{
    struct anlos_survey *s = make_survey_without_wall(positions);
    ok(anlos_survey_add_wall(s, z_axis, WALL_M, 0, 0, &why));
    return s;
}

static inline double distance(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

/* Adds the chirp, so much later, to out [PING]. */
static inline void add_chirp(float *out, double delay_s, double gain)
{
    const double rate = (STOP_HZ - START_HZ) / CHIRP_S;

    for (size_t i = 0; i < PING; i++) {
        double t = (double)i / RATE_HZ - delay_s;
        double phase = 2 * PI * (START_HZ * t + 0.5 * rate * t * t);
        if (t >= 0 && t < CHIRP_S)
            out[i] += (float)(gain * cos(phase));
    }
}

/* samples [MICS][PING] of the point: later by the way there and back. */
static inline void echo(float *samples, size_t position, size_t speaker, double gain)
{
    const double from[3] = {stage[position], element(speaker), 0};

    memset(samples, 0, sizeof(float) * MICS * PING);
    for (size_t m = 0; m < MICS; m++) {
        const double to[3] = {stage[position] + 0.04, element(m), 0};
        double way = distance(from, point_m) + distance(point_m, to);
        add_chirp(samples + m * PING, way / SPEED, gain);
    }
}

static float samples[MICS * PING];

static inline struct anlos_ping make_ping(size_t position, size_t speaker)
{
    struct anlos_ping ping = {.size = sizeof ping};

    ping.position = (uint32_t)position;
    ping.speaker = (uint32_t)speaker;
    ping.n_microphones = MICS;
    ping.n_samples = PING;
    ping.samples = samples;
    return ping;
}

#endif
