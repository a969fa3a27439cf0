#include "tests/recon/near.h"

#include "recon/coherence.h"
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
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
