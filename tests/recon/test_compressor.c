/* SPDX-License-Identifier: MIT */
/* Two directions of a chirp, and chirps that overlap, against what analysis says.  Echoes
 * are made here, by the chirp's formula at a fractional delay. */
#include <complex.h>
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "recon/frontend/compressor.h"

#define RATE_HZ   48000.0
#define START_HZ  2000.0
#define STOP_HZ   20000.0
#define CHIRP_S   0.0625
#define BAND_HZ   (STOP_HZ - START_HZ)
#define LATENCY   20.0
#define SHORT     1200 /* samples of a slot, 25 ms */
#define FAR_M     4.1
#define DELAY_S   0.0123 /* of an echo */
#define MAX_TRACE 4096

struct rig {
    struct survey survey;
    struct processing processing;
    struct compressor *compressor;
    struct trace_format format;
    float *ping;
    float complex trace[MAX_TRACE];
};

static int open_rig(void **state, size_t slot_samples, enum compression compression)
{
    static double speaker[1][3], microphone[1][3] = {{0.1, 0, 0}}, position;
    struct rig *r = calloc(1, sizeof *r);

    if (!r)
        return -1;
    r->survey = (struct survey){.sound_speed_m_s = 343,
                                .temperature_c = 20,
                                .sample_rate_hz = RATE_HZ,
                                .chirp_start_hz = START_HZ,
                                .chirp_stop_hz = STOP_HZ,
                                .chirp_duration_s = CHIRP_S,
                                .chirp_alternates = true,
                                .slot_samples = slot_samples,
                                .latency_samples = LATENCY,
                                .n_speakers = 1,
                                .n_microphones = 1,
                                .n_positions = 1,
                                .speakers_m = speaker,
                                .microphones_m = microphone,
                                .stage_axis = {1, 0, 0},
                                .stage_positions_m = &position,
                                .has_gate = true,
                                .gate_m = {0.5, FAR_M}};
    if (processing_plan(&r->processing, &r->survey, NULL) ||
        compressor_create(&r->compressor, &r->processing, &r->survey, compression,
                          WINDOW_HANN, NULL))
        return -1;
    compressor_format(r->compressor, &r->format);
    r->ping = calloc(r->processing.ping_samples, sizeof *r->ping);
    *state = r;
    return r->ping && r->format.n_samples <= MAX_TRACE ? 0 : -1;
}

static int setup(void **state)
{
    return open_rig(state, 3000, COMPRESSION_MATCHED_FILTER);
}

static int setup_deramp(void **state)
{
    return open_rig(state, 3000, COMPRESSION_DERAMP);
}

static int setup_overlap(void **state)
{
    return open_rig(state, SHORT, COMPRESSION_MATCHED_FILTER);
}

static int teardown(void **state)
{
    struct rig *r = *state;

    compressor_destroy(r->compressor);
    free(r->ping);
    free(r);
    return 0;
}

/* Adds a chirp that arrives at start_s after the emission of sample 0. */
static void add(struct rig *r, bool down, double start_s, double amplitude)
{
    double from = down ? STOP_HZ : START_HZ, to = down ? START_HZ : STOP_HZ;

    for (size_t i = 0; i < r->processing.ping_samples; i++) {
        double t = ((double)i - LATENCY) / RATE_HZ - start_s;
        double turns = (from + 0.5 * (to - from) / CHIRP_S * t) * t;
        if (t >= 0 && t < CHIRP_S)
            r->ping[i] += (float)(amplitude * cos(2 * M_PI * turns));
    }
}

/* Largest magnitude, and the delay where it is. */
static double peak(struct rig *r, bool down, double *delay_s)
{
    double best = 0;

    *delay_s = 0;
    compressor_execute(r->compressor, down, r->ping, r->processing.ping_samples,
                       r->trace);
    for (size_t i = 0; i < r->format.n_samples; i++)
        if (cabsf(r->trace[i]) > best) {
            best = cabsf(r->trace[i]);
            *delay_s = r->format.t0_s + (double)i / r->format.rate_hz;
        }
    return best;
}

static double db(double power)
{
    return 10 * log10(power);
}

static void both_directions_compress_an_echo_to_its_delay(void **state)
{
    struct rig *r = *state;

    for (int down = 0; down < 2; down++) {
        double at_s;
        memset(r->ping, 0, r->processing.ping_samples * sizeof *r->ping);
        add(r, down, DELAY_S, 0.7);
        double level = peak(r, down, &at_s);
        assert_true(level > 0.65 && level < 0.72);
        assert_true(fabs(at_s - DELAY_S) <= 0.5 / r->format.rate_hz);
        /* Phase 0 in the analytic signal, within a quarter of a sample of the trace. */
        size_t i = (size_t)lrint((at_s - r->format.t0_s) * r->format.rate_hz);
        double off = carg((double complex)r->trace[i] *
                          cexp(I * 2 * M_PI * r->format.carrier_hz * DELAY_S));
        double turn = 2 * M_PI * (START_HZ + BAND_HZ / 2 - r->format.carrier_hz) *
                      (at_s - DELAY_S);
        assert_true(fabs(remainder(off - turn, 2 * M_PI)) < 0.1);
    }
}

/* Wrong direction: the phase of what is left over the band is quadratic, with a second
 * derivative of 4 pi T / B, and by the method of stationary phase its sum is
 * sqrt(B / (2 T)) where a right one's is B / 2, the sum of the Hann window. */
static void opposite_chirps_hear_each_other_two_over_time_times_bandwidth(void **state)
{
    struct rig *r = *state;

    for (int down = 0; down < 2; down++) {
        double at_s, expected_db = db(2 / (BAND_HZ * CHIRP_S));
        memset(r->ping, 0, r->processing.ping_samples * sizeof *r->ping);
        add(r, !down, DELAY_S, 1.0);
        double found = peak(r, down, &at_s);
        assert_true(fabs(db(found * found) - expected_db) < 1.0);
    }
}

/* Direct sound of the speakers before and behind, a slot apart: its peaks lie beyond the
 * gate, and in it is only what the ends of the ping cut off of them. */
static void a_start_offset_keeps_other_speakers_out_of_the_gate(void **state)
{
    struct rig *r = *state;
    double at_s, level;

    for (int k = -3; k <= 3; k++) {
        memset(r->ping, 0, r->processing.ping_samples * sizeof *r->ping);
        if (k)
            add(r, false, k * SHORT / RATE_HZ + 0.001, 1.0);
        level = peak(r, false, &at_s);
        assert_true(db(level * level) < (abs(k) > 2 ? -70 : -55));
    }
    memset(r->ping, 0, r->processing.ping_samples * sizeof *r->ping);
    for (int k = -3; k <= 3; k++)
        if (k)
            add(r, false, k * SHORT / RATE_HZ + 0.001, 1.0);
    add(r, false, DELAY_S, 0.01);
    level = peak(r, false, &at_s);
    assert_true(fabs(at_s - DELAY_S) <= 0.5 / r->format.rate_hz);
    assert_true(fabs(level - 0.01) < 0.003);
}

static void an_echo_from_either_end_of_the_gate_is_not_tapered(void **state)
{
    static const double ranges_m[] = {0.55, 2.0, 4.0};
    struct rig *r = *state;

    for (size_t i = 0; i < 3; i++) {
        double at_s, delay_s = 2 * ranges_m[i] / 343;
        memset(r->ping, 0, r->processing.ping_samples * sizeof *r->ping);
        add(r, true, delay_s, 1.0);
        double level = peak(r, true, &at_s);
        assert_true(level > 0.93 && level < 1.02);
        assert_true(fabs(at_s - delay_s) <= 0.5 / r->format.rate_hz);
    }
}

/* Whoever images knows by it what traces will be like, without planning to make them. */
static void the_format_is_known_without_a_plan(void **state)
{
    static const double gates_m[][2] = {{0.5, FAR_M}, {0.3, 0.6}, {2.0, 2.5}, {1.0, 4.0}};
    struct rig *r = *state;
    struct survey s = r->survey;

    for (size_t i = 0; i < 16; i++) {
        enum compression by = i & 1 ? COMPRESSION_DERAMP : COMPRESSION_MATCHED_FILTER;
        struct processing p;
        struct compressor *c;
        struct trace_format planned, known;
        memcpy(s.gate_m, gates_m[i / 2 % 4], sizeof s.gate_m);
        s.sample_rate_hz = i < 8 ? RATE_HZ : 2 * RATE_HZ;
        assert_int_equal(processing_plan(&p, &s, NULL), 0);
        p.reach_s = i & 2 && by == COMPRESSION_MATCHED_FILTER ? p.gate_s[1] : 0.0;
        assert_int_equal(compressor_create(&c, &p, &s, by, WINDOW_HAMMING, NULL), 0);
        compressor_format(c, &planned);
        compressor_destroy(c);
        assert_int_equal(compressor_format_of(&known, &p, &s, by, NULL), 0);
        assert_int_equal(known.n_samples, planned.n_samples);
        assert_true(known.t0_s == planned.t0_s && known.rate_hz == planned.rate_hz &&
                    known.carrier_hz == planned.carrier_hz);
    }
}

static void a_gate_beyond_the_ping_is_refused_without_a_plan(void **state)
{
    struct rig *r = *state;
    struct processing p = r->processing;
    struct trace_format f;
    struct error why = {""};

    p.gate_s[1] = (double)p.ping_samples / RATE_HZ + CHIRP_S;
    for (int by = COMPRESSION_MATCHED_FILTER; by <= COMPRESSION_DERAMP; by++) {
        assert_int_equal(
            compressor_format_of(&f, &p, &r->survey, (enum compression)by, &why),
            -ERANGE);
        assert_non_null(strstr(why.text, "samples"));
    }
}

#define TEST(name, setup) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(both_directions_compress_an_echo_to_its_delay, setup),
        TEST(both_directions_compress_an_echo_to_its_delay, setup_deramp),
        TEST(opposite_chirps_hear_each_other_two_over_time_times_bandwidth, setup),
        TEST(a_start_offset_keeps_other_speakers_out_of_the_gate, setup_overlap),
        TEST(the_format_is_known_without_a_plan, setup),
        TEST(a_gate_beyond_the_ping_is_refused_without_a_plan, setup),
        TEST(an_echo_from_either_end_of_the_gate_is_not_tapered, setup_overlap),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
