/* SPDX-License-Identifier: MIT */
/* Traces from elsewhere: echoes in closed form, written as MATLAB files. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/anlos/recon/traces_file.h"
#include "tests/nodes/mat_write.h"
#include "tests/nodes/traces_write.h"
#include "tests/recon/turntable.h"
#include "tests/worse.h"

static char path[64];

static int set_up(void **state)
{
    struct turntable *t = malloc(sizeof *t);
    *state = t;
    turntable_default(t);
    strcpy(path, "/tmp/anlos-traces-XXXXXX");
    int fd = mkstemp(path);
    return fd < 0 || close(fd);
}

static int tear_down(void **state)
{
    free(*state);
    return unlink(path);
}

static const struct scatterer points[2] = {{{0.02, 0.03, 0.01}, 1.0},
                                           {{-0.05, 0.02, -0.03}, 0.7}};

/* The traces are those of the echoes in the format that they name. */
static void expect_echoes(const struct turntable *t, double limit_db)
{
    struct traces_file f;
    struct error why = {""};
    if (traces_load(&f, path, NULL, &why))
        fail_msg("%s", why.text);
    assert_int_equal(f.n_pings, TURNTABLE_PINGS);
    assert_memory_equal(f.pings_m, t->pings_m, sizeof t->pings_m);
    assert_true(f.sound_speed_m_s == 343.0);
    /* Hann's ends are faint. */
    assert_true(f.band_hz[0] > 9000.0 && f.band_hz[0] < 11500.0);
    assert_true(f.band_hz[1] > 28500.0 && f.band_hz[1] < 31000.0);
    assert_true(f.format.rate_hz >= 2.1 * (f.band_hz[1] - f.band_hz[0]));
    size_t n = f.format.n_samples, skip = n / 20; /* a cut echo rings at the ends */
    float complex *expected = malloc(TURNTABLE_PINGS * n * sizeof *expected);
    turntable_traces(t, &f.format, points, 2, expected);
    double largest = 0.0, worst = 0.0;
    for (size_t i = 0; i < TURNTABLE_PINGS * n; i++) {
        if (i % n < skip || i % n >= n - skip)
            continue;
        largest = fmax(largest, (double)cabsf(expected[i]));
        worst = worse(worst, (double)cabsf(f.traces[i] - expected[i]));
    }
    assert_true(largest > 1.0);
    double error_db = 20.0 * log10(worst / largest);
    if (!(error_db < limit_db))
        fail_msg("%.1f dB, not below %.1f", error_db, limit_db);
    free(expected);
    traces_clear(&f);
}

static void basebanded_traces_come_at_a_rate_for_imaging(void **state)
{
    static const struct trace_format formats[4] = {
        {0.003, 100000.0, 20000.0, 500},
        {0.003, 100000.0, 15000.0, 500}, /* the carrier is not the band's middle */
        {0.0031, 22000.0, 19500.0, 110}, /* just above the band's width */
        {0.003, 20500.0, 20000.0, 105}};
    for (int q = 0; q < 4; q++) {
        struct traces_write w = {.format = formats[q]};
        traces_write(&w, *state, path, points, 2);
        expect_echoes(*state, -40.0);
    }
}

static void traces_with_their_carrier_too(void **state)
{
    const struct trace_format f = {0.003, 100000.0, 0.0, 500};
    struct traces_write analytic = {.format = f},
                        conjugate = {.format = f, .conjugate = true},
                        real = {.format = f, .real = true},
                        doubles = {.format = f, .real = true, .doubles = true};
    traces_write(&analytic, *state, path, points, 2);
    expect_echoes(*state, -45.0);
    traces_write(&conjugate, *state, path, points, 2);
    expect_echoes(*state, -45.0);
    traces_write(&real, *state, path, points, 2);
    expect_echoes(*state, -45.0);
    traces_write(&doubles, *state, path, points, 2);
    expect_echoes(*state, -45.0);
}

static void the_newer_format_and_turned_arrays_too(void **state)
{
    const struct trace_format f = {0.003, 100000.0, 20000.0, 500};
    struct traces_write newer = {.format = f, .v73 = true},
                        turned = {.format = f, .v73 = true, .turned = true};
    traces_write(&newer, *state, path, points, 2);
    expect_echoes(*state, -45.0);
    traces_write(&turned, *state, path, points, 2);
    expect_echoes(*state, -45.0);
}

/* Samples stay at their times. */
static void a_gate_leaves_the_samples_within(void **state)
{
    const struct traces_write w = {.format = {0.0035, 100000.0, 20000.0, 350}};
    struct traces_file whole, cut;
    const double gate_s[2] = {0.0042, 0.0061}, none_s[2] = {0.0002, 0.0034};
    traces_write(&w, *state, path, points, 2);
    assert_int_equal(traces_load(&whole, path, NULL, NULL), 0);
    assert_int_equal(traces_load(&cut, path, NULL, NULL), 0);
    assert_int_equal(traces_cut(&cut, none_s), -ERANGE);
    assert_int_equal(cut.format.n_samples, whole.format.n_samples);
    assert_int_equal(traces_cut(&cut, gate_s), 0);
    double rate_hz = whole.format.rate_hz, first_s = cut.format.t0_s;
    size_t n = cut.format.n_samples, skip = (size_t)rint((first_s - 0.0035) * rate_hz);
    double last_s = first_s + (double)(n - 1) / rate_hz;
    assert_true(first_s >= gate_s[0] && first_s < gate_s[0] + 1.0 / rate_hz);
    assert_true(last_s <= gate_s[1] && last_s > gate_s[1] - 1.0 / rate_hz);
    for (size_t k = 0; k < TURNTABLE_PINGS; k++)
        assert_memory_equal(cut.traces + k * n,
                            whole.traces + k * whole.format.n_samples + skip,
                            n * sizeof *cut.traces);
    traces_clear(&cut);
    traces_clear(&whole);
}

static void pings_without_sound_are_left_out(void **state)
{
    struct traces_file f;
    struct error why = {""};
    struct traces_write w = {.format = {0.003, 100000.0, 20000.0, 500}};
    w.silent[3] = w.silent[70] = w.nan[8] = true;
    traces_write(&w, *state, path, points, 2);
    assert_int_equal(traces_load(&f, path, NULL, &why), 0);
    assert_int_equal(f.n_silent, 2);
    assert_int_equal(f.n_not_finite, 1);
    for (size_t k = 0; k < TURNTABLE_PINGS; k++)
        assert_int_equal(f.masked[k], k == 3 || k == 70 || k == 8);
    for (size_t i = 0; i < TURNTABLE_PINGS * f.format.n_samples; i++)
        assert_true(isfinite(crealf(f.traces[i])) && isfinite(cimagf(f.traces[i])));
    traces_clear(&f);

    for (size_t k = 0; k < TURNTABLE_PINGS; k++)
        w.silent[k] = true;
    traces_write(&w, *state, path, points, 2);
    assert_int_equal(traces_load(&f, path, NULL, &why), -ENODATA);
    assert_non_null(strstr(why.text, "traces: all are silent or not finite"));
    traces_clear(&f);
}

static void traces_louder_than_any_echo_are_counted(void **state)
{
    static const double gains[2] = {1e11, 3e14};
    for (int loud = 0; loud < 2; loud++) {
        struct traces_file f;
        struct error why = {""};
        struct traces_write w = {.format = {0.003, 100000.0, 0.0, 500}, .real = true};
        struct scatterer point = points[0];
        point.gain = gains[loud];
        w.silent[3] = true;
        traces_write(&w, *state, path, &point, 1);
        int err = traces_load(&f, path, NULL, &why);
        assert_int_equal(err, loud ? -ENODATA : 0);
        assert_int_equal(f.n_silent, 1);
        assert_int_equal(f.n_too_loud, loud ? TURNTABLE_PINGS - 1 : 0);
        traces_clear(&f);
    }
}

static void what_is_missing_or_wrong_is_named(void **state)
{
    static const struct {
        const char *leave_out;
        double rate_hz;
        const char *part;
    } cases[] = {{"traces", 1e5, "expected a variable traces"},
                 {"tx_m", 1e5, "expected a variable tx_m"},
                 {"rx_m", 1e5, "expected a variable rx_m"},
                 {"fs_hz", 1e5, "expected a variable fs_hz"},
                 {"t0_s", 1e5, "expected a variable t0_s"},
                 {"fc_hz", 1e5, "expected a variable fc_hz"},
                 {"c_m_s", 1e5, "expected a variable c_m_s"},
                 {NULL, 0.0, "fs_hz: is 0, expected"},
                 {NULL, NAN, "fs_hz: is nan"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct traces_file f;
        struct error why = {""};
        struct traces_write w = {.format = {0.003, 1e5, 20000.0, 100},
                                 .leave_out = cases[i].leave_out,
                                 .rate_hz = &cases[i].rate_hz};
        traces_write(&w, *state, path, points, 2);
        assert_true(traces_load(&f, path, NULL, &why) < 0);
        if (!strstr(why.text, cases[i].part))
            fail_msg("\"%s\" has no \"%s\"", why.text, cases[i].part);
        traces_clear(&f);
    }
}

/* In the place of one that was left out: 0, 0.01, 0.02 ..., with something else in it. */
static void append(const char *name, int rank, const size_t extents[3], size_t at,
                   double value)
{
    size_t n = 1, dims[3];
    for (int d = 0; d < rank; d++)
        n *= dims[d] = extents[d];
    double *x = malloc(n * sizeof *x);
    assert_non_null(x);
    for (size_t i = 0; i < n; i++)
        x[i] = i == at ? value : 0.01 * (double)i;
    mat_t *mat = Mat_Open(path, MAT_ACC_RDWR);
    assert_non_null(mat);
    matvar_t *v = Mat_VarCreate(name, MAT_C_DOUBLE, MAT_T_DOUBLE, rank, dims, x, 0);
    assert_non_null(v);
    assert_int_equal(Mat_VarWrite(mat, v, MAT_COMPRESSION_ZLIB), 0);
    Mat_VarFree(v);
    Mat_Close(mat);
    free(x);
}

static void what_has_another_shape_or_is_not_finite_is_named(void **state)
{
    static const struct {
        const char *name;
        int rank;
        size_t extents[3], at;
        double value;
        const char *part;
    } cases[] = {
        {"tx_m", 2, {180, 3}, 7, NAN, "tx_m: row 8 is not finite"},
        {"rx_m", 2, {180, 3}, 539, INFINITY, "rx_m: row 180 is not finite"},
        {"tx_m", 2, {180, 2}, 0, 0.0, "tx_m: 180 x 2, expected pings x 3"},
        {"rx_m", 2, {180, 2}, 0, 0.0, "rx_m: 180 x 2, expected as many pings as tx_m"},
        {"tx_m", 3, {60, 3, 3}, 0, 0.0, "tx_m: 3 dimensions, expected 2"},
        {"traces", 2, {179, 100}, 0, 0.0, "traces: 179 x 100, expected 180 pings"},
        {"traces", 2, {180, 1}, 0, 0.0, "traces: 180 x 1, expected 180 pings"},
        {"traces", 3, {180, 50, 2}, 0, 0.0, "traces: 3 dimensions, expected 2"},
        {"fs_hz", 2, {1, 2}, 0, 1e5, "fs_hz: 1 x 2, expected one number"},
        {"t0_s", 2, {1, 1}, 0, NAN, "t0_s: is nan, expected"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct traces_file f;
        struct error why = {""};
        struct traces_write w = {.format = {0.003, 1e5, 20000.0, 100},
                                 .leave_out = cases[i].name};
        traces_write(&w, *state, path, points, 2);
        append(cases[i].name, cases[i].rank, cases[i].extents, cases[i].at,
               cases[i].value);
        assert_int_equal(traces_load(&f, path, NULL, &why), -EINVAL);
        if (!strstr(why.text, cases[i].part))
            fail_msg("\"%s\" has no \"%s\"", why.text, cases[i].part);
        traces_clear(&f);
    }
}

static void as_many_places_as_pings(void **state)
{
    struct traces_file f;
    struct error why = {""};
    struct traces_write w = {.format = {0.003, 1e5, 20000.0, 100}, .short_rx = true};
    traces_write(&w, *state, path, points, 2);
    assert_int_equal(traces_load(&f, path, NULL, &why), -EINVAL);
    assert_non_null(
        strstr(why.text, "rx_m: 179 x 3, expected as many pings as tx_m x 3"));
    traces_clear(&f);
}

/* -- noise in other bands ---------------------------------------------------------------
 */

/* Under 5 kHz, and 30 dB louder than the echoes, whose loudest sample is about 1. */
static float rumble(double t_s, unsigned ping)
{
    double sum = 0.0;

    for (unsigned tone = 0; tone < 24; tone++) {
        unsigned long long seed = 1000u * ping + tone + 1;
        double hz = 300.0 + 4500.0 * reference_random(&seed);
        double phase = 2.0 * M_PI * reference_random(&seed);
        sum += cos(2.0 * M_PI * hz * t_s + phase);
    }
    return (float)(10.0 * sum / sqrt(12.0));
}

static const struct trace_format raw = {0.0, 100000.0, 0.0, 2000};

static void noise_that_is_louder_than_the_echoes_is_cut_and_told(void **state)
{
    struct traces_write w = {.format = raw, .real = true, .noise = rumble};
    struct traces_file f;
    traces_write(&w, *state, path, points, 2);
    assert_int_equal(traces_load(&f, path, NULL, NULL), 0);
    assert_true(f.band_hz[0] > 7000.0 && f.band_hz[0] < 13000.0);
    assert_true(f.band_hz[1] > 27000.0 && f.band_hz[1] < 33000.0);
    assert_true(f.cut_share > 0.9 && f.cut_share <= 1.0);
    assert_int_equal(f.n_cut, 1);
    assert_true(f.cut[0].from_hz < 500.0);
    assert_true(f.cut[0].to_hz > 4000.0 && f.cut[0].to_hz < 10000.0);
    assert_false(f.unsure);
    traces_clear(&f);
    w.noise = NULL;
    traces_write(&w, *state, path, points, 2);
    assert_int_equal(traces_load(&f, path, NULL, NULL), 0);
    assert_int_equal(f.n_cut, 0);
    assert_true(f.cut_share == 0.0);
    assert_false(f.unsure);
    traces_clear(&f);
}

/* What is cut is none of the echoes, whose ends, a tenth on each side, are faint. */
static void assert_no_echo_cut(const struct traces_file *f, const char *what)
{
    for (size_t i = 0; i < f->n_cut; i++)
        if (!(f->cut[i].from_hz < f->cut[i].to_hz &&
              (f->cut[i].to_hz < 12000.0 || f->cut[i].from_hz > 28000.0)))
            fail_msg("%s: cut %.0f to %.0f Hz", what, f->cut[i].from_hz, f->cut[i].to_hz);
}

static void assert_echoes_kept(const struct traces_file *f, const char *what)
{
    assert_no_echo_cut(f, what);
    if (!(f->band_hz[0] < 12000.0 && f->band_hz[1] > 28000.0))
        fail_msg("%s: the band is %.0f to %.0f Hz", what, f->band_hz[0], f->band_hz[1]);
}

static bool is_cut(const struct traces_file *f, double hz)
{
    bool found = false;

    for (size_t i = 0; i < f->n_cut; i++)
        found |= f->cut[i].from_hz < hz && hz < f->cut[i].to_hz;
    return found;
}

/* Few pings, some 30 dB fainter than others, tell little of what is echoes. */
static void few_pings_of_unlike_strength_keep_their_echoes(void **state)
{
    static const size_t numbers[] = {1, 2, 3, 5, 20};

    for (size_t q = 0; q < sizeof numbers / sizeof *numbers; q++)
        for (int noisy = 0; noisy < 2; noisy++) {
            struct traces_write w = {
                .format = raw, .real = true, .noise = noisy ? rumble : NULL};
            double gains[TURNTABLE_PINGS];
            struct traces_file f;
            char what[40];
            for (size_t k = 0; k < TURNTABLE_PINGS; k++) {
                gains[k] = pow(10.0, -0.5 * (double)(k * 7 % 4));
                w.silent[k] = k >= numbers[q];
            }
            w.gains = gains;
            traces_write(&w, *state, path, points, 2);
            assert_int_equal(traces_load(&f, path, NULL, NULL), 0);
            snprintf(what, sizeof what, "%zu pings, noise: %d", numbers[q], noisy);
            assert_no_echo_cut(&f, what);
            if (!noisy || numbers[q] > 5) /* of few, what is loudest is the band */
                assert_echoes_kept(&f, what);
            if (!noisy || numbers[q] <= 5)
                assert_int_equal(f.n_cut, 0);
            if (!noisy)
                assert_false(f.unsure);
            traces_clear(&f);
        }
}

/* As loud as the rumble, all the time. */
static float whistle(double t_s, unsigned ping)
{
    double sum = 0.0;

    for (unsigned tone = 0; tone < 24; tone++) {
        unsigned long long seed = 7000u * ping + tone + 1;
        double hz = 18000.0 + 1000.0 * reference_random(&seed);
        double phase = 2.0 * M_PI * reference_random(&seed);
        sum += cos(2.0 * M_PI * hz * t_s + phase);
    }
    return (float)(10.0 * sum / sqrt(12.0));
}

static float both(double t_s, unsigned ping)
{
    return rumble(t_s, ping) + whistle(t_s, ping);
}

static void noise_amid_the_echoes_is_not_cut_and_not_told_as_cut(void **state)
{
    struct traces_write w = {.format = raw, .real = true, .noise = whistle};
    struct traces_file f;

    traces_write(&w, *state, path, points, 2);
    assert_int_equal(traces_load(&f, path, NULL, NULL), 0);
    assert_echoes_kept(&f, "a whistle");
    assert_int_equal(f.n_cut, 0);
    assert_true(f.cut_share == 0.0);
    traces_clear(&f);
    w.noise = both; /* each of them has half of the power, nearly */
    traces_write(&w, *state, path, points, 2);
    assert_int_equal(traces_load(&f, path, NULL, NULL), 0);
    assert_echoes_kept(&f, "a whistle and rumble");
    assert_true(is_cut(&f, 2000.0) && !is_cut(&f, 18500.0));
    assert_true(f.cut_share > 0.4 && f.cut_share < 0.6);
    traces_clear(&f);
}

/* Without a carrier the noise, which is real, is on either side of 0. */
static void noise_of_complex_traces_is_told_by_its_frequency(void **state)
{
    for (int conjugate = 0; conjugate < 2; conjugate++) {
        struct traces_write w = {.format = raw, .conjugate = conjugate, .noise = rumble};
        struct traces_file f;
        traces_write(&w, *state, path, points, 2);
        assert_int_equal(traces_load(&f, path, NULL, NULL), 0);
        assert_echoes_kept(&f, conjugate ? "conjugate" : "analytic");
        assert_int_equal(f.n_cut, 1);
        assert_true(f.cut[0].from_hz == 0.0);
        assert_true(f.cut[0].to_hz > 4000.0 && f.cut[0].to_hz < 10000.0);
        traces_clear(&f);
    }
}

/* About a carrier of 20 kHz it is at 4 to 6 kHz and at 34 to 36. */
static float far_aside(double t_s, unsigned ping)
{
    double sum = 0.0;

    for (unsigned tone = 0; tone < 24; tone++) {
        unsigned long long seed = 3000u * ping + tone + 1;
        double hz = 14000.0 + 2000.0 * reference_random(&seed);
        sum += cos(2.0 * M_PI * (hz * t_s + reference_random(&seed)));
    }
    return (float)(10.0 * sum / sqrt(12.0));
}

static void noise_about_a_carrier_is_told_on_both_sides(void **state)
{
    struct traces_write w = {.format = {0.0, 50000.0, 20000.0, 1000}, .noise = far_aside};
    struct traces_file f;

    traces_write(&w, *state, path, points, 2);
    assert_int_equal(traces_load(&f, path, NULL, NULL), 0);
    assert_echoes_kept(&f, "about a carrier");
    assert_true(is_cut(&f, 5000.0) && is_cut(&f, 35000.0));
    assert_false(is_cut(&f, 20000.0) || is_cut(&f, 500.0) || is_cut(&f, 42000.0));
    traces_clear(&f);
}

static void where_all_is_noise_that_is_told(void **state)
{
    struct traces_write w = {.format = raw, .real = true, .noise = rumble};
    struct traces_file f;

    traces_write(&w, *state, path, points, 0);
    assert_int_equal(traces_load(&f, path, NULL, NULL), 0);
    assert_true(f.unsure);
    assert_int_equal(f.n_cut, 0);
    traces_clear(&f);
}

static void a_band_too_narrow_for_the_traces_is_refused(void **state)
{
    static const double bands_hz[][2] = {{15000.0, 15010.0}, {0.0, 60.0}, {0.0, 5.0}};
    struct traces_write w = {.format = raw, .real = true};
    struct traces_file f;

    traces_write(&w, *state, path, points, 2);
    for (int i = 0; i < 3; i++) {
        struct error why = {""};
        assert_int_equal(traces_load(&f, path, bands_hz[i], &why), -EINVAL);
        if (!strstr(why.text, "--band-hz: ") || !strstr(why.text, "of traces of 20 ms") ||
            !strstr(why.text, "a band has to be "))
            fail_msg("\"%s\"", why.text);
        traces_clear(&f);
    }
}

static void a_band_that_is_named_is_taken(void **state)
{
    static const double wanted[2] = {12000.0, 25000.0}, said[2] = {11000.0, 28000.0};
    static const struct trace_format formats[3] = {{0.0, 100000.0, 0.0, 2000},
                                                   {0.0, 100000.0, 0.0, 2000},
                                                   {0.0, 50000.0, 20000.0, 1000}};
    for (int q = 0; q < 3; q++) {
        struct traces_write w = {
            .format = formats[q], .real = q == 0, .conjugate = q == 1};
        struct traces_file f;
        for (int file = 0; file < 2; file++) {
            const double *band = file ? said : wanted;
            w.band_hz = file ? said : NULL;
            traces_write(&w, *state, path, points, 2);
            assert_int_equal(traces_load(&f, path, file ? NULL : wanted, NULL), 0);
            for (int i = 0; i < 2; i++)
                assert_true(fabs(f.band_hz[i] - band[i]) < 100.0);
            double loudest = 0.0;
            for (size_t i = 0; i < f.n_pings * f.format.n_samples; i++)
                loudest = fmax(loudest, (double)cabsf(f.traces[i]));
            assert_true(loudest > 0.3); /* not the empty half of the spectrum */
            traces_clear(&f);
        }
        w.band_hz = said; /* an option says more than the file */
        traces_write(&w, *state, path, points, 2);
        assert_int_equal(traces_load(&f, path, wanted, NULL), 0);
        assert_true(fabs(f.band_hz[0] - wanted[0]) < 100.0);
        traces_clear(&f);
    }
}

static void a_band_outside_of_the_traces_is_refused(void **state)
{
    static const double high[2] = {40000.0, 60000.0}, turned[2] = {3000.0, 2000.0};
    struct traces_write w = {.format = raw, .real = true};
    struct traces_file f;
    struct error why = {""};
    traces_write(&w, *state, path, points, 2);
    assert_int_equal(traces_load(&f, path, high, &why), -EINVAL);
    assert_non_null(strstr(why.text, "--band-hz: 40000 to 60000 Hz"));
    assert_non_null(strstr(why.text, "hold 0 to 50000 Hz"));
    traces_clear(&f);
    w.band_hz = turned;
    traces_write(&w, *state, path, points, 2);
    assert_int_equal(traces_load(&f, path, NULL, &why), -EINVAL);
    assert_non_null(strstr(why.text, "band_hz: expected two numbers"));
    traces_clear(&f);
}

/* -- the band of a spectrum -------------------------------------------------------------
 */

enum { BINS = 1280 };

static void expect_band(const double *power, size_t n_used, size_t n_spectra, size_t from,
                        size_t to)
{
    size_t first, width, part = n_used / 128;
    assert_int_equal(traces_band(power, BINS, n_used, n_spectra, &first, &width), 0);
    assert_true(first <= from && first + part >= from);
    assert_true(first + width >= to && first + width <= to + part);
}

static void a_band_is_found_wherever_it_lies(void **state)
{
    (void)state;
    double power[BINS];
    unsigned long long seed = 5;
    static const size_t cases[4][2] = {{200, 500}, {0, 300}, {1000, 1400}, {900, 1280}};
    for (int noisy = 0; noisy < 2; noisy++)
        for (int q = 0; q < 4; q++) {
            for (size_t b = 0; b < BINS; b++)
                power[b] = noisy ? 0.1 * (0.9 + 0.2 * reference_random(&seed)) : 0.0;
            for (size_t b = cases[q][0]; b < cases[q][1]; b++)
                power[b % BINS] += 1.0;
            expect_band(power, BINS, 100, cases[q][0], cases[q][1]);
        }
}

static void a_real_signal_s_band_is_in_its_first_half(void **state)
{
    (void)state;
    double power[BINS] = {0};
    for (size_t b = 100; b < 300; b++)
        power[b] = power[BINS - b] = 1.0;
    expect_band(power, BINS / 2, 100, 100, 300);
}

static void a_spectrum_filled_to_the_brim_is_all_band(void **state)
{
    (void)state;
    double power[BINS];
    size_t first, width;
    unsigned long long seed = 9;
    for (size_t b = 0; b < BINS; b++)
        power[b] = 0.7 + 0.6 * reference_random(&seed);
    assert_int_equal(traces_band(power, BINS, BINS, 100, &first, &width), 0);
    assert_int_equal(first, 0);
    assert_int_equal(width, BINS);
}

static void silence_has_no_band(void **state)
{
    (void)state;
    double power[BINS] = {0};
    size_t first, width;
    assert_int_equal(traces_band(power, BINS, BINS, 1, &first, &width), -EINVAL);
    power[4] = INFINITY;
    assert_int_equal(traces_band(power, BINS, BINS, 1, &first, &width), -EINVAL);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(basebanded_traces_come_at_a_rate_for_imaging),
        TEST(traces_with_their_carrier_too),
        TEST(the_newer_format_and_turned_arrays_too),
        TEST(a_gate_leaves_the_samples_within),
        TEST(pings_without_sound_are_left_out),
        TEST(traces_louder_than_any_echo_are_counted),
        TEST(what_is_missing_or_wrong_is_named),
        TEST(what_has_another_shape_or_is_not_finite_is_named),
        TEST(as_many_places_as_pings),
        TEST(noise_that_is_louder_than_the_echoes_is_cut_and_told),
        TEST(few_pings_of_unlike_strength_keep_their_echoes),
        TEST(noise_amid_the_echoes_is_not_cut_and_not_told_as_cut),
        TEST(noise_of_complex_traces_is_told_by_its_frequency),
        TEST(noise_about_a_carrier_is_told_on_both_sides),
        TEST(where_all_is_noise_that_is_told),
        TEST(a_band_too_narrow_for_the_traces_is_refused),
        TEST(a_band_that_is_named_is_taken),
        TEST(a_band_outside_of_the_traces_is_refused),
        cmocka_unit_test(a_band_is_found_wherever_it_lies),
        cmocka_unit_test(a_real_signal_s_band_is_in_its_first_half),
        cmocka_unit_test(a_spectrum_filled_to_the_brim_is_all_band),
        cmocka_unit_test(silence_has_no_band),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
