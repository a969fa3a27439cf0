/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <complex.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/coherent/zero_offset.h"
#include "tests/recon/reference.h"
#include "tests/worse.h"

#define MAX_ELEMENTS 4
#define MAX_LINES    96
#define SAMPLES      240
#define CELLS        (MAX_LINES * 8)

/* A stage that carries few elements along x or y, so that pairs of each offset stand at
 * every line of midpoints. */
struct bench { /* do not copy: geometry points into it */
    struct geometry geometry;
    double speakers_m[MAX_ELEMENTS][3], microphones_m[MAX_ELEMENTS][3];
    double positions_m[MAX_LINES];
    struct zero_offset_config cfg;
    struct zero_offset *zero_offset;
    struct zero_offset_lattice lattice;
    float out[CELLS * SAMPLES * 2];
    float complex traces[MAX_ELEMENTS * SAMPLES];
};

static const double c_m_s = 343.0, band_hz[2] = {2000.0, 20000.0};

static struct bench *bench_alloc(int axis, size_t n_lines, double pitch_m, bool power)
{
    struct bench *b = calloc(1, sizeof *b);
    assert_non_null(b);
    for (size_t k = 0; k < n_lines; k++)
        b->positions_m[k] = pitch_m * ((double)k - 0.5 * (double)(n_lines - 1));
    b->geometry = (struct geometry){
        .sound_speed_m_s = c_m_s,
        .n_speakers = 1,
        .n_microphones = 1,
        .n_positions = n_lines,
        .speakers_m = (const double(*)[3])b->speakers_m,
        .microphones_m = (const double(*)[3])b->microphones_m,
        .stage_positions_m = b->positions_m,
    };
    b->geometry.stage_axis[axis] = 1.0;
    struct trace_format gate = {2.0 * 1.15 / c_m_s, 36000.0, 11000.0, SAMPLES};
    b->cfg = (struct zero_offset_config){.geometry = &b->geometry,
                                         .in = gate,
                                         .band_hz = {band_hz[0], band_hz[1]},
                                         .power = power,
                                         .mute_s = 2.0 * 0.5 / c_m_s,
                                         .out = gate};
    assert_int_equal(pool_create(&b->cfg.pool, 2), 0);
    return b;
}

static void bench_create(struct bench *b)
{
    const char *why = "";
    assert_int_equal(zero_offset_create(&b->zero_offset, &b->cfg, &why), 0);
    zero_offset_lattice(b->zero_offset, &b->lattice);
    assert_true(b->lattice.n[0] * b->lattice.n[1] <= CELLS);
}

static void bench_destroy(struct bench *b)
{
    zero_offset_destroy(b->zero_offset);
    pool_destroy(b->cfg.pool);
    free(b);
}

/* A plane at a distance from the origin, tilted about x or y; brightest at bright_m along
 * it, 0.1 m to either side.  It mirrors the speaker: Snell's law by the image source. */
struct plane {
    double normal[3], distance_m, along[3], bright_m;
};

static struct plane plane_tilted(int axis, double tilt, double distance_m)
{
    struct plane p = {{0, 0, cos(tilt)}, distance_m, {0, 0, sin(tilt)}, 0.05};
    p.normal[axis] = -sin(tilt);
    p.along[axis] = cos(tilt);
    return p;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Path, and how bright the plane is where it mirrors. */
static double mirrored(const struct plane *p, const double s[3], const double m[3],
                       double *level)
{
    double image[3], ray[3], at[3];
    double s_m = p->distance_m - dot(p->normal, s),
           m_m = p->distance_m - dot(p->normal, m);
    for (int a = 0; a < 3; a++)
        image[a] = s[a] + 2.0 * s_m * p->normal[a];
    for (int a = 0; a < 3; a++) {
        ray[a] = image[a] - m[a];
        at[a] = m[a] + ray[a] * m_m / (m_m + s_m);
    }
    *level = exp(-pow((dot(p->along, at) - p->bright_m) / 0.1, 2.0));
    return sqrt(dot(ray, ray));
}

/* What a pair hears of some planes at an instant. */
static double complex heard(const struct bench *b, const struct plane *planes, size_t n,
                            const double s[3], const double m[3], double t)
{
    double complex sum = 0.0;
    for (size_t p = 0; p < n; p++) {
        double level, path_m = mirrored(&planes[p], s, m, &level);
        sum += sqrt(level) / path_m *
               reference_echo(b->cfg.band_hz, b->cfg.in.carrier_hz, path_m / c_m_s, t);
    }
    return sum;
}

/* A masked microphone (not -1) brings no numbers. */
static void add_planes(struct bench *b, const struct plane *planes, size_t n_planes,
                       int microphone)
{
    const struct geometry *g = &b->geometry;
    const struct trace_format *f = &b->cfg.in;
    for (size_t ping = 0; ping < g->n_positions * g->n_speakers; ping++) {
        size_t k = ping / g->n_speakers, j = ping % g->n_speakers;
        bool masked[MAX_ELEMENTS] = {false};
        for (size_t i = 0; i < g->n_microphones; i++) {
            double s[3], m[3];
            geometry_speaker(g, k, j, s);
            geometry_microphone(g, k, 0, i, m);
            masked[i] = (int)i == microphone;
            for (size_t n = 0; n < SAMPLES; n++) {
                double t = f->t0_s + (double)n / f->rate_hz;
                b->traces[i * SAMPLES + n] =
                    masked[i] ? NAN : (float complex)heard(b, planes, n_planes, s, m, t);
            }
        }
        zero_offset_add(b->zero_offset, k, j, b->traces, masked);
    }
}

static void add_plane(struct bench *b, const struct plane *p)
{
    add_planes(b, p, 1, -1);
}

/* Of a midpoint's trace. */
static void powers(const struct bench *b, size_t cell, float *x)
{
    for (size_t n = 0; n < SAMPLES; n++) {
        const float *z = b->out + 2 * (cell * SAMPLES + n);
        x[n] = b->cfg.power ? b->out[cell * SAMPLES + n] : z[0] * z[0] + z[1] * z[1];
    }
}

/* The peak of a midpoint's trace from sample `first` on, before `end`, between samples.
 */
static double peak_within_s(const struct bench *b, size_t cell, size_t first, size_t end,
                            double *power)
{
    float x[SAMPLES];
    size_t best = first;
    powers(b, cell, x);
    for (size_t n = first; n < end; n++)
        best = x[n] > x[best] ? n : best;
    double shift = 0.0;
    *power = x[best];
    if (x[best - 1] > 0.0f && x[best + 1] > 0.0f &&
        x[best] >= fmaxf(x[best - 1], x[best + 1])) {
        double l = log(x[best - 1] / x[best]), r = log(x[best + 1] / x[best]);
        shift = 0.5 * (l - r) / (l + r);
        *power *= exp(-(l - r) * (l - r) / (8.0 * (l + r)));
    }
    return b->cfg.out.t0_s + ((double)best + shift) / b->cfg.out.rate_hz;
}

static double peak_s(const struct bench *b, size_t cell, double *power)
{
    return peak_within_s(b, cell, 1, SAMPLES - 1, power);
}

/* The peak near where a co-located pair hears the plane: within 0.19 m of its range. */
static double event_s(const struct bench *b, int axis, const struct plane *p, size_t line,
                      double *at_m, double *expected_s, double *power)
{
    const struct trace_format *f = &b->cfg.out;
    *at_m = b->lattice.first_m[axis] + b->lattice.pitch_m[axis] * (double)line;
    *expected_s = 2.0 * (p->distance_m - p->normal[axis] * *at_m) / c_m_s;
    double sample = (*expected_s - f->t0_s) * f->rate_hz;
    size_t first = (size_t)fmin(fmax(sample - 40.0, 1.0), SAMPLES - 2);
    size_t end = (size_t)fmin(fmax(sample + 40.0, 2.0), SAMPLES - 1);
    return peak_within_s(b, line, first, end, power);
}

/* Where the bright part is, on the axis of the stage: the midpoints' centroid. */
static void expect_plane(const struct bench *b, int axis, const struct plane *p,
                         double time_samples, double shift_m)
{
    double weight = 0.0, sum = 0.0, worst = 0.0, loudest = 0.0, at_m, expected_s, power;
    for (size_t l = 0; l < b->lattice.n[axis]; l++) {
        event_s(b, axis, p, l, &at_m, &expected_s, &power);
        loudest = fmax(loudest, power);
    }
    for (size_t l = 0; l < b->lattice.n[axis]; l++) {
        double t = event_s(b, axis, p, l, &at_m, &expected_s, &power);
        if (!(power > 0.05 * loudest))
            continue;
        weight += power;
        sum += power * at_m;
        if (power > 0.25 * loudest)
            worst = worse(worst, fabs(t - expected_s) * b->cfg.out.rate_hz);
    }
    /* The co-located pair whose foot is the bright place: at_m cos(tilt) = bright_m. */
    double expected_m = p->bright_m / p->normal[2];
    assert_below(worst, time_samples);
    assert_near(sum / weight, expected_m, shift_m);
}

/* Of midpoints: waves of 20 kHz that arrive at 30 degrees want 8 mm, of 12 kHz, and their
 * power, less.  Pairs stand before all that is bright, whatever their offset. */
#define LINES      56
#define PITCH_M    0.0125
#define FINE_LINES 84
#define FINE_M     0.008

/* Two planes at a time, so far apart that their echoes keep clear of each other. */
static void expect_dips(struct bench *b, int axis)
{
    static const double dips_rad[2][2] = {{-M_PI / 6.0, M_PI / 8.0},
                                          {M_PI / 6.0, -M_PI / 12.0}};
    for (int d = 0; d < 2; d++) {
        const struct plane planes[2] = {plane_tilted(axis, dips_rad[d][0], 1.45),
                                        plane_tilted(axis, dips_rad[d][1], 1.95)};
        zero_offset_reset(b->zero_offset);
        add_planes(b, planes, 2, -1);
        zero_offset_stack(b->zero_offset, b->out);
        for (int p = 0; p < 2; p++)
            expect_plane(b, axis, &planes[p], 0.25, 0.004);
    }
}

static void expect_one_offset(int axis, double half_m, bool power)
{
    struct bench *b = power ? bench_alloc(axis, LINES, PITCH_M, true)
                            : bench_alloc(axis, FINE_LINES, FINE_M, false);
    b->speakers_m[0][axis] = -half_m;
    b->microphones_m[0][axis] = half_m;
    bench_create(b);
    expect_dips(b, axis);
    bench_destroy(b);
}

/* Asked for: half a sample and a quarter of a midpoint (8 mm on the paper's array), dips
 * to 30 degrees, offsets to 1 m, either axis.  Found: a fifth and 1.1 mm of powers,
 * 0.05 and 0.8 mm of traces. */
static void a_dipping_plane_lands_where_co_located_pairs_see_it(void **state)
{
    (void)state;
    static const double halves_m[3] = {0.15, 0.35, 0.5};
    for (int q = 0; q < 6; q++)
        expect_one_offset(q / 3, halves_m[q % 3], true);
    for (int axis = 0; axis < 2; axis++)
        expect_one_offset(axis, 0.5, false);
}

/* Two speakers and two microphones: offsets of 0.3, 0.65 (twice, 0.35 m from each other)
 * and 1 m. */
static void so_does_the_stack_over_all_offsets(void **state)
{
    (void)state;
    static const double ends_m[2] = {0.15, 0.5};
    for (int axis = 0; axis < 2; axis++) {
        struct bench *b = bench_alloc(axis, LINES, PITCH_M, axis == 0);
        b->geometry.n_speakers = b->geometry.n_microphones = 2;
        for (size_t e = 0; e < 2; e++) {
            b->speakers_m[e][axis] = -ends_m[e];
            b->microphones_m[e][axis] = ends_m[e];
        }
        if (axis == 1)
            b->cfg.band_hz[1] = 12000.0;
        bench_create(b);
        expect_dips(b, axis);
        bench_destroy(b);
    }
}

/* The same with phases: what a co-located pair would have recorded, as 1 / r. */
static void coherent_traces_keep_their_phase(void **state)
{
    (void)state;
    for (int axis = 0; axis < 2; axis++) {
        struct bench *b = bench_alloc(axis, MAX_LINES, 0.0125, false);
        b->speakers_m[0][axis] = -0.35;
        b->microphones_m[0][axis] = 0.35;
        bench_create(b);
        struct plane p = plane_tilted(axis, M_PI / 180.0 * 12.0, 1.6);
        add_plane(b, &p);
        zero_offset_stack(b->zero_offset, b->out);
        double error = 0.0, all = 0.0;
        for (size_t l = 12; l < MAX_LINES - 12; l++) {
            double at[3] = {0.0}, level;
            at[axis] = b->lattice.first_m[axis] + 0.0125 * (double)l;
            double path_m = mirrored(&p, at, at, &level);
            for (size_t n = 10; n < SAMPLES - 10; n++) {
                const float *z = b->out + 2 * (l * SAMPLES + n);
                double t = b->cfg.out.t0_s + (double)n / 36000.0;
                double complex e = 0.5 * sqrt(level) *
                                   reference_echo(band_hz, 11000.0, path_m / c_m_s, t);
                error += pow(cabs(z[0] + I * z[1] - e), 2.0);
                all += pow(cabs(e), 2.0);
            }
        }
        assert_below(sqrt(error / all), 0.1);
        bench_destroy(b);
    }
}

/* -- sorting, weights, bad input --------------------------------------------------------
 */

/* 2 speakers and 3 microphones on y, 8 positions on x: 8 x 6 midpoints, one shared. */
static struct bench *array_create(bool power)
{
    struct bench *b = bench_alloc(0, 8, 0.03, power);
    b->geometry.n_speakers = 2;
    b->geometry.n_microphones = 3;
    for (size_t e = 0; e < 2; e++)
        b->speakers_m[e][1] = 0.06 * (double)e;
    for (size_t e = 0; e < 3; e++)
        b->microphones_m[e][1] = 0.06 * (double)e;
    bench_create(b);
    return b;
}

/* A bright plane straight ahead: every midpoint hears it at its range with the power
 * (t c)^2 / path^2 = 1, but for the plane's brightness, however many pairs it has. */
static void expect_even(struct bench *b, const struct plane *p)
{
    zero_offset_stack(b->zero_offset, b->out);
    for (size_t y = 0; y < b->lattice.n[1]; y++) {
        for (size_t x = 0; x < 8; x++) {
            double power, t = peak_s(b, y * 8 + x, &power), level;
            double at[3] = {b->positions_m[x], 0.0, 0.0};
            double path_m = mirrored(p, at, at, &level);
            assert_near(t, path_m / c_m_s, 0.1 / 36000.0);
            assert_near(power / level, 1.0, 0.05);
        }
    }
}

static void pairs_of_one_midpoint_count_as_one(void **state)
{
    (void)state;
    struct bench *b = array_create(true);
    struct plane p = plane_tilted(0, 0.0, 1.6);
    assert_int_equal(b->lattice.n[0], 8);
    assert_int_equal(b->lattice.n[1], 4);
    add_plane(b, &p);
    expect_even(b, &p);
    bench_destroy(b);
}

static void masked_microphones_are_left_out(void **state)
{
    (void)state;
    struct bench *b = array_create(true);
    struct plane p = plane_tilted(0, 0.0, 1.6);
    add_planes(b, &p, 1, 1);
    expect_even(b, &p);
    bench_destroy(b);
}

static void what_is_no_number_or_too_loud_is_silence(void **state)
{
    (void)state;
    static const float bad[4] = {NAN, INFINITY, -INFINITY, 1e30f};
    for (int power = 0; power < 2; power++) {
        struct bench *b = array_create(power);
        size_t n = 8 * 4 * SAMPLES * (power ? 1 : 2);
        for (size_t q = 0; q < 3 * SAMPLES; q++)
            b->traces[q] = bad[q % 4];
        for (size_t p = 0; p < 16; p++)
            zero_offset_add(b->zero_offset, p / 2, p % 2, b->traces, NULL);
        zero_offset_stack(b->zero_offset, b->out);
        for (size_t q = 0; q < n; q++)
            assert_near(b->out[q], 0.0, 0.0);
        bench_destroy(b);
    }
}

static void gains_of_twelve_decades_only_scale(void **state)
{
    (void)state;
    struct bench *b = array_create(true);
    float *one = malloc(sizeof b->out);
    assert_non_null(one);
    for (int q = -1; q <= 1; q++) {
        double gain = pow(10.0, 12.0 * q), worst = 0.0;
        zero_offset_reset(b->zero_offset);
        for (size_t n = 0; n < 3 * SAMPLES; n++)
            b->traces[n] = (float)(gain * sin(0.1 * (double)(n * n % 1000)));
        for (size_t p = 0; p < 16; p++)
            zero_offset_add(b->zero_offset, p / 2, p % 2, b->traces, NULL);
        zero_offset_stack(b->zero_offset, b->out);
        if (q == -1)
            memcpy(one, b->out, sizeof b->out);
        for (size_t n = 0; n < 32 * SAMPLES; n++)
            worst = worse(worst, fabs(b->out[n] / (gain * gain) - one[n] * 1e24));
        assert_below(worst, 1e-4); /* of some 10 */
    }
    free(one);
    bench_destroy(b);
}

static void a_lost_stage_position_leaves_a_gap(void **state)
{
    (void)state;
    struct bench *b = bench_alloc(0, 9, 0.03, true);
    for (size_t k = 4; k < 8; k++)
        b->positions_m[k] = b->positions_m[k + 1];
    b->geometry.n_positions = 8;
    bench_create(b);
    struct plane p = plane_tilted(0, 0.0, 1.6);
    assert_int_equal(b->lattice.n[0], 9);
    assert_near(b->lattice.pitch_m[0], 0.03, 1e-9);
    add_plane(b, &p);
    zero_offset_stack(b->zero_offset, b->out);
    for (size_t n = 0; n < SAMPLES; n++)
        assert_near(b->out[4 * SAMPLES + n], 0.0, 1e-6);
    bench_destroy(b);
}

static void one_position_one_speaker_one_microphone_will_do(void **state)
{
    (void)state;
    struct bench *b = bench_alloc(0, 1, 0.03, true);
    b->microphones_m[0][1] = 0.2;
    bench_create(b);
    struct plane p = plane_tilted(0, 0.0, 1.6);
    double power;
    add_plane(b, &p);
    zero_offset_stack(b->zero_offset, b->out);
    assert_near(peak_s(b, 0, &power), 3.2 / c_m_s, 0.2 / 36000.0);
    bench_destroy(b);
}

static void expect_refused(struct bench *b)
{
    const char *why = "";
    struct zero_offset *z = NULL;
    assert_int_equal(zero_offset_create(&z, &b->cfg, &why), -ENOTSUP);
    assert_null(z);
    assert_true(strlen(why) > 10);
    bench_destroy(b);
}

static void geometries_that_it_cannot_do_are_refused_with_a_reason(void **state)
{
    (void)state;
    struct bench *b = bench_alloc(0, 8, 0.03, true);
    b->positions_m[3] += 0.011;
    expect_refused(b); /* uneven */
    b = bench_alloc(0, 8, 0.03, true);
    b->microphones_m[0][2] = 0.1;
    expect_refused(b); /* not plane */
    b = bench_alloc(0, 8, 0.03, true);
    b->microphones_m[0][0] = b->microphones_m[0][1] = 1.0;
    expect_refused(b); /* far apart along both axes */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_dipping_plane_lands_where_co_located_pairs_see_it),
        cmocka_unit_test(so_does_the_stack_over_all_offsets),
        cmocka_unit_test(coherent_traces_keep_their_phase),
        cmocka_unit_test(pairs_of_one_midpoint_count_as_one),
        cmocka_unit_test(masked_microphones_are_left_out),
        cmocka_unit_test(what_is_no_number_or_too_loud_is_silence),
        cmocka_unit_test(gains_of_twelve_decades_only_scale),
        cmocka_unit_test(a_lost_stage_position_leaves_a_gap),
        cmocka_unit_test(one_position_one_speaker_one_microphone_will_do),
        cmocka_unit_test(geometries_that_it_cannot_do_are_refused_with_a_reason),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
