/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <complex.h>

#include "recon/static_array/range_doppler.h"

#define SOUND_M_S 343.0

struct sound { /* a chirp, with a smooth beginning and end */
    double start_hz, stop_hz, duration_s;
};

static double complex emit(const struct sound *s, double t)
{
    double part = t / s->duration_s;
    if (part <= 0.0 || part >= 1.0)
        return 0.0;
    double rate = (s->stop_hz - s->start_hz) / s->duration_s;
    double window = 0.5 - 0.5 * cos(2.0 * M_PI * part);
    return window * cexp(2.0 * M_PI * I * (s->start_hz * t + 0.5 * rate * t * t));
}

/* The delay of what is heard at t from a reflector whose range is range + v (t' - half)
 * when the sound meets it at t', half way: solved exactly. */
static double delay_s(double t, double range_m, double v_m_s, double half_s)
{
    /* d = 2 (range + v (t - d / 2 - half)) / c */
    return 2.0 * (range_m + v_m_s * (t - half_s)) / (SOUND_M_S + v_m_s);
}

/* Where the matched filter's output is largest, as a range. */
static double apparent_m(const struct sound *s, double range_m, double v_m_s)
{
    const double rate_hz = 96000.0;
    double best = 0.0, best_m = 0.0;
    /* The middle of the chirp meets the reflector, at range_m, half a delay after it. */
    double half_s = 0.5 * s->duration_s + range_m / SOUND_M_S;

    for (double at_m = range_m - 0.15; at_m < range_m + 0.15; at_m += 0.0005) {
        double complex sum = 0.0;
        double tau_s = 2.0 * at_m / SOUND_M_S;
        for (double t = tau_s; t < tau_s + s->duration_s; t += 1.0 / rate_hz)
            sum += emit(s, t - delay_s(t, range_m, v_m_s, half_s)) *
                   conj(emit(s, t - tau_s));
        if (cabs(sum) > best) {
            best = cabs(sum);
            best_m = at_m;
        }
    }
    return best_m;
}

/* The reflector is at `range` when the middle of the chirp meets it. */
static double expected_m(const struct sound *s, double range_m, double v_m_s)
{
    double after_s = range_doppler_instant_s(s->start_hz, s->stop_hz, s->duration_s);
    return range_m + v_m_s * (after_s - 0.5 * s->duration_s);
}

static void an_echo_shows_where_its_reflector_is_at_another_instant(void **state)
{
    const struct sound up = {8000.0, 14000.0, 0.008}, down = {14000.0, 8000.0, 0.008};

    (void)state;
    for (double v = -1.5; v <= 1.5; v += 1.5) {
        assert_near(apparent_m(&up, 2.0, v), expected_m(&up, 2.0, v), 0.0015);
        assert_near(apparent_m(&down, 2.0, v), expected_m(&down, 2.0, v), 0.0015);
    }
    assert_near(expected_m(&up, 2.0, 1.5), 2.022, 1e-9); /* 1.5 x 11 kHz x 8 ms / 6 kHz */
}

static void up_and_down_show_the_middle_together(void **state)
{
    (void)state;
    assert_near(0.5 * (range_doppler_instant_s(2000.0, 20000.0, 0.0625) +
                       range_doppler_instant_s(20000.0, 2000.0, 0.0625)),
                0.03125, 1e-15);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_echo_shows_where_its_reflector_is_at_another_instant),
        cmocka_unit_test(up_and_down_show_the_middle_together),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
