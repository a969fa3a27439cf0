/* SPDX-License-Identifier: MIT */
/* tests/recon/survey_example.h -- surveys with all that there is in them. */
#ifndef ANLOS_TESTS_RECON_SURVEY_EXAMPLE_H
#define ANLOS_TESTS_RECON_SURVEY_EXAMPLE_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "recon/survey.h"

/* Borrows static arrays: not to be cleared. */
static inline struct survey example(void)
{
    static double speakers[2][3], microphones[3][3], positions[4];
    static double frequencies[3][3], gains[3][3];
    static struct survey_response responses[3];
    for (int i = 0; i < 2; i++)
        memcpy(speakers[i], (double[3]){0.1, 0.06 * i, -0.02}, sizeof speakers[i]);
    for (int i = 0; i < 3; i++) {
        memcpy(microphones[i], (double[3]){-0.1, 0.03 + 0.06 * i, 0.01 / 3},
               sizeof microphones[i]);
        snprintf(responses[i].serial, sizeof responses[i].serial, "mic-%d", i);
        responses[i].n_points = 3;
        responses[i].frequency_hz = memcpy(
            frequencies[i], (double[3]){100, 1000.5, 20000}, sizeof frequencies[i]);
        responses[i].gain_db =
            memcpy(gains[i], (double[3]){-1.5, 0, 0.1 * i}, sizeof gains[i]);
    }
    memcpy(positions, (double[4]){0, 0.03, 0.06, 0.09}, sizeof positions);
    return (struct survey){
        .source = SURVEY_SIMULATION,
        .sound_speed_m_s = 343.2,
        .temperature_c = 20.25,
        .sample_rate_hz = 48000,
        .chirp_start_hz = 2000,
        .chirp_stop_hz = 20000,
        .chirp_duration_s = 0.0625,
        .chirp_sine = true,
        .slot_samples = 3000,
        .latency_samples = 17.5,
        .n_speakers = 2,
        .n_microphones = 3,
        .n_positions = 4,
        .speakers_m = speakers,
        .microphones_m = microphones,
        .stage_axis = {1, 0, 0},
        .stage_positions_m = positions,
        .has_gate = true,
        .gate_m = {0.5, 4},
        .has_volume = true,
        .volume_m = {{-1, 1, 0.01}, {-0.5, 0.5, 0.02}, {1, 3, 0.005}},
        .has_wall = true,
        .wall_normal = {0.6, 0, 0.8},
        .wall_distance_m = 1.25,
        .has_mount = true,
        .mount_origin_m = {3.5, 0.25, 0.5},
        .mount_x_axis = {0, 1, 0},
        .mount_y_axis = {0, 0, 1},
        .n_responses = 3,
        .responses = responses,
    };
}

static inline void assert_same(const void *a, const void *b, size_t n_doubles)
{
    assert_memory_equal(a, b, n_doubles * sizeof(double));
}

static inline void assert_surveys_equal(const struct survey *a, const struct survey *b)
{
    assert_int_equal(a->source, b->source);
    assert_same(&a->sound_speed_m_s, &b->sound_speed_m_s, 1);
    assert_true(a->temperature_c == b->temperature_c ||
                (isnan(a->temperature_c) && isnan(b->temperature_c)));
    assert_same(&a->sample_rate_hz, &b->sample_rate_hz, 1);
    assert_same(&a->chirp_start_hz, &b->chirp_start_hz, 1);
    assert_same(&a->chirp_stop_hz, &b->chirp_stop_hz, 1);
    assert_same(&a->chirp_duration_s, &b->chirp_duration_s, 1);
    assert_int_equal(a->chirp_sine, b->chirp_sine);
    assert_int_equal(a->slot_samples, b->slot_samples);
    assert_same(&a->latency_samples, &b->latency_samples, 1);
    assert_int_equal(a->n_speakers, b->n_speakers);
    assert_same(a->speakers_m, b->speakers_m, 3 * a->n_speakers);
    assert_int_equal(a->n_microphones, b->n_microphones);
    assert_same(a->microphones_m, b->microphones_m, 3 * a->n_microphones);
    assert_same(a->stage_axis, b->stage_axis, 3);
    assert_int_equal(a->n_positions, b->n_positions);
    assert_same(a->stage_positions_m, b->stage_positions_m, a->n_positions);
    assert_int_equal(a->has_gate, b->has_gate);
    assert_same(a->gate_m, b->gate_m, 2);
    assert_int_equal(a->has_volume, b->has_volume);
    assert_same(a->volume_m, b->volume_m, 9);
    assert_int_equal(a->has_wall, b->has_wall);
    assert_same(a->wall_normal, b->wall_normal, 3);
    assert_same(&a->wall_distance_m, &b->wall_distance_m, 1);
    assert_int_equal(a->has_mount, b->has_mount);
    assert_same(a->mount_origin_m, b->mount_origin_m, 3);
    assert_same(a->mount_x_axis, b->mount_x_axis, 3);
    assert_same(a->mount_y_axis, b->mount_y_axis, 3);
    assert_int_equal(a->n_responses, b->n_responses);
    for (size_t i = 0; i < a->n_responses; i++) {
        const struct survey_response *p = &a->responses[i], *q = &b->responses[i];
        assert_string_equal(p->serial, q->serial);
        assert_int_equal(p->n_points, q->n_points);
        assert_same(p->frequency_hz, q->frequency_hz, p->n_points);
        assert_same(p->gain_db, q->gain_db, p->n_points);
    }
}

/* One speaker, one microphone, places ping by ping, and a replica. */
static inline struct survey foreign_example(void)
{
    static double pings[5000][2][3];
    static double zeros[5000];
    static float replica[100];
    struct survey s = example();
    for (int k = 0; k < 5000; k++)
        for (int c = 0; c < 6; c++)
            pings[k][c / 3][c % 3] = 0.001 * k + 0.1 * c;
    for (int i = 0; i < 100; i++)
        replica[i] = 0.01f * (float)(i - 50);
    s.n_speakers = s.n_microphones = 1;
    s.n_responses = 0;
    s.n_positions = 5000; /* more than a stage may have */
    s.stage_positions_m = zeros;
    s.pings_m = pings;
    s.n_replica = 100;
    s.replica = replica;
    return s;
}

#endif
