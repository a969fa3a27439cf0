/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include "recon/planning/coherence.h"
#include "tests/recon/array_traces.h"

/* Straight ahead of the middle, so that places off along z are off along the sound. */
static const struct scatterer ahead[] = {{{0.5, 0.5, 2.6}, 1.0}, {{0.4, 0.6, 2.1}, 0.5}};

static struct coherence measure(const struct array_traces *a, size_t threads)
{
    struct coherence c;
    struct pool *pool;
    assert_int_equal(pool_create(&pool, threads), 0);
    assert_int_equal(coherence_measure(&c, &a->set, pool), 0);
    pool_destroy(pool);
    return c;
}

static struct coherence measure_displaced(double rms_m, double noise)
{
    struct array_traces a;
    array_traces_create(&a, 12);
    array_traces_displace(&a, rms_m);
    array_traces_fill(&a, ahead, 2, noise);
    struct coherence c = measure(&a, 2);
    array_traces_clear(&a);
    return c;
}

/* 24 elements tell an rms to 1 / sqrt(2 x 24) = 14%. */
static void places_that_are_off_are_measured(void **state)
{
    (void)state;
    static const double rms_m[] = {0.003, 0.006, 0.01};
    for (int i = 0; i < 3; i++)
        assert_near(measure_displaced(rms_m[i], 0.0).element_m / rms_m[i], 1.0, 0.14);
}

static void places_that_are_right_are_found_right(void **state)
{
    (void)state;
    struct coherence c = measure_displaced(0.0, 0.0);
    assert_below(c.element_m, 0.001);
    assert_near(c.level, 1.0, 0.01);
}

/* Echoes of 0.15, of which 1.5 samples are full, over 470 samples of noise. */
static void noise_is_not_taken_for_displacement(void **state)
{
    (void)state;
    struct coherence c = measure_displaced(0.0, 0.02);
    assert_below(c.level, 0.6);
    assert_below(c.element_m, 0.0015);
}

static void displacement_is_measured_in_noise(void **state)
{
    (void)state;
    struct coherence c = measure_displaced(0.006, 0.02);
    assert_near(c.element_m / 0.006, 1.0, 0.25);
}

static void noise_alone_tells_nothing(void **state)
{
    (void)state;
    struct array_traces a;
    array_traces_create(&a, 12);
    array_traces_fill(&a, ahead, 0, 1.0);
    assert_true(isnan(measure(&a, 1).element_m));
    array_traces_clear(&a);
}

static void what_some_pairs_hear_more_loudly_counts_for_nothing(void **state)
{
    (void)state;
    struct array_traces a;
    array_traces_create(&a, 12);
    array_traces_fill(&a, ahead, 2, 0.0);
    size_t n = a.set.format.n_samples;
    for (size_t q = 0; q < 8 * 144; q++)
        for (size_t s = 0; q % 3 == 0 && s < n; s++)
            a.traces[q * n + s] *= 10.0f;
    assert_below(measure(&a, 1).element_m, 0.001);
    array_traces_clear(&a);
}

static void a_single_pair_tells_nothing(void **state)
{
    (void)state;
    struct array_traces a;
    array_traces_create(&a, 1);
    array_traces_fill(&a, ahead, 2, 0.0);
    assert_true(isnan(measure(&a, 1).element_m));
    array_traces_clear(&a);
}

static void traces_that_were_not_heard_do_not_count(void **state)
{
    (void)state;
    struct array_traces a;
    array_traces_create(&a, 12);
    array_traces_fill(&a, ahead, 2, 0.0);
    size_t n = a.set.format.n_samples;
    for (size_t q = 5; q < 8 * 144; q += 12) { /* one microphone, which hears nonsense */
        a.heard[q] = false;
        for (size_t s = 0; s < n; s++)
            a.traces[q * n + s] = NAN;
    }
    struct coherence c = measure(&a, 2);
    assert_below(c.element_m, 0.001);
    assert_near(c.level, 1.0, 0.01);
    array_traces_clear(&a);
}

/* 12 positions: every third one tells; of 3 all do. */
static void positions_that_tell_are_spread_over_the_scan(void **state)
{
    (void)state;
    struct geometry g = {.n_positions = 12};
    for (size_t k = 0; k < 12; k++)
        assert_int_equal(coherence_samples(&g, k), k % 3 == 0);
    g.n_positions = 3;
    for (size_t k = 0; k < 3; k++)
        assert_true(coherence_samples(&g, k));
}

/* Short traces with one echo, wherever in them it lies: what is beside it is no echo. */
static void the_quiet_beside_an_echo_is_found(void **state)
{
    (void)state;
    struct array_traces a;
    array_traces_create(&a, 4);
    size_t n = 110, traces = 4 * trace_set_pairs(&a.set);
    a.set.format.n_samples = n;
    for (size_t at = 20; at < n - 20; at += 3) {
        for (size_t q = 0; q < traces; q++) {
            float complex *trace = a.traces + q * n;
            for (size_t i = 0; i < n; i++)
                trace[i] = 1e-3f * (float)cos((double)(i * i + 7 * q * i));
            trace[at] = 1.0f;
        }
        assert_near(measure(&a, 1).level, 1.0, 0.01);
    }
    array_traces_clear(&a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(places_that_are_off_are_measured),
        cmocka_unit_test(places_that_are_right_are_found_right),
        cmocka_unit_test(noise_is_not_taken_for_displacement),
        cmocka_unit_test(displacement_is_measured_in_noise),
        cmocka_unit_test(noise_alone_tells_nothing),
        cmocka_unit_test(what_some_pairs_hear_more_loudly_counts_for_nothing),
        cmocka_unit_test(a_single_pair_tells_nothing),
        cmocka_unit_test(traces_that_were_not_heard_do_not_count),
        cmocka_unit_test(positions_that_tell_are_spread_over_the_scan),
        cmocka_unit_test(the_quiet_beside_an_echo_is_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
