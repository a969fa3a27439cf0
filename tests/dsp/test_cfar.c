/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "dsp/cfar.h"
#include "tests/dsp/near.h"

enum { NX = 160, NZ = 400, CELLS = NX * NZ };

static const struct cfar_config usual = {.kind = CFAR_AVERAGING,
                                         .false_alarm_rate = 1e-3,
                                         .rank = 0.75,
                                         .n = {NX, 1, NZ},
                                         .pitch = {1, 1, 1},
                                         .guard = {1, 0, 1},
                                         .training = {3, 0, 4}};

static double uniform(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005ull + 1442695040888963407ull;
    return ((double)(*seed >> 11) + 0.5) / 9007199254740992.0;
}

/* Powers: sums of `looks` exponentials of mean 1 / looks, on a level of their own. */
static float *noise(uint64_t seed, int looks, double (*level)(int x, int z))
{
    float *image = malloc(CELLS * sizeof *image);

    assert_non_null(image);
    for (int i = 0; i < CELLS; i++) {
        double sum = 0.0;
        for (int k = 0; k < looks; k++)
            sum -= log(uniform(&seed));
        image[i] = (float)(sum / looks * (level ? level(i % NX, i / NX) : 1.0));
    }
    return image;
}

static struct cfar *create(const struct cfar_config *cfg)
{
    struct cfar *c = NULL;

    assert_int_equal(cfar_create(&c, cfg), 0);
    return c;
}

/* How many of every step-th cell are brighter than their threshold. */
static size_t alarms(struct cfar *c, const float *image, size_t step)
{
    size_t above = 0;

    for (size_t i = 0; i < CELLS; i += step)
        above += (double)image[i] > cfar_at(c, image, i).threshold;
    return above;
}

static void averaging_has_the_factor_of_finn_and_johnson(void **state)
{
    (void)state;
    static const double rates[] = {1e-2, 1e-4, 1e-8};

    for (size_t i = 0; i < sizeof rates / sizeof *rates; i++) {
        struct cfar_config cfg = usual;
        cfg.false_alarm_rate = rates[i];
        struct cfar *c = create(&cfg);
        for (size_t n = 16; n <= 70; n += 27)
            assert_near(cfar_factor(c, n) /
                            ((double)n * (pow(rates[i], -1.0 / (double)n) - 1)),
                        1.0, 1e-9);
        cfar_destroy(c);
    }
}

static void the_ordered_statistic_has_the_factor_of_rohling(void **state)
{
    (void)state;
    static const double rates[] = {1e-2, 1e-4, 1e-6};

    for (size_t i = 0; i < sizeof rates / sizeof *rates; i++) {
        struct cfar_config cfg = usual;
        cfg.kind = CFAR_ORDERED;
        cfg.false_alarm_rate = rates[i];
        struct cfar *c = create(&cfg);
        for (size_t n = 16; n <= 66; n += 25) { /* 12, 30.75, 49.5 are below */
            double factor = cfar_factor(c, n), product = 1.0;
            size_t k = (size_t)ceil(0.75 * (double)n);
            for (size_t j = 0; j < k; j++)
                product *= (double)(n - j) / ((double)(n - j) + factor);
            assert_near(product / rates[i], 1.0, 0.01);
        }
        cfar_destroy(c);
    }
}

/* The quantile is the least value that so large a part of all is not above: of 62 cells
 * around, 0.75 of which are 46.5, the 47th. */
static void the_ordered_level_is_the_quantile_of_the_cells_around(void **state)
{
    (void)state;
    enum { WIDE = 9, HIGH = 7, AROUND = WIDE * HIGH - 1 };
    struct cfar_config cfg = {.kind = CFAR_ORDERED,
                              .false_alarm_rate = 1e-3,
                              .rank = 0.75,
                              .n = {WIDE, 1, HIGH},
                              .pitch = {1, 1, 1},
                              .training = {4, 0, 3}};
    struct cfar *c = create(&cfg);
    float image[WIDE * HIGH];
    const size_t middle = WIDE * HIGH / 2;

    for (size_t i = 0; i < WIDE * HIGH; i++)
        image[i] = (float)(1 + i - (i > middle)); /* 1 to 62 */
    image[middle] = 1000.0f;
    assert_near(cfar_at(c, image, middle).threshold / cfar_factor(c, AROUND), 47.0, 1e-6);
    cfar_destroy(c);
}

/* Every other cell of a volume is far brighter than those that a cell may train on, which
 * lie a pitch apart on either side of the guard, along each axis as far as there are any.
 */
static void the_cells_that_are_trained_on_lie_a_pitch_apart_beyond_the_guard(void **state)
{
    (void)state;
    enum { WIDE = 23, DEEP = 9, HIGH = 14 };
    static float image[HIGH][DEEP][WIDE];
    const struct cfar_config cfg = {.kind = CFAR_AVERAGING,
                                    .false_alarm_rate = 1e-3,
                                    .n = {WIDE, DEEP, HIGH},
                                    .pitch = {2, 1, 3},
                                    .guard = {2, 1, 3},
                                    .training = {2, 1, 1}};
    static const int cells[][3] = {{11, 4, 7}, {0, 0, 0}, {22, 8, 13}, {5, 1, 9}};
    struct cfar *c = create(&cfg);

    for (size_t q = 0; q < sizeof cells / sizeof *cells; q++) {
        const int *at = cells[q];
        for (int i = 0; i < WIDE * DEEP * HIGH; i++) {
            int off[3] = {i % WIDE - at[0], i / WIDE % DEEP - at[1],
                          i / (WIDE * DEEP) - at[2]};
            bool trained = false;
            for (int a = 0; a < 3; a++)
                trained |= abs(off[a]) > (int)cfg.guard[a];
            for (int a = 0; a < 3; a++)
                trained &= off[a] % (int)cfg.pitch[a] == 0 &&
                           abs(off[a]) <=
                               (int)(cfg.guard[a] + cfg.pitch[a] * cfg.training[a]);
            (&image[0][0][0])[i] = trained ? 2.0f : 1e6f;
        }
        size_t cell = (size_t)((at[2] * DEEP + at[1]) * WIDE + at[0]);
        assert_near(cfar_at(c, &image[0][0][0], cell).noise, 2.0, 1e-6);
    }
    cfar_destroy(c);
}

static double hill(int x, int z)
{
    return 1.0 + 30.0 * exp(-pow((x - 80) / 40.0, 2.0) - pow((z - 150) / 90.0, 2.0));
}

/* At each rate so many cells are looked at that 19 false alarms are expected at least. */
static void assert_rates_hold(int looks, double (*level)(int x, int z), size_t n_rates)
{
    static const struct {
        double rate;
        size_t step, images;
    } cases[] = {{1e-2, 10, 1}, {1e-3, 2, 1}, {1e-4, 1, 3}};

    for (size_t k = 0; k < 2 * n_rates; k++) {
        struct cfar_config cfg = usual;
        cfg.kind = k % 2 ? CFAR_ORDERED : CFAR_AVERAGING;
        cfg.false_alarm_rate = cases[k / 2].rate;
        size_t step = cases[k / 2].step, images = cases[k / 2].images, above = 0;
        struct cfar *c = create(&cfg);
        for (size_t seed = 0; seed < images; seed++) {
            float *image = noise(77 + seed, looks, level);
            if (seed == 0)
                cfar_learn(c, image);
            above += alarms(c, image, step);
            free(image);
        }
        double expected = cfg.false_alarm_rate * CELLS * (double)images / (double)step;
        assert_in_range((long)(100 * (double)above / expected), 50, 200);
        cfar_destroy(c);
    }
}

static void the_rate_holds_in_noise(void **state)
{
    (void)state;
    assert_rates_hold(1, NULL, 3);
}

static void the_rate_holds_where_the_level_changes(void **state)
{
    (void)state;
    assert_rates_hold(1, hill, 2);
}

static void the_rate_holds_for_sums_of_powers(void **state)
{
    (void)state;
    assert_rates_hold(4, NULL, 3);
}

/* Scatterers, 40 times as bright as the noise, in one cell of fifty: no gamma
 * distribution, and a tail that begins in the last hundredth. */
static float *clutter(uint64_t seed)
{
    float *image = noise(seed, 1, NULL);

    for (int i = 0; i < CELLS; i++)
        if (uniform(&seed) < 0.02)
            image[i] *= 40.0f;
    return image;
}

/* Never more than 1. */
static float *even(uint64_t seed)
{
    float *image = noise(seed, 1, NULL);

    for (int i = 0; i < CELLS; i++)
        image[i] = powf(1.0f - expf(-image[i]), 0.4f);
    return image;
}

/* In images that it has not seen, after so many that it has. */
static void assert_learnt_rate(float *(*make)(uint64_t seed), enum cfar_kind kind,
                               double rate, size_t learnt)
{
    struct cfar_config cfg = usual;
    cfg.kind = kind;
    cfg.false_alarm_rate = rate;
    struct cfar *c = create(&cfg);
    size_t images = rate < 5e-4 ? 4 : 1, above = 0;

    for (size_t i = 0; i < learnt + images; i++) {
        float *image = make(100 + i);
        if (i < learnt)
            cfar_learn(c, image);
        else
            above += alarms(c, image, 1);
        free(image);
    }
    double expected = rate * CELLS * (double)images;
    assert_in_range((long)(100 * (double)above / expected), 50, 200);
    cfar_destroy(c);
}

static void the_rate_holds_in_clutter(void **state)
{
    (void)state;
    for (int k = CFAR_AVERAGING; k <= CFAR_ORDERED; k++)
        for (double rate = 1e-2; rate > 5e-5; rate *= 0.1)
            assert_learnt_rate(clutter, (enum cfar_kind)k, rate, 1);
}

/* What is left out as no noise must not be the tail of the noise. */
static void learning_on_and_on_does_not_change_the_rate(void **state)
{
    (void)state;
    for (double rate = 1e-2; rate > 5e-5; rate *= 0.1)
        assert_learnt_rate(clutter, CFAR_ORDERED, rate, 12);
}

static void the_rate_holds_for_a_tail_lighter_than_any_shape(void **state)
{
    (void)state;
    for (int k = CFAR_AVERAGING; k <= CFAR_ORDERED; k++)
        for (double rate = 1e-2; rate > 5e-4; rate *= 0.1)
            assert_learnt_rate(even, (enum cfar_kind)k, rate, 1);
}

static void the_shape_is_found(void **state)
{
    (void)state;
    static const int looks[] = {1, 2, 8};

    for (int i = 0; i < 3; i++) {
        struct cfar *c = create(&usual);
        float *image = noise(5, looks[i], hill);
        cfar_learn(c, image);
        double shape = cfar_noise(c)->shape;
        assert_true(fabs(log(shape / looks[i])) < 0.1);
        free(image);
        cfar_destroy(c);
    }
}

/* Two objects in the window of one another. */
static void a_neighbour_hides_an_object_from_the_mean_only(void **state)
{
    (void)state;
    float *image = noise(9, 1, NULL);
    const size_t cell = 200 * NX + 80;

    image[cell] = 40.0f;
    for (size_t x = cell + 2; x <= cell + 4; x++)
        image[x] = 2000.0f;
    for (int k = 0; k < 2; k++) {
        struct cfar_config cfg = usual;
        cfg.kind = k ? CFAR_ORDERED : CFAR_AVERAGING;
        struct cfar *c = create(&cfg);
        assert_int_equal((double)image[cell] > cfar_at(c, image, cell).threshold, k);
        cfar_destroy(c);
    }
    free(image);
}

static void an_object_does_not_raise_its_own_threshold(void **state)
{
    (void)state;
    float *image = noise(11, 1, NULL);
    const size_t cell = 60 * NX + 100;
    struct cfar *c = create(&usual);
    struct cfar_level before = cfar_at(c, image, cell);

    for (int z = -1; z <= 1; z++)
        for (int x = -1; x <= 1; x++)
            image[(ptrdiff_t)cell + z * NX + x] = 1e4f;
    struct cfar_level after = cfar_at(c, image, cell);
    assert_true(after.threshold == before.threshold && after.noise == before.noise);
    free(image);
    cfar_destroy(c);
}

static void the_noise_is_its_mean(void **state)
{
    (void)state;
    float *image = noise(13, 1, NULL);

    for (int k = 0; k < 2; k++) {
        struct cfar_config cfg = usual;
        double sum = 0.0;
        cfg.kind = k ? CFAR_ORDERED : CFAR_AVERAGING;
        struct cfar *c = create(&cfg);
        for (size_t i = 0; i < CELLS; i += 7)
            sum += cfar_at(c, image, i).noise;
        assert_near(sum / (CELLS / 7 + 1), 1.0, 0.03);
        cfar_destroy(c);
    }
    free(image);
}

static void a_level_of_zero_and_a_lonely_cell_detect_nothing_wrong(void **state)
{
    (void)state;
    float *image = calloc(CELLS, sizeof *image);
    struct cfar *c = create(&usual);

    assert_non_null(image);
    cfar_learn(c, image);
    assert_near(cfar_noise(c)->shape, 1.0, 0.0);
    assert_true(isinf(cfar_at(c, image, 0).threshold));
    assert_true(cfar_at(c, image, CELLS - 1).noise == 0.0);
    cfar_destroy(c);
    free(image);
    /* 3 x 3 cells: too few to tell a level from. */
    struct cfar_config small = usual;
    small.n[0] = small.n[2] = 3;
    const float few[9] = {1, 1, 1, 1, 100, 1, 1, 1, 1};
    c = create(&small);
    assert_true(isinf(cfar_at(c, few, 4).threshold));
    cfar_destroy(c);
}

/* Where the level changes, at the borders, beside what was not imaged, with a tail that
 * was learnt: the quick way says what the threshold says, also where they nearly touch.
 */
static void a_cell_stands_out_where_it_is_over_its_threshold(void **state)
{
    (void)state;
    for (int k = 0; k < 5; k++) {
        struct cfar_config cfg = usual;
        cfg.kind = k == 3 ? CFAR_AVERAGING : CFAR_ORDERED;
        if (k == 4) { /* a volume, and rows of more than a vector */
            cfg.n[1] = 5;
            cfg.n[2] /= 5;
            cfg.guard[1] = cfg.training[1] = 1;
            cfg.training[0] = 20;
        }
        cfg.pitch[0] = k == 1 ? 3 : 1;
        cfg.pitch[2] = k == 2 ? 2 : 1;
        cfg.guard[0] = cfg.guard[2] = 4;
        cfg.false_alarm_rate = 0.1;
        struct cfar *c = create(&cfg);
        float *image = noise((uint64_t)k, 1, hill);
        size_t above = 0;
        for (size_t i = 0; i < CELLS / 3; i++)
            image[i] = 0.0f;
        cfar_learn(c, image);
        for (size_t i = CELLS / 3; i < CELLS; i += 211) {
            double threshold = cfar_at(c, image, i).threshold;
            if (i % 2 && isfinite(threshold))
                image[i] = nextafterf((float)threshold, i % 4 == 1 ? INFINITY : 0.0f);
            cfar_look(c, image);
            bool stands_out = (double)image[i] > cfar_at(c, image, i).threshold;
            assert_int_equal(cfar_stands_out(c, image, i), stands_out);
            above += stands_out;
        }
        assert_in_range(above, CELLS / 211 / 10, CELLS / 211);
        free(image);
        cfar_destroy(c);
    }
}

/* Two thirds of the cells are beyond the gate. */
static void what_was_not_imaged_is_no_noise(void **state)
{
    (void)state;
    float *image = noise(5, 1, NULL);
    struct cfar *c = create(&usual);
    double sum = 0.0;
    size_t n = 0;

    for (size_t i = 0; i < CELLS; i++)
        if (i % NX >= NX / 3)
            image[i] = 0.0f;
    cfar_learn(c, image);
    assert_near(cfar_noise(c)->shape, 1.0, 0.1);
    for (size_t i = NX / 3 - 1; i < CELLS; i += NX, n++) /* along its edge */
        sum += cfar_at(c, image, i).noise;
    assert_near(sum / (double)n, 1.0, 0.05);
    cfar_destroy(c);
    free(image);
}

/* Spiky or smooth, rare or not: the factor is a number, and rises as the rate falls. */
static void factors_are_there_for_every_shape(void **state)
{
    (void)state;
    static const double rates[] = {1e-1, 1e-4, 1e-12};

    for (int looks = 0; looks < 4; looks++) {
        double before = 0.0;
        float *image = noise(3, looks ? looks * looks * looks * 3 : 1, NULL);
        for (size_t i = 0; !looks && i < CELLS; i++)
            image[i] = powf(image[i], 4.0f); /* spiky */
        for (size_t r = 0; r < 3; r++) {
            struct cfar_config cfg = usual;
            cfg.kind = CFAR_ORDERED;
            cfg.n[2] = NZ / 8; /* enough to tell a shape from */
            cfg.false_alarm_rate = rates[r];
            struct cfar *c = create(&cfg);
            cfar_learn(c, image);
            double factor = cfar_factor(c, 40);
            assert_true(isfinite(factor) && factor > before);
            before = factor;
            cfar_destroy(c);
        }
        free(image);
    }
}

static void wrong_configurations_are_refused(void **state)
{
    (void)state;
    struct cfar *c = NULL;
    struct cfar_config wrong[6];

    for (size_t i = 0; i < 6; i++)
        wrong[i] = usual;
    wrong[0].kind = CFAR_OFF;
    wrong[1].false_alarm_rate = 0.9;
    wrong[2].false_alarm_rate = NAN;
    wrong[3].pitch[0] = 0;
    wrong[4].training[0] = wrong[4].training[2] = 0;
    wrong[5].kind = CFAR_ORDERED;
    wrong[5].rank = 1.0;
    for (size_t i = 0; i < 6; i++)
        assert_int_equal(cfar_create(&c, &wrong[i]), -EINVAL);
    cfar_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(averaging_has_the_factor_of_finn_and_johnson),
        cmocka_unit_test(the_ordered_statistic_has_the_factor_of_rohling),
        cmocka_unit_test(the_ordered_level_is_the_quantile_of_the_cells_around),
        cmocka_unit_test(
            the_cells_that_are_trained_on_lie_a_pitch_apart_beyond_the_guard),
        cmocka_unit_test(the_rate_holds_in_noise),
        cmocka_unit_test(the_rate_holds_where_the_level_changes),
        cmocka_unit_test(the_rate_holds_for_sums_of_powers),
        cmocka_unit_test(the_rate_holds_in_clutter),
        cmocka_unit_test(learning_on_and_on_does_not_change_the_rate),
        cmocka_unit_test(the_rate_holds_for_a_tail_lighter_than_any_shape),
        cmocka_unit_test(the_shape_is_found),
        cmocka_unit_test(a_neighbour_hides_an_object_from_the_mean_only),
        cmocka_unit_test(an_object_does_not_raise_its_own_threshold),
        cmocka_unit_test(the_noise_is_its_mean),
        cmocka_unit_test(a_level_of_zero_and_a_lonely_cell_detect_nothing_wrong),
        cmocka_unit_test(what_was_not_imaged_is_no_noise),
        cmocka_unit_test(a_cell_stands_out_where_it_is_over_its_threshold),
        cmocka_unit_test(factors_are_there_for_every_shape),
        cmocka_unit_test(wrong_configurations_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
