/* SPDX-License-Identifier: MIT */
/* Normal moveout and log-stretch against golden vectors: gates that begin with the
 * emission, with the bin after it, and later; half-offsets up to 0.5 m. */
#include "tests/recon/near.h"

#include <complex.h>
#include <stdlib.h>
#include <string.h>

#include "recon/coherent/nmo.h"
#include "recon/coherent/stretch.h"
#include "tests/golden/golden.h"
#include "tests/worse.h"

#define POINT   32 /* 16 re, 16 im, or 32 powers */
#define OFFSETS 3
#define MAX     300

static const char *const gates[3] = {"moveout_gate_from_bin_0", "moveout_gate_from_bin_1",
                                     "moveout_gate_from_8_ms"};

struct gate {
    struct golden *golden;
    struct trace_format format;
    double band_hz[2], c_m_s;
    const double *halves_m;
    const double *co_located; /* [n][OFFSETS][re, im] */
    const double *power;      /* [n][OFFSETS] */
    float complex trace[MAX];
};

static void gate_open(struct gate *g, const char *name)
{
    g->golden = golden_open(name);
    const double *v = golden_table(g->golden, "t0_rate_carrier_low_high_c", NULL, NULL);
    size_t n;
    const double *trace = golden_table(g->golden, "trace", &n, NULL);
    assert_true(n <= MAX);
    g->format = (struct trace_format){v[0], v[1], v[2], n};
    g->band_hz[0] = v[3];
    g->band_hz[1] = v[4];
    g->c_m_s = v[5];
    g->halves_m = golden_table(g->golden, "half_offsets", NULL, NULL);
    g->co_located = golden_table(g->golden, "co_located", NULL, NULL);
    g->power = golden_table(g->golden, "co_located_power", NULL, NULL);
    for (size_t q = 0; q < n; q++)
        g->trace[q] = (float)trace[2 * q] + I * (float)trace[2 * q + 1];
}

static double zero_offset_s(const struct gate *g, size_t n)
{
    return g->format.t0_s + (double)n / g->format.rate_hz;
}

/* Where in the input the sound of co-located sample n is. */
static double input_sample(const struct gate *g, size_t n, size_t offset)
{
    double t = hypot(zero_offset_s(g, n), 2.0 * g->halves_m[offset] / g->c_m_s);
    return (t - g->format.t0_s) * g->format.rate_hz;
}

static double last_sample(const struct gate *g)
{
    return (double)(g->format.n_samples - 1);
}

/* -- normal moveout ---------------------------------------------------------------------
 */

static void move_out(const struct gate *g, size_t offset, double mute_s,
                     const float complex *in, float complex *out)
{
    struct nmo *n;
    const struct nmo_config cfg = {
        .sound_speed_m_s = g->c_m_s,
        .in = g->format,
        .out = g->format,
        .mute_s = mute_s,
        .band_hz = g->band_hz[1] - g->band_hz[0],
        .n_offsets = OFFSETS,
        .half_offset_m = g->halves_m,
    };
    memset(out, 0, g->format.n_samples * sizeof *out);
    assert_int_equal(nmo_create(&n, &cfg), 0);
    /* A block of its own, so that a read past its end is seen. */
    float complex *block = malloc(g->format.n_samples * sizeof *block);
    assert_non_null(block);
    memcpy(block, in, g->format.n_samples * sizeof *block);
    nmo_stack(n, offset, block, out);
    free(block);
    nmo_destroy(n);
}

/* 2e-3 of the loudest echo; 0 where there is no input.  The ends fade over 8 samples. */
static void expect_moved_out(const struct gate *g, size_t offset)
{
    float complex out[MAX];
    double worst = 0.0, loudest = 0.0;
    size_t n = g->format.n_samples, heard = 0;
    move_out(g, offset, 0.0, g->trace, out);
    for (size_t q = 0; q < n; q++) {
        const double *e = g->co_located + 2 * (q * OFFSETS + offset);
        double at = input_sample(g, q, offset);
        assert_true(isfinite(crealf(out[q])) && isfinite(cimagf(out[q])));
        loudest = fmax(loudest, cabs(e[0] + I * e[1]));
        if (at > last_sample(g) || !(zero_offset_s(g, q) > 0.0))
            assert_near(cabsf(out[q]), 0.0, 0.0);
        if (q < 8 || q > n - 9 || at < 4.0 || at > last_sample(g) - 4.0)
            continue;
        worst = worse(worst, cabs(out[q] - e[0] - I * e[1]));
        heard++;
    }
    assert_true(heard > 100);
    assert_below(worst, 2e-3 * loudest);
}

static void moveout_is_that_of_double_precision(void **state)
{
    (void)state;
    for (size_t q = 0; q < 3 * OFFSETS; q++) {
        struct gate g;
        gate_open(&g, gates[q / OFFSETS]);
        expect_moved_out(&g, q % OFFSETS);
        golden_close(g.golden);
    }
}

/* Not even for a weight of 0, which would make NaN of NaN. */
static void expect_not_read_before(const char *name, double mute_s)
{
    struct gate g;
    float complex with[MAX], without[MAX];
    gate_open(&g, name);
    double first_s = hypot(mute_s, 2.0 * g.halves_m[2] / g.c_m_s);
    move_out(&g, 2, mute_s, g.trace, without);
    size_t n = (size_t)((first_s - g.format.t0_s) * g.format.rate_hz) - 3;
    assert_true(n > 20);
    for (size_t i = 0; i < n; i++)
        g.trace[i] = NAN;
    move_out(&g, 2, mute_s, g.trace, with);
    assert_memory_equal(with, without, g.format.n_samples * sizeof *with);
    golden_close(g.golden);
}

/* What is heard before sound can go from the speaker to the microphone, t < 2 h / c, has
 * no zero-offset time. */
static void what_comes_before_the_direct_sound_is_not_read(void **state)
{
    (void)state;
    expect_not_read_before(gates[0], 0.0);
    expect_not_read_before(gates[1], 0.0);
}

static void what_comes_before_the_mute_is_not_read(void **state)
{
    (void)state;
    expect_not_read_before(gates[0], 0.004);
    expect_not_read_before(gates[2], 0.009);
}

/* -- log-stretch ------------------------------------------------------------------------
 */

/* Lane 0 is the trace or its power. */
static void stretch_there_and_back(const struct gate *g, bool power, size_t offset,
                                   float *out)
{
    size_t n = g->format.n_samples;
    struct stretch *s;
    const struct stretch_config cfg = {
        .sound_speed_m_s = g->c_m_s,
        .power = power,
        .band_hz = {g->band_hz[0], g->band_hz[1]},
        .in = g->format,
        .out = g->format,
        .n_offsets = OFFSETS,
        .half_offset_m = g->halves_m,
    };
    assert_int_equal(stretch_create(&s, &cfg), 0);
    float *in = calloc(n * POINT, sizeof *in);
    float *rows = malloc(stretch_rows(s) * POINT * sizeof *rows);
    assert_non_null(in);
    assert_non_null(rows);
    for (size_t q = 0; q < n; q++) {
        float re = crealf(g->trace[q]), im = cimagf(g->trace[q]);
        in[q * POINT] = power ? re * re + im * im : re;
        in[q * POINT + 16] = power ? 0.0f : im;
    }
    stretch_in(s, offset, in, rows);
    stretch_out(s, rows, out);
    free(in);
    free(rows);
    stretch_destroy(s);
}

static double complex golden_at(const struct gate *g, bool power, size_t n, size_t offset)
{
    const double *z = g->co_located + 2 * (n * OFFSETS + offset);
    return power ? g->power[n * OFFSETS + offset] : z[0] + I * z[1];
}

/* In parts of the loudest echo.  Stretch above 2 is muted, above 1.7 fading; sound at the
 * very ends of the input fades over 8 samples. */
static void expect_stretched(const struct gate *g, bool power, size_t offset,
                             double tolerance)
{
    float out[MAX * POINT];
    double worst = 0.0, loudest = 0.0;
    size_t heard = 0;
    stretch_there_and_back(g, power, offset, out);
    for (size_t q = 0; q < g->format.n_samples; q++) {
        double complex z = out[q * POINT] + I * out[q * POINT + 16];
        double complex e = golden_at(g, power, q, offset);
        double t0 = zero_offset_s(g, q), at = input_sample(g, q, offset);
        double stretch = (at / g->format.rate_hz + g->format.t0_s) / t0;
        assert_true(isfinite(creal(z)) && isfinite(cimag(z)));
        loudest = fmax(loudest, cabs(e));
        if (!(stretch < 2.2) || at > last_sample(g) + 6.0)
            assert_near(cabs(z), 0.0, 1e-3 * loudest);
        if (!(stretch < 1.65) || at < 14.0 || at > last_sample(g) - 16.0)
            continue;
        worst = worse(worst, cabs(z - e));
        heard++;
    }
    assert_true(heard > 50);
    assert_below(worst, tolerance * loudest);
}

/* 1% of the loudest echo, 3% of complex traces from the emission on. */
static void stretched_and_back_is_that_of_double_precision(void **state)
{
    (void)state;
    for (size_t q = 0; q < 3 * OFFSETS; q++) {
        struct gate g;
        gate_open(&g, gates[q / OFFSETS]);
        expect_stretched(&g, true, q % OFFSETS, 0.01);
        expect_stretched(&g, false, q % OFFSETS, q / OFFSETS < 2 ? 0.03 : 0.01);
        golden_close(g.golden);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(moveout_is_that_of_double_precision),
        cmocka_unit_test(what_comes_before_the_direct_sound_is_not_read),
        cmocka_unit_test(what_comes_before_the_mute_is_not_read),
        cmocka_unit_test(stretched_and_back_is_that_of_double_precision),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
